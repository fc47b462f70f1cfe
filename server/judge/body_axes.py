"""Imu and Odometry in the axes of the car: a sensor mounted backwards measures driving forward as driving back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from server.judge.frames import Frames
from server.judge.message_fields import has_fields
from server.judge.transforms import MAX_NAME, Rotation, inverse, product, rotated

IMU, ODOMETRY = "sensor_msgs/Imu", "nav_msgs/Odometry"
TYPES = frozenset({IMU, ODOMETRY, "sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry"})  # in both spellings
NEGLIGIBLE = 1e-6  # of a unit vector: an axis that plays no part may be NaN


def in_body_axes(frames: Frames, topic: str, kind: str | None, message: Any) -> tuple[Any, str | None]:
    """The message as a sensor with the body's axes would send it, and why that cannot be known.

    An Imu is in its header's frame (REP-145); the twist of an Odometry is in `child_frame_id`, whose pose it states. A
    frame that no transform names is taken for the body, as drivers without transforms mean it.
    """
    if kind not in TYPES or not has_fields(message):
        return message, None
    is_imu = kind.endswith("Imu")
    header = message.get("header") if is_imu else None
    named = header.get("frame_id") if has_fields(header) else message.get("child_frame_id")
    turn = frames.turn(topic, named) if isinstance(named, str) and len(named) <= MAX_NAME else None
    if turn is None or isinstance(turn, str):
        return message, turn
    return (_imu(message, turn) if is_imu else _odometry(message, turn)), None


def _imu(message: Mapping[str, Any], turn: Rotation) -> dict[str, Any]:
    vectors = ("linear_acceleration", "angular_velocity")
    found = {name: _vector(message.get(name), turn) for name in vectors if name in message}
    return {**message, **found, "orientation": _orientation(message.get("orientation"), turn)}


def _odometry(message: Mapping[str, Any], turn: Rotation) -> dict[str, Any]:
    found = dict(message)
    pose, twist = message.get("pose"), message.get("twist")
    if isinstance(pose, Mapping) and isinstance(inner := pose.get("pose"), Mapping):
        turned = {**inner, "orientation": _orientation(inner.get("orientation"), turn)}
        found["pose"] = {**pose, "pose": turned}
    if isinstance(twist, Mapping) and isinstance(inner := twist.get("twist"), Mapping):
        found["twist"] = {**twist, "twist": {name: _vector(vector, turn) for name, vector in inner.items()}}
    return found


def _vector(vector: Any, turn: Rotation) -> Any:
    """A vector of the sensor in the axes of the body; what is none stays as it is, to be refused by the decoder."""
    if not isinstance(vector, Mapping):
        return vector
    parts = [_number(vector.get(axis)) for axis in "xyz"]
    axes = [rotated(turn, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0))]
    return {
        name: sum(axis[at] * part for axis, part in zip(axes, parts, strict=True) if abs(axis[at]) > NEGLIGIBLE)
        for at, name in enumerate("xyz")
    }


def _orientation(orientation: Any, turn: Rotation) -> Any:
    """The body's orientation in the world, from that of the sensor."""
    if not isinstance(orientation, Mapping):
        return orientation
    x, y, z, w = (_number(orientation.get(axis)) for axis in "xyzw")
    return dict(zip("xyzw", product((x, y, z, w), inverse(turn)), strict=True))


def _number(value: Any) -> float:
    is_number = isinstance(value, int | float) and not isinstance(value, bool)
    return float(value) if is_number else math.nan
