"""A straight line through measured points, by least squares."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, slots=True, kw_only=True)
class Line:
    """`base` and what each of the counts adds to it; `residual`: how far the points are from it (root mean square)."""

    base: float
    each: tuple[float, ...]
    residual: float

    def at(self, *counts: float) -> float:
        """The line, also far beyond the points."""
        return self.base + sum(each * count for each, count in zip(self.each, counts, strict=True))


def fitted(points: Sequence[tuple[tuple[float, ...], float]]) -> Line:
    """Through points of (counts, figure). Where there are too few, the shortest of the lines that meet them."""
    counts = np.array([[1.0, *counts] for counts, _ in points])
    figures = np.array([figure for _, figure in points])
    found = np.linalg.lstsq(counts, figures, rcond=None)[0]
    off = counts @ found - figures
    base, *each = map(float, found)
    return Line(base=base, each=tuple(each), residual=float(np.sqrt(np.mean(off**2))))
