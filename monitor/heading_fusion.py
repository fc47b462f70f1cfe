"""Which way the car's nose points, from the best that is known: its own heading, its odometry, its course."""

from __future__ import annotations

import math

from monitor.geo import heading_of_yaw_deg, turn_deg
from monitor.values import Heading, Odometry

EARTH_FRAMES = frozenset({"map", "utm", "earth", "world", "enu", "gps"})  # x east, y north (REP-103, REP-105)
UTM_EAST_M = (100_000.0, 900_000.0)  # the range of eastings in every zone
DOUBT_DEG = 45.0  # further than this from the course, several times running, the yaw is not a heading
DOUBTS = 5
REVERSING_MPS = -0.3


class HeadingFusion:
    """Selects the heading: a published one first, then the yaw of earth-fixed odometry, then the course.

    Yaw is a heading only in a frame whose x is east: REP-105 lets `odom` start anywhere. A frame is earth-fixed by its
    name or by UTM coordinates. Two cases are rejected: drivers that send UTM with a constant orientation, and yaws that
    the course contradicts.
    """

    def __init__(self) -> None:
        self.is_published = False
        self._yaw_rad: float | None = None
        self._yaw_changes = False
        self._doubts = 0

    def on_odometry(self, odometry: Odometry) -> Heading | None:
        yaw_rad = odometry.yaw_rad
        if yaw_rad is None or not math.isfinite(yaw_rad) or not _is_earth_fixed(odometry):
            return None
        self._yaw_changes = self._yaw_changes or (self._yaw_rad is not None and yaw_rad != self._yaw_rad)
        self._yaw_rad = yaw_rad
        if self.is_published or not self._trusts_yaw:
            return None
        return Heading(heading_deg=heading_of_yaw_deg(yaw_rad), source="odometry")

    def on_course(self, course_deg: float | None, speed_mps: float | None, *, yaw_is_fresh: bool) -> Heading | None:
        """`course_deg` over ground, None while standing; `speed_mps` by the wheels, None where unknown."""
        if course_deg is None or self.is_published:
            return None
        nose_deg = (course_deg + 180.0) % 360.0 if speed_mps is not None and speed_mps < REVERSING_MPS else course_deg
        if self._yaw_rad is not None and yaw_is_fresh:
            is_off = abs(turn_deg(nose_deg, heading_of_yaw_deg(self._yaw_rad))) > DOUBT_DEG
            self._doubts = min(self._doubts + 1, 2 * DOUBTS) if is_off else max(self._doubts - 1, 0)
            if self._trusts_yaw:
                return None
        return Heading(heading_deg=nose_deg, source="track")

    @property
    def _trusts_yaw(self) -> bool:
        return self._yaw_changes and self._doubts < DOUBTS


def _is_earth_fixed(odometry: Odometry) -> bool:
    frame = odometry.frame_id.strip("/").rpartition("/")[2].lower()
    if frame in EARTH_FRAMES:
        return True
    return UTM_EAST_M[0] <= abs(odometry.x_m) <= UTM_EAST_M[1] and abs(odometry.y_m) > 10_000.0
