"""The type of a message by its fields, for bridges that do not say it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from server.judge.signals import TOPICS

# The first type whose fields are there: an odometry has a twist too.
FIELDS: Mapping[str, tuple[str, ...]] = {
    "nav_msgs/Odometry": ("pose", "twist"),
    "geometry_msgs/TwistStamped": ("header", "twist"),
    "geometry_msgs/Twist": ("linear", "angular"),
    "geometry_msgs/Wrench": ("force", "torque"),
    "sensor_msgs/LaserScan": ("ranges", "angle_increment"),
    "sensor_msgs/NavSatFix": ("latitude", "longitude"),
    "sensor_msgs/Imu": ("angular_velocity", "linear_acceleration"),
    "sensor_msgs/BatteryState": ("percentage", "voltage"),
    "diagnostic_msgs/DiagnosticArray": ("header", "status"),
    "autoware_vehicle_msgs/ControlModeReport": ("stamp", "mode"),
}
PLAIN = ("std_msgs/Bool", "std_msgs/String")
NUMBERS = ("std_msgs/Float32", "std_msgs/UInt8")  # alike in JSON; the topic's name tells which of them are possible


def type_of(message: Any, topic: str, signal: str | None = None) -> str:
    """The type (ROS 1 spelling) of a message of a topic that may carry a signal by its name, or that was picked for
    one; the usual type of the signal where the fields are of none."""
    rows = [row for row in TOPICS if row.signal == signal or topic.lower() in map(str.lower, row.names)]
    allowed = [kind for row in rows for kind in row.types]
    found = next((kind for kind in allowed if _fits(message, kind)), None)
    return found or (rows[0].expected_type if rows else "")


def type_by_fields(message: Any) -> str:
    """The type of a message of any topic; "" where its fields are of none that a signal has."""
    return next((kind for kind in (*FIELDS, *PLAIN, NUMBERS[0]) if _fits(message, kind)), "")


def _fits(message: Any, kind: str) -> bool:
    if not isinstance(message, Mapping):
        return False
    if kind in FIELDS:
        return _has(message, FIELDS[kind]) and not _is_of_an_earlier_one(message, kind)
    data = message.get("data")
    if kind == "std_msgs/Bool":
        return isinstance(data, bool)
    if kind == "std_msgs/String":
        return isinstance(data, str)
    is_number = "data" in message and (data is None or (isinstance(data, (int, float)) and not isinstance(data, bool)))
    return is_number and kind in NUMBERS


def _has(message: Mapping[str, Any], fields: Collection[str]) -> bool:
    return all(field in message for field in fields)


def _is_of_an_earlier_one(message: Mapping[str, Any], kind: str) -> bool:
    for other, fields in FIELDS.items():
        if other == kind:
            return False
        if _has(message, fields):
            return True
    return False
