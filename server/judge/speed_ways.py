"""Compares the way that follows from a speed with the way of a pose or of positions: is it m/s or km/h?"""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from monitor.values import GpsFix, Odometry

STRETCH_M = 20.0  # so long a way gives a verdict
STEP_M = 5.0  # between two places whose distance is counted: below, the noise of a receiver is part of it
LONGEST_STEP_M = 100.0  # further is a jump of the pose, no way
SLOWEST_MPS = 2.0
GAP_S = 1.0  # between two speeds: longer, the way between them is not known
TOLERANCE = 0.1
M_PER_DEG = 111_195.0
RATIOS = {"mps": 1.0, "kmh": 3.6}  # name of the unit → its number for 1 m/s


@dataclass(slots=True, kw_only=True)
class _Stretch:
    """Against one reference, from its newest place on."""

    place: Odometry | GpsFix
    at_s: float
    way: float  # in the unit of the speed times seconds, since the first speed
    gaps: int
    driven_m: float = 0.0
    by_speed: float = 0.0


@dataclass(slots=True)
class Ways:
    """Of one speed topic against odometry and positions. Times are on the receiver's clock."""

    shown: frozenset[str] = frozenset()  # names of units that a stretch showed; more than one: they contradict
    moved: bool = False
    _way: float = 0.0
    _gaps: int = 0
    _speed: float = 0.0
    _at_s: float = -math.inf
    _stretches: dict[str, _Stretch] = field(default_factory=dict)
    compared: set[str] = field(default_factory=set)  # references with a verdict

    def add_speed(self, speed: float, at_s: float) -> None:
        """A speed in the unit of its topic."""
        span_s = at_s - self._at_s
        size = abs(speed)
        if 0.0 <= span_s <= GAP_S:
            self._way += (size + self._speed) / 2 * span_s
        else:
            self._gaps += 1
        self._speed, self._at_s = size, at_s

    def add_place(self, signal: str, value: Odometry | GpsFix, at_s: float) -> bool:
        """A place by the odometry or the receiver; whether it shows another unit than before."""
        if isinstance(value, GpsFix) and (value.status < 0 or not math.isfinite(value.lat_deg)):
            return False
        way = self._way + self._speed * min(max(at_s - self._at_s, 0.0), GAP_S)
        before = self._stretches.get(signal)
        if before is not None and before.gaps == self._gaps:
            span_s, step_m = at_s - before.at_s, _distance_m(before.place, value)
            if 0.0 <= span_s <= STEP_M / SLOWEST_MPS and step_m < STEP_M:
                return False
            if 0.0 < span_s and SLOWEST_MPS * span_s <= step_m <= LONGEST_STEP_M and span_s <= 2 * GAP_S + 1.0:
                before.driven_m += step_m
                before.by_speed += way - before.way
                before.place, before.at_s, before.way = value, at_s, way
                return before.driven_m >= STRETCH_M and self._judge(signal, before)
        self._stretches[signal] = _Stretch(place=value, at_s=at_s, way=way, gaps=self._gaps)
        return False

    def _judge(self, signal: str, stretch: _Stretch) -> bool:
        ratio = stretch.by_speed / stretch.driven_m
        stretch.driven_m = stretch.by_speed = 0.0
        for name, expected in RATIOS.items():
            if abs(ratio / expected - 1.0) <= TOLERANCE:
                self.compared.add(signal)
                if name not in self.shown:
                    self.shown |= {name}
                    return True
        return False


def _distance_m(first: Odometry | GpsFix, second: Odometry | GpsFix) -> float:
    if isinstance(first, GpsFix) and isinstance(second, GpsFix):
        north_deg, east_deg = second.lat_deg - first.lat_deg, second.lon_deg - first.lon_deg
        return M_PER_DEG * math.hypot(north_deg, east_deg * math.cos(math.radians(first.lat_deg)))
    if isinstance(first, Odometry) and isinstance(second, Odometry):
        return math.hypot(second.x_m - first.x_m, second.y_m - first.y_m)
    return math.inf
