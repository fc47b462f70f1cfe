"""The car's laser: its beams, the scenery around the lap, and what it measures of it.

It is a SICK LMS291 as its ROS driver publishes it, or a denser scanner for load tests. No return in range is +Inf and
an invalid measurement NaN, as the driver does since REP 117; rosbridge makes both null in JSON. The driver gives
range_min 0 and range_max 81 in centimetre mode.

The scenery is walls, a building, parked cars and people, all as upright flat faces. The corridor ahead of the car
always ends at something nearer than the laser reaches, as on a walled proving ground: an empty corridor and a blind
laser look the same to a health check. To the side the view is open in places.
"""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
import numpy.typing as npt

from server.simulator.vehicle import LASER_AHEAD_M, Motion

Floats = npt.NDArray[np.float64]

SICK_HZ = 75
DENSE_HZ = 20
FEWEST_BEAMS, MOST_BEAMS = 16, 20_000
Point = tuple[float, float]

WALL_RADIUS_M = 125.0  # 25 m beyond the sweep: the sight along the tangent is then 75 m
NEAR_M = 90.0  # farther faces cannot be seen: the laser reaches 81 m, and the car drives on between two selections

RANGE_MAX_M = 81.0
NOISE_M = 0.008
RESOLUTION_M = 0.01
INVALID_SHARE = 0.004  # of the beams: dazzled, or too little light back
CONE_RAD = 0.1  # the distance estimator covers this angle to either side


@dataclass(frozen=True, slots=True, kw_only=True)
class Beams:
    """One scan: beam i is at angle_min + i · increment, counter-clockwise, 0 ahead [rad]."""

    angle_min_rad: float
    angle_max_rad: float
    increment_rad: float
    scan_time_s: float
    time_increment_s: float
    angles_rad: Floats
    directions: Floats  # cosines (row 0) and sines (row 1) of the angles


def fan(first_rad: float, increment_rad: float, count: int, scan_time_s: float, time_increment_s: float) -> Beams:
    """`count` beams from the first one on, evenly spaced; the increment must be positive."""
    angles: Floats = first_rad + increment_rad * np.arange(count, dtype=np.float64)
    return Beams(
        angle_min_rad=first_rad,
        angle_max_rad=float(angles[-1]),
        increment_rad=increment_rad,
        scan_time_s=scan_time_s,
        time_increment_s=time_increment_s,
        angles_rad=angles,
        directions=np.array((np.cos(angles), np.sin(angles))),
    )


def _sick(first_deg: float, count: int) -> Beams:
    # a turn of the mirror takes 1/75 s and gives every whole degree, the next turn the half degrees between
    degree = math.radians(1)
    return fan(math.radians(first_deg), degree, count, 1 / SICK_HZ, degree / (2 * math.pi) / SICK_HZ)


INTERLACED = (_sick(-90.0, 181), _sick(-89.5, 180))  # the SICK LMS291's two kinds of scan, in turn


def dense(count: int) -> Beams:
    """`count` beams round the whole circle, 20 times a second. Raises ValueError for too few or too many."""
    if not FEWEST_BEAMS <= count <= MOST_BEAMS:
        raise ValueError(f"A scan has {FEWEST_BEAMS} to {MOST_BEAMS} beams, not {count}.")
    return fan(-math.pi, 2 * math.pi / count, count, 1 / DENSE_HZ, 1 / DENSE_HZ / count)


def _chain(points: Iterable[Point]) -> list[tuple[Point, Point]]:
    return list(pairwise(points))


def _arc(radius_m: float, from_deg: float, to_deg: float, *, step_deg: float) -> list[tuple[Point, Point]]:
    angles = np.radians(np.linspace(from_deg, to_deg, 1 + round((to_deg - from_deg) / step_deg)))
    return _chain([(radius_m * math.cos(angle), radius_m * math.sin(angle)) for angle in angles.tolist()])


def box(x_m: float, y_m: float, yaw_rad: float, length_m: float, width_m: float) -> list[tuple[Point, Point]]:
    """The four faces of an upright box about its middle."""
    along = (math.cos(yaw_rad) * length_m / 2, math.sin(yaw_rad) * length_m / 2)
    across = (-math.sin(yaw_rad) * width_m / 2, math.cos(yaw_rad) * width_m / 2)
    corners = [
        (x_m + a * along[0] + b * across[0], y_m + a * along[1] + b * across[1])
        for a, b in ((1, 1), (-1, 1), (-1, -1), (1, -1), (1, 1))
    ]
    return _chain(corners)


def _parked_car(radius_m: float, angle_deg: float) -> list[tuple[Point, Point]]:
    """Parked along the sweep."""
    angle = math.radians(angle_deg)
    return box(radius_m * math.cos(angle), radius_m * math.sin(angle), angle + math.pi / 2, 4.6, 1.8)


def _faces() -> list[tuple[Point, Point]]:
    return [
        *_arc(WALL_RADIUS_M, 0, 360, step_deg=10),
        *_arc(112.5, 36, 68, step_deg=8),  # ends the view out of the notch's middle bend
        *box(24, 0, 0, 28, 96),  # the building which the notch faces
        *_chain([(38, 62), (64, 62)]),
        *_chain([(66, 0), (125, 0)]),  # between the notch's two straights
        *_parked_car(91, 95),
        *_parked_car(91.5, 100),
        *_parked_car(90, 150),
        *_parked_car(91, 210),
        *_parked_car(91, 214),
        *_parked_car(92, 268),
        *box(59, -20, 0.4, 0.5, 0.4),  # a marshal left of the stop line
        *box(59.8, -20.9, 1.1, 0.5, 0.4),  # and someone beside
    ]


class Scenery:
    """The faces near the car, and the distance to the first of them along any number of beams."""

    def __init__(self) -> None:
        faces = np.array(_faces())  # (n, 2 ends, 2 coordinates)
        self._all: Floats = faces
        middle = faces.mean(axis=1)
        self._middle: Floats = middle
        self._reach: Floats = np.hypot(*(faces[:, 1] - faces[:, 0]).T) / 2
        self._chosen_at: Point | None = None
        self._near: Floats = faces
        self._extra: Floats | None = None

    @property
    def faces(self) -> Floats:
        """Every face there is: (faces, 2 ends, 2 coordinates) in the lap's metres."""
        return self._all if self._extra is None else np.concatenate((self._all, self._extra))

    def put(self, faces: list[tuple[Point, Point]] | None) -> None:
        """Places one thing that was not there before, or takes it away again with None."""
        self._extra = np.array(faces) if faces else None
        self._chosen_at = None

    def distances_m(self, x_m: float, y_m: float, yaw_rad: float, beams: Beams, farthest_m: float) -> Floats:
        """Distance from a point along each beam to the first face, +Inf where none is nearer than `farthest_m`.

        Of each face only the beams between its two ends are reckoned, so that the work hardly grows with the number of
        beams. A ray along d meets the line through a and b (seen from the point) at the distance a×b / d×(b−a).
        """
        self._choose(x_m, y_m)
        count = beams.directions.shape[1]
        nearest = np.full(count, np.inf)
        cosine, sine = math.cos(yaw_rad), math.sin(yaw_rad)
        x, y = self._near[:, :, 0] - x_m, self._near[:, :, 1] - y_m
        ahead, left = x * cosine + y * sine, y * cosine - x * sine  # (faces, 2 ends) in the laser's frame
        face, beam = _pairs(np.arctan2(left, ahead), beams)
        area = ahead[:, 0] * left[:, 1] - left[:, 0] * ahead[:, 1]
        side = beams.directions[0][beam] * (left[:, 1] - left[:, 0])[face]
        side -= beams.directions[1][beam] * (ahead[:, 1] - ahead[:, 0])[face]
        is_edge_on = np.abs(side) < 1e-9  # such a face cannot be hit, and 0/0 is no distance
        distance = np.where(is_edge_on, np.inf, area[face] / np.where(is_edge_on, 1.0, side))
        np.minimum.at(nearest, beam, distance)
        nearest[nearest > farthest_m] = np.inf
        return nearest

    def _choose(self, x_m: float, y_m: float) -> None:
        """Drops the faces out of sight; done again only after some metres of way, for speed."""
        if self._chosen_at is not None and math.dist(self._chosen_at, (x_m, y_m)) < 4.0:
            return
        away = np.hypot(self._middle[:, 0] - x_m, self._middle[:, 1] - y_m) - self._reach
        near = self._all[away < NEAR_M]
        self._near = near if self._extra is None else np.concatenate((near, self._extra))
        self._chosen_at = (x_m, y_m)


def _pairs(ends_rad: Floats, beams: Beams) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.intp]]:
    """Which face may be met by which beam, as two index lists; `ends_rad` are the bearings of each face's two ends."""
    turn = 2 * math.pi
    span = (
        np.remainder(ends_rad[:, 1] - ends_rad[:, 0] + math.pi, turn) - math.pi
    )  # a face fills less than half the view
    begin = np.where(span >= 0, ends_rad[:, 0], ends_rad[:, 1]) - beams.angle_min_rad
    first = np.ceil(begin / beams.increment_rad).astype(np.intp)
    last = np.floor((begin + np.abs(span)) / beams.increment_rad).astype(np.intp)
    counts = np.maximum(0, last - first + 1)
    face = np.repeat(np.arange(len(counts)), counts)
    beam = np.arange(len(face)) - np.repeat(np.cumsum(counts) - counts - first, counts)
    beam %= round(turn / beams.increment_rad)
    in_fan = beam < len(beams.angles_rad)
    return face[in_fan], beam[in_fan]


class Laser:
    """Measures the scenery from the car, 2.5 m ahead of base_link."""

    def __init__(self, scenery: Scenery, rng: np.random.Generator) -> None:
        self._scenery = scenery
        self._rng = rng

    def ranges_m(self, motion: Motion, beams: Beams) -> npt.NDArray[np.float32]:
        """One scan in the order of the beams: metres in steps of 1 cm, +Inf for nothing in range, NaN for invalid."""
        ranges = self._scenery.distances_m(
            motion.x_m + LASER_AHEAD_M * math.cos(motion.yaw_rad),
            motion.y_m + LASER_AHEAD_M * math.sin(motion.yaw_rad),
            motion.yaw_rad,
            beams,
            RANGE_MAX_M - 0.1,
        )
        ranges += NOISE_M * self._rng.standard_normal(len(ranges))
        np.maximum(ranges, 0.0, out=ranges)
        ranges = np.round(ranges / RESOLUTION_M) * RESOLUTION_M
        ranges[self._rng.random(len(ranges)) < INVALID_SHARE] = np.nan
        return ranges.astype(np.float32)


def nearest(ranges: npt.NDArray[np.float32], beams: Beams) -> tuple[float, float]:
    """Distance [m] and bearing [rad, counter-clockwise] of the nearest return within ±0.1 rad, as the car's distance
    estimator publishes them: where there is none, range_max and angle_min."""
    ahead = np.flatnonzero(np.abs(beams.angles_rad) <= CONE_RAD)
    seen = ahead[ranges[ahead] <= RANGE_MAX_M]  # NaN and +Inf both fall out here
    if not len(seen):
        return RANGE_MAX_M, beams.angle_min_rad
    first = seen[np.argmin(ranges[seen])]
    return float(ranges[first]), float(np.float32(beams.angles_rad[first]))
