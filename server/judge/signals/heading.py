"""Compass heading of the car's nose."""

from __future__ import annotations

import math
from typing import Any

from monitor.values import Heading
from server.judge.message_fields import Rejected, finite, yaw
from server.judge.not_measured import NO_ORIENTATION
from server.judge.topic import Topic, floats


def heading_of_imu(message: Any) -> Heading:
    """Compass heading from an IMU whose yaw 0 is east (REP-103). Raises NotMeasured for an IMU without orientation."""
    NO_ORIENTATION.demand(message)
    yaw_rad = yaw(message)
    if yaw_rad is None:
        raise Rejected("orientation is not a rotation")
    return Heading(heading_deg=_compass(90 - math.degrees(yaw_rad)), source="topic")


def heading_of_float(message: Any) -> Heading:
    value = finite(message, "data")
    if abs(value) > 720:
        raise Rejected("a heading beyond two turns")
    return Heading(heading_deg=_compass(value), source="topic")


def _compass(degrees: float) -> float:
    return degrees % 360 % 360  # the first alone makes 360 of the smallest angle west of north


TOPICS = (
    Topic(
        signal="heading",
        names=("/catvehicle/heading", "/heading"),
        types={**floats(heading_of_float), "sensor_msgs/Imu": heading_of_imu},
    ),
)
