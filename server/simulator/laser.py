"""The car's SICK LMS291 as its ROS driver publishes it, or a denser scanner for load tests.

No return in range is +Inf and an invalid measurement NaN, as the driver does since REP 117; rosbridge makes both null
in JSON. The driver gives range_min 0 and range_max 81 in centimetre mode.
"""

from __future__ import annotations

import math

import numpy as np
import numpy.typing as npt

from server.simulator.beams import Beams
from server.simulator.scenery import Scenery
from server.simulator.vehicle import LASER_AHEAD_M, Motion

RANGE_MAX_M = 81.0
NOISE_M = 0.008
RESOLUTION_M = 0.01
INVALID_SHARE = 0.004  # of the beams: dazzled, or too little light back
CONE_RAD = 0.1  # the distance estimator looks this far to either side


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
