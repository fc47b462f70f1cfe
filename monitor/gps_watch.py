"""Behaviour of the receiver, from the newest positions: drift while the car stands, and speed of the position."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass
from statistics import median

from monitor.geo import Plane, offset_m
from monitor.values import GpsFix

ANCHOR_S = 2.0  # the anchor is the median of the first fixes at rest, this long
FIXES = 3  # in a row: one stray fix is not a fault
STEP_AT_LEAST_S = 0.04  # two fixes closer than that are one, reported twice
STEP_AT_MOST_S = 2.0  # after a longer gap the car may be anywhere
GAINS_MPS2, UNEVEN_MPS = 6.0, 0.5  # no car gains speed faster; so much is the noise of a good receiver
SMOOTH_AFTER_S = 5.0
DRIVES_MPS, RESTS_MPS = 3.0, 0.5  # a position that moves so, faster than receivers drift, until it rests again


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsWatch:
    """At one moment; empty tuples where there is nothing to judge."""

    drift_m: tuple[float, ...] = ()  # of the last fixes at rest, newest last: distance from the anchor
    anchored_s: float | None = None  # since when the car rests where the anchor is
    over_ground_mps: tuple[float, ...] = ()  # speed between the last fixes, newest last
    net_mps: float | None = None  # the same from the first to the last of them, because noise alternates
    sigma_m: float | None = None  # the receiver's own; None: not reported
    # For some seconds the position has gained speed no faster than a car: what moves so is hardly the receiver's error.
    is_smooth: bool = False


class GpsFollower:
    """Follows the fixes of one receiver."""

    def __init__(self) -> None:
        self._resting: list[tuple[float, GpsFix]] = []  # fixes since the car came to rest, until there is an anchor
        self._since_s: float | None = None
        self._anchor: Plane | None = None
        self._drift: deque[float] = deque(maxlen=FIXES)
        self._steps: deque[tuple[float, float, float]] = deque(maxlen=FIXES)  # east m, north m, s
        self._last: tuple[float, GpsFix] | None = None
        self._paces: deque[tuple[float, float]] = deque(maxlen=2)  # s, m/s of the steps before
        self._uneven_s: float | None = None  # when the speed grew as no car's does, or the steps began
        self._is_smooth = self._drives = False

    def receive(self, fix: GpsFix, at_s: float, stamp_s: float | None, standing_since_s: float | None) -> GpsWatch:
        """One fix. Steps are timed by the receiver's own stamps, since Wi-Fi bunches arrivals."""
        if fix.status < 0 or not (math.isfinite(fix.lat_deg) and math.isfinite(fix.lon_deg)):
            self.__init__()  # type: ignore[misc]  # without a fix the coordinates mean nothing
            return GpsWatch()
        self._step(fix, at_s if stamp_s is None else stamp_s)
        net_mps = self._net_mps()
        if net_mps is not None:
            self._drives = net_mps > RESTS_MPS if self._drives else self._is_smooth and net_mps > DRIVES_MPS
        self._rest(fix, at_s, standing_since_s)
        return GpsWatch(
            drift_m=tuple(self._drift),
            anchored_s=self._since_s if self._anchor is not None else None,
            over_ground_mps=tuple(math.hypot(east, north) / span for east, north, span in self._steps),
            net_mps=net_mps,
            sigma_m=fix.sigma_m,
            is_smooth=self._is_smooth,
        )

    def _step(self, fix: GpsFix, time_s: float) -> None:
        if self._last is not None:
            span_s = time_s - self._last[0]
            if 0.0 <= span_s < STEP_AT_LEAST_S:
                return
            if 0.0 < span_s <= STEP_AT_MOST_S:
                before = self._last[1]
                east_m, north_m = offset_m(before.lat_deg, before.lon_deg, fix.lat_deg, fix.lon_deg)
                self._steps.append((east_m, north_m, span_s))
                self._judge_step(time_s, math.hypot(east_m, north_m) / span_s)
            else:
                self._steps.clear()
                self._paces.clear()
                self._uneven_s = None
        self._last = (time_s, fix)

    def _judge_step(self, time_s: float, mps: float) -> None:
        """Against the two steps before, since a leap may fall between two fixes."""
        grew = any(mps - before > GAINS_MPS2 * (time_s - at_s) + UNEVEN_MPS for at_s, before in self._paces)
        if self._uneven_s is None or grew:
            self._uneven_s = time_s
        self._is_smooth = time_s - self._uneven_s >= SMOOTH_AFTER_S
        self._paces.append((time_s, mps))

    def _net_mps(self) -> float | None:
        if len(self._steps) < FIXES:
            return None
        east_m = sum(east for east, _, _ in self._steps)
        north_m = sum(north for _, north, _ in self._steps)
        return math.hypot(east_m, north_m) / sum(span_s for _, _, span_s in self._steps)

    def _rest(self, fix: GpsFix, at_s: float, standing_since_s: float | None) -> None:
        if standing_since_s is None or standing_since_s != self._since_s or self._drives:
            self._resting.clear()
            self._drift.clear()
            self._anchor = None
            self._since_s = standing_since_s
        if standing_since_s is None or self._drives:
            return
        if self._anchor is None:
            self._resting.append((at_s, fix))
            if at_s - self._resting[0][0] >= ANCHOR_S:
                self._anchor = Plane(
                    median(f.lat_deg for _, f in self._resting),
                    _median_lon(tuple(f.lon_deg for _, f in self._resting)),
                )
                self._resting.clear()
            return
        self._drift.append(math.hypot(*self._anchor.enu(fix.lat_deg, fix.lon_deg)))


def _median_lon(longitudes: tuple[float, ...]) -> float:
    """Median of longitudes on either side of the 180° meridian."""
    first = longitudes[0]
    return math.remainder(first + median(math.remainder(lon - first, 360.0) for lon in longitudes), 360.0)
