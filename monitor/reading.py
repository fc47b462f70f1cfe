"""The newest value of a signal, and how old it may grow before nothing may be judged by it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Generic, Literal, TypeVar

from monitor.freeze_detection import Repeats
from monitor.immutable import immutable

AGEING_PERIODS = 3
AGEING_FLOOR_S = 0.4  # three periods of a 75 Hz signal are one hiccup of Wi-Fi; a healthy link has its own 0.15 s
DELAY_AT_MOST_S = 2.0  # later than this a value is old, however patient one is with a signal that comes seldom

Freshness = Literal["fresh", "ageing", "stale"]
T_co = TypeVar("T_co", covariant=True)


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
