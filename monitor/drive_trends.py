"""The whole drive of every signal that is one number, as lowest and highest in buckets of a quarter second to a minute.

A pyramid: each level has buckets four times as wide as the level below. Every level keeps its newest `CAPACITY`
buckets: one hour at 0.25 s, four at 1 s, sixteen at 4 s, ten days at 64 s. At most 576 kB a signal, 8 MB a car.
Where nothing came is kept as spans of time and never bridged by a number.
"""

from __future__ import annotations

import math
from array import array
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from monitor.signals import CHARTED, SIGNALS
from monitor.state import State

BASE_S = 0.25  # width of a bucket of the finest level
FACTOR = 4  # between two levels
LEVELS = 5
CAPACITY = 14_400  # buckets of each level
BLIND_S = 1.0  # without a message of any signal for longer: nothing is known of the car
MOST_SPANS = 500  # of one kind: beyond them the two that are nearest to each other become one
MOST_STEPS = 200  # changes of one limit

Span = tuple[float, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Course:
    """One signal in buckets; None: no number in it."""

    lowest: tuple[float | None, ...]
    highest: tuple[float | None, ...]
    gaps: tuple[Span, ...]  # no message came
    none: tuple[Span, ...]  # messages came and had no number to give: nothing is in range


@dataclass(frozen=True, slots=True, kw_only=True)
class View:
    """Some signals between two moments. Bucket i begins at `from_s` + i · `step_s`."""

    from_s: float
    step_s: float
    courses: dict[str, Course]
    blind: tuple[Span, ...]  # no message of any signal


class Spans:
    """Spans of time in order, bounded."""

    def __init__(self) -> None:
        self._spans: list[Span] = []

    def add(self, from_s: float, to_s: float) -> None:
        self._spans.append((from_s, to_s))
        if len(self._spans) > MOST_SPANS:
            between = [b[0] - a[1] for a, b in pairwise(self._spans)]
            nearest = between.index(min(between))
            self._spans[nearest : nearest + 2] = [(self._spans[nearest][0], self._spans[nearest + 1][1])]

    def between(self, from_s: float, to_s: float, open_span: Span | None, apart_s: float) -> tuple[Span, ...]:
        """Those of a part of the drive, cut to it; spans less than `apart_s` apart are one."""
        found: list[Span] = []
        for begin_s, end_s in [*self._spans, *([open_span] if open_span is not None else [])]:
            if end_s <= from_s or begin_s >= to_s:
                continue
            begin_s, end_s = max(begin_s, from_s), min(end_s, to_s)
            if found and begin_s - found[-1][1] < apart_s:
                found[-1] = (found[-1][0], end_s)
            else:
                found.append((begin_s, end_s))
        return tuple(found)


class _Level:
    """The newest buckets of one width, in a ring that grows up to `CAPACITY`; NaN: nothing."""

    __slots__ = ("highest", "last", "lowest")

    def __init__(self) -> None:
        self.last = -1
        self.lowest = array("f")
        self.highest = array("f")

    def merge(self, index: int, low: float, high: float) -> None:
        if index > self.last:
            self._open(index)
        elif index <= self.last - CAPACITY:
            return
        place = index % CAPACITY
        if not self.lowest[place] <= low:  # NaN is not
            self.lowest[place] = low
        if not self.highest[place] >= high:
            self.highest[place] = high

    def _open(self, index: int) -> None:
        missing = min(index + 1, CAPACITY) - len(self.lowest)
        if missing > 0:
            self.lowest.extend([math.nan] * missing)
            self.highest.extend([math.nan] * missing)
        for step in range(max(self.last + 1, index - CAPACITY + 1), index + 1):
            self.lowest[step % CAPACITY] = self.highest[step % CAPACITY] = math.nan
        self.last = index

    def range(self, first: int, count: int) -> tuple[float, float] | None:
        """Lowest and highest of some buckets; None: no number."""
        low, high = math.inf, -math.inf
        for index in range(max(first, self.last - CAPACITY + 1, 0), min(first + count, self.last + 1)):
            place = index % CAPACITY
            if self.lowest[place] < low:
                low = self.lowest[place]
            if self.highest[place] > high:
                high = self.highest[place]
        return (low, high) if low <= high else None


class _Line:
    """One signal. The open bucket is added to the levels when the next one begins, or when the trend is read."""

    __slots__ = ("gaps", "has_data", "high", "horizon_s", "levels", "low", "none", "none_since_s", "received_s", "step")

    def __init__(self) -> None:
        self.levels = tuple(_Level() for _ in range(LEVELS))
        self.step = -1
        self.low = self.high = math.nan
        self.received_s = 0.0  # a drive begins with a gap
        self.horizon_s = 0.0
        self.has_data = False
        self.gaps = Spans()
        self.none = Spans()
        self.none_since_s: float | None = None

    def note(self, number: float, at_s: float, horizon_s: float) -> None:
        """A message; NaN: it had no number to give. After more than `horizon_s` without one was a gap."""
        self.horizon_s = horizon_s
        if at_s - self.received_s > horizon_s:
            self.gaps.add(self.received_s, at_s)
            self._end_none(self.received_s)
        self.received_s = at_s
        self.has_data = True
        if not math.isfinite(number):
            if self.none_since_s is None:
                self.none_since_s = at_s
            return
        self._end_none(at_s)
        step = max(0, math.floor(at_s / BASE_S))
        if step != self.step:
            self.flush()
            self.step, self.low, self.high = step, number, number
        elif number < self.low:
            self.low = number
        elif number > self.high:
            self.high = number

    def _end_none(self, at_s: float) -> None:
        if self.none_since_s is not None:
            self.none.add(self.none_since_s, at_s)
            self.none_since_s = None

    def flush(self) -> None:
        """Bring the levels up to date."""
        index = self.step
        if index >= 0:
            for level in self.levels:
                level.merge(index, self.low, self.high)
                index //= FACTOR


class DriveTrends:
    """Since `since_s`. Moments given are of one monotonic clock; in what is answered they count from `since_s`."""

    def __init__(self, since_s: float) -> None:
        self.since_s = since_s
        self._lines = {name: _Line() for name in CHARTED}
        self._blind = Spans()
        self._received_s = 0.0
        self._limits: dict[str, list[tuple[float, float]]] = {}

    def receive(self, changed: Iterable[str], state: State, now_s: float) -> None:
        """Take the signals that just changed, as the state has them now."""
        at_s = now_s - self.since_s
        if at_s - self._received_s > BLIND_S:
            self._blind.add(self._received_s, at_s)
        self._received_s = at_s
        for name in changed:
            field = CHARTED.get(name)
            reading = state.get(name) if field is not None else None
            if field is not None and reading is not None:
                number = getattr(reading.value, field, None)
                horizon_s = math.inf if SIGNALS[name].event_like else reading.horizon_s
                self._lines[name].note(math.nan if number is None else number, at_s, horizon_s)

    def set_limits(self, limits: object, now_s: float) -> None:
        """The thresholds in force from now on, of the signals that have one."""
        for name, signal in SIGNALS.items():
            if signal.limit is None:
                continue
            value: object = limits
            for part in signal.limit.split("."):
                value = getattr(value, part)
            steps = self._limits.setdefault(name, [])
            if isinstance(value, float | int) and (not steps or steps[-1][1] != value):
                steps.append((max(0.0, now_s - self.since_s) if steps else 0.0, float(value)))
                del steps[1 : len(steps) - MOST_STEPS + 1]

    def limits(self, signal: str) -> tuple[tuple[float, float], ...]:
        """From when on which limit stood beside a signal."""
        return tuple(self._limits.get(signal, ()))

    def has_data(self, signal: str) -> bool:
        """Whether a message of it ever came."""
        return self._lines[signal].has_data

    def bytes(self) -> int:
        """Memory of all buckets."""
        return sum(
            (len(level.lowest) + len(level.highest)) * level.lowest.itemsize
            for line in self._lines.values()
            for level in line.levels
        )

    def view(self, signals: Sequence[str], from_s: float, to_s: float, buckets: int, now_s: float) -> View:
        """Some signals between two moments of the drive, in at most `buckets` + 1 buckets.

        The buckets are as narrow as the level that still holds `from_s` allows, and begin at multiples of their width.
        """
        until_s = max(0.0, now_s - self.since_s)
        from_s = min(max(from_s, 0.0), until_s)
        to_s = min(max(to_s, from_s), until_s)
        number, step_s = _level_for(from_s, to_s, buckets, until_s)
        merged = max(1, math.ceil((to_s - from_s) / buckets / step_s - 1e-9))
        width_s = step_s * merged
        first = math.floor(from_s / width_s)
        count = max(1, math.ceil(to_s / width_s - 1e-9) - first)
        blind = self._blind.between(from_s, to_s, _open_span(self._received_s, until_s, BLIND_S), apart_s=width_s)
        courses = {}
        for name in signals:
            line = self._lines[name]
            line.flush()
            ranges = [line.levels[number].range((first + i) * merged, merged) for i in range(count)]
            silent = _open_span(line.received_s, until_s, line.horizon_s)
            without = None if line.none_since_s is None else (line.none_since_s, line.received_s)
            courses[name] = Course(
                lowest=tuple(None if one is None else one[0] for one in ranges),
                highest=tuple(None if one is None else one[1] for one in ranges),
                gaps=line.gaps.between(from_s, to_s, silent, apart_s=width_s),
                none=line.none.between(from_s, to_s, without, apart_s=width_s),
            )
        return View(from_s=first * width_s, step_s=width_s, courses=courses, blind=blind)


def _open_span(received_s: float, until_s: float, patience_s: float) -> Span | None:
    return (received_s, until_s) if until_s - received_s > patience_s else None


def _level_for(from_s: float, to_s: float, buckets: int, until_s: float) -> tuple[int, float]:
    """The coarsest level that is fine enough, or the finest that still holds `from_s`."""
    wanted_s = (to_s - from_s) / buckets
    found, step_s = 0, BASE_S
    for number in range(1, LEVELS):
        wider_s = BASE_S * FACTOR**number
        is_held = math.floor(until_s / step_s) - math.floor(from_s / step_s) < CAPACITY
        if is_held and wider_s > wanted_s:
            break
        found, step_s = number, wider_s
    return found, step_s
