"""The newest value of a signal, how old it may grow before nothing may be judged by it, and its recent values.

Messages that come without a value are kept apart, for they are no silence: not a number, out of range, of another
shape, or not measured by their own definition.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Any, Generic, Literal, TypeVar

from monitor.freeze_detection import Repeats
from monitor.immutable import immutable

AGEING_PERIODS = 3
AGEING_FLOOR_S = 0.4  # three periods of a 75 Hz signal are one hiccup of Wi-Fi; a healthy link has its own 0.15 s
DELAY_AT_MOST_S = 2.0  # from this age a value is old, also of a signal that comes seldom

Freshness = Literal["fresh", "ageing", "stale"]
T_co = TypeVar("T_co", covariant=True)

BEFORE_S = 0.4  # long enough to distinguish a walking person from noise, short enough for a braking car
AT_MOST_S = 1.2


@immutable
class Reading(Generic[T_co]):
    """The newest value of a signal, and how old it may grow. Times are on the receiver's monotonic clock."""

    value: T_co
    received_s: float
    horizon_s: float  # older than this is stale
    stamp_s: float | None = (
        None  # the vehicle's own time, seconds since 1970; another clock: never subtract it from received_s
    )
    period_s: float | None = None  # seconds between two messages, as far as known
    count: int = 0  # messages since connecting; 0 for a derived value
    derived_from: str | None = None  # the signal it was computed from; None: published by the car
    repeats: Repeats | None = None  # what it repeats of the messages before it; None: nothing of it can be followed
    delay_s: float = 0.0  # how old it was when it came, at most: what its transport may have taken
    # How much further its stamp is behind the receiver's clock (negative) or ahead of it (positive) than usual since
    # connecting; None: no stamp, or many writers.
    stamp_change_s: float | None = None

    def age_s(self, now_s: float) -> float:
        """How old the value is, its transport included."""
        return self.silent_s(now_s) + self.delay_s

    def silent_s(self, now_s: float) -> float:
        """Age of the message, not of its content."""
        return max(0.0, now_s - self.received_s)

    def is_fresh(self, now_s: float) -> bool:
        # Both ways: a reading from far in the future means that the clock went back, not that the value is new.
        silent_s = now_s - self.received_s
        return -self.horizon_s <= silent_s <= self.horizon_s - self.delay_s and self.delay_s <= DELAY_AT_MOST_S

    def is_coming(self, now_s: float) -> bool:
        """Whether messages come, however late they are."""
        return -self.horizon_s <= now_s - self.received_s <= self.horizon_s

    def freshness(self, now_s: float) -> Freshness:
        if not self.is_fresh(now_s):
            return "stale"
        if self.period_s is None:
            return "fresh"
        return "ageing" if self.age_s(now_s) > max(AGEING_PERIODS * self.period_s, AGEING_FLOOR_S) else "fresh"


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """Lowest and highest headline number since connecting."""

    lowest: float
    highest: float


class ReadingHistory:
    """The recent values of a signal, for the closing speed of an object.

    The last second of one signal's readings; bounded by time and number.
    """

    __slots__ = ("_readings", "before")

    def __init__(self) -> None:
        self._readings: deque[Reading[Any]] = deque(maxlen=256)
        # The newest reading at least 0.4 s older than the latest one; None where there is none within 1.2 s.
        self.before: Reading[Any] | None = None

    def add(self, reading: Reading[Any]) -> None:
        readings, at_s = self._readings, reading.received_s
        if readings and at_s < readings[-1].received_s:
            readings.clear()  # the clock went back
        readings.append(reading)
        # The oldest that is kept is the one to compare with: drop it when the next is old enough too.
        while len(readings) > 1 and at_s - readings[1].received_s >= BEFORE_S:
            readings.popleft()
        oldest = readings[0]
        self.before = oldest if BEFORE_S <= at_s - oldest.received_s <= AT_MOST_S else None


class ReadingTable:
    """The newest readings and the ranges of all signals, which snapshots share without a copy.

    Copies on write: what a snapshot shares is copied before the next change.
    """

    __slots__ = ("_extents", "_extents_shared", "_readings_shared", "newest")

    def __init__(self) -> None:
        self.newest: dict[str, Reading[Any]] = {}  # by signal; to read, `put` and `drop` alone change it
        self._extents: dict[str, Extent] = {}
        self._readings_shared: Mapping[str, Reading[Any]] | None = None
        self._extents_shared: Mapping[str, Extent] | None = None

    def put(self, signal: str, reading: Reading[Any]) -> None:
        """Replace the newest reading of a signal."""
        if self._readings_shared is not None:
            self.newest = self.newest.copy()
            self._readings_shared = None
        self.newest[signal] = reading

    def drop(self, signal: str) -> None:
        """Forget the newest reading of a signal."""
        self.newest = {name: reading for name, reading in self.newest.items() if name != signal}
        self._readings_shared = None

    def forget(self, signal: str) -> None:
        """Forget the newest reading of a signal, and its range."""
        if signal in self.newest:
            self.drop(signal)
        if signal in self._extents:
            self._extents = {name: extent for name, extent in self._extents.items() if name != signal}
            self._extents_shared = None

    def age(self, signal: str, received_s: float, delay_s: float) -> None:
        """The reading that came at `received_s`, and what was derived from it, was so old when it came."""
        for name, reading in self.newest.items():
            is_of_it = signal in (name, reading.derived_from) and reading.received_s == received_s
            if is_of_it and reading.delay_s != delay_s:
                self.put(name, replace(reading, delay_s=delay_s))

    def put_extent(self, signal: str, lowest: float, highest: float) -> None:
        """Replace the range of a signal's headline number."""
        if self._extents_shared is not None:
            self._extents = self._extents.copy()
            self._extents_shared = None
        self._extents[signal] = Extent(lowest=lowest, highest=highest)

    def is_fresh(self, signal: str, now_s: float) -> bool:
        """Whether a signal has a reading to judge by at `now_s`."""
        reading = self.newest.get(signal)
        return reading is not None and reading.is_fresh(now_s)

    def shift(self, by_s: float) -> None:
        """Move the times of all readings, so that their ages survive a clock that went back."""
        self.newest = {
            name: replace(reading, received_s=reading.received_s + by_s) for name, reading in self.newest.items()
        }
        self._readings_shared = None

    def readings(self) -> Mapping[str, Reading[Any]]:
        """The newest readings as they are now; later changes do not reach this mapping."""
        shared = self._readings_shared
        if shared is None:
            shared = self._readings_shared = MappingProxyType(self.newest)
        return shared

    def extents(self) -> Mapping[str, Extent]:
        """The ranges as they are now; later changes do not reach this mapping."""
        shared = self._extents_shared
        if shared is None:
            shared = self._extents_shared = MappingProxyType(self._extents)
        return shared


NOT_A_NUMBER = " is not a number"


@dataclass(frozen=True, slots=True, kw_only=True)
class Unusable:
    """The newest messages of a signal, none of which could be used."""

    reason: str  # of the newest one; of the newest wrong one, as long as such come
    at_s: float  # when the newest one came, wrong or declared
    since_s: float  # when the first one in a row came
    count: int  # in a row; of the wrong ones alone, as long as such come
    horizon_s: float  # a silence of this signal longer than that is one
    period_s: float | None = None
    is_declared: bool = False  # they declare the value as not measured, none of late is wrong: no fault of the sensor
    wrong_s: float | None = None  # when the newest wrong one came, where declared ones came after it

    @property
    def text(self) -> str:
        """The reason as it follows the name of the signal: "not a number (linear.x)"."""
        field, is_not, rest = self.reason.partition(NOT_A_NUMBER)
        return f"not a number ({field})" if is_not and not rest else self.reason

    def is_coming(self, now_s: float) -> bool:
        return now_s - self.at_s <= self.horizon_s


def with_unusable(
    before: Mapping[str, Unusable],
    signal: str,
    reason: str,
    at_s: float,
    horizon_s: float,
    period_s: float | None,
    *,
    is_declared: bool = False,
) -> Mapping[str, Unusable]:
    """The unusable signals after one more message of `signal` without a value."""
    known = before.get(signal)
    if known is not None and known.is_declared != is_declared:
        wrong_s = known.at_s if known.wrong_s is None else known.wrong_s
        if is_declared and at_s - wrong_s <= horizon_s:
            now = replace(known, at_s=at_s, horizon_s=horizon_s, period_s=period_s, wrong_s=wrong_s)
            return MappingProxyType({**before, signal: now})
        known = None
    now = Unusable(
        reason=reason,
        at_s=at_s,
        since_s=at_s if known is None else known.since_s,
        count=1 if known is None else known.count + 1,
        horizon_s=horizon_s,
        period_s=period_s,
        is_declared=is_declared,
    )
    return MappingProxyType({**before, signal: now})


def without_unusable(before: Mapping[str, Unusable], signal: str) -> Mapping[str, Unusable]:
    """The unusable signals after a usable message of `signal`."""
    return MappingProxyType({name: one for name, one in before.items() if name != signal})
