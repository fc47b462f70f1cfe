"""The questions to the operator in control in a canned state, and their candidates."""

from __future__ import annotations

import math
from typing import Any

Json = dict[str, Any]
FRONT, REAR = "/front/scan", "/rear/scan"


def two_lasers() -> Json:
    """The question which of two lasers looks ahead."""
    options = [
        {"value": FRONT, "label": FRONT, "why": "frame front_laser, 20 Hz, no transform to the car"},
        {"value": REAR, "label": REAR, "why": "frame rear_laser, 20 Hz, no transform to the car"},
    ]
    return {
        "signal": "scan", "kind": "source", "words": "Two lasers: which one faces forward?", "options": options,
        "options_count": 2,
    }  # fmt: skip


def brake_unit() -> Json:
    """The question in which unit the brake is published."""
    options = [
        {"value": "share", "label": "0 to 1", "why": "all values so far are between 0 and 0.42"},
        {"value": "percent", "label": "0 to 100 %", "why": ""},
    ]
    return {
        "signal": "brake", "kind": "unit", "words": "Brake: is it published as 0 to 1 or as 0 to 100 %?",
        "options": options, "options_count": 2,
    }  # fmt: skip


def laser_offers() -> list[Json]:
    """Both lasers as candidates, with a few beams of their newest scans: a person 3.2 m before the front one."""
    step = math.pi / 71
    half = {"angle_min_rad": -math.pi / 2, "angle_increment_rad": step}
    front = [3.2 if 32 <= i <= 38 else None if i > 66 else 8.5 / max(0.35, abs(math.sin(i * step))) for i in range(72)]
    rear = [9.0 + 0.4 * math.sin(i / 2) for i in range(72)]
    scan, why = "sensor_msgs/LaserScan", "readable, one publisher"
    return [
        {"topic": FRONT, "type": scan, "frame": "front_laser", "why": why, "ranges_m": front} | half,
        {"topic": REAR, "type": scan, "frame": "rear_laser", "why": why, "ranges_m": rear} | half,
        {"topic": "/depth/scan", "type": scan, "frame": None, "why": "no publisher"},
    ]


NOT_CHOSEN: Json = {
    "value": None, "age_s": None, "delay_s": None, "freshness": "not_published", "topic": None, "type": None,
    "why": None, "rate_hz": None, "note": "not chosen",
}  # fmt: skip
