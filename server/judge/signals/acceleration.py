"""Acceleration along the car."""

from __future__ import annotations

from typing import Any

from monitor.values import Acceleration
from server.judge.message_fields import Rejected, finite
from server.judge.not_measured import NO_ACCELERATION
from server.judge.topic import Topic, floats

HARDEST_MPS2 = 300.0  # a crash; what is beyond is another unit, or noise


def acceleration_of_imu(message: Any) -> Acceleration:
    """Raises NotMeasured for an IMU without an accelerometer."""
    NO_ACCELERATION.demand(message)
    return Acceleration(acceleration_mps2=_plausible(finite(message, "linear_acceleration", "x")), source="topic")


def acceleration_of_float(message: Any) -> Acceleration:
    return Acceleration(acceleration_mps2=_plausible(finite(message, "data")), source="topic")


def _plausible(value: float) -> float:
    if abs(value) > HARDEST_MPS2:
        raise Rejected("an acceleration beyond the range of a car")
    return value


TOPICS = (
    Topic(
        signal="acceleration",
        names=("/catvehicle/acceleration", "/acceleration", "/catvehicle/imu", "/imu/data", "/imu"),
        types={"sensor_msgs/Imu": acceleration_of_imu, **floats(acceleration_of_float)},
    ),
)
