"""The last minute of a few signals: the lowest and the highest number heard in each fifth of a second, or nothing.

Bounded: a ring of one minute a signal, however fast it speaks. Lowest and highest are kept, so that no peak of a fast
signal is lost between two points.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

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
