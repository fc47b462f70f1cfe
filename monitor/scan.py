"""Geometry of one laser sweep: which beams measured something, and which is the nearest."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray


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
