"""Speed: by the wheels, or by the odometry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from monitor.values import Twist
from server.judge.message_fields import finite, inner, known, number
from server.judge.plausible import FASTEST_KMH, plausible_speed
from server.judge.topic import Topic, floats

SIDEWAYS = 0.25  # of the way made: a car rolls forwards or backwards, and slips a little


def twist(message: Any) -> Twist:
    """A speed in the unit of the topic, which `server.judge.units` decides."""
    yaw_rate = number(message, "angular", "z") if isinstance(message, Mapping) and "angular" in message else math.nan
    speed = plausible_speed(finite(message, "linear", "x"), FASTEST_KMH)
    return Twist(speed_mps=speed, yaw_rate_radps=known(yaw_rate))


def twist_stamped(message: Any) -> Twist:
    return twist(inner(message, "twist"))


def twist_of_odometry(message: Any) -> Twist:
    """Speed of a nav_msgs/Odometry; its twist is in the body frame by definition, and in east and north as the
    CATVehicle's drivers and Gazebo fill it. The way made is the same in both; backwards is what points back and hardly
    aside."""
    body = inner(inner(message, "twist"), "twist")
    x, y = finite(body, "linear", "x"), number(body, "linear", "y")
    y = 0.0 if math.isnan(y) else y
    speed = math.hypot(x, y)
    yaw_rate = number(body, "angular", "z") if "angular" in body else math.nan
    return Twist(
        speed_mps=plausible_speed(-speed if x < 0 and abs(y) <= SIDEWAYS * speed else speed),
        yaw_rate_radps=known(yaw_rate),
    )


def speed_of_float(message: Any) -> Twist:
    """As `twist`."""
    return Twist(speed_mps=plausible_speed(finite(message, "data"), FASTEST_KMH), yaw_rate_radps=None)


TOPICS = (
    Topic(
        signal="speed",
        names=("/catvehicle/vel", "/vel", "/vehicle/twist", "/twist", "/vehicle/speed", "/speed"),
        types={
            "geometry_msgs/Twist": twist,
            "geometry_msgs/TwistStamped": twist_stamped,
            "nav_msgs/Odometry": twist_of_odometry,
            **floats(speed_of_float),
        },
        by_type=("nav_msgs/Odometry",),
    ),
)
