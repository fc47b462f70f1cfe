"""Bounds of what several signals have: what is beyond is another unit, or noise, and is rejected."""

from __future__ import annotations

from typing import Any

from monitor.values import Number
from server.judge.message_fields import Rejected, finite
from server.judge.topic import Decode

FULLEST_PERCENT = 10_000.0  # a hundred times all there is
FASTEST_MPS = 150.0  # beyond that a wheel sensor or a unit is broken, not the car fast
FASTEST_KMH = FASTEST_MPS * 3.6
TOO_FAST = "a speed beyond the range of a car"


def one_number(*path: str, minimum: float, maximum: float) -> Decode:
    """The decoder of a signal that is one number, at a path of fields; what is outside the bounds is rejected."""
    reason = f"{'.'.join(path)} is outside {minimum:g} to {maximum:g}"

    def decode(message: Any) -> Number:
        value = finite(message, *path)
        if not minimum <= value <= maximum:
            raise Rejected(reason)
        return Number(value=value)

    return decode


def plausible_speed(value: float, most: float = FASTEST_MPS) -> float:
    """A speed [m/s] as it is; raises Rejected where no car is as fast. `most`: of another unit."""
    if abs(value) > most:
        raise Rejected(TOO_FAST)
    return value


def plausible_percent(value: float) -> float:
    """A percentage as it is; raises Rejected where it can be none."""
    if abs(value) > FULLEST_PERCENT:
        raise Rejected("a percentage beyond the range of a pedal")
    return value
