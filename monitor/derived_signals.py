"""Derived signals: acceleration by the wheels, heading, track, standstill, GPS drift; and what is compared."""

from __future__ import annotations

import math
from typing import Any

from monitor.compared import Comparisons
from monitor.gps_watch import GpsFollower, GpsWatch
from monitor.heading_fusion import HeadingFusion
from monitor.motion import Slope, Standstill
from monitor.reading import Reading
from monitor.reading_table import ReadingTable
from monitor.signal_stats import SignalStats
from monitor.tracks import Track
from monitor.values import Acceleration, GpsFix, Heading, Odometry, Twist, Value

SOURCES = frozenset({Twist, GpsFix, Odometry, Heading})  # the values from which something else is derived


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
        """A message declares that `signal` is not measured: a reading that is not fresh goes, and a derived one may
        come. A fresh one stays, because another sensor on the same topic may measure it."""
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
