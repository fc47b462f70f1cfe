"""Speed: by the wheels, or by the odometry."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from monitor.values import Twist
from server.judge.frame_names import is_earth_fixed
from server.judge.message_fields import finite, inner, known, number, text
from server.judge.topic import Topic, floats
from server.judge.units import FASTEST_KMH, plausible_speed

SIDEWAYS = 0.25  # of the way made: a car rolls forwards or backwards, and slips a little
MOVES_MPS = 1.0  # below it what is measured sideways may be noise


def twist(message: Any) -> Twist:
    """Speed of a geometry_msgs/Twist in the frame of the car, in the unit of the topic, which `server.judge.units`
    decides. A sideways part that no car can have means east and north: then the norm is the speed."""
    yaw_rate = number(message, "angular", "z") if isinstance(message, Mapping) and "angular" in message else math.nan
    x, y = finite(message, "linear", "x"), _sideways(message)
    way = math.hypot(x, y)
    speed = way if way > MOVES_MPS and abs(y) > SIDEWAYS * way else x
    return Twist(speed_mps=plausible_speed(speed, FASTEST_KMH), yaw_rate_radps=known(yaw_rate))


def twist_stamped(message: Any) -> Twist:
    """As `twist`; in a frame of the earth or of a GPS receiver it is east and north, and the way made is the speed."""
    if is_earth_fixed(text(message, "header", "frame_id")):
        return way_made_stamped(message)
    return twist(inner(message, "twist"))


def way_made(message: Any) -> Twist:
    """Speed of a velocity in east and north: never negative, for it does not say where the nose of the car points."""
    way = math.hypot(finite(message, "linear", "x"), finite(message, "linear", "y"))
    return Twist(speed_mps=plausible_speed(way, FASTEST_KMH), yaw_rate_radps=None)


def way_made_stamped(message: Any) -> Twist:
    """As `way_made`, of a geometry_msgs/TwistStamped."""
    return way_made(inner(message, "twist"))


def _sideways(message: Any) -> float:
    linear = message["linear"]
    y = number(message, "linear", "y") if isinstance(linear, Mapping) and "y" in linear else 0.0
    return 0.0 if math.isnan(y) else y


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
