"""The command as a ROS message: Twist or TwistStamped, of ROS 1 or ROS 2."""

from __future__ import annotations

from typing import Any, Literal

Kind = Literal["Twist", "TwistStamped"]
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
    seconds, nanoseconds = divmod(stamp_ns, 1_000_000_000)
    stamp = {"sec": seconds, "nanosec": nanoseconds} if ros_version == 2 else {"secs": seconds, "nsecs": nanoseconds}
    return {"header": {"stamp": stamp, "frame_id": "base_link"}, "twist": twist}
