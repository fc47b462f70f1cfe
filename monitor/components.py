"""The newest report of every component on /diagnostics, where several nodes publish, each its own components."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import replace

from monitor.values import Component, Diagnostics

SILENT_AFTER_S = 5.0  # at least, as ROS's diagnostic aggregator …
SILENT_PERIODS = 3  # … and so many of the component's own intervals
INTERVALS = 8  # the longest of the newest ones is a component's own: reports also come out of turn
ONE_INTERVAL_S = 60.0  # at least, while there is only one: two reports at a start are no interval
SELDOM_S = 150.0  # healthy components report every two minutes, and between two reports nothing else may come
TOPIC_SILENT_S = 10.0  # at least, of the whole topic
FORGOTTEN_AFTER_S = 60.0  # at least, and twice the allowed silence: a node that was ended does not alarm for ever
FORGOTTEN_UNKNOWN_S = 3600.0  # of a component that reported once
UNWATCHED_S = 1.0  # all is judged twenty times a second: a stall, or a stretch of a recording that was skipped
MOST = 1000
STALE = 3  # diagnostic_msgs/DiagnosticStatus


class _Reports:
    """What one component reported."""

    __slots__ = ("_intervals", "allowed_s", "at_s", "missed_s", "newest")

    def __init__(self, newest: Component, at_s: float) -> None:
        self.newest, self.at_s = replace(newest, once_s=at_s), at_s
        self.missed_s = 0.0  # since then, the time in which no report could be received
        self.allowed_s = math.inf  # the silence that its own interval explains; infinite after a single report
        self._intervals: deque[float] = deque(maxlen=INTERVALS)

    def add(self, newest: Component, at_s: float) -> None:
        if at_s > self.at_s and self.missed_s == 0.0:
            self._intervals.append(at_s - self.at_s)
            least_s = SILENT_AFTER_S if len(self._intervals) > 1 else ONE_INTERVAL_S
            self.allowed_s = max(least_s, SILENT_PERIODS * max(self._intervals))
        self.newest = replace(newest, once_s=at_s) if math.isinf(self.allowed_s) else newest
        self.at_s, self.missed_s = at_s, 0.0

    @property
    def interval_s(self) -> float | None:
        """Its own; None while it is not known."""
        return max(self._intervals) if len(self._intervals) > 1 else None

    def miss(self, from_s: float, until_s: float) -> None:
        self.missed_s += max(0.0, until_s - max(from_s, self.at_s))

    def is_kept(self, now_s: float) -> bool:
        if math.isinf(self.allowed_s):
            return -1.0 <= now_s - self.at_s <= FORGOTTEN_UNKNOWN_S
        return -1.0 <= now_s - self.at_s - self.missed_s <= max(FORGOTTEN_AFTER_S, 2 * self.allowed_s)

    def is_due(self, now_s: float) -> bool:
        return now_s - self.at_s - self.missed_s > self.allowed_s

    def at(self, now_s: float) -> Component:
        if not self.is_due(now_s):
            return self.newest
        return Component(name=self.newest.name, level=STALE, message=f"no report for {now_s - self.at_s:.0f} s")


class Components:
    """Merges messages into one list of components.

    Each is judged against its own interval: one that falls silent turns STALE, and is forgotten in the end.
    """

    def __init__(self) -> None:
        self._known: dict[str, _Reports] = {}
        self._watched_s: float | None = None  # when all was judged, the last time
        self._closed_s = math.inf  # when the link was closed, the last time

    def merge(self, message: Diagnostics, at_s: float) -> Diagnostics:
        """All components known after this message, in the order in which they first reported."""
        self._miss_stall(at_s)
        known = self._known
        for component in message.components:
            before = known.get(component.name)
            if before is None or not before.is_kept(at_s):
                known[component.name] = _Reports(component, at_s)
            else:
                before.add(component, at_s)
        if len(known) > MOST:  # those that were silent longest are dropped
            for name in sorted(known, key=lambda name: known[name].at_s)[: len(known) - MOST]:
                del known[name]
        self._known = {name: reports for name, reports in known.items() if reports.is_kept(at_s)}
        return Diagnostics(components=tuple(reports.at(at_s) for reports in self._known.values()))

    def watch(self, now_s: float) -> None:
        """Must be called at every judgement of all checks: in a time without a call nothing could be received."""
        self._miss_stall(now_s)
        self._watched_s = now_s

    def _miss_stall(self, now_s: float) -> None:
        if self._watched_s is not None and now_s - self._watched_s > UNWATCHED_S:
            self.miss(self._watched_s, now_s)
            self._watched_s = now_s

    def closed(self, at_s: float) -> None:
        """The link is closed."""
        self._closed_s = at_s

    def opened(self, at_s: float) -> None:
        """The link is open again."""
        self.miss(self._closed_s, at_s)

    def miss(self, from_s: float, until_s: float) -> None:
        """No report could be received for so long: that is neither a component's silence nor its interval."""
        for reports in self._known.values():
            reports.miss(from_s, until_s)

    def horizon_s(self, now_s: float) -> float:
        """The silence of all together that the intervals of those that still report explain [s]."""
        allowed_s = min((one.allowed_s for one in self._known.values() if not one.is_due(now_s)), default=math.inf)
        return SELDOM_S if math.isinf(allowed_s) else max(TOPIC_SILENT_S, allowed_s)

    def period_s(self, now_s: float) -> float | None:
        """The interval of the one that reports most often, of those that still report [s]; None: not known."""
        found = [one.interval_s for one in self._known.values() if not one.is_due(now_s)]
        return min((interval_s for interval_s in found if interval_s is not None), default=None)
