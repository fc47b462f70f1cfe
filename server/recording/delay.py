"""The delay of the link in our recordings; without it a re-evaluation would assume no delay.

Rows are on the channel `/catgraph/delay`, at most one per tick, and only after a change: the delay of each topic's
newest message, the delay of the link, and its throttling. A recording without rows counts as one without delay.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from collections.abc import Mapping
from dataclasses import dataclass, replace
from itertools import islice
from operator import attrgetter
from typing import TYPE_CHECKING, Any

from server.recording.own import PREFIX

if TYPE_CHECKING:
    from server.recording.read.read import Recording

EVERY_S = 0.1  # a row applies to the messages of this time before it
FINE_S = 0.005  # a change of a delay that is written
COARSE_S, COARSE_BELOW_S = 0.05, 0.3  # … where both are small: no check is near its limit
MOST_ROWS = 2_000_000  # that are read: two days of a slow link
MOST_S = 3600.0  # a longer delay is none of ours; an older sample is written as so old


@dataclass(frozen=True, slots=True)
class LinkDelay:
    """What the link was like at one moment."""

    at_s: float = -math.inf
    late_s: float | None = None
    throttled: frozenset[str] = frozenset()  # signals
    reduced: str | None = None


class DelayWriter:
    """What is to be written of one part; it begins knowing nothing."""

    def __init__(self) -> None:
        self._delays: dict[str, float] = {}
        self._link = LinkDelay()

    def row(self, delays: Mapping[str, float], link: LinkDelay) -> dict[str, Any] | None:
        """What changed since the last row; None where nothing did. `delays`: of each topic's newest message [s]."""
        delays = {topic: min(delay_s, MOST_S) for topic, delay_s in delays.items()}
        changed = {topic: delay_s for topic, delay_s in delays.items() if _differs(self._delays.get(topic), delay_s)}
        before = self._link
        is_other = (before.throttled, before.reduced) != (link.throttled, link.reduced)
        if not changed and not is_other and not _differs(before.late_s, link.late_s):
            return None
        self._delays |= changed
        self._link = link
        row: dict[str, Any] = {
            "late_s": None if link.late_s is None else round(link.late_s, 3),
            "delays": {topic: round(delay_s, 3) for topic, delay_s in changed.items()},
        }
        return row | {"throttled": sorted(link.throttled), "reduced": link.reduced} if is_other else row


class RecordedDelay:
    """The recorded delay. Times are seconds since the start of the recording, in any order."""

    def __init__(self, recording: Recording) -> None:
        self._times: dict[str, list[float]] = {}  # by topic
        self._delays: dict[str, list[float]] = {}
        self._links: list[LinkDelay] = []
        link = LinkDelay()
        own = getattr(recording, "own", None)  # what is no file has none
        for at_s, row in islice(own(PREFIX + "delay") if own is not None else (), MOST_ROWS):
            since_s = at_s - recording.start_s
            link = _link_of(row, replace(link, at_s=since_s))
            self._links.append(link)
            delays = row.get("delays")
            for topic, delay_s in delays.items() if isinstance(delays, dict) else ():
                if _is_delay(delay_s):
                    self._times.setdefault(topic, []).append(since_s)
                    self._delays.setdefault(topic, []).append(float(delay_s))

    @property
    def is_known(self) -> bool:
        return bool(self._links)

    def course(self) -> list[tuple[float, float]]:
        """The delay of the link over time: when it changed, and to what [s]."""
        return [(link.at_s, link.late_s) for link in self._links if link.late_s is not None]

    def receive(self, topic: str, at_s: float, stamp_s: float | None = None) -> float:
        """How old a message was that came now [s]."""
        times = self._times.get(topic)
        if times is None:
            return 0.0
        place = bisect_right(times, at_s + EVERY_S)
        return self._delays[topic][place - 1] if place else 0.0

    def link(self, now_s: float) -> LinkDelay:
        """What was known of the link; before the first row, nothing."""
        place = bisect_right(self._links, now_s, key=attrgetter("at_s"))
        return self._links[place - 1] if place else LinkDelay()


def recorded_delay(recording: Recording) -> RecordedDelay | None:
    """None if the recording has no delay."""
    delay = RecordedDelay(recording)
    return delay if delay.is_known else None


def _link_of(row: Mapping[str, Any], before: LinkDelay) -> LinkDelay:
    late_s: Any = row.get("late_s")
    link = replace(before, late_s=float(late_s) if _is_delay(late_s) else None)
    throttled, reduced = row.get("throttled"), row.get("reduced")
    if not isinstance(throttled, list):
        return link
    named = frozenset(name for name in throttled if isinstance(name, str))
    return replace(link, throttled=named, reduced=reduced if isinstance(reduced, str) else None)


def _is_delay(value: object) -> bool:
    return isinstance(value, (int, float)) and not isinstance(value, bool) and 0.0 <= value <= MOST_S


def _differs(before: float | None, after: float | None) -> bool:
    if before is None or after is None:
        return before is not after
    is_small = max(before, after) < COARSE_BELOW_S
    return abs(after - before) > (COARSE_S if is_small else FINE_S)
