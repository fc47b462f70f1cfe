"""The command as a ROS message: Twist or TwistStamped, of ROS 1 or ROS 2."""

from __future__ import annotations

from typing import Any, Literal

Kind = Literal["Twist", "TwistStamped"]
LAST_STAMP_NS = 2**31 * 1_000_000_000  # an int32 of seconds in ROS 2
KINDS: tuple[Kind, ...] = ("Twist", "TwistStamped")


def kind_of(type: str) -> Kind | None:
    """Which of the two a type is, as any bridge spells it; None: neither."""
    package, _, name = type.replace("/msg/", "/").rpartition("/")
    return next((kind for kind in KINDS if package == "geometry_msgs" and name == kind), None)


def message(kind: Kind, speed_mps: float, tyre_rad: float, *, stamp_ns: int, ros_version: int) -> dict[str, Any]:
    """linear.x in m/s, angular.z as the car means it: the tyre angle in rad. `stamp_ns`: since 1970, for a header."""
    twist = {"linear": {"x": speed_mps, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": tyre_rad}}
    if kind == "Twist":
        return twist
    # A stamp that no ROS message can hold is sent as 0, "unknown": a wrong clock here must not stop a slow-down.
    seconds, nanoseconds = divmod(stamp_ns if 0 <= stamp_ns < LAST_STAMP_NS else 0, 1_000_000_000)
    stamp = {"sec": seconds, "nanosec": nanoseconds} if ros_version == 2 else {"secs": seconds, "nsecs": nanoseconds}
    return {"header": {"stamp": stamp, "frame_id": "base_link"}, "twist": twist}
