"""Compares log times with the stamps of sensors that have a clock of their own, where a recorder's clock may be set."""

from __future__ import annotations

import re
import struct
from collections.abc import Callable, Sequence

import numpy as np

from server.recording.read.clock_returns import S
from server.recording.read.clock_steps import BACK_NS, Arrivals, Ints
from server.recording.read.source import Channel

COMPARED = 5  # messages of a channel on each side
LEAST = 3
MOST_CHANNELS = 6
SIDE = 4000  # messages on each side among which they are sought
AFTER_NS = 10 * S  # what waited in a queue has come by then, each later message less late
STEADY_NS = S // 5  # differences of stamp and log time that spread further are of no clock
AGREE_NS = S // 2  # clocks that show a step agree so well
LEAST_STEP_NS = S

_HEADER = re.compile(r"(std_msgs/)?(msg/)?Header\s+\w+")
_STAMPED = re.compile(r"\w+/msg/(Imu|NavSatFix|LaserScan|PointCloud2|Image|CompressedImage|Odometry|\w+Stamped)")
_ROS1 = struct.Struct("<III")  # sequence, seconds, nanoseconds
_CDR = {0: struct.Struct(">4xiI"), 1: struct.Struct("<4xiI")}  # by the second byte: its order of bytes


class StampWitness:
    """Of one file. `raw_at(place, channel)` is the message at a place; None: it cannot be read."""

    def __init__(self, channels: Sequence[Channel], raw_at: Callable[[int, int], bytes | None]) -> None:
        self._encodings = {one.number: one.encoding for one in channels if _is_stamped(one)}
        self._raw_at = raw_at

    def ahead_ns(self, found: Arrivals, begin: int, at: int) -> int | None:
        """How far the log time gained on the stamps at a gap: between the messages from `begin` and those from `at` on;
        None: no clock shows it."""
        start, end = max(begin, at - SIDE), at + SIDE
        before = np.arange(start, at)
        after = np.arange(at, at + _goes_on(found.times_ns[at:end]))
        shared, counts = np.unique(found.channels[after], return_counts=True)
        named = [int(one) for one in shared[np.argsort(-counts)] if int(one) in self._encodings]
        shown = []
        for channel in named[:MOST_CHANNELS]:
            old = before[found.channels[before] == channel][-COMPARED:]
            new = after[found.channels[after] == channel]
            if len(old) < LEAST or len(new) < LEAST:
                continue
            new = new[np.linspace(0, len(new) - 1, min(COMPARED, len(new))).astype(int)]
            gained_ns = self._gained(found, old, new)
            if gained_ns is not None and abs(gained_ns) >= LEAST_STEP_NS:
                shown.append(gained_ns)
        return int(np.median(shown)) if shown and max(shown) - min(shown) <= AGREE_NS else None

    def _gained(self, found: Arrivals, old: Sequence[int], new: Sequence[int]) -> int | None:
        was, now = self._ahead_of_stamps(found, old), self._ahead_of_stamps(found, new)
        if was is None or now is None:
            return None
        return int(np.median(now)) - int(np.median(was))

    def _ahead_of_stamps(self, found: Arrivals, indexes: Sequence[int]) -> list[int] | None:
        """Log time minus stamp of these messages [ns]; None where one has no stamp, or they differ."""
        ahead = []
        for index in indexes:
            channel = int(found.channels[index])
            raw = self._raw_at(int(found.places[index]), channel)
            stamp_ns = None if raw is None else _stamp(raw, self._encodings[channel])
            if stamp_ns is None:
                return None
            ahead.append(int(found.times_ns[index]) - stamp_ns)
        return ahead if max(ahead) - min(ahead) <= STEADY_NS else None


def _goes_on(times_ns: Ints) -> int:
    """How many of these times are within AFTER_NS of the first, before they go back or leap."""
    is_other = (times_ns - times_ns[0] > AFTER_NS) | (np.maximum.accumulate(times_ns) - times_ns >= BACK_NS)
    return int(np.argmax(is_other)) if is_other.any() else len(times_ns)


def _is_stamped(channel: Channel) -> bool:
    """Whether its messages begin with a header."""
    if channel.encoding not in ("ros1", "cdr"):
        return False
    if channel.format == "msg":
        lines = (line.partition("#")[0].strip() for line in channel.definition.splitlines())
        return _HEADER.match(next((line for line in lines if line), "")) is not None
    return _STAMPED.fullmatch(channel.type) is not None


def _stamp(raw: bytes, encoding: str) -> int | None:
    """The stamp of a message that begins with a header [ns]; None: there is none."""
    try:
        if encoding == "ros1":
            _, seconds, nanoseconds = _ROS1.unpack_from(raw)
        else:
            seconds, nanoseconds = _CDR[raw[1] & 1].unpack_from(raw)
    except (struct.error, IndexError):
        return None
    return seconds * S + nanoseconds if seconds or nanoseconds else None
