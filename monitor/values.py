"""The contents of a vehicle's messages, decoded: SI units, degrees only for WGS84 and compass headings."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np
from numpy.typing import NDArray

from monitor import scan as _scan
from monitor.scan import Mounting, within_half_turn

NO_FIX = -1  # sensor_msgs/NavSatStatus
STATUS_UNSET = -2  # of ROS 2 since Kilted


@dataclass(frozen=True, slots=True, kw_only=True)
class Twist:
    """Motion in the body frame, x forward."""

    speed_mps: float  # forward positive
    yaw_rate_radps: float | None = None  # counter-clockwise; None: the car does not fill it


@dataclass(frozen=True, slots=True, kw_only=True)
class Acceleration:
    """Longitudinal acceleration in the body frame."""

    acceleration_mps2: float
    source: Literal["topic", "speed"] = "topic"


@dataclass(frozen=True, slots=True, kw_only=True)
class Effort:
    """How far a pedal is pressed."""

    percent: float  # 0 … 100


@dataclass(frozen=True, slots=True, kw_only=True)
class Steering:
    """How far the steering is turned."""

    percent: float  # −100 … 100, negative = left
    tyre_rad: float | None = None  # angle of the front tyres, positive = left; None: not known for this kind of car


@dataclass(frozen=True, slots=True, kw_only=True)
class Distance:
    """Distance to the nearest object ahead."""

    distance_m: float | None  # None: nothing in range, or not reported by the estimator
    none_in_range: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class Bearing:
    """Where the nearest object is."""

    bearing_rad: float | None  # counter-clockwise, 0 ahead; None: unknown


@dataclass(frozen=True, slots=True, kw_only=True)
class GpsFix:
    """A position on the WGS84 ellipsoid with its horizontal one-sigma error."""

    lat_deg: float  # NaN, as the longitude: no place, which only a receiver without a fix may report
    lon_deg: float
    alt_m: float | None = None  # above the ellipsoid
    status: int = 0  # NavSatStatus: −2 not set, −1 no fix, 0 fix, 1 satellite augmented, 2 ground augmented
    is_unset: bool = False  # the receiver states a fix with zero coordinates; `status` is then −1
    covariance_type: int = 0
    sigma_m: float | None = None  # None: quality unknown
    covariance_m2: tuple[float, float, float] | None = None  # east, north, east-north; None: as `sigma_m` all around


@dataclass(frozen=True, slots=True, kw_only=True)
class PhoneFix:
    """The position of an operator's phone, as the W3C Geolocation API reports it (WGS84)."""

    lat_deg: float
    lon_deg: float
    accuracy_m: float  # radius; see `agreement.phone_sigma_m`
    alt_m: float | None = None  # above the ellipsoid
    speed_mps: float | None = None
    heading_deg: float | None = None  # 0 north, clockwise; None while standing
    at_ms: float | None = None  # by the phone's own clock, which may be wrong by hours: for display only


@dataclass(frozen=True, slots=True, kw_only=True)
class Odometry:
    """Pose in `frame_id` and forward speed in the body frame."""

    x_m: float
    y_m: float
    z_m: float | None = None
    yaw_rad: float | None = None  # counter-clockwise; in an earth-fixed frame 0 is east (REP-103)
    speed_mps: float | None = None
    frame_id: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Heading:
    """Compass heading of the vehicle's nose."""

    heading_deg: float  # 0 north, clockwise, 0 ≤ heading < 360
    source: Literal["topic", "odometry", "track"] = "topic"


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class LaserScan:
    """One sweep of a laser; beam i stands at angle_min_rad + i·angle_increment_rad, counter-clockwise from the car's
    ahead as far as its mounting is known, else from the laser's own zero."""

    ranges_m: NDArray[np.float32]  # NaN, +Inf and −Inf kept as they came (REP-117); never written to
    angle_min_rad: float
    angle_max_rad: float
    angle_increment_rad: float  # may be negative
    time_increment_s: float
    scan_time_s: float
    range_min_m: float
    range_max_m: float
    frame_id: str
    mounting: Mounting | None = None  # None: as a laser at the nose that looks ahead

    @property
    def beams(self) -> int:
        return int(self.ranges_m.size)

    @property
    def usable(self) -> int:
        """How many beams measured something: finite and within [range_min_m, range_max_m]."""
        return int(np.count_nonzero(_scan.usable(self.ranges_m, self.range_min_m, self.range_max_m)))

    @property
    def nearest(self) -> tuple[float, float] | None:
        """Range [m] and bearing [rad, counter-clockwise, −π to π] of the nearest usable return, None without any."""
        found = _scan.nearest(self.ranges_m, self.range_min_m, self.range_max_m)
        if found is None:
            return None
        index, range_m = found
        return range_m, within_half_turn(self.angle_min_rad + index * self.angle_increment_rad)

    @property
    def nearest_m(self) -> float | None:
        found = _scan.nearest(self.ranges_m, self.range_min_m, self.range_max_m)
        return None if found is None else found[1]


@dataclass(frozen=True, slots=True, kw_only=True)
class Component:
    """One line of the vehicle's own diagnostics."""

    name: str
    level: int  # 0 OK, 1 WARN, 2 ERROR, 3 STALE
    message: str
    # When it reported, on the receiver's clock, where its interval is not known; no part of its report.
    once_s: float | None = field(default=None, compare=False)


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnostics:
    """The vehicle's own diagnostics."""

    components: tuple[Component, ...] = ()

    @property
    def worst(self) -> int:
        return max((component.level for component in self.components), default=0)


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCommand:
    """The motion that the vehicle is commanded."""

    speed_mps: float | None
    tyre_angle_rad: float | None  # counter-clockwise; not a yaw rate


@dataclass(frozen=True, slots=True, kw_only=True)
class Level:
    """How much of something is left."""

    value: float
    unit: str  # "%" or "l"


Mode = Literal["autonomous", "manual", "unknown"]


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveMode:
    """Who drives, as the car reports it."""

    mode: Mode  # unknown: the meaning of its report is not known
    text: str  # the car's own name of the mode, short
    number: int | None = None  # of a plain number, whose meaning is a setting


@dataclass(frozen=True, slots=True, kw_only=True)
class Number:
    """A signal that is one number, in the unit of its row in `monitor.signals`."""

    value: float


Value = (
    Twist
    | Acceleration
    | Effort
    | Steering
    | Distance
    | Bearing
    | GpsFix
    | Odometry
    | Heading
    | LaserScan
    | Diagnostics
    | MotionCommand
    | Level
    | DriveMode
    | Number
)
