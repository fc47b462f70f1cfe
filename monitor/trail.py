"""Where the car was in the last seconds, at any moment between its positions."""

from __future__ import annotations

import math
from collections import deque
from dataclasses import dataclass

from monitor.geo import offset_m
from monitor.values import GpsFix

KEPT_S = 15.0
MOST = 512
GAP_S = 2.0  # after a longer one the car may have been anywhere
VELOCITY_S = 1.0  # over this long, so that the noise of single fixes is no speed
SIGMA_UNKNOWN_M = 5.0  # of a receiver whose covariance cannot be trusted


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """The car at one moment."""

    lat_deg: float
    lon_deg: float
    sigma_m: float  # one sigma per axis
    velocity_mps: tuple[float, float]  # over ground: east, north


class Trail:
    """The newest positions of the car, by the time they were received; bounded by time and number."""

    def __init__(self) -> None:
        self._fixes: deque[tuple[float, float, float, float]] = deque(maxlen=MOST)  # s, latitude, longitude, sigma m

    @property
    def newest_s(self) -> float:
        """When the newest position came; −Infinity without any."""
        return self._fixes[-1][0] if self._fixes else -math.inf

    def add(self, fix: GpsFix, at_s: float) -> None:
        """One position. Without a fix, and when the clock went back, what was known is no guide any more."""
        fixes = self._fixes
        if fix.status < 0 or not (math.isfinite(fix.lat_deg) and math.isfinite(fix.lon_deg)):
            fixes.clear()
            return
        if fixes and at_s < fixes[-1][0]:
            fixes.clear()
        fixes.append((at_s, fix.lat_deg, fix.lon_deg, SIGMA_UNKNOWN_M if fix.sigma_m is None else fix.sigma_m))
        while fixes[0][0] < at_s - KEPT_S:
            fixes.popleft()

    def at(self, moment_s: float) -> Place | None:
        """The car's position at that time, interpolated linearly between two positions; None: unknown."""
        found = self._between(moment_s)
        if found is None:
            return None
        lat_deg, lon_deg, sigma_m = found
        before_s = moment_s - VELOCITY_S
        before = self._between(before_s)
        if before is None and moment_s - self._fixes[0][0] >= VELOCITY_S / 2:  # the trail has just started
            before_s, *_ = self._fixes[0]
            before = self._fixes[0][1:]
        velocity_mps = (0.0, 0.0)
        if before is not None:
            east_m, north_m = offset_m(before[0], before[1], lat_deg, lon_deg)
            velocity_mps = (east_m / (moment_s - before_s), north_m / (moment_s - before_s))
        return Place(lat_deg=lat_deg, lon_deg=lon_deg, sigma_m=sigma_m, velocity_mps=velocity_mps)

    def _between(self, moment_s: float) -> tuple[float, float, float] | None:
        after: tuple[float, float, float, float] | None = None
        for fix in reversed(self._fixes):
            if fix[0] <= moment_s:
                if fix[0] == moment_s:
                    return fix[1:]
                if after is None or after[0] - fix[0] > GAP_S:
                    return None
                share = (moment_s - fix[0]) / (after[0] - fix[0])
                lon_deg = fix[2] + share * math.remainder(after[2] - fix[2], 360.0)
                return (
                    fix[1] + share * (after[1] - fix[1]),
                    math.remainder(lon_deg, 360.0),
                    max(fix[3], after[3]),
                )
            after = fix
        return None
