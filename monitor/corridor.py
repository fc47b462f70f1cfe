"""The way the car is about to take, as seen by a laser on its front, and how far along it the first obstacle stands."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from monitor.scan import usable
from monitor.values import LaserScan

STRAIGHT_RAD = 0.0005  # a radius of more than five kilometres
TYRE_RAD_A_PERCENT = -0.00536  # of the CATVehicle's steering; negative percent = left, positive angle = left


@dataclass(frozen=True, slots=True, kw_only=True)
class Corridor:
    """A strip ahead of the car, bent by its steering."""

    half_width_m: float
    wheelbase_m: float
    laser_ahead_m: float  # of the rear axle
    tyre_angle_rad: float = 0.0  # positive = left


@dataclass(frozen=True, slots=True, kw_only=True)
class Sight:
    """What a scan says of a corridor."""

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
    turn = math.copysign(1.0, centre_m)
    ahead_m = x_m + corridor.laser_ahead_m
    from_centre_m = np.hypot(ahead_m, y_m - centre_m)
    rear_m = abs(centre_m)
    nose_m = math.hypot(corridor.laser_ahead_m, centre_m)
    aside_m = np.maximum(rear_m - from_centre_m, from_centre_m - nose_m) - corridor.half_width_m
    # Angle about the centre, from the nose on, in the direction of driving.
    of_point = np.arctan2(ahead_m, (centre_m - y_m) * turn)
    of_nose = math.atan2(corridor.laser_ahead_m, rear_m)
    return nose_m * (of_point - of_nose), aside_m


def look(scan: LaserScan, corridor: Corridor, reach_m: float) -> Sight:
    """What the scan shows within `reach_m` along the corridor. A beam without a return is blind, never free."""
    n = scan.beams
    if n == 0:
        return Sight(beams=0, blind=0, gap_m=None, bearing_rad=None)
    cosines, sines = _directions(n, scan.angle_min_rad, scan.angle_increment_rad)
    good = usable(scan.ranges_m, scan.range_min_m, scan.range_max_m)
    ranges = np.where(good, scan.ranges_m, np.nan).astype(np.float64)
    with np.errstate(invalid="ignore"):
        along_m, aside_m = along_and_aside(ranges * cosines, ranges * sines, corridor)
        inside = good & (aside_m <= 0) & (along_m > 0) & (ranges * cosines > 0)
    pairs = inside[:-1] & inside[1:]
    gap_m = bearing_rad = None
    if pairs.any():
        # The farther of the two: a single stray return beside a wall's is not an obstacle's distance.
        both_m = np.where(pairs, np.maximum(along_m[:-1], along_m[1:]), np.inf)
        at = int(np.argmin(both_m))
        nearer = at if along_m[at] <= along_m[at + 1] else at + 1
        gap_m, bearing_rad = float(both_m[at]), scan.angle_min_rad + nearer * scan.angle_increment_rad
    watched = _points_into(n, scan.angle_min_rad, scan.angle_increment_rad, corridor, reach_m)
    return Sight(
        beams=int(np.count_nonzero(watched)),
        blind=int(np.count_nonzero(watched & ~good)),
        gap_m=gap_m,
        bearing_rad=bearing_rad,
    )


# A laser keeps its geometry (two of them, where it is interlaced), so that this is reckoned once and not 75 times
# a second.
@lru_cache(maxsize=16)
def _directions(n: int, angle_min_rad: float, increment_rad: float) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """Cosines and sines of the beams, each shape (n,), never to be written to."""
    angles = angle_min_rad + increment_rad * np.arange(n)
    return np.cos(angles), np.sin(angles)


@lru_cache(maxsize=256)
def _points_into(
    n: int, angle_min_rad: float, increment_rad: float, corridor: Corridor, reach_m: float
) -> NDArray[np.bool_]:
    """Which beams would see something that stands at `reach_m` in the corridor; shape (n,)."""
    cosines, sines = _directions(n, angle_min_rad, increment_rad)
    _, aside_m = along_and_aside(reach_m * cosines, reach_m * sines, corridor)
    found: NDArray[np.bool_] = (aside_m <= 0) & (cosines > 0)
    return found
