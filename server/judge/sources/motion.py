"""Since when a topic shows without a pause that the car moves, so that another one that is zero is never filled."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

GAP_S = 3.0  # between two values of one motion
FASTEST_MPS = 80.0  # a step that is faster is a jump of the estimate
METRES_A_DEGREE = 111_200.0

MOVES_MPS = 1.0
WINDOW_S = 0.5  # between two places that are compared: nearer ones differ by their noise
LONG_S = 2.0  # so long a motion proves that a topic which is zero meanwhile is not filled
POSE_LEAST_M = 2.0  # between the first and the newest place of a motion, without its largest step
PLACES_S = 1.5  # between two places of one motion: what happened in a longer pause was not seen
LEAST_STEPS = 2  # of a motion: one may be a jump
FIX_MPS, FIX_LEAST_M, FIX_SIGMAS = 2.0, 15.0, 6.0  # of a receiver, which wanders at standstill
POSES_MPS = 0.8  # of poses without a twist, which may be a receiver's too: straight on, over the same least way
FAR_M = 100.0  # without a pause and a turn: no receiver wanders so
LOST_M2 = 1000.0  # the covariance by which an odometry declares itself lost
STRAIGHT_RAD = math.radians(90)  # a step that turns more is noise


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


@dataclass(slots=True)
class Motion:
    """By one kind of value of one topic: the speed that it states, or its places."""

    since_s: float | None = None  # None: it does not move now
    newest_s: float = -math.inf
    way_m: float = math.inf  # from the first to the newest place, without the largest step; not of a stated speed
    _steps: int = 0  # since `since_s`
    _largest_m: float = 0.0  # of these
    _anchor: tuple[float, float, float] | None = None  # when, x and y [m] of the place that is compared next
    _course: float | None = None
    _start: tuple[float, float] = (0.0, 0.0)

    def state(self, mps: float, at_s: float) -> None:
        """A speed; NaN: not known."""
        if not abs(mps) > MOVES_MPS:
            self.since_s = None
        elif self.since_s is None or at_s - self.newest_s > GAP_S:
            self.since_s, self._steps = at_s, 0
        else:
            self._steps += 1
        self.newest_s = at_s

    def place(self, x_m: float, y_m: float, at_s: float, *, slowest_mps: float = MOVES_MPS) -> None:
        """A place on a plane; what is not a number is left out."""
        if not math.isfinite(x_m + y_m):
            return
        self.newest_s = at_s
        if self._anchor is None or not 0.0 <= at_s - self._anchor[0] <= PLACES_S:
            self._anchor, self._course, self.since_s = (at_s, x_m, y_m), None, None
            return
        before_s, before_x, before_y = self._anchor
        if at_s - before_s < WINDOW_S:
            return
        step_x, step_y = x_m - before_x, y_m - before_y
        step_m, course = math.hypot(step_x, step_y), math.atan2(step_y, step_x)
        is_straight = self._course is None or abs(turned(course, self._course)) <= STRAIGHT_RAD
        if not slowest_mps < step_m / (at_s - before_s) <= FASTEST_MPS or not is_straight:
            self.since_s = self._course = None
        else:
            self._course = course
            if self.since_s is None:
                self.since_s, self._start = before_s, (before_x, before_y)
                self._steps, self._largest_m = 0, 0.0
            self._steps += 1
            self._largest_m = max(self._largest_m, step_m)
        self._anchor = (at_s, x_m, y_m)
        self.way_m = math.hypot(x_m - self._start[0], y_m - self._start[1]) - self._largest_m

    def is_long(self, at_s: float, zero_since_s: float, *, within_s: float, least_m: float = 0.0) -> bool:
        """Whether it has lasted long since `zero_since_s`, and still does."""
        if self.since_s is None or self._steps < LEAST_STEPS or at_s - self.newest_s > within_s:
            return False
        return at_s - max(self.since_s, zero_since_s) >= LONG_S and self.way_m >= least_m


def is_lost(pose: Mapping[str, Any]) -> bool:
    """Whether the covariance of a pose (geometry_msgs/PoseWithCovariance) marks it as unknown."""
    return _first(pose.get("covariance")) > LOST_M2


def least_way_m(covariance: Any) -> float:
    """The way between positions of this covariance that is more than the wander of their receiver."""
    variance_m2 = _first(covariance)
    return max(FIX_LEAST_M, FIX_SIGMAS * math.sqrt(variance_m2)) if variance_m2 > 0.0 else FIX_LEAST_M


def _first(covariance: Any) -> float:
    """The first element of a covariance; NaN where there is none."""
    try:
        return float(covariance[0])
    except (TypeError, KeyError, IndexError, ValueError, OverflowError):
        return math.nan
