"""Pose and speed by the odometry."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

from monitor.values import Odometry
from server.judge.message_fields import finite, inner, known, number, text, yaw
from server.judge.topic import Topic


def odometry(message: Any) -> Odometry:
    pose = inner(inner(message, "pose"), "pose")
    body = inner(inner(message, "twist"), "twist")
    x, y = number(body, "linear", "x"), number(body, "linear", "y")
    speed = math.hypot(x, 0.0 if math.isnan(y) else y)
    return Odometry(
        x_m=finite(pose, "position", "x"),
        y_m=finite(pose, "position", "y"),
        z_m=known(number(pose, "position", "z")),
        yaw_rad=yaw(pose),
        speed_mps=known(speed),
        frame_id=text(message, "header", "frame_id"),
    )


def pose_only(message: Any) -> Odometry:
    """As `odometry`, of a topic whose twist is never filled: its speed is not known."""
    return replace(odometry(message), speed_mps=None)


TOPICS = (
    Topic(
        signal="odometry",
        names=("/catvehicle/odom", "/gps_odom", "/utm_odom", "/odom", "/odometry"),
        types={"nav_msgs/Odometry": odometry},
        by_type=("nav_msgs/Odometry",),
    ),
)
