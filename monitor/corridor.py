"""The swept path of the car, and the distance of the first obstacle in it by a laser anywhere on the car.

Axes of the car: x ahead and y left, with the origin on the rear axle; the nose is the foremost point of the car.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from monitor.scan import usable, within_half_turn
from monitor.values import LaserScan

STRAIGHT_RAD = 0.0005  # a radius of more than five kilometres
# A return so little behind the nose is something that touches it: the nose is measured by hand, and ranges have noise.
CONTACT_M = 0.3
AHEAD_STEPS = 181  # directions ahead, of which those into the corridor are to be covered by beams


@dataclass(frozen=True, slots=True, kw_only=True)
class Corridor:
    """A strip ahead of the car, bent by its steering, and the laser that looks into it."""

    half_width_m: float
    wheelbase_m: float
    laser_ahead_m: float  # of the rear axle
    laser_left_m: float = 0.0  # of the car's centre line
    nose_ahead_m: float | None = None  # of the rear axle; None: the laser is the nose
    tyre_angle_rad: float = 0.0  # positive = left

    @property
    def nose_m(self) -> float:
        """The nose ahead of the rear axle; a laser ahead of it is itself the nose."""
        return self.laser_ahead_m if self.nose_ahead_m is None else max(self.nose_ahead_m, self.laser_ahead_m)


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """The result of a scan in a corridor."""

    beams: int  # that point into the corridor within `reach_m` of the nose
    blind: int  # of those, the ones without a usable return from beyond the nose
    gap_m: float | None  # from the nose along the corridor to the nearest thing two adjacent beams agree on; None: none
    bearing_rad: float | None  # of it, from the laser, counter-clockwise from ahead, −π to π
    covered: float = 1.0  # share of the directions into the corridor that the laser covers


def along_and_aside(
    x_m: NDArray[np.float64], y_m: NDArray[np.float64], corridor: Corridor
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Way along the path from the nose, and distance beyond the swept strip's edges, for points from the laser in the
    car's axes; all of shape (n,).

    Kinematic bicycle model: all points of the car turn about one centre abeam of the rear axle at radius
    wheelbase / tan(tyre angle) (REP-103: left positive). The strip swept reaches from the path of the rear axle to the
    path of the nose, plus the half-width on either side. Aside ≤ 0 is inside.
    """
    left_m = y_m + corridor.laser_left_m
    if abs(corridor.tyre_angle_rad) < STRAIGHT_RAD:
        return _along(x_m, y_m, corridor), np.abs(left_m) - corridor.half_width_m
    centre_m = corridor.wheelbase_m / math.tan(corridor.tyre_angle_rad)
    from_centre_m = np.hypot(x_m + corridor.laser_ahead_m, left_m - centre_m)
    rear_m = abs(centre_m)
    nose_m = math.hypot(corridor.nose_m, centre_m)
    aside_m = np.maximum(rear_m - from_centre_m, from_centre_m - nose_m) - corridor.half_width_m
    return _along(x_m, y_m, corridor), aside_m


def _along(x_m: NDArray[np.float64], y_m: NDArray[np.float64], corridor: Corridor) -> NDArray[np.float64]:
    if abs(corridor.tyre_angle_rad) < STRAIGHT_RAD:
        behind_nose_m = corridor.nose_m - corridor.laser_ahead_m
        return x_m - behind_nose_m if behind_nose_m else x_m
    centre_m = corridor.wheelbase_m / math.tan(corridor.tyre_angle_rad)
    # Angle about the centre, from the nose on, in the direction of driving.
    of_nose = math.atan2(corridor.nose_m, abs(centre_m))
    side = math.copysign(1.0, centre_m)
    of_point = np.arctan2(x_m + corridor.laser_ahead_m, (centre_m - corridor.laser_left_m - y_m) * side)
    way_m: NDArray[np.float64] = (of_point - of_nose) * math.hypot(corridor.nose_m, centre_m)
    return way_m


# Several checks call it with the same scan, and again when that is the scan before.
@lru_cache(maxsize=64)
def look(scan: LaserScan, corridor: Corridor, reach_m: float) -> Sight:
    """What the scan shows within `reach_m` along the corridor. A beam without a return is blind, never free, and so is
    one that ends on the car itself."""
    n = scan.beams
    if n == 0:
        return Sight(beams=0, blind=0, gap_m=None, bearing_rad=None, covered=0.0)
    view = _view((n, scan.angle_min_rad, scan.angle_increment_rad), corridor, reach_m)
    good = usable(scan.ranges_m, scan.range_min_m, scan.range_max_m)
    inside = _inside(np.where(good, scan.ranges_m, np.inf), view.spans)
    gap_m, bearing_rad = _nearest(scan, inside.nonzero()[0], corridor)
    seen = good[view.beams]
    if view.car_m is not None:
        seen &= scan.ranges_m[view.beams] > view.car_m
    return Sight(
        beams=view.beams.size,
        blind=view.beams.size - int(np.count_nonzero(seen)),
        gap_m=gap_m,
        bearing_rad=bearing_rad,
        covered=view.covered,
    )


Geometry = tuple[int, float, float]  # beams, first angle and increment [rad]


def _nearest(scan: LaserScan, beams: NDArray[np.intp], corridor: Corridor) -> tuple[float | None, float | None]:
    """Way and bearing to the nearest thing which two adjacent beams agree on, of the beams that end in the corridor."""
    if beams.size < 2:
        return None, None
    n, at_beam = scan.beams, beams
    if beams[0] == 0 and beams[-1] == n - 1 and is_round(n, scan.angle_increment_rad):
        beams, at_beam = np.append(beams, n), np.append(beams, 0)  # the first one again, beside the last
    cosines, sines = _directions(n, scan.angle_min_rad, scan.angle_increment_rad)
    ranges = scan.ranges_m[at_beam].astype(np.float64)
    along_m = _along(ranges * cosines[at_beam], ranges * sines[at_beam], corridor)
    contact_m = min(CONTACT_M, corridor.nose_m - corridor.laser_ahead_m)
    # The farther of the two: a single stray return beside a wall's is not an obstacle's distance.
    both_m = np.maximum(along_m[:-1], along_m[1:])
    both_m[(beams[1:] - beams[:-1] != 1) | (np.minimum(along_m[:-1], along_m[1:]) <= -contact_m)] = np.inf
    at = int(both_m.argmin())
    if both_m[at] == np.inf:
        return None, None
    nearer = int(at_beam[at if along_m[at] <= along_m[at + 1] else at + 1])
    bearing_rad = within_half_turn(scan.angle_min_rad + nearer * scan.angle_increment_rad)
    return max(0.0, float(both_m[at])), bearing_rad


def is_round(n: int, increment_rad: float) -> bool:
    """Whether a scan covers the full circle, up to one increment: its last beam is then beside its first."""
    return abs(math.tau - n * abs(increment_rad)) <= 1.01 * abs(increment_rad)


# A laser keeps its geometry (two of them, where it is interlaced, and one for each part of a sweep), so that this is
# computed once and not 75 times a second.
@lru_cache(maxsize=64)
def _directions(n: int, angle_min_rad: float, increment_rad: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosines and sines of the beams, each shape (n,), never to be written to."""
    angles = angle_min_rad + increment_rad * np.arange(n)
    return np.cos(angles), np.sin(angles)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spans:
    """Over which ranges [m] each beam runs inside the strip: up to `leaves_m`, but for its way up to the strip and
    across the turn's inner circle. Each shape (n,)."""

    leaves_m: NDArray[np.float64]
    enters_m: NDArray[np.float64] | None  # None: the laser is inside
    hole: tuple[NDArray[np.float64], NDArray[np.float64]] | None  # from … to; None: no beam crosses it


def _inside(ranges_m: NDArray[np.float32], spans: _Spans) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = ranges_m <= spans.leaves_m
    if spans.enters_m is not None:
        inside &= ranges_m >= spans.enters_m
    if spans.hole is not None:
        inside &= (ranges_m <= spans.hole[0]) | (ranges_m >= spans.hole[1])
    return inside


@dataclass(frozen=True, slots=True, kw_only=True)
class _View:
    """What the beams of a scan have to do with a corridor, whatever their ranges are."""

    spans: _Spans
    beams: NDArray[np.intp]  # indices of those that would hit an object in it
    car_m: NDArray[np.float64] | None  # up to which range each of these is over the car itself; None: none is
    covered: float


@lru_cache(maxsize=256)
def _view(geometry: Geometry, corridor: Corridor, reach_m: float) -> _View:
    beams = _points_into(*geometry, corridor, reach_m)
    behind_m = corridor.nose_m - corridor.laser_ahead_m - CONTACT_M
    return _View(
        spans=_spans(*geometry, corridor),
        beams=beams,
        car_m=behind_m / _directions(*geometry)[0][beams] if behind_m > 0 else None,
        covered=covered((geometry,), corridor, reach_m),
    )


def _spans(n: int, angle_min_rad: float, increment_rad: float, corridor: Corridor) -> _Spans:
    """As `along_and_aside`, solved for the range. A beam from the laser meets a circle about the turn's centre where
    r² + 2br + laser² = circle², b being the way of the laser from the centre along the beam."""
    cosines, sines = _directions(n, angle_min_rad, increment_rad)
    forward = cosines > 0
    left_m = corridor.laser_left_m
    if abs(corridor.tyre_angle_rad) < STRAIGHT_RAD:
        steep = np.maximum(np.abs(sines), 1e-9)  # finite: a beam without a return is outside
        # To the edge that the beam runs towards; negative where the laser is beyond it.
        leaves_m = (corridor.half_width_m - np.where(sines >= 0, left_m, -left_m)) / steep
        enters_m = None
        if abs(left_m) > corridor.half_width_m:
            enters_m = (-corridor.half_width_m - np.where(sines >= 0, left_m, -left_m)) / steep
        return _Spans(leaves_m=np.where(forward, leaves_m, -1.0), enters_m=enters_m, hole=None)
    centre_m = corridor.wheelbase_m / math.tan(corridor.tyre_angle_rad)
    laser_m = math.hypot(corridor.laser_ahead_m, left_m - centre_m)
    b_m = corridor.laser_ahead_m * cosines + (left_m - centre_m) * sines
    outer_m = math.hypot(corridor.nose_m, centre_m) + corridor.half_width_m
    inner_m = abs(centre_m) - corridor.half_width_m
    meets = b_m**2 + outer_m**2 - laser_m**2
    to_outer_m = np.sqrt(np.maximum(meets, 0.0))
    leaves_m = np.where(forward & (meets >= 0), to_outer_m - b_m, -1.0)
    enters_m = -b_m - to_outer_m if laser_m > outer_m else None
    crossing = b_m**2 - (laser_m**2 - inner_m**2)
    half_m = np.sqrt(np.maximum(crossing, 0.0))
    crosses = forward & (crossing > 0) & (half_m > b_m) & (inner_m > 0)
    hole = (np.where(crosses, -b_m - half_m, np.inf), np.where(crosses, -b_m + half_m, np.inf))
    return _Spans(leaves_m=leaves_m, enters_m=enters_m, hole=hole if crosses.any() else None)


def _points_into(
    n: int, angle_min_rad: float, increment_rad: float, corridor: Corridor, reach_m: float
) -> NDArray[np.intp]:
    """Indices of the beams that would hit an object in the corridor, `reach_m` from the nose."""
    cosines, sines = _directions(n, angle_min_rad, increment_rad)
    range_m = reach_m + corridor.nose_m - corridor.laser_ahead_m
    _, aside_m = along_and_aside(range_m * cosines, range_m * sines, corridor)
    return np.flatnonzero((aside_m <= 0) & (cosines > 0))


@lru_cache(maxsize=256)
def covered(geometries: tuple[Geometry, ...], corridor: Corridor, reach_m: float) -> float:
    """Share of the directions into the corridor that lie between the first and the last beam of one of these scans."""
    step_rad = math.pi / (AHEAD_STEPS - 1)
    ahead = -math.pi / 2 + step_rad * _points_into(AHEAD_STEPS, -math.pi / 2, step_rad, corridor, reach_m)
    if ahead.size == 0:
        return 0.0
    seen = np.zeros(ahead.size, dtype=bool)
    for n, first_rad, increment_rad in geometries:
        if n < 2:
            continue  # no two adjacent beams: a single beam is no proof
        span_rad = (n - 1) * abs(increment_rad)
        low_rad = first_rad if increment_rad > 0 else first_rad - span_rad
        margin_rad = min(abs(increment_rad) / 2, step_rad)
        seen |= np.mod(ahead - low_rad + margin_rad, math.tau) <= span_rad + 2 * margin_rad
    return float(np.count_nonzero(seen) / ahead.size)
