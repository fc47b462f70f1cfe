"""Ways and directions by positions: whether a pose moves, the course over ground."""

from __future__ import annotations

import math
from dataclasses import dataclass

HAS_MOVED_M = 1.0
GAP_S = 3.0  # between two poses of one way
FASTEST_MPS = 80.0  # a step that is faster is a jump of the estimate
METRES_A_DEGREE = 111_200.0


@dataclass(slots=True)
class Way:
    """The way of a pose from its first message on, without its largest step: one jump of an estimate is no motion."""

    at_s: float | None = None
    x_m: float = 0.0  # of the newest pose
    y_m: float = 0.0
    made_m: tuple[float, float] = (0.0, 0.0)
    largest_m: tuple[float, float] = (0.0, 0.0)
    has_moved: bool = False  # more than HAS_MOVED_M

    def add(self, x_m: float, y_m: float, at_s: float) -> None:
        """A further pose; what is not a number is left out."""
        if not math.isfinite(x_m + y_m):
            return
        before_s, step = self.at_s, (x_m - self.x_m, y_m - self.y_m)
        self.at_s, self.x_m, self.y_m = at_s, x_m, y_m
        if before_s is not None and at_s - before_s > GAP_S:
            self.made_m = self.largest_m = (0.0, 0.0)  # how it came here was not seen
            return
        if before_s is None or not math.hypot(*step) <= FASTEST_MPS * max(0.01, at_s - before_s):
            return
        self.made_m = (self.made_m[0] + step[0], self.made_m[1] + step[1])
        if math.hypot(*step) > math.hypot(*self.largest_m):
            self.largest_m = step
        rest = (self.made_m[0] - self.largest_m[0], self.made_m[1] - self.largest_m[1])
        self.has_moved |= math.hypot(*rest) > HAS_MOVED_M


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
