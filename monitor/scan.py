"""One laser: how it is mounted on the car, and which beams of a sweep measured something."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

# At 5 m, the obstacle distance, a plane tilted by 10° passes 0.9 m above or below the laser's height: beyond that it
# misses what stands on the road, or measures the road itself.
MOST_TILT_RAD = math.radians(10.0)
REPORTED_TILT_RAD = math.radians(2.0)  # a smaller tilt is the tolerance of a bracket

Origin = Literal["transforms", "settings", "profile", "assumed"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Mounting:
    """Pose of a laser in the body frame: x ahead, y left, its origin on the rear axle (REP-103, REP-105)."""

    origin: Origin
    x_m: float | None = None  # ahead of the rear axle; None: as the setting has it
    y_m: float = 0.0
    yaw_rad: float = 0.0  # direction of the laser's own zero, counter-clockwise
    is_upside_down: bool = False  # its angles count clockwise, seen from above
    tilt_rad: float = 0.0  # of the scan's plane against the horizontal
    why_unknown: str | None = None  # the transforms contradict each other: where the laser looks is not known
    note: str | None = None  # what is to be known of it, once
    gap_from: str | None = None  # what gaps are counted from where no bumper is set: "the laser"

    @property
    def why_not(self) -> str | None:
        """Why its scans show nothing of the road ahead; None: they do."""
        if self.why_unknown is not None:
            return f"Where the laser looks is not known: {self.why_unknown}"
        if self.tilt_rad > MOST_TILT_RAD:
            return f"The laser is tilted by {math.degrees(self.tilt_rad):.0f}°"
        return None

    @property
    def reservation(self) -> str | None:
        """What limits a finding by its scans, in short; None: nothing."""
        if self.origin == "assumed":
            return "laser assumed to look ahead"
        if self.tilt_rad > REPORTED_TILT_RAD:
            return f"laser tilted by {math.degrees(self.tilt_rad):.0f}°"
        return None

    @property
    def gap_words(self) -> str | None:
        """What gaps are measured from, in short; None: from the front bumper, as expected."""
        return f"gap from {self.gap_from}: no bumper set" if self.gap_from else None

    @property
    def notes(self) -> list[str]:
        """Short notes on the mounting; where all is assumed, that alone."""
        gap = None if self.origin == "assumed" else self.gap_words
        return [note for note in (gap, self.note) if note]


def within_half_turn(bearing_rad: float) -> float:
    """The same bearing from −π to π."""
    return math.remainder(bearing_rad, math.tau)


def usable(ranges_m: NDArray[np.float32], range_min_m: float, range_max_m: float) -> NDArray[np.bool_]:
    """Which of the n beams are real measurements, as n booleans; NaN and ±Inf are not (REP-117).

    The limits are compared in the precision of the ranges: a return at exactly range_max is a measurement.
    """
    # Both comparisons are false for NaN; +Inf passes only where range_max itself is infinite, hence isfinite.
    low, high = np.float32(range_min_m), np.float32(range_max_m)
    return (ranges_m >= low) & (ranges_m <= high) & np.isfinite(ranges_m)


def nearest(ranges_m: NDArray[np.float32], range_min_m: float, range_max_m: float) -> tuple[int, float] | None:
    """Index and range [m] of the nearest usable beam, None where no beam is usable."""
    indices = np.flatnonzero(usable(ranges_m, range_min_m, range_max_m))
    if indices.size == 0:
        return None
    index = int(indices[int(np.argmin(ranges_m[indices]))])
    return index, float(ranges_m[index])
