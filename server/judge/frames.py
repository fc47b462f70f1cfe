"""Where the sensors of a car are and how they are turned: by its transforms, by the settings, or assumed."""

from __future__ import annotations

import math
import re
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import Any

from monitor.catalog import AllLimits
from monitor.scan import Mounting
from monitor.values import LaserScan
from server.judge.signals.scan import LOOKS_AHEAD
from server.judge.topics import plain_type
from server.judge.transforms import (
    TYPES,
    Contradiction,
    FrameTree,
    Pose,
    Rotation,
    frame_name,
    is_body,
    is_world,
    rotated,
)

MAX_SENSORS = 64  # topics and frames whose mounting is kept
MAX_TREES = 8  # namespaces with transforms of their own
_DEFAULTS = AllLimits()
PLAIN = re.compile(r"[\w./-]+", re.ASCII)  # a name that is the same in every encoding but for its slashes
NOTHING = b"\x00no frame\x00"  # of no message
AHEAD_RAD = math.radians(60.0)
ROAD_RAD = math.radians(15.0)  # on either side of ahead: the corridor from 5 m on


def is_transforms(topic: str, kind: str | None) -> bool:
    """Whether a topic, of a type in either spelling, holds transforms: /tf, /tf_static, also in a namespace."""
    return topic.rpartition("/")[2] in ("tf", "tf_static") and kind is not None and plain_type(kind) in TYPES


def is_static(topic: str) -> bool:
    """Whether the transforms of such a topic never change."""
    return topic.endswith("tf_static")


BY_NAME, BY_TRANSFORMS = "by its name", "by transforms"


@dataclass(frozen=True, slots=True, kw_only=True)
class Axes:
    """Of a frame in which a sensor gives vectors."""

    turn: Rotation | None = None  # in the body frame; None: not turned, or no transform gives it
    ground: str | None = None  # BY_NAME or BY_TRANSFORMS: it is fixed to the ground, and not to the car
    why_unknown: str | None = None


AS_THE_BODY = Axes()


class Frames:
    """What is known of the frames of one car; small, so that it can be kept with the state of a run."""

    def __init__(self) -> None:
        self._trees: dict[str, FrameTree] = {}  # by namespace
        self._changes = 0  # of all trees: what is kept is computed again after each
        self._kept: dict[tuple[str, str], tuple[int, Any, Mounting]] = {}  # by topic and frame
        self._axes: dict[tuple[str, str], tuple[int, Axes]] = {}  # by topic and frame
        self._located: dict[str, str] = {}  # topic → the frame whose place its transforms gave
        self._requested: dict[tuple[str, str], None] = {}  # topics and frames that were requested, the newest last
        self._growth = 0  # grows with each frame and each sensor that comes to be known
        self._noted = -1  # the growth when the needed names were noted

    def __getstate__(self) -> dict[str, Any]:
        kept = ("_trees", "_changes", "_located", "_requested", "_growth")
        return {"_kept": {}, "_axes": {}, "_noted": -1} | {name: getattr(self, name) for name in kept}

    def forget(self) -> None:
        """The link opens again: what is latched is sent again, and may be of another calibration by now."""
        self._trees.clear()
        self._requested.clear()
        self._growth += 1
        self._changes += 1

    def receive(self, topic: str, message: Any) -> None:
        """A message of a topic for which `is_transforms` holds."""
        space = topic.rpartition("/")[0]
        tree = self._trees.get(space)
        if tree is None:
            if len(self._trees) >= MAX_TREES:
                return
            tree = self._trees[space] = FrameTree()
        version, taken = tree.version, tree.taken
        tree.add(message, is_static=is_static(topic))
        self._changes += tree.version - version
        self._growth += tree.taken - taken

    @property
    def notes(self) -> list[str]:
        """What of the transforms could not be used, in sentences."""
        return [note for tree in self._trees.values() for note in tree.notes]

    def tree_of(self, topic: str) -> FrameTree | None:
        """The transforms that count for a topic: those of its namespace or of one around it; None: there are none."""
        space = topic
        while space:
            space = space.rpartition("/")[0]
            if space in self._trees:
                return self._trees[space]
        return None

    def locate(self, topic: str, frame: str) -> tuple[str, Pose] | None:
        """The body frame of the car and the pose of a sensor's frame in it; None: no transform gives it. Raises
        Contradiction."""
        tree = self.tree_of(topic) or FrameTree()
        body = tree.body_of(frame)
        pose = None if body is None else tree.pose(frame, body)
        return None if body is None or pose is None else (body, pose)

    def is_settled(self, topic: str, frame: str) -> bool:
        """Whether static transforms alone place a sensor's frame, so that those that move can change nothing there."""
        try:
            return not frame_name(frame) or (self.tree_of(topic) or FrameTree()).is_settled(frame)
        except Contradiction:
            return False

    @property
    def needs_moving(self) -> bool:
        """Whether transforms that move may place a requested sensor."""
        return not all(self.is_settled(topic, frame) for topic, frame in self._requested)

    def note_needed(self, names: set[bytes]) -> None:
        """Change `names` to those of which a serialized message of transforms that may count holds one, if it is not of
        the same frames as before; of all where a name may be spelled in another way there."""
        if names and self._growth == self._noted:
            return
        self._noted = self._growth
        trees = ((self.tree_of(topic) or FrameTree(), frame) for topic, frame in self._requested)
        needed = {name for tree, frame in trees for name in tree.needed(frame)}
        found = {name.rpartition("/")[2].encode() if PLAIN.fullmatch(name) else b"" for name in needed}
        names.clear()
        names.update(found or {NOTHING})

    def ask(self, topic: str, frame: str) -> None:
        """A sensor's frame is to be placed."""
        frame = frame_name(frame)
        self._request(topic, frame)
        with suppress(Contradiction):
            if self.locate(topic, frame) is not None and len(self._located) < MAX_SENSORS:
                self._located[topic] = frame

    def _request(self, topic: str, frame: str) -> None:
        if self._requested.pop((topic, frame), 0) is not None:
            self._growth += 1
        self._requested[topic, frame] = None
        if len(self._requested) > MAX_SENSORS:
            del self._requested[next(iter(self._requested))]
        (self.tree_of(topic) or FrameTree()).place(frame)

    def axes(self, topic: str, frame: str) -> Axes:
        """What is known of the axes of a frame in which a topic gives vectors."""
        kept = self._axes.get((topic, frame))
        if kept is None or kept[0] != self._changes:
            if len(self._axes) >= MAX_SENSORS:
                self._axes.clear()
            name = frame_name(frame)
            self._request(topic, name)
            try:
                found = self._find_axes(topic, name)
            except Contradiction as why:
                found = Axes(why_unknown=f"its axes are not known: {why}")
            kept = self._axes[topic, frame] = self._changes, found
        return kept[1]

    def _find_axes(self, topic: str, frame: str) -> Axes:
        """Raises Contradiction."""
        if not frame:
            return AS_THE_BODY
        tree = self.tree_of(topic)
        body = None if tree is None else tree.body_of(frame)
        if tree is None or body is None:
            return Axes(ground=BY_NAME) if is_world(frame) else AS_THE_BODY
        is_on_car = is_body(frame) or tree.is_on_car(frame, body)
        if is_on_car is False or (is_on_car is None and is_world(frame)):
            return Axes(ground=BY_TRANSFORMS)
        pose = tree.pose(frame, body)
        if pose is None or not Pose(rotation=pose.rotation).differs(Pose()):
            return AS_THE_BODY  # how far a sensor is from the axle does not matter here
        return Axes(turn=pose.rotation)

    def looks_ahead(self, topic: str, scan: LaserScan) -> bool | None:
        """Whether the laser of a topic looks ahead, as `looks_ahead` finds it; None: no transform gives it."""
        tree = self.tree_of(topic)
        self._request(topic, frame_name(scan.frame_id))
        return None if tree is None else looks_ahead(tree, frame_name(scan.frame_id), scan)

    def mounted(self, topic: str, scan: LaserScan, limits: AllLimits) -> LaserScan:
        """The scan with its angles in the car's axes."""
        key = (topic, scan.frame_id)
        kept = self._kept.get(key)
        if kept is None or kept[0] != self._changes or kept[1] is not limits:
            if len(self._kept) >= MAX_SENSORS:
                self._kept.clear()
            self._request(topic, frame_name(scan.frame_id))
            kept = self._kept[key] = self._changes, limits, self._mounting(topic, frame_name(scan.frame_id), limits)
        return mounted(scan, kept[2])

    def _mounting(self, topic: str, frame: str, limits: AllLimits) -> Mounting:
        found: Mounting
        try:
            located = self.locate(topic, frame) if frame else None
        except Contradiction as why:
            found = Mounting(origin="transforms", why_unknown=str(why), note=f"mounting not known: {why}")
        else:
            if located is not None:
                if len(self._located) < MAX_SENSORS:
                    self._located[topic] = frame
                found = _by_pose(*located)
            else:
                found = self._without(topic, frame)
        return _from_bumper(_by_settings(found, limits), limits)

    def _without(self, topic: str, frame: str) -> Mounting:
        """Of a frame whose place no transform gives."""
        before = self._located.get(topic)
        if before is not None:
            why = f"its frame was {before} and is {frame or 'none'}, whose place is not sent"
            if frame == before:
                why = f"the place of its frame {frame} is not sent any more"
            return Mounting(origin="transforms", why_unknown=why, note=f"mounting not known: {why}")
        if topic.lower() in LOOKS_AHEAD:
            return Mounting(origin="profile")
        which = f"no transform of its frame {frame}" if frame else "it names no frame"
        return Mounting(origin="assumed", note=f"assumed to look ahead: {which}, and no setting")


def _by_pose(body: str, pose: Pose) -> Mounting:
    """The mounting of a laser by its pose in the body frame. The direction of its zero is that of the rotation in the
    plane which comes nearest to the one in space."""
    ahead, left, up = (rotated(pose.rotation, axis) for axis in ((1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)))
    is_upside_down = up[2] < 0.0
    side = -1.0 if is_upside_down else 1.0
    yaw_rad = round(math.atan2(ahead[1] - side * left[0], ahead[0] + side * left[1]), 5)
    found = Mounting(
        origin="transforms",
        x_m=round(pose.x_m, 3),
        y_m=round(pose.y_m, 3) + 0.0,
        yaw_rad=yaw_rad + 0.0,
        is_upside_down=is_upside_down,
        tilt_rad=round(math.acos(min(1.0, abs(up[2]))), 5),
    )
    return replace(found, note=f"by the car's transforms {place_words(found)} of {body}")


def _by_settings(found: Mounting, limits: AllLimits) -> Mounting:
    """With what the operator set in place of the rest."""
    ours, usual = limits.mounting, _DEFAULTS.mounting
    all_count = ours.by_settings >= 0.5
    is_x_set = all_count or limits.obstacle.laser_ahead_m != _DEFAULTS.obstacle.laser_ahead_m
    turned = {name for name in ("yaw_deg", "left_m", "upside_down") if getattr(ours, name) != getattr(usual, name)}
    by_transforms = found.origin == "transforms"
    if not (turned or all_count or (by_transforms and is_x_set)):
        return found
    is_known = by_transforms and found.why_unknown is None and not all_count
    if by_transforms and not is_known and not turned and not all_count:
        return found  # its position does not give its direction
    base = found if is_known else Mounting(origin="settings")
    mounting = replace(
        base,
        origin="settings",
        x_m=None if is_x_set else base.x_m,
        y_m=ours.left_m if all_count or "left_m" in turned else base.y_m,
        yaw_rad=math.radians(ours.yaw_deg) if all_count or "yaw_deg" in turned else base.yaw_rad,
        is_upside_down=ours.upside_down >= 0.5 if all_count or "upside_down" in turned else base.is_upside_down,
        note=None,
    )
    note = f"mounted by the settings, {describe_turn(mounting)}"
    return replace(mounting, note=f"{note}, not by the car's transforms" if by_transforms else note)


def _from_bumper(found: Mounting, limits: AllLimits) -> Mounting:
    """With what gaps are counted from, where it is not the bumper: no transform names that."""
    if limits.obstacle.bumper_ahead_m > 0.0 or found.origin == "profile" or found.why_unknown is not None:
        return found
    is_behind = found.x_m is not None and found.x_m < 0.0
    return replace(found, gap_from="the rear axle" if is_behind else "the laser")


def place_words(mounting: Mounting) -> str:
    """ "turned by 180°, upside down, 0.30 m ahead"."""
    x_m = mounting.x_m or 0.0
    return f"{describe_turn(mounting)}, {abs(x_m):.2f} m {'behind' if x_m < 0 else 'ahead'}"


def describe_turn(mounting: Mounting) -> str:
    """ "turned by 90° to the left, upside down"."""
    degrees = round(math.degrees(mounting.yaw_rad)) % 360
    parts = ["looking ahead" if degrees == 0 else f"turned by {min(degrees, 360 - degrees)}°"]
    if degrees not in (0, 180):
        parts[0] += " to the left" if degrees < 180 else " to the right"
    if mounting.is_upside_down:
        parts.append("upside down")
    if abs(mounting.y_m) >= 0.005:
        parts.append(f"{abs(mounting.y_m):.2f} m {'left' if mounting.y_m > 0 else 'right'} of the centre line")
    if mounting.tilt_rad > math.radians(0.5):
        parts.append(f"tilted by {math.degrees(mounting.tilt_rad):.0f}°")
    return ", ".join(parts)


def mounted(scan: LaserScan, mounting: Mounting) -> LaserScan:
    """The scan with its angles in the car's axes: 0 ahead, counter-clockwise."""
    first_rad, last_rad, increment_rad = scan.angle_min_rad, scan.angle_max_rad, scan.angle_increment_rad
    if mounting.yaw_rad != 0.0 or mounting.is_upside_down:
        sign = -1.0 if mounting.is_upside_down else 1.0
        first_rad, last_rad = mounting.yaw_rad + sign * first_rad, mounting.yaw_rad + sign * last_rad
        # Its middle within half a turn of ahead: the page and texts read bearings so.
        turns = round((first_rad + last_rad) / 2 / math.tau) * math.tau
        first_rad, last_rad, increment_rad = first_rad - turns, last_rad - turns, sign * increment_rad
    return LaserScan(  # for each scan: `replace` takes four times as long
        ranges_m=scan.ranges_m,
        angle_min_rad=first_rad,
        angle_max_rad=last_rad,
        angle_increment_rad=increment_rad,
        time_increment_s=scan.time_increment_s,
        scan_time_s=scan.scan_time_s,
        range_min_m=scan.range_min_m,
        range_max_m=scan.range_max_m,
        frame_id=scan.frame_id,
        mounting=mounting,
    )


def looks_ahead(tree: FrameTree, frame: str, scan: LaserScan) -> bool | None:
    """Whether a laser looks ahead by its transforms: the middle of its view is within 60° of ahead, or the view covers
    the road ahead. None: the transforms do not give it. `scan` in the laser's own axes, as it is decoded."""
    try:
        body = tree.body_of(frame)
        pose = None if body is None else tree.pose(frame, body)
    except Contradiction:
        return None
    if body is None or pose is None:
        return None
    turned = mounted(scan, _by_pose(body, pose))
    if turned.mounting is None or turned.mounting.why_not is not None:
        return False
    half_rad = (scan.beams - 1) * abs(scan.angle_increment_rad) / 2
    middle_rad = turned.angle_min_rad + (scan.beams - 1) * turned.angle_increment_rad / 2
    aside_rad = abs(math.remainder(middle_rad, math.tau))
    return aside_rad <= AHEAD_RAD or half_rad >= min(aside_rad + ROAD_RAD, math.pi - abs(scan.angle_increment_rad))
