"""The directions in which a laser measures."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

Floats = npt.NDArray[np.float64]

SICK_HZ = 75
DENSE_HZ = 20
FEWEST_BEAMS, MOST_BEAMS = 16, 20_000


@dataclass(frozen=True, slots=True, kw_only=True)
class Beams:
    """One scan: beam i stands at angle_min + i · increment, counter-clockwise, 0 ahead [rad]."""

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
