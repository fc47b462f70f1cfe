"""Ways and directions by positions, and whether two speeds are the same."""

from __future__ import annotations

import math

GAP_S = 3.0  # between two values of one motion
FASTEST_MPS = 80.0  # a step that is faster is a jump of the estimate
METRES_A_DEGREE = 111_200.0


def is_same(one_mps: float, other_mps: float) -> bool:
    """Whether two speeds are the same but for noise and calibration."""
    return abs(one_mps - other_mps) <= max(0.5, 0.15 * max(one_mps, other_mps))


def turned(one_rad: float, other_rad: float) -> float:
    """The angle from one direction to the other, −π to π."""
    return math.remainder(one_rad - other_rad, 2 * math.pi)


def east_north_m(start: tuple[float, float], end: tuple[float, float]) -> tuple[float, float]:
    """The way between two places (latitude, longitude in degrees) that are near each other."""
    east = math.remainder(end[1] - start[1], 360.0) * math.cos(math.radians(start[0]))
    return east * METRES_A_DEGREE, (end[0] - start[0]) * METRES_A_DEGREE


def metres_between(start: tuple[float, float], end: tuple[float, float]) -> float:
    """The distance of two places that are near each other."""
    return math.hypot(*east_north_m(start, end))


def course_rad(start: tuple[float, float], end: tuple[float, float]) -> float:
    """The direction from one place to another, from east, counter-clockwise."""
    east, north = east_north_m(start, end)
    return math.atan2(north, east)
