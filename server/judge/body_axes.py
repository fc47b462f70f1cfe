"""Imu and Odometry in the axes of the car: a sensor mounted backwards measures driving forward as driving back."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any

from server.judge.frames import BY_TRANSFORMS, Frames
from server.judge.message_fields import has_fields
from server.judge.signals.speed import MOVES_MPS, SIDEWAYS
from server.judge.transforms import MAX_NAME, Rotation, frame_name, inverse, product, rotated

IMU, ODOMETRY = "sensor_msgs/Imu", "nav_msgs/Odometry"
TYPES = frozenset({IMU, ODOMETRY, "sensor_msgs/msg/Imu", "nav_msgs/msg/Odometry"})  # in both spellings
EXACTLY = 1e-6  # of the way made: what the rounding of a rotation leaves
STANDS_MPS = 1e-6  # the direction of what is slower does not matter
NEGLIGIBLE = 1e-6  # of a unit vector: an axis that plays no part may be NaN


def in_body_axes(frames: Frames, topic: str, kind: str | None, message: Any) -> tuple[Any, str | None]:
    """The message as a sensor with the body's axes would send it, and why that cannot be known.

    An Imu is in its header's frame (REP-145); the twist of an Odometry is in `child_frame_id`, whose pose it states. A
    frame that no transform names is taken for the body, as drivers without transforms mean it. Where `child_frame_id`
    is fixed to the ground, as `odom` is, the twist has the axes of that frame, and the pose is that of the car.
    """
    if kind not in TYPES or not has_fields(message):
        return message, None
    is_imu = kind.endswith("Imu")
    header = message.get("header") if is_imu else None
    named = header.get("frame_id") if has_fields(header) else message.get("child_frame_id")
    if not isinstance(named, str) or len(named) > MAX_NAME:
        return message, None
    axes = frames.axes(topic, named)
    if axes.why_unknown is not None:
        return message, axes.why_unknown
    if axes.ground is not None and not is_imu:
        return _from_ground(message, frame_name(named))
    if axes.ground == BY_TRANSFORMS:
        return message, f"its axes are not known: {frame_name(named)} is no frame of the car"
    if axes.turn is None:
        return message, None
    return (_imu(message, axes.turn) if is_imu else _odometry(message, axes.turn)), None


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


def _from_ground(message: Mapping[str, Any], frame: str) -> tuple[Any, str | None]:
    """An Odometry whose twist has the axes of a frame on the ground, by its own orientation in that frame."""
    found, why = dict(message), f"its axes are not known: its twist is in {frame}"
    header, pose, twist = (message.get(name) for name in ("header", "pose", "twist"))
    inner = pose.get("pose") if has_fields(pose) else None
    orientation = inner.get("orientation") if has_fields(inner) else None
    if not has_fields(twist) or not has_fields(moving := twist.get("twist")):
        return message, None  # to be refused by the decoder
    if not has_fields(linear := moving.get("linear")):
        return message, None
    above = frame_name(header.get("frame_id") if has_fields(header) else None)
    if above != frame:
        return message, f"{why}, and its pose in {above or 'no frame'}"
    x, y, z, w = (_number(orientation.get(axis) if has_fields(orientation) else None) for axis in "xyzw")
    norm = math.hypot(x, y, z, w)
    if not 0.7 < norm < 1.2:  # that of a driver without a compass is zero
        return message, f"{why}, and its orientation is none"
    turn = inverse((x / norm, y / norm, z / norm, w / norm))
    turned = {name: _vector(vector, turn) for name, vector in moving.items()}
    way_mps = math.hypot(_number(linear.get("x")), _number(linear.get("y")))
    aside_mps = abs(turned["linear"]["y"])
    if linear.get("y") == 0.0 and aside_mps > EXACTLY * way_mps:
        return message, None  # along an axis of the car, and of no other: it has the axes of the car
    if linear.get("y") == 0.0 and way_mps > STANDS_MPS and turned["linear"]["x"] * linear["x"] < 0.0:
        return message, f"{why} or in the axes of the car, which point the other way"
    if way_mps > MOVES_MPS and aside_mps > SIDEWAYS * way_mps:
        return message, f"{why}, and moves sideways by its orientation"
    found["twist"] = {**twist, "twist": turned}
    return found, None


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
