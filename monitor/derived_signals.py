"""Derived signals: acceleration by the wheels, heading, track, standstill, GPS drift; and what is compared."""

from __future__ import annotations

import math
from typing import Any

from monitor.compared import Comparisons
from monitor.geo import heading_of_yaw_deg, turn_deg
from monitor.gps_watch import GpsFollower, GpsWatch
from monitor.motion import Slope, Standstill
from monitor.reading import Reading, ReadingTable
from monitor.signal_stats import SignalStats
from monitor.tracks import Track
from monitor.values import Acceleration, GpsFix, Heading, Odometry, Twist, Value

EARTH_FRAMES = frozenset({"map", "utm", "earth", "world", "enu", "gps"})  # x east, y north (REP-103, REP-105)
UTM_EAST_M = (100_000.0, 900_000.0)  # the range of eastings in every zone
DOUBT_DEG = 45.0  # further than this from the course, several times running, the yaw is not a heading
DOUBTS = 5
REVERSING_MPS = -0.3

SOURCES = frozenset({Twist, GpsFix, Odometry, Heading})  # the values from which something else is derived


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


class DerivedSignals:
    """Follows the readings of one vehicle. A derived signal never replaces one that the car publishes."""

    def __init__(self, table: ReadingTable) -> None:
        """`table`: the newest readings of all signals, the one passed to `receive` included."""
        self._table = table
        self._slope = Slope()
        self._headings = HeadingFusion()
        self._gps_follower = GpsFollower()
        self.slope_mps2: float | None = None  # how the wheels' speed changes
        self.standstill = Standstill()
        self.track = Track()
        self.gps = GpsWatch()
        self.comparisons = Comparisons()

    def receive(self, signal: str, reading: Reading[Any]) -> tuple[str, Reading[Any]] | None:
        """Follow a reading of `signal`, a value of a type in `SOURCES`.

        The name of the signal that is derived from it, and its reading, which is as old; None: nothing is.
        """
        value = reading.value
        self.comparisons.receive(signal, reading)
        name, derived = "heading", None
        match value:
            case Twist():
                name, derived = "acceleration", self._acceleration(reading)
            case GpsFix():
                derived = self._heading_on_course(reading)
            case Odometry():
                derived = self._headings.on_odometry(value)
            case Heading():
                self._headings.is_published = True
        if derived is None:
            return None
        return name, Reading(
            value=derived,
            received_s=reading.received_s,
            stamp_s=reading.stamp_s,
            horizon_s=reading.horizon_s,
            period_s=reading.period_s,
            delay_s=reading.delay_s,
            derived_from=signal,
        )

    def not_measured(self, signal: str, at_s: float) -> None:
        """A message declares that `signal` is not measured: a reading that is not fresh is dropped, and a derived one
        may come. A fresh one stays, because another sensor on the same topic may measure it."""
        known = self._table.newest.get(signal)
        if known is not None and known.derived_from is None:
            if known.is_fresh(at_s):
                return
            self._table.drop(signal)
        if signal == "heading":
            self._headings.is_published = False

    def forget_speed(self) -> None:
        """The speeds so far are void: nothing is derived from them any more."""
        known = self._table.newest.get("acceleration")
        if known is not None and known.derived_from is not None:
            self._table.drop("acceleration")
        self._slope, self.slope_mps2 = Slope(), None
        self.standstill = Standstill()
        self.comparisons.forget("speed")

    def _heading_on_course(self, reading: Reading[GpsFix]) -> Value | None:
        fix, at_s, table = reading.value, reading.received_s, self._table
        speed_mps = table.newest["speed"].value.speed_mps if table.is_fresh("speed", at_s) else None
        is_standing = None if speed_mps is None else self.standstill.is_standing
        self.track.receive(fix, at_s, speed_mps, is_standing)
        standing_since_s = None if speed_mps is None else self.standstill.since_s
        self.gps = self._gps_follower.receive(fix, at_s, reading.stamp_s, standing_since_s)
        return self._headings.on_course(self.track.course_deg, speed_mps, yaw_is_fresh=table.is_fresh("odometry", at_s))

    def _acceleration(self, reading: Reading[Twist]) -> Value | None:
        speed_mps = reading.value.speed_mps
        self.standstill.add(reading.received_s, speed_mps)
        # The car's own stamps are free of the jitter of the way here, where there are any.
        at_s = reading.received_s if reading.stamp_s is None else reading.stamp_s
        slope_mps2 = self.slope_mps2 = self._slope.add(at_s, speed_mps)
        if slope_mps2 is None:
            return None
        known = self._table.newest.get("acceleration")
        if known is not None and known.derived_from is None:
            return None
        return Acceleration(acceleration_mps2=slope_mps2, source="speed")


def forget(signal: str, stats: SignalStats, table: ReadingTable, derived: DerivedSignals) -> None:
    """Forget what was received of a signal, and what was derived from it."""
    stats.lowest, stats.highest = math.inf, -math.inf
    table.forget(signal)
    if signal == "speed":
        derived.forget_speed()
