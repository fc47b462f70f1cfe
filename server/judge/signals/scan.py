"""Sweeps of the laser."""

from __future__ import annotations

import math
from typing import Any

from monitor.values import LaserScan
from server.judge.message_fields import Rejected, finite, number, numbers, text
from server.judge.topic import Topic

MAX_BEAMS = 65535
FARTHEST_SCAN_M = 10_000.0  # a range_max beyond is "no end", which drivers write as the largest float there is
LOOKS_AHEAD = ("/catvehicle/front_laser_points",)  # topics in lower case whose laser is at the nose by its definition
WIDEST_RAD = 4 * math.pi  # two turns: no laser sweeps more


def laser_scan(message: Any) -> LaserScan:
    """Ranges in m in the order of the beams; null becomes NaN, and ±Inf are kept where the transport kept them."""
    ranges = numbers(message, "ranges")
    if ranges.size > MAX_BEAMS:
        raise Rejected(f"more than {MAX_BEAMS} beams")
    first, last, increment = (finite(message, f"angle_{name}") for name in ("min", "max", "increment"))
    sweep = max(ranges.size - 1, 1) * abs(increment)
    if max(abs(first), abs(last), sweep) > WIDEST_RAD:
        raise Rejected("angles beyond two turns; they are radians")
    if increment == 0 and ranges.size > 1:
        raise Rejected("angle_increment is zero")
    nearest, farthest = finite(message, "range_min"), number(message, "range_max")
    if math.isnan(farthest) or farthest > FARTHEST_SCAN_M:
        farthest = math.inf  # no upper limit, which JSON cannot express
    if nearest < 0 or farthest <= nearest:
        raise Rejected("range_min and range_max contradict each other")
    return LaserScan(
        ranges_m=ranges,
        angle_min_rad=first,
        angle_max_rad=last,
        angle_increment_rad=increment,
        time_increment_s=_or_zero(number(message, "time_increment")),
        scan_time_s=_or_zero(number(message, "scan_time")),
        range_min_m=nearest,
        range_max_m=farthest,
        frame_id=text(message, "header", "frame_id"),
    )


def _or_zero(value: float) -> float:
    return value if math.isfinite(value) and value > 0 else 0.0  # 0: not given


TOPICS = (
    Topic(
        signal="scan",
        names=("/catvehicle/front_laser_points", "/scan", "/catvehicle/scan", "/front/scan", "/laser/scan"),
        types={"sensor_msgs/LaserScan": laser_scan},
        by_type=("sensor_msgs/LaserScan",),
        queue_length=1,
        compression="cbor",
    ),
)
