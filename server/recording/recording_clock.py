"""The clock of a recording: the time of day at its beginning, and from then on the time that passes; and its history.

The server's clock may be set while a recording is written. The times of its messages and entries continue as before,
whatever the time of day is then, and entries that carry a time of day are corrected.

A page knows the time of day of the server as it was when the page received it last. What waited on a phone while the
server's clock was set therefore has a time of the clock before. The history has the time of day of each moment,
over all steps of the server's clock, and the clock of the recording that covers it.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

STEP_MS = 1000  # a smaller difference is not corrected: clocks are slewed
NEAR_MS = 86_400_000  # times of day in an entry are of about now

MOST_STEPS, MOST_RECORDINGS = 50, 50
SLACK_S = 1.0  # clocks that were set by each other differ by less


class RecordingClock:
    """Of one vehicle. `now` is a monotonic clock [s], `wall_ms` the time of day [ms since 1970]."""

    def __init__(self, now: Callable[[], float], wall_ms: Callable[[], int]) -> None:
        self._now = now
        self._wall_ms = wall_ms
        self._anchor = (0.0, 0)  # a moment of `now`, and the time of day then [ns]

    def start(self) -> None:
        """A recording begins."""
        self._anchor = self._now(), self._wall_ms() * 1_000_000

    def ns(self, now_s: float) -> int:
        """The time of a moment of `now`, since 1970."""
        since_s, since_ns = self._anchor
        return since_ns + round((now_s - since_s) * 1e9)

    def ms(self) -> int:
        """The time now, since 1970."""
        return self.ns(self._now()) // 1_000_000

    def shift_ms(self) -> int:
        """What is added to a time of day to make it a time of the recording."""
        by_ms = self.ms() - self._wall_ms()
        return by_ms if abs(by_ms) > STEP_MS else 0

    def moment_ms(self, at_ms: float) -> float:
        """The time of the recording for a time of day of about now; others are of before the clock was set."""
        return at_ms + self.shift_ms() if abs(at_ms - self._wall_ms()) < NEAR_MS else at_ms

    def entry(self, fields: Mapping[str, Any]) -> Mapping[str, Any]:
        """An entry with the times of day in it (`…_ms`) as times of the recording."""
        return self._corrected(fields) if self.shift_ms() else fields

    def _corrected(self, fields: Mapping[str, Any]) -> dict[str, Any]:
        found = dict(fields)
        for name, value in fields.items():
            if isinstance(value, Mapping):
                found[name] = self._corrected(value)
            elif name.endswith("_ms") and isinstance(value, int | float) and not isinstance(value, bool):
                found[name] = self.moment_ms(value)
        return found


@dataclass(slots=True)
class _Clock:
    """The server's clock between two steps."""

    start_s: float
    end_s: float
    zero_ms: float  # time of day at 0 of `now`

    def moment_s(self, at_ms: float) -> float:
        return (at_ms - self.zero_ms) / 1000


@dataclass(slots=True)
class _Recording:
    """A session of recording, whose clock is that of its beginning."""

    start_s: float
    zero_ms: float
    end_s: float = math.inf
    part_s: float = math.inf  # beginning of the part that is written


@dataclass(frozen=True, slots=True)
class Placed:
    """A moment as a time of day."""

    ms: int
    is_over: bool  # by the clock of a recording of which no part that is written covers the moment


class ClockHistory:
    """Which time of day a moment had, over all steps of the server's clock, and the clock of its recording.

    Of one vehicle. `now` is a monotonic clock [s], `wall_ms` the time of day [ms since 1970].
    """

    def __init__(self, now: Callable[[], float], wall_ms: Callable[[], int]) -> None:
        self._now = now
        self._wall_ms = wall_ms
        self._clocks: deque[_Clock] = deque(maxlen=MOST_STEPS)
        self._recordings: deque[_Recording] = deque(maxlen=MOST_RECORDINGS)

    def look(self) -> float:
        """Notice whether the clock was set; the moment of now."""
        now_s = self._now()
        zero_ms = self._wall_ms() - now_s * 1000
        if not self._clocks:
            self._clocks.append(_Clock(-math.inf, math.inf, zero_ms))
        newest = self._clocks[-1]
        if abs(zero_ms - newest.zero_ms) > STEP_MS:
            newest.end_s = now_s
            self._clocks.append(_Clock(now_s, math.inf, zero_ms))
        else:
            newest.zero_ms = zero_ms  # a clock is slewed
        return now_s

    def recording_started(self) -> None:
        """A session of recording begins."""
        now_s = self.look()
        if self._recordings:
            self._recordings[-1].end_s = min(self._recordings[-1].end_s, now_s)
        self._recordings.append(_Recording(now_s, self._clocks[-1].zero_ms))

    def part_started(self) -> None:
        """A part of the newest session begins."""
        self._recordings[-1].end_s, self._recordings[-1].part_s = math.inf, self._now()

    def part_ended(self) -> None:
        """The part that was written is complete."""
        self._recordings[-1].end_s, self._recordings[-1].part_s = self._now(), math.inf

    def moment_s(self, at_ms: float, age_ms: float | None = None) -> float | None:
        """The moment that a page meant by a time of day of the server; None: it is ahead of every clock there was.

        `age_ms`: how long ago it was by the page's own clock, which decides where the times of two clocks overlap.
        """
        now_s = self.look()
        # A time of a clock before it was set is unknown to everybody; one of after its end is of a page that was away.
        found = [
            (moment_s, _outside_s(moment_s, clock.start_s, min(clock.end_s, now_s)))
            for clock in reversed(self._clocks)
            if clock.start_s - SLACK_S <= (moment_s := clock.moment_s(at_ms)) <= now_s + SLACK_S
        ]
        if not found:
            return None
        if age_ms is None:
            return min(found, key=lambda one: one[1])[0]
        meant_s = now_s - age_ms / 1000
        return min(found, key=lambda one: abs(one[0] - meant_s))[0]

    def placed(self, moment_s: float) -> Placed:
        """A moment by the clock of the recording that covers it and is not being written; else by the clock of now."""
        self.look()
        for one in self._recordings:
            if one.start_s <= moment_s < one.end_s and moment_s < one.part_s:
                return Placed(round(one.zero_ms + moment_s * 1000), is_over=True)
        return Placed(round(self._clocks[-1].zero_ms + moment_s * 1000), is_over=False)


def _outside_s(moment_s: float, start_s: float, end_s: float) -> float:
    return max(start_s - moment_s, 0.0, moment_s - end_s)
