"""The frames of a car, from its transforms (tf2_msgs/TFMessage on /tf_static and /tf). Bounded; nothing is guessed."""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from functools import lru_cache
from typing import Any

from server.judge.frame_names import name_parts
from server.judge.message_fields import Rejected, finite
from server.system.clean_text import clean

TYPES = ("tf2_msgs/TFMessage", "tf/tfMessage")  # ROS 1 spelling
MAX_FRAMES, FORGOTTEN = 500, 50  # frames that are kept, and that are forgotten at a time where more are sent
MAX_PLACED = 64  # frames of sensors that are never forgotten, nor those that place them
MAX_NAME = 100
MAX_DEPTH = 50  # a chain of more frames is none
MAX_NOTES = 20
UNIT_WITHIN = 0.01  # a rotation whose norm is farther from 1 is not one
FARTHEST_M = 50.0  # on a car no sensor is farther from the rear axle; what is, is in another unit
SAME = 0.002  # m, and of each part of a rotation: no contradiction, but rounding

BODIES = ("base_link", "base_footprint")  # REP-105, REP-120; the first that there is
ROOTS = ("base", "body", "chassis", "vehicle", "car", "ego_vehicle", "base_frame", "vehicle_frame", "robot")

BODY_WORDS = frozenset({"base", "footprint", "chassis", "body"})
WORLD_WORDS = frozenset({"odom", "odometry", "map", "world", "earth", "utm", "ecef"})
WORLDS = ("enu", "ned", "global", "local", "origin", "local_origin")  # as name parts they occur in names of sensors too

Rotation = tuple[float, float, float, float]  # unit quaternion x, y, z, w


class Contradiction(Exception):
    """The pose of a frame cannot be determined; `str()` is a short reason."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Pose:
    """Of one frame in another: its origin [m] and its axes."""

    x_m: float = 0.0
    y_m: float = 0.0
    z_m: float = 0.0
    rotation: Rotation = (0.0, 0.0, 0.0, 1.0)

    def of(self, inner: Pose) -> Pose:
        """The pose of a frame that has the pose `inner` in this one."""
        x, y, z = rotated(self.rotation, (inner.x_m, inner.y_m, inner.z_m))
        return Pose(
            x_m=self.x_m + x, y_m=self.y_m + y, z_m=self.z_m + z, rotation=product(self.rotation, inner.rotation)
        )

    def inverse(self) -> Pose:
        """The pose of the other frame in this one."""
        back = inverse(self.rotation)
        at = rotated(back, (-self.x_m, -self.y_m, -self.z_m))
        return Pose(x_m=at[0], y_m=at[1], z_m=at[2], rotation=back)

    def differs(self, other: Pose) -> bool:
        """Whether it is another pose, beyond what rounding makes of one."""
        sign = math.copysign(1.0, sum(a * b for a, b in zip(self.rotation, other.rotation, strict=True)))
        pairs = [(self.x_m, other.x_m), (self.y_m, other.y_m), (self.z_m, other.z_m)]
        pairs += [(a, sign * b) for a, b in zip(self.rotation, other.rotation, strict=True)]
        return any(abs(a - b) > SAME for a, b in pairs)


def rotated(rotation: Rotation, of: tuple[float, float, float]) -> tuple[float, float, float]:
    """A vector of the inner frame in the axes of the outer one."""
    x, y, z, w = rotation
    vx, vy, vz = of
    # v + 2w(q × v) + 2q × (q × v)
    cx, cy, cz = y * vz - z * vy, z * vx - x * vz, x * vy - y * vx
    return (
        vx + 2 * (w * cx + y * cz - z * cy),
        vy + 2 * (w * cy + z * cx - x * cz),
        vz + 2 * (w * cz + x * cy - y * cx),
    )


def product(a: Rotation, b: Rotation) -> Rotation:
    """The rotation `b`, in the axes that `a` turns; the norm is the product of theirs."""
    ax, ay, az, aw = a
    bx, by, bz, bw = b
    return (
        aw * bx + ax * bw + ay * bz - az * by,
        aw * by - ax * bz + ay * bw + az * bx,
        aw * bz + ax * by - ay * bx + az * bw,
        aw * bw - ax * bx - ay * by - az * bz,
    )


def inverse(rotation: Rotation) -> Rotation:
    """The rotation back."""
    x, y, z, w = rotation
    return -x, -y, -z, w


@dataclass(slots=True)
class _Link:
    """A frame below another one."""

    parent: str
    pose: Pose | None  # None: what was sent is no pose
    is_static: bool
    fault: str | None = None  # why it cannot be used; stays, for who is right cannot be known
    first: Pose | None = None  # as it was sent first
    has_moved: bool = False
    sent: int = 0  # grows with each transform that was sent of any frame


def frame_name(name: Any) -> str:
    """A frame as it is looked up: without the slash that ROS 1 allowed before it; empty: none, or no name."""
    if not isinstance(name, str):
        return ""
    name = name.strip().lstrip("/")
    return clean(name) if len(name) <= MAX_NAME else ""


@lru_cache(maxsize=1000)
def is_body(frame: str) -> bool:
    """Whether a frame is one of the car's body, by its name."""
    return _last(frame) in (*BODIES, *ROOTS) or not BODY_WORDS.isdisjoint(name_parts(_last(frame)))


@lru_cache(maxsize=1000)
def is_world(frame: str) -> bool:
    """Whether a frame is fixed to the ground, by its name: odom, map_frame, robot1/world; see REP-105."""
    last = _last(frame)
    return not is_body(frame) and (last in WORLDS or not WORLD_WORDS.isdisjoint(name_parts(last)))


class FrameTree:
    """Which frame is where in which. `version` grows with each change."""

    def __init__(self) -> None:
        self.version = 0
        self.taken = 0  # frames so far, forgotten ones too
        self.notes: list[str] = []  # what could not be used or is not kept, in sentences
        self._links: dict[str, _Link] = {}  # by the lower frame
        self._sent = 0
        self._is_crowded = False  # frames were forgotten
        self._placed: dict[str, None] = {}  # frames that were placed, the newest last

    def add(self, message: Any, *, is_static: bool) -> None:
        """The transforms of one message. What is not static may move: then the newest counts."""
        rows = message.get("transforms") if isinstance(message, Mapping) else None
        if isinstance(rows, list | tuple):
            for row in rows[:MAX_FRAMES]:
                self._add(row, is_static)

    def _add(self, row: Any, is_static: bool) -> None:
        header = row.get("header") if isinstance(row, Mapping) else None
        parent = frame_name(header.get("frame_id") if isinstance(header, Mapping) else None)
        child = frame_name(row.get("child_frame_id") if isinstance(row, Mapping) else None)
        if not parent or not child:
            self._note("A transform names no frames, or longer ones than are read.")
            return
        known = self._links.get(child)
        self._sent += 1
        if known is not None:
            known.sent = self._sent
        elif len(self._links) >= MAX_FRAMES:
            self._forget_some()
        try:
            pose, fault = _pose(row), None
        except Rejected as why:
            pose, fault = None, f"the transform of {child} is not usable, {why}"
        if known is None:
            self._links[child] = _Link(parent, pose, is_static, fault, pose, sent=self._sent)
            self.taken += 1
        else:
            if known.fault is not None or (
                parent == known.parent and is_static == known.is_static and pose == known.pose and fault is None
            ):
                return
            fault = fault or _contradiction(child, known, parent, pose, is_static)
            if fault is not None:
                known.fault = fault
            elif is_static == known.is_static:
                known.pose = pose
                known.has_moved = known.has_moved or _differ(pose, known.first)
            else:
                return  # the same, by another topic
        if fault is not None:
            self._note(f"{fault[0].upper()}{fault[1:]}.")
        self.version += 1

    def body_of(self, frame: str) -> str | None:
        """The body frame of the car that a frame is part of; None: there is none. Raises Contradiction where that may
        be because what is above it cannot be known."""
        above = list(self._above(frame_name(frame)))
        for body in BODIES:
            found = [name for name in above if _last(name) == body]
            if found:
                return found[0]
            beside = {name for name in self._links if _last(name) == body and above[-1] in self._above(name)}
            if len(beside) == 1:
                return beside.pop()
        if _last(above[-1]) in ROOTS:
            return above[-1]
        for link in filter(None, map(self._links.get, above)):
            if link.fault is not None:
                raise Contradiction(link.fault)
        return None

    def pose(self, frame: str, body: str) -> Pose | None:
        """The pose of a frame in another one; None: nothing connects them. Raises Contradiction."""
        to_body = self._chain(frame_name(body))
        to_frame = self._chain(frame_name(frame))
        common = next((name for name in to_frame if name in to_body), None)
        if common is None:
            return None
        found = self._down(to_body, common).inverse().of(self._down(to_frame, common))
        if math.hypot(found.x_m, found.y_m, found.z_m) > FARTHEST_M:
            raise Contradiction(f"{frame_name(frame)} is more than {FARTHEST_M:.0f} m from {frame_name(body)}")
        return found

    def is_settled(self, frame: str) -> bool:
        """Whether static transforms place a frame below base_link. Raises Contradiction."""
        chain = self._chain(frame_name(frame))
        body = next((name for name in chain if _last(name) == BODIES[0]), None)
        if body is None or not all(self._links[name].is_static for name in chain[: chain.index(body)]):
            return False
        self._down(chain, body)
        return True

    def needed(self, frame: str) -> set[str]:
        """Frames of which each transform that counts for the place of this one names at least one."""
        found: list[str] = []
        for name in self._above(frame):
            if _last(name) == BODIES[0]:
                return set(found)
            found.append(name)
        is_connected = len(found) > 1 or any(link.parent == frame for link in self._links.values())
        return {*found, *(BODIES if is_connected else ())}  # a body may be beside it

    def is_on_car(self, frame: str, body: str) -> bool | None:
        """Whether a frame is fixed to the car, and not to the ground that it drives on, as `odom` is; None: what was
        sent does not show it. Raises Contradiction."""
        to_body, to_frame = self._chain(frame_name(body)), self._chain(frame_name(frame))
        common = next((name for name in to_frame if name in to_body), None)
        if common is None:
            return None
        ours = [self._links[name] for name in to_body[: to_body.index(common)]]
        theirs = [self._links[name] for name in to_frame[: to_frame.index(common)]]
        if all(link.is_static for link in (*ours, *theirs)):
            return True
        is_car_seen_from = any(link.has_moved for link in ours) and not any(link.has_moved for link in theirs)
        return False if is_car_seen_from and not is_body(common) else None

    def _above(self, frame: str) -> Iterator[str]:
        """A frame and all above it, as far as there is no loop."""
        for _ in range(MAX_DEPTH):
            yield frame
            link = self._links.get(frame)
            if link is None:
                return
            frame = link.parent

    def _chain(self, frame: str) -> list[str]:
        """Raises Contradiction where the frames above it never end."""
        found = list(self._above(frame))
        if len(set(found)) < len(found) or len(found) == MAX_DEPTH:
            raise Contradiction(f"the frames above {frame} form a loop")
        return found

    def _down(self, chain: list[str], common: str) -> Pose:
        """The pose of the first frame of a chain in one above it. Raises Contradiction."""
        pose = Pose()
        for name in chain[: chain.index(common)]:
            link = self._links[name]
            if link.fault is not None or link.pose is None:
                raise Contradiction(link.fault or f"the transform of {name} is not usable")
            pose = link.pose.of(pose)
        return pose

    def place(self, frame: str) -> None:
        """A sensor is in this frame: it is not forgotten, nor what places it."""
        self._placed.pop(frame, None)
        self._placed[frame] = None
        if len(self._placed) > MAX_PLACED:
            del self._placed[next(iter(self._placed))]

    def _forget_some(self) -> None:
        """Those that move and were not sent for longest come first: they would be sent again; what places a sensor
        comes last."""
        bodies = [name for name in self._links if _last(name) in BODIES]
        needed = {name for frame in (*self._placed, *bodies) for name in self._above(frame)}
        order = sorted(
            self._links, key=lambda name: (name in needed, self._links[name].is_static, self._links[name].sent)
        )
        for name in order[:FORGOTTEN]:
            del self._links[name]
        self.version += 1
        if not self._is_crowded:
            self._is_crowded = True
            self._note(f"More than {MAX_FRAMES} frames are sent: the longest unused are forgotten, {order[0]} first.")

    def _note(self, sentence: str) -> None:
        if sentence not in self.notes and len(self.notes) < MAX_NOTES:
            self.notes.append(sentence)


def _differ(pose: Pose | None, first: Pose | None) -> bool:
    return pose is not None and first is not None and pose.differs(first)


def _contradiction(child: str, known: _Link, parent: str, pose: Pose | None, is_static: bool) -> str | None:
    """Why a further transform of a frame is refused; None: it is the newest."""
    if parent != known.parent:
        return f"the frame {child} is below {known.parent} and also below {parent}"
    if (is_static or known.is_static) and pose is not None and known.pose is not None and pose.differs(known.pose):
        return f"the frame {child} is static, and is sent at two places in {parent}"
    return None


def _pose(row: Mapping[str, Any]) -> Pose:
    """Raises Rejected for what is no pose."""
    x_m, y_m, z_m = (finite(row, "transform", "translation", axis) for axis in "xyz")
    x, y, z, w = (finite(row, "transform", "rotation", axis) for axis in "xyzw")
    norm = math.hypot(x, y, z, w)
    if abs(norm - 1.0) > UNIT_WITHIN:
        raise Rejected("its rotation is not a unit quaternion")
    return Pose(x_m=x_m, y_m=y_m, z_m=z_m, rotation=(x / norm, y / norm, z / norm, w / norm))


def _last(frame: str) -> str:
    return frame.rpartition("/")[2].lower()
