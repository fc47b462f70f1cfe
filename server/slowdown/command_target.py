"""The topic on which the car is commanded, why it cannot be, and the command as a ROS message."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal

from server.judge.topics import Source
from server.rosbridge.outgoing import is_topic

Kind = Literal["Twist", "TwistStamped"]
LAST_STAMP_NS = 2**31 * 1_000_000_000  # an int32 of seconds in ROS 2
KINDS: tuple[Kind, ...] = ("Twist", "TwistStamped")

GUARD_CMD = "/ocu_guard/cmd_vel"  # a guard on the car: its commands have priority over the controllers
GUARD_STATE = "/ocu_guard/state"
GUARD_HEARTBEAT = "/ocu_guard/heartbeat"
GUARD_RELEASE = "/ocu_guard/release"


def kind_of(type: str) -> Kind | None:
    """Which of the two a type is, as any bridge spells it; None: neither."""
    package, _, name = type.replace("/msg/", "/").rpartition("/")
    return next((kind for kind in KINDS if package == "geometry_msgs" and name == kind), None)


def twist_message(kind: Kind, speed_mps: float, tyre_rad: float, *, stamp_ns: int, ros_version: int) -> dict[str, Any]:
    """linear.x in m/s, angular.z as the car means it: the tyre angle in rad. `stamp_ns`: since 1970, for a header."""
    twist = {"linear": {"x": speed_mps, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": tyre_rad}}
    if kind == "Twist":
        return twist
    # A stamp that no ROS message can hold is sent as 0, "unknown": a wrong clock here must not stop a slow-down.
    seconds, nanoseconds = divmod(stamp_ns if 0 <= stamp_ns < LAST_STAMP_NS else 0, 1_000_000_000)
    stamp = {"sec": seconds, "nanosec": nanoseconds} if ros_version == 2 else {"secs": seconds, "nsecs": nanoseconds}
    return {"header": {"stamp": stamp, "frame_id": "base_link"}, "twist": twist}


@dataclass(frozen=True, slots=True, kw_only=True)
class CommandTarget:
    """`problem`: why nothing can be ordered, as a sentence; None: it can."""

    topic: str = ""
    type: str | None = None  # as the bridge spells it
    kind: Kind | None = None
    has_guard: bool = False
    problem: str | None = None


def target_of(
    *,
    phase: str,
    sources: Mapping[str, Source],
    offered: Mapping[str, str] | None,
    refusal: str | None = None,
) -> CommandTarget:
    """`sources` by signal; `offered` topic → type of all topics, None while unknown. `refusal`: why the car's server
    takes no message; None: it does."""
    if phase not in ("monitoring", "lost"):
        return CommandTarget(problem="No car is connected.")
    if refusal is not None:
        return CommandTarget(problem=refusal)
    if offered is None:
        return CommandTarget(problem="The bridge does not say which topics the car has, so the type is not confirmed.")
    has_guard = GUARD_STATE in offered and kind_of(offered.get(GUARD_CMD, "")) is not None
    source = sources.get("command")
    if not has_guard and source is None:
        return CommandTarget(problem="The car has no command topic: pick one for Command in Settings.")
    topic = GUARD_CMD if has_guard or source is None else source.topic
    type = offered.get(topic) or (None if source is None else source.type)
    kind = kind_of(type or "")
    if kind is None:
        return CommandTarget(topic=topic, type=type, problem=f"{topic} is {type or 'of unknown type'}, not a Twist.")
    if not is_topic(topic):
        return CommandTarget(topic=topic, type=type, problem=f"{topic} is not a topic name that ROS accepts.")
    return CommandTarget(topic=topic, type=type, kind=kind, has_guard=has_guard)
