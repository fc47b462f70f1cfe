"""Round numbers for axes, grids and scale bars."""

from __future__ import annotations

import math
from dataclasses import dataclass
from datetime import UTC, datetime

_TIMES_S = (1, 2, 5, 10, 15, 30, 60, 120, 300, 600, 900, 1800, 3600, 7200, 10800, 21600, 43200, 86400)


def nice_step(span: float, most: int) -> float:
    """The smallest of 1, 2, 5 · 10ⁿ by which `span` has at most `most` steps."""
    if not span > 0:
        return 1.0
    rough = span / max(most, 1)
    size = 10.0 ** math.floor(math.log10(rough))
    return next(factor * size for factor in (1, 2, 5, 10) if factor * size >= rough * (1 - 1e-9))


def ticks(low: float, high: float, most: int) -> list[float]:
    """Round numbers from at most `low` to at least `high`."""
    step = nice_step(high - low, most)
    first = math.floor(low / step + 1e-9)
    return [number * step for number in range(first, math.ceil(high / step - 1e-9) + 1)]


def time_ticks(from_ms: int, to_ms: int, most: int) -> list[tuple[int, str]]:
    """Round times of day (UTC) within a span, with what stands below them."""
    span_s = max((to_ms - from_ms) / 1000, 0.001)
    step_s = next((one for one in _TIMES_S if span_s / one <= most), _TIMES_S[-1])
    first = math.ceil(from_ms / 1000 / step_s)
    found = []
    for number in range(first, math.floor(to_ms / 1000 / step_s) + 1):
        at_ms = number * step_s * 1000
        found.append((at_ms, day_time(at_ms, with_seconds=step_s < 60)))
    return found


def day_time(at_ms: float, *, with_seconds: bool = True) -> str:
    """A time of day, UTC; a dash where no calendar has it."""
    try:
        return datetime.fromtimestamp(at_ms / 1000, UTC).strftime("%H:%M:%S" if with_seconds else "%H:%M")
    except (OverflowError, ValueError, OSError):
        return "–"


def dated_time(at_ms: float, beside_ms: float) -> str:
    """As `day_time`, with the day where it is another than that of `beside_ms`."""
    try:
        at, beside = (datetime.fromtimestamp(one / 1000, UTC) for one in (at_ms, beside_ms))
    except (OverflowError, ValueError, OSError):
        return day_time(at_ms)
    return day_time(at_ms) if at.date() == beside.date() else f"{at:%-d %b %Y}, {day_time(at_ms)}"


@dataclass(frozen=True, slots=True)
class Scale:
    """Numbers of the drive to units of the drawing."""

    low: float
    high: float
    from_px: float
    to_px: float

    def __call__(self, value: float) -> float:
        span = self.high - self.low
        share = (value - self.low) / span if span else 0.0
        return self.from_px + min(1.0, max(0.0, share)) * (self.to_px - self.from_px)
