"""The alarms of a recording by check, for who opens one in a replay: what had happened by the moment that is shown."""

from __future__ import annotations

from collections import defaultdict

from monitor.alarm import Transition

MOST = 20_000  # transitions of all alarms: days of a car in trouble
MOST_SHOWN = 300  # of one alarm, the newest


class AlarmHistory:
    """Times are seconds since the beginning of the recording."""

    def __init__(self) -> None:
        self._of: defaultdict[str, list[tuple[float, Transition]]] = defaultdict(list)
        self._count = 0
        self._full_s: float | None = None  # from here on transitions are missing

    def add(self, transition: Transition, at_s: float) -> None:
        """Keep it. `at_s`: when it became known; what stood before the recording is older than that."""
        if self._count >= MOST:
            if self._full_s is None:
                self._full_s = at_s
            return
        self._count += 1
        self._of[transition.alarm_id].append((at_s, transition))

    def until(self, alarm: str, at_s: float) -> list[Transition] | None:
        """The transitions of one alarm up to a moment, the oldest first; None: some of them are missing."""
        if self._full_s is not None and at_s >= self._full_s:
            return None
        return [transition for known_s, transition in self._of[alarm] if known_s <= at_s][-MOST_SHOWN:]
