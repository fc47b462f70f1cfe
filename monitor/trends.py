"""The last minute of a few signals and of every check.

Bounded: a ring of one minute for each signal, whatever its rate, and for each check that ever measured. Of signals
the lowest and the highest number received in each fifth of a second are kept, so that no peak of a fast signal is lost
between two points. A check is sampled once in each step; what it found between two samples is in its alarm.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from monitor.check import Finding, Verdict
from monitor.signals import SIGNALS
from monitor.state import State

STEP_S = 0.2
SPAN = 300  # steps: a minute
TRENDS = tuple(name for name, signal in SIGNALS.items() if signal.trend)

Row = tuple[float, float] | Literal["none"] | None
NO_NUMBER: Literal["none"] = "none"  # a message came and had no number to give: no object is in range


@dataclass(frozen=True, slots=True, kw_only=True)
class Piece:
    """Some steps of every signal, the oldest first."""

    since: int  # the first step that was ever counted
    first: int  # number of the first step here
    now: float  # the moment itself, as a step and its part: it grows by one in each STEP_S
    rows: Mapping[str, tuple[Row, ...]]  # each of the same length; None: no message came in that step


class _Line:
    """One signal's ring."""

    __slots__ = ("highest", "lowest", "step")

    def __init__(self) -> None:
        self.step = [-1] * SPAN  # which step stands in each place
        self.lowest = [math.nan] * SPAN  # NaN: a message without a number
        self.highest = [math.nan] * SPAN

    def note(self, step: int, number: float) -> None:
        place = step % SPAN
        if self.step[place] != step or math.isnan(self.lowest[place]):
            self.step[place] = step
            self.lowest[place] = self.highest[place] = number
        elif number < self.lowest[place]:
            self.lowest[place] = number
        elif number > self.highest[place]:
            self.highest[place] = number

    def row(self, step: int) -> Row:
        place = step % SPAN
        if self.step[place] != step:
            return None
        low = self.lowest[place]
        return NO_NUMBER if math.isnan(low) else (low, self.highest[place])


class Trends:
    """The last minute since `now_s`. All times are seconds of one monotonic clock."""

    def __init__(self, now_s: float) -> None:
        self._since = math.floor(now_s / STEP_S)
        self._lines = {name: _Line() for name in TRENDS}

    def note(self, signal: str, number: float | None, now_s: float) -> None:
        """A message of a signal; None or what is no number: it had none to give. Other signals are not kept."""
        line = self._lines.get(signal)
        if line is not None:
            is_number = number is not None and math.isfinite(number)
            line.note(math.floor(now_s / STEP_S), number if number is not None and is_number else math.nan)

    def receive(self, changed: Iterable[str], state: State, now_s: float) -> None:
        """Take the signals that just changed, as the state has them now."""
        for name in changed:
            if name in self._lines:
                reading, headline = state.get(name), SIGNALS[name].headline
                if reading is not None and headline is not None:
                    self.note(name, getattr(reading.value, headline, None), now_s)

    def piece(self, now_s: float, *, after: int | None = None, at_most: int = SPAN) -> Piece:
        """The steps that are over, at most so many, those after a number only where one is given."""
        now = now_s / STEP_S
        open_step = math.floor(now)
        first = max(self._since, open_step - min(at_most, SPAN - 1), 0 if after is None else after + 1)
        first = min(first, open_step)
        steps = range(first, open_step)
        rows = {name: tuple(line.row(step) for step in steps) for name, line in self._lines.items()}
        return Piece(since=self._since, first=first, now=now, rows=rows)


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckCourse:
    """One check's last minute, the oldest step first; None: not checked then, or nothing measured."""

    since_s: float | None  # when it began to answer as it does now; None: it has not answered
    values: tuple[float | None, ...]
    limits: tuple[float | None, ...]


class _Ring:
    """Values and limits of one check by step; NaN: none."""

    __slots__ = ("limits", "values")

    def __init__(self) -> None:
        self.values = [math.nan] * SPAN
        self.limits = [math.nan] * SPAN


class CheckMinute:
    """The last minute of every check: what it measured against which limit, and since when it answers as it does.

    All times are seconds of one monotonic clock.
    """

    def __init__(self) -> None:
        self._rings: dict[str, _Ring] = {}
        self._since: dict[str, tuple[Verdict, float]] = {}
        self._step: int | None = None  # the newest that was sampled
        self._first = 0

    def note(self, findings: Mapping[str, Finding], now_s: float) -> None:
        """Sample the findings of the checks, once in a step."""
        step = math.floor(now_s / STEP_S)
        if step == self._step:
            return
        self._skip_to(step)
        place = step % SPAN
        for name, finding in findings.items():
            before = self._since.get(name)
            if before is None or before[0] is not finding.verdict:
                self._since[name] = (finding.verdict, now_s)
            measured = finding.measured
            if measured is None or finding.verdict is Verdict.UNKNOWN:
                continue
            ring = self._rings.get(name)
            if ring is None:
                ring = self._rings[name] = _Ring()
            ring.values[place] = measured.value
            ring.limits[place] = math.nan if finding.limit is None else finding.limit.value

    def _skip_to(self, step: int) -> None:
        """Empty the places of the steps since the newest one; all where the clock went back or a minute was missed."""
        newest = self._step
        self._step = step
        if newest is None or step < newest or step - newest >= SPAN:
            self._rings.clear()
            self._first = step
            return
        for ring in self._rings.values():
            for missed in range(newest + 1, step + 1):
                ring.values[missed % SPAN] = ring.limits[missed % SPAN] = math.nan

    def course(self, name: str) -> CheckCourse:
        """The steps of one check."""
        since = self._since.get(name)
        ring, newest = self._rings.get(name), self._step
        if ring is None or newest is None:
            return CheckCourse(since_s=since[1] if since else None, values=(), limits=())
        steps = range(max(self._first, newest - SPAN + 1), newest + 1)
        return CheckCourse(
            since_s=since[1] if since else None,
            values=tuple(_number(ring.values[step % SPAN]) for step in steps),
            limits=tuple(_number(ring.limits[step % SPAN]) for step in steps),
        )


def _number(value: float) -> float | None:
    return value if math.isfinite(value) else None
