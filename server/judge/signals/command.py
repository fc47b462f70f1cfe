"""The command of a controller."""

from __future__ import annotations

from typing import Any

from monitor.values import MotionCommand
from server.judge.message_fields import inner, known, number
from server.judge.topic import Topic
from server.judge.units import plausible_speed


def command(message: Any) -> MotionCommand:
    """The command of a controller. The real car's angular.z is NaN in every message: unknown, not invalid."""
    speed = known(number(message, "linear", "x"))
    return MotionCommand(
        speed_mps=None if speed is None else plausible_speed(speed),
        tyre_angle_rad=known(number(message, "angular", "z")),
    )


def command_stamped(message: Any) -> MotionCommand:
    return command(inner(message, "twist"))


TOPICS = (
    Topic(
        signal="command",
        queue_length=10,
        names=("/catvehicle/cmd_vel", "/cmd_vel"),
        types={"geometry_msgs/Twist": command, "geometry_msgs/TwistStamped": command_stamped},
    ),
)
