"""The swept path of the car in the frame of its front laser, and the distance of the first obstacle in it."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from monitor.scan import usable
from monitor.values import LaserScan

STRAIGHT_RAD = 0.0005  # a radius of more than five kilometres


@dataclass(frozen=True, slots=True, kw_only=True)
class Corridor:
    """A strip ahead of the car, bent by its steering."""

    half_width_m: float
    wheelbase_m: float
    laser_ahead_m: float  # of the rear axle
    tyre_angle_rad: float = 0.0  # positive = left


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """The result of a scan in a corridor."""

    beams: int  # that point into the corridor within `reach_m`
    blind: int  # of those, the ones without a usable return
    gap_m: float | None  # along the corridor to the nearest thing two adjacent beams agree on; None: nothing seen
    bearing_rad: float | None  # of it, laser frame, counter-clockwise


def along_and_aside(
    x_m: NDArray[np.float64], y_m: NDArray[np.float64], corridor: Corridor
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Way along the path and distance beyond the swept strip's edges, for points of the laser frame; both shape (n,).

    Kinematic bicycle model: all points of the car turn about one centre abeam of the rear axle at radius
    wheelbase / tan(tyre angle) (REP-103: left positive). The strip swept reaches from the path of the rear axle to the
    path of the nose, plus the half-width on either side. Aside ≤ 0 is inside.
    """
    if abs(corridor.tyre_angle_rad) < STRAIGHT_RAD:
        return x_m, np.abs(y_m) - corridor.half_width_m
    centre_m = corridor.wheelbase_m / math.tan(corridor.tyre_angle_rad)
    ahead_m = x_m + corridor.laser_ahead_m
    from_centre_m = np.hypot(ahead_m, y_m - centre_m)
    rear_m = abs(centre_m)
    nose_m = math.hypot(corridor.laser_ahead_m, centre_m)
    aside_m = np.maximum(rear_m - from_centre_m, from_centre_m - nose_m) - corridor.half_width_m
    return _along(x_m, y_m, corridor), aside_m


def _along(x_m: NDArray[np.float64], y_m: NDArray[np.float64], corridor: Corridor) -> NDArray[np.float64]:
    if abs(corridor.tyre_angle_rad) < STRAIGHT_RAD:
        return x_m
    centre_m = corridor.wheelbase_m / math.tan(corridor.tyre_angle_rad)
    # Angle about the centre, from the nose on, in the direction of driving.
    of_nose = math.atan2(corridor.laser_ahead_m, abs(centre_m))
    of_point = np.arctan2(x_m + corridor.laser_ahead_m, (centre_m - y_m) * math.copysign(1.0, centre_m))
    way_m: NDArray[np.float64] = (of_point - of_nose) * math.hypot(corridor.laser_ahead_m, centre_m)
    return way_m


# Asked for a scan by several checks, and again when it has become the one to compare with.
@lru_cache(maxsize=64)
def look(scan: LaserScan, corridor: Corridor, reach_m: float) -> Sight:
    """What the scan shows within `reach_m` along the corridor. A beam without a return is blind, never free."""
    n = scan.beams
    if n == 0:
        return Sight(beams=0, blind=0, gap_m=None, bearing_rad=None)
    geometry = (n, scan.angle_min_rad, scan.angle_increment_rad)
    good = usable(scan.ranges_m, scan.range_min_m, scan.range_max_m)
    inside = _inside(np.where(good, scan.ranges_m, np.inf), _spans(*geometry, corridor))
    gap_m, bearing_rad = _nearest(scan, inside.nonzero()[0], corridor)
    watched = _points_into(*geometry, corridor, reach_m)
    return Sight(
        beams=watched.size,
        blind=watched.size - int(np.count_nonzero(good[watched])),
        gap_m=gap_m,
        bearing_rad=bearing_rad,
    )


def _nearest(scan: LaserScan, beams: NDArray[np.intp], corridor: Corridor) -> tuple[float | None, float | None]:
    """Way and bearing to the nearest thing which two adjacent beams agree on, of the beams that end in the corridor."""
    if beams.size < 2:
        return None, None
    cosines, sines = _directions(scan.beams, scan.angle_min_rad, scan.angle_increment_rad)
    ranges = scan.ranges_m[beams].astype(np.float64)
    along_m = _along(ranges * cosines[beams], ranges * sines[beams], corridor)
    # The farther of the two: a single stray return beside a wall's is not an obstacle's distance.
    both_m = np.maximum(along_m[:-1], along_m[1:])
    both_m[(beams[1:] - beams[:-1] != 1) | (np.minimum(along_m[:-1], along_m[1:]) <= 0)] = np.inf
    at = int(both_m.argmin())
    if both_m[at] == np.inf:
        return None, None
    nearer = int(beams[at if along_m[at] <= along_m[at + 1] else at + 1])
    return float(both_m[at]), scan.angle_min_rad + nearer * scan.angle_increment_rad


# A laser keeps its geometry (two of them, where it is interlaced), so that this is reckoned once and not 75 times
# a second.
@lru_cache(maxsize=16)
def _directions(n: int, angle_min_rad: float, increment_rad: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosines and sines of the beams, each shape (n,), never to be written to."""
    angles = angle_min_rad + increment_rad * np.arange(n)
    return np.cos(angles), np.sin(angles)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Spans:
    """Over which ranges [m] each beam runs inside the strip: up to `leaves_m`, but for its way across the turn's inner
    circle. Each shape (n,)."""

    leaves_m: NDArray[np.float64]
    hole: tuple[NDArray[np.float64], NDArray[np.float64]] | None  # from … to; None: no beam crosses it


def _inside(ranges_m: NDArray[np.float32], spans: _Spans) -> NDArray[np.bool_]:
    inside: NDArray[np.bool_] = ranges_m <= spans.leaves_m
    if spans.hole is not None:
        inside &= (ranges_m <= spans.hole[0]) | (ranges_m >= spans.hole[1])
    return inside


@lru_cache(maxsize=256)
def _spans(n: int, angle_min_rad: float, increment_rad: float, corridor: Corridor) -> _Spans:
    """As `along_and_aside`, solved for the range: a beam from the nose meets a circle about the turn's centre where
    r² + 2br + nose² = circle², b being the way of the nose from the centre along the beam."""
    cosines, sines = _directions(n, angle_min_rad, increment_rad)
    forward = cosines > 0
    if abs(corridor.tyre_angle_rad) < STRAIGHT_RAD:
        leaves_m = corridor.half_width_m / np.maximum(np.abs(sines), 1e-9)  # finite: a beam without a return is outside
        return _Spans(leaves_m=np.where(forward, leaves_m, -1.0), hole=None)
    centre_m = corridor.wheelbase_m / math.tan(corridor.tyre_angle_rad)
    nose_m = math.hypot(corridor.laser_ahead_m, centre_m)
    b_m = corridor.laser_ahead_m * cosines - centre_m * sines
    outer_m, inner_m = nose_m + corridor.half_width_m, abs(centre_m) - corridor.half_width_m
    leaves_m = np.sqrt(b_m**2 + outer_m**2 - nose_m**2) - b_m
    crossing = b_m**2 - (nose_m**2 - inner_m**2)
    crosses = forward & (crossing > 0) & (b_m < 0) & (inner_m > 0)
    half_m = np.sqrt(np.maximum(crossing, 0.0))
    hole = (np.where(crosses, -b_m - half_m, np.inf), np.where(crosses, -b_m + half_m, np.inf))
    return _Spans(leaves_m=np.where(forward, leaves_m, -1.0), hole=hole if crosses.any() else None)


@lru_cache(maxsize=256)
def _points_into(
    n: int, angle_min_rad: float, increment_rad: float, corridor: Corridor, reach_m: float
) -> NDArray[np.intp]:
    """Indices of the beams that would hit an object at `reach_m` in the corridor."""
    cosines, sines = _directions(n, angle_min_rad, increment_rad)
    _, aside_m = along_and_aside(reach_m * cosines, reach_m * sines, corridor)
    return np.flatnonzero((aside_m <= 0) & (cosines > 0))
