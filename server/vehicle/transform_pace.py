"""Which messages of transforms are parsed: each frame's newest is seen soon, without parsing all of them.

A car sends the transforms of wheels and joints fifty times a second, and between them perhaps once a second where its
laser is. What counts is therefore when each frame was parsed last, which the unparsed text of a message shows.

Pure: time is an argument, on a monotonic clock in seconds.
"""

from __future__ import annotations

import math
import re
from collections.abc import Collection

from server.judge.transforms import MAX_FRAMES
from server.rosbridge.raw_frame import RawFrame

PERIOD_S = 0.2  # of each frame: where a sensor is changes slowly
FRAME_S = 0.004  # with more frames, each comes less often: 500 of them every 2 s
MOST_KEY = 120  # bytes

# From the name of this field to that of the next one, in JSON and in CBOR: the same for the same frame. The order of
# the fields is that of their definition; where a bridge has another one, nothing is found.
_CHILD = re.compile(rb"child_frame_id(.{1,%d}?)transform" % MOST_KEY, re.DOTALL)


class TransformPace:
    """Of one car, while its link is open."""

    def __init__(self) -> None:
        self._parsed_s: dict[tuple[str, bytes], float] = {}  # by topic and frame
        self._is_binary = False  # as which it came last: a frame looks different then
        self._rest_s: dict[str, float] = {}  # by topic: of messages whose frames are not known, or too many

    def is_due(self, sent: RawFrame, now_s: float, needed: Collection[bytes] = ()) -> bool:
        """Whether a message is to be parsed, because it has a frame that was not parsed for a while. Names of frames
        that hold one of `needed` are kept, whatever else a car sends; of the others, the first ones."""
        if sent.is_binary != self._is_binary:
            self._is_binary = sent.is_binary
            self._parsed_s.clear()
        topic = sent.topic
        frames = {(topic, name) for name in _CHILD.findall(sent.payload)}
        known = self._parsed_s
        period_s = max(PERIOD_S, len(known) * FRAME_S)
        kept = {
            one for one in frames if one in known or len(known) < MAX_FRAMES or any(name in one[1] for name in needed)
        }
        rest_s = self._rest_s.get(topic, -math.inf)
        oldest_s = min((known.get(one, -math.inf) for one in kept), default=rest_s)
        has_rest = len(kept) < len(frames) or not frames
        if now_s - (min(oldest_s, rest_s) if has_rest else oldest_s) < period_s:
            return False
        if has_rest:
            self._rest_s[topic] = now_s
        for one in kept:
            known.pop(one, None)
            known[one] = now_s  # the newest last
        while len(known) > MAX_FRAMES:
            del known[next(iter(known))]
        return True
