"""The closed lap of the simulated car, and its place on Earth: in WGS84 and in UTM zone 12N.

The lap is a long fast sweep and a notch with three bends and a stop. Local metres, x east, y north, origin at the
centre of the sweep; driven counter-clockwise; stations are metres of way from the beginning of the sweep, in base_link
(the middle of the rear axle).
"""

from __future__ import annotations

import bisect
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt

LAT_DEG = 32.23  # Tucson, Arizona: the centre of the lap
LON_DEG = -110.95
ALT_M = 748.0  # above the ellipsoid

_A_M = 6378137.0  # WGS84: semi-major axis, flattening
_F = 1 / 298.257223563
_E2 = _F * (2 - _F)
_N = _F / (2 - _F)

# UTM (NGA.SIG.0012): scale on the central meridian, false easting, central meridian of zone 12
_K0 = 0.9996
_FALSE_EASTING_M = 500_000.0
_MERIDIAN_DEG = -111.0

# Krüger's series, third order in n (Karney 2011, equations 12 and 14): below 1 µm within the zone's 3°
_RECTIFYING_M = _A_M / (1 + _N) * (1 + _N**2 / 4)
_ALPHA = (
    _N / 2 - 2 * _N**2 / 3 + 5 * _N**3 / 16,
    13 * _N**2 / 48 - 3 * _N**3 / 5,
    61 * _N**3 / 240,
)

Floats = npt.NDArray[np.float64]

SWEEP_RADIUS_M = 100.0
BEND_RADIUS_M = 12.0
GAP_RAD = math.radians(60)  # of the sweep, taken by the notch
SIDE_RAD = math.radians(75)  # first and last bend of the notch; the one between them turns back by 90°
STEP_M = 0.5  # between two points of the table

# By symmetry the notch closes the gap when the way along its chord fits: chord = 2 R sin(gap/2), and each straight
# stands at 45° to it.
_CHORD_M = 2 * SWEEP_RADIUS_M * math.sin(GAP_RAD / 2)
_ARCS_M = BEND_RADIUS_M * (2 * (math.sin(math.pi / 4) + math.sin(GAP_RAD / 2)) + math.sqrt(2))
STRAIGHT_M = (_CHORD_M - _ARCS_M) / math.sqrt(2)

SWEEP_M = SWEEP_RADIUS_M * (2 * math.pi - GAP_RAD)
STOP_M = SWEEP_M + BEND_RADIUS_M * SIDE_RAD + 0.8 * STRAIGHT_M  # the stop line, before the middle bend

# (length in m, curvature in 1/m, left positive)
_PIECES = (
    (SWEEP_M, 1 / SWEEP_RADIUS_M),
    (BEND_RADIUS_M * SIDE_RAD, 1 / BEND_RADIUS_M),
    (STRAIGHT_M, 0.0),
    (BEND_RADIUS_M * math.pi / 2, -1 / BEND_RADIUS_M),
    (STRAIGHT_M, 0.0),
    (BEND_RADIUS_M * SIDE_RAD, 1 / BEND_RADIUS_M),
)
LENGTH_M = sum(length for length, _ in _PIECES)

_START_YAW = GAP_RAD / 2 + math.pi / 2  # the notch is in the east: the sweep begins 30° north of it, heading north-west


def metres_per_degree(lat_deg: float) -> tuple[float, float]:
    """Metres to a degree of longitude and of latitude on the WGS84 ellipsoid, from its two radii of curvature there."""
    sine = math.sin(math.radians(lat_deg))
    bend = 1 - _E2 * sine * sine
    east_m = _A_M / math.sqrt(bend) * math.cos(math.radians(lat_deg))
    north_m = _A_M * (1 - _E2) / bend**1.5
    return math.radians(east_m), math.radians(north_m)


_EAST_M, _NORTH_M = metres_per_degree(LAT_DEG)


def lat_lon_deg(east_m: float, north_m: float) -> tuple[float, float]:
    """Latitude and longitude of a point of the lap, given in metres east and north of its centre.

    A plane laid on the ellipsoid: within 150 m of the centre the error stays below 5 mm.
    """
    return LAT_DEG + north_m / _NORTH_M, LON_DEG + east_m / _EAST_M


def utm12_m(lat_deg: float, lon_deg: float) -> tuple[float, float]:
    """Easting and northing in UTM zone 12N, in metres, of a point of the northern hemisphere near that zone."""
    lat, lon = math.radians(lat_deg), math.radians(lon_deg - _MERIDIAN_DEG)
    e = math.sqrt(_E2)
    tau = math.tan(lat)
    sigma = math.sinh(e * math.atanh(e * tau / math.hypot(1, tau)))
    conformal = tau * math.hypot(1, sigma) - sigma * math.hypot(1, tau)
    xi = math.atan2(conformal, math.cos(lon))
    eta = math.asinh(math.sin(lon) / math.hypot(conformal, math.cos(lon)))
    x, y = eta, xi
    for order, alpha in enumerate(_ALPHA, start=1):
        x += alpha * math.cos(2 * order * xi) * math.sinh(2 * order * eta)
        y += alpha * math.sin(2 * order * xi) * math.cosh(2 * order * eta)
    return _FALSE_EASTING_M + _K0 * _RECTIFYING_M * x, _K0 * _RECTIFYING_M * y


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """A point of the way. x and y in m, yaw in rad counter-clockwise from east, curvature in 1/m, left positive."""

    x_m: float
    y_m: float
    yaw_rad: float
    curvature: float


class Lap:
    """The way as exact arcs and straights, with a table for finding the nearest station."""

    def __init__(self) -> None:
        start = Pose(
            x_m=SWEEP_RADIUS_M * math.cos(GAP_RAD / 2),
            y_m=SWEEP_RADIUS_M * math.sin(GAP_RAD / 2),
            yaw_rad=_START_YAW,
            curvature=_PIECES[0][1],
        )
        self._begins_m: list[float] = []
        self._begin_poses: list[Pose] = []
        way_m = 0.0
        for length, curvature in _PIECES:
            start = Pose(x_m=start.x_m, y_m=start.y_m, yaw_rad=start.yaw_rad, curvature=curvature)
            self._begins_m.append(way_m)
            self._begin_poses.append(start)
            start = _along(start, length)
            way_m += length
        self.stations_m: Floats = np.arange(0, LENGTH_M, STEP_M)
        poses = [self.at(float(station)) for station in self.stations_m]
        self._x: Floats = np.array([pose.x_m for pose in poses])
        self._y: Floats = np.array([pose.y_m for pose in poses])

    def at(self, station_m: float) -> Pose:
        """The pose at a station; stations beyond the lap's length go on with the next lap."""
        station_m %= LENGTH_M
        piece = bisect.bisect_right(self._begins_m, station_m) - 1
        return _along(self._begin_poses[piece], station_m - self._begins_m[piece])

    def nearest_m(self, x_m: float, y_m: float, *, near_m: float | None = None) -> float:
        """The station nearest to a point. With `near_m` only 10 m around it are searched, so that the notch's two
        straights are not confused."""
        count = len(self.stations_m)
        if near_m is None:
            index = int(np.argmin((self._x - x_m) ** 2 + (self._y - y_m) ** 2))
        else:
            middle = round(near_m / STEP_M)
            window = np.arange(middle - 20, middle + 21) % count
            near = (self._x[window] - x_m) ** 2 + (self._y[window] - y_m) ** 2
            index = int(window[int(np.argmin(near))])
        station_m = float(self.stations_m[index])
        pose = self.at(station_m)
        ahead_m = (x_m - pose.x_m) * math.cos(pose.yaw_rad) + (y_m - pose.y_m) * math.sin(pose.yaw_rad)
        return (station_m + max(-STEP_M, min(STEP_M, ahead_m))) % LENGTH_M


@lru_cache(maxsize=1)
def lap() -> Lap:
    """The one lap; it never changes."""
    return Lap()


def _along(pose: Pose, way_m: float) -> Pose:
    """The pose after `way_m` on an arc of the pose's own curvature."""
    turn = way_m * pose.curvature
    yaw = pose.yaw_rad + turn
    if pose.curvature == 0:
        x_m = pose.x_m + way_m * math.cos(pose.yaw_rad)
        y_m = pose.y_m + way_m * math.sin(pose.yaw_rad)
    else:
        x_m = pose.x_m + (math.sin(yaw) - math.sin(pose.yaw_rad)) / pose.curvature
        y_m = pose.y_m - (math.cos(yaw) - math.cos(pose.yaw_rad)) / pose.curvature
    return Pose(x_m=x_m, y_m=y_m, yaw_rad=yaw, curvature=pose.curvature)
