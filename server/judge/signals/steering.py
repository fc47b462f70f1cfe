"""How far the steering is turned."""

from __future__ import annotations

from typing import Any

from monitor.values import Steering
from server.judge.message_fields import finite
from server.judge.topic import Topic, floats
from server.judge.units import plausible_percent


def steering(message: Any) -> Steering:
    """By torque.z of a Wrench, where the CATVehicle has percent, negative = left; `server.judge.units` decides."""
    return Steering(percent=plausible_percent(finite(message, "torque", "z")))


def steering_of_float(message: Any) -> Steering:
    """As `steering`."""
    return Steering(percent=plausible_percent(finite(message, "data")))


TOPICS = (
    Topic(
        signal="steering",
        names=("/catvehicle/steering", "/vehicle/steering", "/steering"),
        types={"geometry_msgs/Wrench": steering, **floats(steering_of_float)},
    ),
)
