"""What is known of one topic by its messages. Pure."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from monitor.values import LaserScan
from server.judge.frame_names import is_earth_fixed
from server.judge.message_fields import inner, number
from server.judge.sources.motion import FAR_M, MOVES_MPS, POSE_LEAST_M, POSES_MPS, Motion, is_lost, least_way_m
from server.judge.topic import FLOATS

BINS = 72
SAME_M = 0.005  # a filter leaves a range as it is; another laser has noise of its own
SAME_SHARE = 0.95
COMPARED = 8  # parts at least

FIXES_S = 1.2  # two positions so near in time are compared: many receivers send one a second
ENOUGH = 5  # messages that show the same
ODOMETRY = "nav_msgs/Odometry"
POSES = "poses"  # of an odometry whose twist is not filled: they may be a receiver's


@dataclass(frozen=True, slots=True, kw_only=True)
class Picture:
    """A coarse picture of a scan: by it an operator recognises a laser, and two topics of one laser are alike.

    The nearest usable range [m] in each of at most BINS equal parts of the view, in the laser's own frame; None:
    nothing was measured there.
    """

    at_s: float
    stamp_s: float | None  # by its header
    ranges_m: tuple[float | None, ...]
    angle_min_rad: float  # of the middle of the first part
    angle_increment_rad: float


def picture_of(scan: LaserScan, stamp: float | None, at_s: float) -> Picture | None:
    """The picture of a scan; None: it has no beams."""
    beams = scan.beams
    if beams == 0:
        return None
    ranges = np.where(
        np.isfinite(scan.ranges_m) & (scan.ranges_m >= scan.range_min_m) & (scan.ranges_m <= scan.range_max_m),
        scan.ranges_m,
        np.inf,
    )
    bins = min(BINS, beams)
    starts = (np.arange(bins) * beams) // bins
    nearest = np.minimum.reduceat(ranges, starts)
    step_rad = scan.angle_increment_rad * beams / bins
    return Picture(
        at_s=at_s,
        stamp_s=stamp,
        ranges_m=tuple(round(float(found), 3) if math.isfinite(found) else None for found in nearest),
        angle_min_rad=scan.angle_min_rad + (step_rad - scan.angle_increment_rad) / 2,
        angle_increment_rad=step_rad,
    )


def see_the_same(one: Picture, other: Picture) -> bool | None:
    """Whether two pictures in one frame and of one moment are of one scan, as of a laser and of its filter; None: too
    little is seen by both, or they are of two moments."""
    if one.stamp_s is None or one.stamp_s != other.stamp_s:
        return None
    alike = compared = 0
    for place, range_m in enumerate(one.ranges_m):
        beside_m = _at(other, one.angle_min_rad + place * one.angle_increment_rad)
        if range_m is not None and beside_m is not None:
            compared += 1
            alike += abs(range_m - beside_m) <= SAME_M
    return None if compared < COMPARED else alike >= SAME_SHARE * compared


def _at(picture: Picture, angle_rad: float) -> float | None:
    if picture.angle_increment_rad == 0.0:
        return None
    number = round((angle_rad - picture.angle_min_rad) / picture.angle_increment_rad)
    return picture.ranges_m[number] if 0 <= number < len(picture.ranges_m) else None


@dataclass(slots=True)
class TopicEvidence:
    """What is known of one topic. A velocity is along and across the car, or in east and north."""

    kind: str
    frame: str | None = None  # that its messages name; None: none, or no message yet
    count: int = 0
    is_beside: bool = False  # followed only to see whether the car moves, and whether it is filled
    has_twist: bool = False  # its horizontal velocity, or its number, was not zero
    is_filled: bool = False  # its horizontal velocity was a number other than zero
    has_moved: bool = False  # its pose, farther than that of a receiver which rests
    stated: Motion = field(default_factory=Motion)  # by its velocity
    made: Motion = field(default_factory=Motion)  # by its pose or its positions
    least_m: float = POSE_LEAST_M  # way that its places must make to show a motion
    origin: tuple[float, float] | None = None  # latitude and longitude of its first position
    zero_s: tuple[float, float] | None = None  # when it was exactly zero, first and last, without a gap
    idle_beside: dict[str, str] = field(default_factory=dict)  # proof → topic that moved while this one was zero
    earth_votes: int = 0
    body_votes: int = 0
    velocity: tuple[float, float, float] | None = None  # when, x and y [m/s] of the newest message
    place: tuple[float, float, float] | None = None  # when, latitude and longitude [degrees]
    course: tuple[float, float] | None = None  # when, direction of the way made [rad from east]
    looks_ahead: bool | None = None  # of a laser, by the transforms of the car; None: they do not give it
    picture: Picture | None = None  # of its newest scan, at most every PICTURE_EVERY_S

    @property
    def is_twist_empty(self) -> bool:
        """Whether its speed is exactly zero though its pose moves, or another topic shows that the car does."""
        return not self.has_twist and (self.has_moved or bool(self.idle_beside))

    @property
    def is_empty_by_odometry(self) -> bool:
        """The same where it is beyond doubt: another velocity may be a command, and a receiver may be wrong."""
        return not self.has_twist and (self.has_moved or ODOMETRY in self.idle_beside)

    @property
    def why_empty(self) -> str:
        """The reason for `is_twist_empty`, as text."""
        what = "its value" if self.kind in FLOATS else "its twist"
        beside = self.idle_beside.get(ODOMETRY) or next(iter(self.idle_beside.values()), "")
        return f"{what} is zero while {'its pose' if self.has_moved else beside} moves"

    @property
    def is_body_fixed(self) -> bool:
        """Whether its values follow the car and not the compass."""
        return self.body_votes >= ENOUGH and self.body_votes > 2 * self.earth_votes

    @property
    def is_earth_fixed(self) -> bool:
        """Whether its values are in east and north."""
        return self.earth_votes >= ENOUGH and self.earth_votes > 2 * self.body_votes

    @property
    def shown(self) -> tuple[object, ...]:
        """What a choice may depend on."""
        return (
            self.frame,
            self.count > 0,
            self.has_twist,
            self.is_twist_empty,
            self.is_empty_by_odometry,
            self.is_earth_fixed,
            self.is_body_fixed,
            self.looks_ahead,
        )

    @property
    def is_enough(self) -> bool:
        """Whether more messages would hardly show more."""
        match self.kind:
            case "nav_msgs/Odometry" | "std_msgs/Float32" | "std_msgs/Float64":
                return self.has_twist or self.is_twist_empty
            case "geometry_msgs/TwistStamped" | "geometry_msgs/Twist":
                named = self.is_beside or (self.frame is not None and is_earth_fixed(self.frame))
                is_known = named or self.is_earth_fixed or self.is_body_fixed
                return (self.has_twist and is_known) or self.is_twist_empty
            case "sensor_msgs/LaserScan":
                return self.count > 0
        return True

    def pose(self, pose: Mapping[str, Any], at_s: float) -> None:
        """Takes the pose of an odometry (geometry_msgs/PoseWithCovariance): without a twist it may be a receiver's."""
        x_m, y_m = (number(inner(pose, "pose"), "position", axis) for axis in "xy")
        if is_lost(pose):
            return
        self.least_m = POSE_LEAST_M if self.is_filled else least_way_m(pose.get("covariance"))
        self.made.place(x_m, y_m, at_s, slowest_mps=MOVES_MPS if self.is_filled else POSES_MPS)
        self.has_moved |= self.made.is_long(at_s, -math.inf, within_s=FIXES_S, least_m=self.least_m)

    def moves_since(self, zero_since_s: float, at_s: float) -> str | None:
        """As what it shows for long that the car moves, while another topic was zero; None: it does not.

        The poses of an odometry whose twist is not filled prove as little as positions, until they are far away.
        """
        if not self.stated.is_long(at_s, zero_since_s, within_s=FIXES_S) and not self.made.is_long(
            at_s, zero_since_s, within_s=FIXES_S, least_m=self.least_m
        ):
            return None
        return POSES if self.kind == ODOMETRY and not self.is_filled and self.made.way_m < FAR_M else self.kind
