"""From a ROS message, as rosbridge spells it, to a value of ours.

Each function takes one message and gives one value, or raises Rejected with the reason in few words. Numbers that
rosbridge had to flatten to null are NaN here; a value whose headline number is unknown is rejected, because a signal
that says nothing must grow old and not look alive.
"""

from __future__ import annotations

import base64
import binascii
import math
from collections.abc import Callable, Mapping
from typing import Any

import numpy as np

from monitor.values import (
    Acceleration,
    Bearing,
    Component,
    Diagnostics,
    Distance,
    Effort,
    GpsFix,
    Heading,
    LaserScan,
    Level,
    MotionCommand,
    Odometry,
    Steering,
    Twist,
)
from server.judge.message_fields import Rejected, finite, inner, known, number, numbers, text

Decode = Callable[[Any], Any]

NONE_REAL_M, NONE_SIMULATED_M = 81.0, 180.0  # what the distance estimator says of nothing ahead: car, simulator
NONE_YET_M = 2147483647.0  # what its steering-based variant says before the first object
FARTHEST_M = 1000.0  # no sensor on a car sees farther
MAX_BEAMS = 65535
MAX_COMPONENTS = 500
FULLEST_PERCENT = 10_000.0  # a hundred times all there is: another unit, or noise
FASTEST_MPS = 150.0  # beyond that a wheel sensor or a unit is broken, not the car fast

HARDEST_MPS2 = 300.0  # a crash; what is beyond is another unit, or noise
SIDEWAYS = 0.25  # of the way made: a car rolls forwards or backwards, and slips a little
FARTHEST_SCAN_M = 10_000.0  # a range_max beyond is "no end", which drivers write as the largest float there is
WIDEST_RAD = 4 * math.pi  # two turns: no laser sweeps more

# What comes a hundred times a second is made quickly.


def _speed(value: float) -> float:
    if abs(value) > FASTEST_MPS:
        raise Rejected("a speed beyond any car")
    return value


def _percent(value: float) -> float:
    if abs(value) > FULLEST_PERCENT:
        raise Rejected("a percentage beyond any pedal")
    return value


def twist(message: Any) -> Twist:
    yaw_rate = number(message, "angular", "z") if isinstance(message, Mapping) and "angular" in message else math.nan
    return Twist(speed_mps=_speed(finite(message, "linear", "x")), yaw_rate_radps=known(yaw_rate))


def twist_stamped(message: Any) -> Twist:
    return twist(inner(message, "twist"))


def twist_of_odometry(message: Any) -> Twist:
    """Speed of a nav_msgs/Odometry; its twist is in the body frame by definition, and in east and north as the
    CATVehicle's drivers and Gazebo fill it. The way made is the same in both; backwards is what points back and hardly
    aside."""
    body = inner(inner(message, "twist"), "twist")
    x, y = finite(body, "linear", "x"), number(body, "linear", "y")
    y = 0.0 if math.isnan(y) else y
    speed = math.hypot(x, y)
    yaw_rate = number(body, "angular", "z") if "angular" in body else math.nan
    return Twist(
        speed_mps=_speed(-speed if x < 0 and abs(y) <= SIDEWAYS * speed else speed), yaw_rate_radps=known(yaw_rate)
    )


def speed_of_float(message: Any) -> Twist:
    return Twist(speed_mps=_speed(finite(message, "data")), yaw_rate_radps=None)


def effort(message: Any) -> Effort:
    """Percent in force.x of a Wrench, as the car's pedals have it."""
    return Effort(percent=_percent(finite(message, "force", "x")))


def effort_of_float(message: Any) -> Effort:
    return Effort(percent=_percent(finite(message, "data")))


def steering(message: Any) -> Steering:
    """Percent in torque.z of a Wrench, negative = left."""
    return Steering(percent=_percent(finite(message, "torque", "z")))


def steering_of_float(message: Any) -> Steering:
    return Steering(percent=_percent(finite(message, "data")))


def distance(message: Any) -> Distance:
    value = finite(message, "data")
    if value < 0:
        raise Rejected("a distance below zero")
    if value >= FARTHEST_M or abs(value - NONE_REAL_M) < 1e-3 or abs(value - NONE_SIMULATED_M) < 1e-3:
        return Distance(distance_m=None, none_in_range=True)
    return Distance(distance_m=value, none_in_range=False)


def bearing(message: Any) -> Bearing:
    value = finite(message, "data")
    if abs(value) > 2 * math.pi:
        raise Rejected("an angle beyond a full turn")
    return Bearing(bearing_rad=value)


def nav_sat_fix(message: Any) -> GpsFix:
    """Position on WGS84. Raises Rejected for coordinates that are no place on Earth; without a fix they may be
    anything."""
    status = finite(message, "status", "status")
    if status != int(status) or not -128 <= status <= 127:  # an int8; beyond −1…2 drivers have their own
        raise Rejected("status.status is no status")
    latitude, longitude = number(message, "latitude"), number(message, "longitude")
    if math.isnan(latitude) or math.isnan(longitude):
        if status >= 0:
            raise Rejected("latitude or longitude is not a number")
        latitude = longitude = math.nan
    elif abs(latitude) > 90 or abs(longitude) > 360:
        raise Rejected("latitude or longitude out of range")
    kind = number(message, "position_covariance_type")
    kind_is_known = kind in (1, 2, 3)
    spread = _spread(message.get("position_covariance")) if kind_is_known else None
    return GpsFix(
        lat_deg=latitude,
        lon_deg=(longitude + 180) % 360 - 180 if abs(longitude) > 180 else longitude,
        alt_m=known(number(message, "altitude")),
        status=int(status),
        covariance_type=int(kind) if kind_is_known else 0,
        sigma_m=None if spread is None else known(math.sqrt(spread[0] / 2 + spread[1] / 2)),
        covariance_m2=spread,
    )


def _spread(covariance: Any) -> tuple[float, float, float] | None:
    """East, north and east-north [m²] of the ENU covariance (row-major); None where it is not to be trusted."""
    if not isinstance(covariance, (list, tuple, np.ndarray)) or len(covariance) != 9:
        return None
    try:
        east, north = (number({"variance": covariance[at]}, "variance") for at in (0, 4))
    except Rejected:
        return None
    if not (0 < east < math.inf and 0 < north < math.inf):  # false for NaN
        return None
    try:
        both = number({"covariance": covariance[1]}, "covariance")
    except Rejected:
        both = 0.0
    # Some drivers fill in for the mixed term what no covariance can be: then the axes are taken alone.
    return east, north, both if abs(both) < math.sqrt(east) * math.sqrt(north) else 0.0


def odometry(message: Any) -> Odometry:
    pose = inner(inner(message, "pose"), "pose")
    body = inner(inner(message, "twist"), "twist")
    x, y = number(body, "linear", "x"), number(body, "linear", "y")
    speed = math.hypot(x, 0.0 if math.isnan(y) else y)
    return Odometry(
        x_m=finite(pose, "position", "x"),
        y_m=finite(pose, "position", "y"),
        z_m=known(number(pose, "position", "z")),
        yaw_rad=_yaw(pose),
        speed_mps=known(speed),
        frame_id=text(message, "header", "frame_id"),
    )


def _yaw(pose: Any) -> float | None:
    """Yaw in rad, counter-clockwise from the frame's x axis (REP-103), from the pose's quaternion; None where it
    is none."""
    x, y, z, w = (number(pose, "orientation", axis) for axis in "xyzw")
    norm = x * x + y * y + z * z + w * w
    if not 0.5 < norm < 1.5:  # NaN and the all-zero quaternion of drivers without a compass both fall out here
        return None
    return math.atan2(2 * (w * z + x * y), norm - 2 * (y * y + z * z))


def acceleration_of_imu(message: Any) -> Acceleration:
    return Acceleration(acceleration_mps2=_push(finite(message, "linear_acceleration", "x")), source="topic")


def acceleration_of_float(message: Any) -> Acceleration:
    return Acceleration(acceleration_mps2=_push(finite(message, "data")), source="topic")


def _push(value: float) -> float:
    if abs(value) > HARDEST_MPS2:
        raise Rejected("an acceleration beyond any car")
    return value


def heading_of_imu(message: Any) -> Heading:
    """Compass heading from an IMU whose yaw 0 is east (REP-103)."""
    yaw = _yaw(message)
    if yaw is None:
        raise Rejected("orientation is no rotation")
    return Heading(heading_deg=_compass(90 - math.degrees(yaw)), source="topic")


def heading_of_float(message: Any) -> Heading:
    value = finite(message, "data")
    if abs(value) > 720:
        raise Rejected("a heading beyond two turns")
    return Heading(heading_deg=_compass(value), source="topic")


def _compass(degrees: float) -> float:
    return degrees % 360 % 360  # the first alone makes 360 of the smallest angle west of north


def level(message: Any) -> Level:
    return Level(value=_not_below_zero(finite(message, "data")), unit="%")


def battery(message: Any) -> Level:
    """`percentage` is 0 … 1 by definition, and 0 … 100 in many a driver."""
    share = _not_below_zero(finite(message, "percentage"))
    return Level(value=share * 100 if share <= 1.0 else share, unit="%")


def _not_below_zero(value: float) -> float:
    if value < 0:
        raise Rejected("a level below zero")
    return _percent(value)


def command(message: Any) -> MotionCommand:
    """What a controller asks of the car. The real car's angular.z is NaN in every message: unknown, not wrong."""
    speed = known(number(message, "linear", "x"))
    return MotionCommand(
        speed_mps=None if speed is None else _speed(speed), tyre_angle_rad=known(number(message, "angular", "z"))
    )


def command_stamped(message: Any) -> MotionCommand:
    return command(inner(message, "twist"))


def laser_scan(message: Any) -> LaserScan:
    """Ranges in m in the order of the beams; null becomes NaN, and ±Inf are kept where the transport kept them."""
    ranges = numbers(message, "ranges")
    if ranges.size > MAX_BEAMS:
        raise Rejected(f"more than {MAX_BEAMS} beams")
    first, last, increment = (finite(message, f"angle_{name}") for name in ("min", "max", "increment"))
    sweep = max(ranges.size - 1, 1) * abs(increment)
    if max(abs(first), abs(last), sweep) > WIDEST_RAD:
        raise Rejected("angles beyond two turns; they are radians")
    if increment == 0 and ranges.size > 1:
        raise Rejected("angle_increment is zero")
    nearest, farthest = finite(message, "range_min"), number(message, "range_max")
    if math.isnan(farthest) or farthest > FARTHEST_SCAN_M:
        farthest = math.inf  # an open end; JSON cannot say so
    if nearest < 0 or farthest <= nearest:
        raise Rejected("range_min and range_max contradict each other")
    return LaserScan(
        ranges_m=ranges,
        angle_min_rad=first,
        angle_max_rad=last,
        angle_increment_rad=increment,
        time_increment_s=_or_zero(number(message, "time_increment")),
        scan_time_s=_or_zero(number(message, "scan_time")),
        range_min_m=nearest,
        range_max_m=farthest,
        frame_id=text(message, "header", "frame_id"),
    )


def _or_zero(value: float) -> float:
    return value if math.isfinite(value) and value > 0 else 0.0  # 0: not given


def diagnostics(message: Any) -> Diagnostics:
    rows = message.get("status") if isinstance(message, Mapping) else None
    if not isinstance(rows, (list, tuple)):
        raise Rejected("status is not a list")
    if len(rows) > MAX_COMPONENTS:
        raise Rejected(f"more than {MAX_COMPONENTS} components")
    return Diagnostics(
        components=tuple(
            Component(name=text(row, "name", default="unnamed"), level=_level(row), message=text(row, "message"))
            for row in rows
        )
    )


def _level(row: Any) -> int:
    """0 OK, 1 WARN, 2 ERROR, 3 STALE; a `byte` comes as an integer, as base64 or as a character, by version."""
    value = row.get("level") if isinstance(row, Mapping) else None
    if isinstance(value, str):
        if len(value) == 4:
            try:
                raw = base64.b64decode(value, validate=True)
            except (binascii.Error, ValueError):
                raw = b""
            value = raw[0] if len(raw) == 1 else None
        elif len(value) == 1:
            value = int(value) if value in "0123" else ord(value)
    elif isinstance(value, (bytes, bytearray)) and len(value) == 1:
        value = value[0]
    elif isinstance(value, (list, tuple)) and len(value) == 1:
        value = value[0]
    if type(value) is not int or value not in (0, 1, 2, 3):
        raise Rejected("level is not one of OK, WARN, ERROR, STALE")
    return value
