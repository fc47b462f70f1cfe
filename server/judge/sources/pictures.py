"""A coarse picture of a scan: what an operator recognises a laser by, and what two topics of one laser share."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from monitor.values import LaserScan

BINS = 72
SAME_M = 0.005  # a filter leaves a range as it is; another laser has noise of its own
SAME_SHARE = 0.95
COMPARED = 8  # parts at least


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """The nearest usable range [m] in each of at most BINS equal parts of the view, in the laser's own frame; None:
    nothing was measured there."""

    at_s: float
    stamp_s: float | None  # by its header
    ranges_m: tuple[float | None, ...]
    angle_min_rad: float  # of the middle of the first part
    angle_increment_rad: float


def picture_of(scan: LaserScan, stamp: float | None, at_s: float) -> Picture | None:
    """The picture of a scan; None: it has no beams."""
    beams = scan.beams
    if beams == 0:
        return None
    ranges = np.where(
        np.isfinite(scan.ranges_m) & (scan.ranges_m >= scan.range_min_m) & (scan.ranges_m <= scan.range_max_m),
        scan.ranges_m,
        np.inf,
    )
    bins = min(BINS, beams)
    starts = (np.arange(bins) * beams) // bins
    nearest = np.minimum.reduceat(ranges, starts)
    step_rad = scan.angle_increment_rad * beams / bins
    return Picture(
        at_s=at_s,
        stamp_s=stamp,
        ranges_m=tuple(round(float(found), 3) if math.isfinite(found) else None for found in nearest),
        angle_min_rad=scan.angle_min_rad + (step_rad - scan.angle_increment_rad) / 2,
        angle_increment_rad=step_rad,
    )


def see_the_same(one: Picture, other: Picture) -> bool | None:
    """Whether two pictures in one frame and of one moment are of one scan, as of a laser and of its filter; None: too
    little is seen by both, or they are of two moments."""
    if one.stamp_s is None or one.stamp_s != other.stamp_s:
        return None
    alike = compared = 0
    for number, range_m in enumerate(one.ranges_m):
        beside_m = _at(other, one.angle_min_rad + number * one.angle_increment_rad)
        if range_m is not None and beside_m is not None:
            compared += 1
            alike += abs(range_m - beside_m) <= SAME_M
    return None if compared < COMPARED else alike >= SAME_SHARE * compared


def _at(picture: Picture, angle_rad: float) -> float | None:
    if picture.angle_increment_rad == 0.0:
        return None
    number = round((angle_rad - picture.angle_min_rad) / picture.angle_increment_rad)
    return picture.ranges_m[number] if 0 <= number < len(picture.ranges_m) else None
