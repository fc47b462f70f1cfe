"""From messages to values: real shapes of ROS 1 and 2, every number a bridge flattens, and whatever else may come."""

from __future__ import annotations

import copy
import dataclasses
import json
import math
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import cbor2
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor.signals import SIGNALS
from monitor.values import (
    Acceleration,
    Bearing,
    Component,
    Diagnostics,
    Distance,
    DriveMode,
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
from server.judge import message_fields, signals
from server.judge.message_fields import Rejected
from server.judge.signals import TOPICS
from server.rosbridge import codec

MESSAGES = Path(__file__).parent / "messages"
NAN, INF = math.nan, math.inf


def message(name: str) -> Any:
    """The msg of a frame as rosbridge sends it, read as the link reads it."""
    operation, _ = codec.decode((MESSAGES / f"{name}.json").read_bytes(), is_binary=False)
    return operation["msg"]


def flat(value: Any) -> dict[str, Any]:
    """A value's fields, arrays as lists, numbers near enough to compare."""
    fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
    for name, field in fields.items():
        if isinstance(field, np.ndarray):
            fields[name] = [None if math.isnan(one) else pytest.approx(one) for one in field.tolist()]
        elif isinstance(field, float):
            fields[name] = pytest.approx(field, abs=1e-6, nan_ok=True)
    return fields


# File without version → the signal it fills, its type, and the value.
SHAPES: dict[str, tuple[str, str, Any]] = {
    "Twist": ("speed", "geometry_msgs/Twist", Twist(speed_mps=4.22, yaw_rate_radps=0.12)),
    "TwistStamped": ("speed", "geometry_msgs/TwistStamped", Twist(speed_mps=-1.5, yaw_rate_radps=-0.05)),
    "Odometry": ("speed", "nav_msgs/Odometry", Twist(speed_mps=4.0001125, yaw_rate_radps=0.01)),
    "Float32": ("speed", "std_msgs/Float32", Twist(speed_mps=14.550000190734863, yaw_rate_radps=None)),
    "Wrench.pedal": ("brake", "geometry_msgs/Wrench", Effort(percent=22.352941513061523)),
    "Float32 ": ("accelerator", "std_msgs/Float32", Effort(percent=14.550000190734863)),
    "Wrench.steering": ("steering", "geometry_msgs/Wrench", Steering(percent=-4.33)),
    "Float64": ("steering", "std_msgs/Float64", Steering(percent=-0.0872664626)),
    "Float32  ": ("distance", "std_msgs/Float32", Distance(distance_m=14.550000190734863, none_in_range=False)),
    "Float64 ": ("bearing", "std_msgs/Float64", Bearing(bearing_rad=-0.0872664626)),
    "NavSatFix": (
        "position",
        "sensor_msgs/NavSatFix",
        GpsFix(
            lat_deg=32.2186,
            lon_deg=-110.939,
            alt_m=716.1,
            status=0,
            covariance_type=2,
            sigma_m=math.sqrt(2.0),
            covariance_m2=(2.25, 1.75, 0.0),
        ),
    ),
    "NavSatFix.zeros": (
        "position",
        "sensor_msgs/NavSatFix",
        GpsFix(lat_deg=32.2186, lon_deg=-110.939, alt_m=716.1, status=0, covariance_type=2, sigma_m=None),
    ),
    "NavSatFix.nofix": (
        "position",
        "sensor_msgs/NavSatFix",
        GpsFix(lat_deg=NAN, lon_deg=NAN, alt_m=None, status=-1, covariance_type=0, sigma_m=None),
    ),
    "Odometry ": (
        "odometry",
        "nav_msgs/Odometry",
        Odometry(
            x_m=505759.7077873536,
            y_m=3564595.323613051,
            z_m=716.1353165926412,
            yaw_rad=math.pi / 2,
            speed_mps=4.0001125,
            frame_id="/odom",
        ),
    ),
    "Imu": ("acceleration", "sensor_msgs/Imu", Acceleration(acceleration_mps2=-1.25, source="topic")),
    "Imu ": ("heading", "sensor_msgs/Imu", Heading(heading_deg=90.0, source="topic")),
    "LaserScan": (
        "scan",
        "sensor_msgs/LaserScan",
        LaserScan(
            ranges_m=np.array([5.25, NAN, 0.05, 80.5, 81.5], dtype=np.float32),
            angle_min_rad=-0.02,
            angle_max_rad=0.02,
            angle_increment_rad=0.01,
            time_increment_s=1.8518e-05,
            scan_time_s=0.013333,
            range_min_m=0.1,
            range_max_m=81.0,
            frame_id="laser",
        ),
    ),
    "DiagnosticArray": (
        "diagnostics",
        "diagnostic_msgs/DiagnosticArray",
        Diagnostics(
            components=(
                Component(name="gps: fix", level=0, message="OK"),
                Component(name="laser: connection", level=2, message="no data"),
                Component(name="laser: rate", level=1, message="slow"),
                Component(name="brake", level=3, message=""),
            )
        ),
    ),
    "Twist.command": ("command", "geometry_msgs/Twist", MotionCommand(speed_mps=2.0, tyre_angle_rad=None)),
    "TwistStamped ": (
        "command",
        "geometry_msgs/TwistStamped",
        MotionCommand(speed_mps=-1.5, tyre_angle_rad=-0.05),
    ),
    "BatteryState": ("fuel", "sensor_msgs/BatteryState", Level(value=0.72, unit="")),
    "Float32   ": ("fuel", "std_msgs/Float32", Level(value=14.550000190734863, unit="")),
    "Bool": ("mode", "std_msgs/Bool", DriveMode(mode="autonomous", text="true")),
    "UInt8": ("mode", "std_msgs/UInt8", DriveMode(mode="unknown", text="1", number=1)),
    "String": ("mode", "std_msgs/String", DriveMode(mode="autonomous", text="autonomous")),
    "ControlModeReport": (
        "mode",
        "autoware_vehicle_msgs/ControlModeReport",
        DriveMode(mode="manual", text="manual"),
    ),
    "ControlModeReport.auto": (
        "mode",
        "autoware_auto_vehicle_msgs/ControlModeReport",
        DriveMode(mode="manual", text="manual"),
    ),
}
DECODERS = {read for row in TOPICS for read in row.types.values()}


def decoder(signal: str, kind: str) -> Callable[[Any], Any]:
    return next(row for row in TOPICS if row.signal == signal).types[kind]


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("name", SHAPES)
def test_a_real_message_of_either_ros(name: str, ros: int) -> None:
    signal, kind, value = SHAPES[name]
    found = decoder(signal, kind)(message(f"{name.strip()}.ros{ros}"))
    assert type(found) is type(value)
    assert flat(found) == flat(value)


def test_every_type_that_is_accepted_has_a_real_message() -> None:
    accepted = {kind for row in TOPICS for kind in row.types}
    assert accepted == {kind for _, kind, _ in SHAPES.values()}
    assert {path.stem for path in MESSAGES.iterdir()} == {f"{n.strip()}.ros{ros}" for n in SHAPES for ros in (1, 2)}


@pytest.mark.parametrize("ros", [1, 2])
@pytest.mark.parametrize("name", ["TwistStamped", "NavSatFix", "Odometry", "Imu", "LaserScan", "DiagnosticArray"])
def test_the_stamp_of_either_ros(name: str, ros: int) -> None:
    assert message_fields.stamp_s(message(f"{name}.ros{ros}")) == pytest.approx(1464818234.3041979, abs=1e-6)


STAMPS: dict[str, Any] = {
    "no message": None,
    "a list": [],
    "no header": {},
    "header null": {"header": None},
    "no stamp": {"header": {}},
    "stamp a number": {"header": {"stamp": 5}},
    "zero": {"header": {"stamp": {"secs": 0, "nsecs": 0}}},
    "half of each": {"header": {"stamp": {"secs": 5, "sec": 5}}},
    "null": {"header": {"stamp": {"secs": None, "nsecs": None}}},
    "floats": {"header": {"stamp": {"secs": 5.0, "nsecs": 0.0}}},
    "bools": {"header": {"stamp": {"secs": True, "nsecs": False}}},
    "before time": {"header": {"stamp": {"sec": -5, "nanosec": 0}}},
    "after all time": {"header": {"stamp": {"sec": 10**12, "nanosec": 0}}},
    "beyond floats": {"header": {"stamp": {"sec": 10**400, "nanosec": 0}}},
    "nanoseconds beyond floats": {"header": {"stamp": {"sec": 5, "nanosec": 10**400}}},
    "nanoseconds beyond a second": {"header": {"stamp": {"sec": 5, "nanosec": 10**9}}},
}


@pytest.mark.parametrize("shape", STAMPS.values(), ids=STAMPS)
def test_no_stamp_is_none(shape: Any) -> None:
    assert message_fields.stamp_s(shape) is None


# -- numbers ---------------------------------------------------------------------------------------------------------

NUMBERS: dict[str, tuple[Any, float | str]] = {
    "a float": (1.5, 1.5),
    "a whole number": (3, 3.0),
    "zero": (0, 0.0),
    "minus zero": (-0.0, 0.0),
    "a numpy number": (np.float32(1.5), 1.5),
    "a numpy whole number": (np.int16(-3), -3.0),
    "null": (None, "data is not a number"),
    "NaN": (NAN, "data is not a number"),
    "infinity": (INF, "data is not a number"),
    "minus infinity": (-INF, "data is not a number"),
    "a numpy NaN": (np.float32(NAN), "data is not a number"),
    "a whole number beyond floats": (10**400, "data is too large"),
    "true": (True, "data is not a number"),
    "false": (False, "data is not a number"),
    "a numpy bool": (np.True_, "data is not a number"),
    "a complex number": (1j, "data is not a number"),
    "a numpy complex number": (np.complex64(1), "data is not a number"),
    "a text": ("1.5", "data is not a number"),
    "the text NaN": ("NaN", "data is not a number"),
    "bytes": (b"1", "data is not a number"),
    "a list": ([1.5], "data is not a number"),
    "an array": (np.array([1.5]), "data is not a number"),
    "an object": ({"data": 1.5}, "data is not a number"),
    "a CBOR undefined": (cbor2.undefined, "data is not a number"),
}


@pytest.mark.parametrize(("given_", "expected"), NUMBERS.values(), ids=NUMBERS)
def test_a_number_is_known_or_refused(given_: Any, expected: float | str) -> None:
    if isinstance(expected, float):
        assert signals.speed.speed_of_float({"data": given_}).speed_mps == expected
    else:
        with pytest.raises(Rejected, match=f"^{expected}$"):
            signals.speed.speed_of_float({"data": given_})


MISSING: dict[str, tuple[Any, str]] = {
    "nothing": (None, "linear.x is missing"),
    "a list": ([], "linear.x is missing"),
    "a number": (5, "linear.x is missing"),
    "empty": ({}, "linear.x is missing"),
    "null": ({"linear": None}, "linear.x is missing"),
    "a number for a vector": ({"linear": 5}, "linear.x is missing"),
    "a vector as a list": ({"linear": [1, 0, 0]}, "linear.x is missing"),
    "no x": ({"linear": {"y": 1}}, "linear.x is missing"),
    "x null": ({"linear": {"x": None}}, "linear.x is not a number"),
    "angular a number": ({"linear": {"x": 1}, "angular": 3}, "angular.z is missing"),
}


@pytest.mark.parametrize(("shape", "why"), MISSING.values(), ids=MISSING)
def test_what_is_missing_is_named(shape: Any, why: str) -> None:
    with pytest.raises(Rejected, match=f"^{re.escape(why)}$"):
        signals.speed.twist(shape)


def test_a_twist_without_a_yaw_rate_is_a_speed() -> None:
    assert signals.speed.twist({"linear": {"x": 1.0}}).yaw_rate_radps is None
    assert signals.speed.twist({"linear": {"x": 1.0}, "angular": {"z": None}}).yaw_rate_radps is None


BOUNDS: dict[str, tuple[Callable[[Any], Any], Any, str | None]] = {
    "the fastest car": (signals.speed.speed_of_float, 150.0, None),
    "backwards": (signals.speed.speed_of_float, -150.0, None),
    "faster than any car, in km/h": (signals.speed.speed_of_float, 540.1, "a speed beyond the range of a car"),
    "faster backwards": (signals.speed.speed_of_float, -1e300, "a speed beyond the range of a car"),
    "a pedal beyond the floor": (signals.pedals.effort_of_float, 101.0, None),
    "a pedal of another unit": (signals.pedals.effort_of_float, 1e5, "a percentage beyond the range of a pedal"),
    "steering of another unit": (signals.steering.steering_of_float, -1e5, "a percentage beyond the range of a pedal"),
    "a crash": (signals.acceleration.acceleration_of_float, -300.0, None),
    "more than a crash": (signals.acceleration.acceleration_of_float, 1e4, "an acceleration beyond the range of a car"),
    "a full turn": (signals.nearest.bearing, -2 * math.pi, None),
    "beyond a full turn": (signals.nearest.bearing, 6.3, "an angle beyond a full turn"),
    "degrees": (signals.nearest.bearing, 90.0, "an angle beyond a full turn"),
    "a distance": (signals.nearest.distance, 0.0, None),
    "a distance below zero": (signals.nearest.distance, -0.1, "a distance below zero"),
    "two turns": (signals.heading.heading_of_float, -720.0, None),
    "beyond two turns": (signals.heading.heading_of_float, 721.0, "a heading beyond two turns"),
    "an empty tank": (signals.fuel.level, 0.0, None),
    "less than empty": (signals.fuel.level, -1.0, "a level below zero"),
}


@pytest.mark.parametrize(("read", "value", "why"), BOUNDS.values(), ids=BOUNDS)
def test_what_no_car_can_be(read: Callable[[Any], Any], value: float, why: str | None) -> None:
    if why is None:
        read({"data": value})
    else:
        with pytest.raises(Rejected, match=f"^{why}$"):
            read({"data": value})


DISTANCES: dict[str, tuple[float, float | None]] = {
    "near": (4.1, 4.1),
    "the real car's laser ends": (81.0, None),
    "as a float32": (float(np.float32(81.0)), None),
    "a hair beside it": (float(np.float32(81.0004)), None),
    "just before it": (80.99, 80.99),
    "the simulator's laser ends": (180.0, None),
    "between the two": (120.0, 120.0),
    "nothing ever seen": (2147483647.0, None),
    "the same as a float32": (float(np.float32(2147483647.0)), None),
    "the largest float32": (float(np.finfo(np.float32).max), None),
    "farther than any sensor": (1000.0, None),
}


@pytest.mark.parametrize(("value", "distance_m"), DISTANCES.values(), ids=DISTANCES)
def test_what_the_distance_estimator_reports_with_nothing_ahead(value: float, distance_m: float | None) -> None:
    found = signals.nearest.distance({"data": value})
    assert found == Distance(distance_m=distance_m, none_in_range=distance_m is None)


TURNS = {"north": (0.0, 0.0), "a full turn": (360.0, 0.0), "west": (-90.0, 270.0), "a hair west": (-1e-20, 0.0)}


@pytest.mark.parametrize(("value", "heading_deg"), TURNS.values(), ids=TURNS)
def test_a_heading_is_within_one_turn(value: float, heading_deg: float) -> None:
    found = signals.heading.heading_of_float({"data": value}).heading_deg
    assert found == pytest.approx(heading_deg)
    assert 0 <= found < 360


def test_an_imu_that_looks_a_hair_west_of_north_is_within_one_turn() -> None:
    yaw = math.nextafter(math.pi / 2, 4)
    imu = {"orientation": {"x": 0.0, "y": 0.0, "z": math.sin(yaw / 2), "w": math.cos(yaw / 2)}}
    assert 0 <= signals.heading.heading_of_imu(imu).heading_deg < 360


def test_an_imu_without_a_compass_has_no_heading() -> None:
    for orientation in ((0, 0, 0, 0), (None,) * 4, (5, 5, 5, 5), (1e200,) * 4):
        with pytest.raises(Rejected, match="not a rotation"):
            signals.heading.heading_of_imu({"orientation": dict(zip("xyzw", orientation, strict=True))})


# -- odometry --------------------------------------------------------------------------------------------------------

WAYS = {
    "forward": (4.0, 0.0, 4.0),
    "backward": (-1.0, 0.0, -1.0),
    "backward with a slip": (-1.0, 0.2, -1.0198),
    "north, as the CATVehicle reports it": (0.03, 4.0, 4.0001),
    "south-west, as the CATVehicle reports it": (-3.0, -4.0, 5.0),
    "no sideways": (2.0, None, 2.0),
    "standing": (0.0, 0.0, 0.0),
}


@pytest.mark.parametrize(("x", "y", "speed_mps"), WAYS.values(), ids=WAYS)
def test_the_speed_of_odometry_is_the_way_made_in_whatever_frame(x: float, y: float | None, speed_mps: float) -> None:
    odometry = message("Odometry.ros1")
    odometry["twist"]["twist"]["linear"] = {"x": x, "y": y, "z": 0.0}
    assert signals.speed.twist_of_odometry(odometry).speed_mps == pytest.approx(speed_mps, abs=1e-4)
    assert signals.odometry.odometry(odometry).speed_mps == pytest.approx(abs(speed_mps), abs=1e-4)


def test_odometry_without_a_pose_or_with_half_a_twist() -> None:
    odometry = message("Odometry.ros2")
    odometry["twist"]["twist"]["linear"]["x"] = None
    assert signals.odometry.odometry(odometry).speed_mps is None
    odometry["pose"]["pose"]["orientation"] = {"x": 0.0, "y": 0.0, "z": 0.0, "w": 0.0}
    assert signals.odometry.odometry(odometry).yaw_rad is None
    odometry["pose"]["pose"]["position"]["x"] = None
    with pytest.raises(Rejected, match=r"^position\.x is not a number$"):
        signals.odometry.odometry(odometry)
    del odometry["pose"]["pose"]
    with pytest.raises(Rejected, match=r"^pose is missing$"):
        signals.odometry.odometry(odometry)


# -- GPS -------------------------------------------------------------------------------------------------------------


def fix(**others: Any) -> dict[str, Any]:
    changed: dict[str, Any] = message("NavSatFix.ros1") | others
    return changed


def covariance(east: Any, north: Any) -> list[Any]:
    return [east, 0, 0, 0, north, 0, 0, 0, 9.0]


SIGMAS: dict[str, tuple[Any, Any, float | None]] = {
    "unknown": (0, covariance(4.0, 4.0), None),
    "approximated": (1, covariance(4.0, 4.0), 2.0),
    "diagonal known": (2, covariance(1.0, 7.0), 2.0),
    "known": (3, covariance(4.0, 4.0), 2.0),
    "a type of its own": (4, covariance(4.0, 4.0), None),
    "type below zero": (-1, covariance(4.0, 4.0), None),
    "type between two": (1.5, covariance(4.0, 4.0), None),
    "type null": (None, covariance(4.0, 4.0), None),
    "zeros": (2, covariance(0.0, 0.0), None),
    "one zero": (2, covariance(4.0, 0.0), None),
    "below zero": (2, covariance(-1.0, 4.0), None),
    "null": (2, [None] * 9, None),
    "bare NaN": (2, [NAN] * 9, None),
    "infinite": (2, covariance(INF, 4.0), None),
    "as large as floats": (2, covariance(1.7e308, 1.7e308), math.sqrt(1.7e308)),
    "beyond floats": (2, covariance(10**400, 4.0), None),
    "texts": (2, ["4.0"] * 9, None),
    "bools": (2, [True] * 9, None),
    "eight numbers": (2, [4.0] * 8, None),
    "no numbers": (2, [], None),
    "no list": (2, None, None),
    "a text": (2, "123456789", None),
    "an array": (2, np.full(9, 4.0), 2.0),
    "an array of float32": (2, np.full(9, 4.0, dtype=np.float32), 2.0),
    "an array of NaN": (2, np.full(9, NAN), None),
    "a table": (2, np.ones((9, 9)), None),
}


@pytest.mark.parametrize(("kind", "numbers", "sigma_m"), SIGMAS.values(), ids=SIGMAS)
def test_covariance_is_trusted_only_where_it_can_be(kind: Any, numbers: Any, sigma_m: float | None) -> None:
    found = signals.position.nav_sat_fix(fix(position_covariance_type=kind, position_covariance=numbers))
    assert found.sigma_m == (None if sigma_m is None else pytest.approx(sigma_m))


@pytest.mark.parametrize(
    ("mixed", "kept"),
    [
        (1.5, 1.5),
        (-1.9, -1.9),
        (2.0, 0.0),  # as much as both: a line, not an ellipse
        (-7.0, 0.0),
        (None, 0.0),
        (NAN, 0.0),
        (INF, 0.0),
        ("1.5", 0.0),
    ],
)
def test_the_ellipse_of_a_fix(mixed: Any, kept: float) -> None:
    numbers = [4.0, mixed, 0, mixed, 1.0, 0, 0, 0, 9.0]
    found = signals.position.nav_sat_fix(fix(position_covariance_type=3, position_covariance=numbers))
    assert found.covariance_m2 == (4.0, 1.0, kept)
    assert found.sigma_m == pytest.approx(math.sqrt(2.5))


def test_a_fix_of_unknown_quality_has_no_ellipse() -> None:
    assert signals.position.nav_sat_fix(fix(position_covariance_type=0)).covariance_m2 is None


STATUSES: dict[str, tuple[Any, int | str]] = {
    "no fix": (-1, -1),
    "a fix": (0, 0),
    "augmented from the ground": (2, 2),
    "unknown, as newer ROS has it": (-2, -2),
    "whole as a float": (1.0, 1),
    "half a status": (0.5, "status.status is not a valid status"),
    "no byte": (128, "status.status is not a valid status"),
    "far from it": (1e300, "status.status is not a valid status"),
    "null": (None, "status.status is not a number"),
    "true": (True, "status.status is not a number"),
}


@pytest.mark.parametrize(("value", "expected"), STATUSES.values(), ids=STATUSES)
def test_the_status_of_a_fix(value: Any, expected: int | str) -> None:
    given_ = fix(status={"status": value, "service": 1})
    if isinstance(expected, int):
        assert signals.position.nav_sat_fix(given_).status == expected
    else:
        with pytest.raises(Rejected, match=f"^{expected}$"):
            signals.position.nav_sat_fix(given_)


PLACES: dict[str, tuple[Any, Any, int, tuple[float, float] | str]] = {
    "Tucson": (32.2, -110.9, 0, (32.2, -110.9)),
    "the north pole": (90.0, 0.0, 0, (90.0, 0.0)),
    "beyond it": (90.001, 0.0, 0, "latitude or longitude out of range"),
    "the date line": (0.0, 180.0, 0, (0.0, 180.0)),
    "the date line from the other side": (0.0, -180.0, 0, (0.0, -180.0)),
    "east all the way round": (0.0, 249.1, 0, (0.0, -110.9)),
    "more than round": (0.0, 361.0, 0, "latitude or longitude out of range"),
    "a number that is none": (None, 0.0, 0, "latitude or longitude is not a number"),
    "the other": (0.0, None, 0, "latitude or longitude is not a number"),
    "no fix, a place": (32.2, -110.9, -1, (32.2, -110.9)),
    "no fix, no place": (None, None, -1, (NAN, NAN)),
    "no fix, half a place": (1e300, None, -1, (NAN, NAN)),
    "no fix, no place on Earth": (1e300, 0.0, -1, (NAN, NAN)),
}


@pytest.mark.parametrize(("lat", "lon", "status", "expected"), PLACES.values(), ids=PLACES)
def test_where_the_car_is(lat: Any, lon: Any, status: int, expected: tuple[float, float] | str) -> None:
    given_ = fix(latitude=lat, longitude=lon, status={"status": status})
    if isinstance(expected, str):
        with pytest.raises(Rejected, match=f"^{expected}$"):
            signals.position.nav_sat_fix(given_)
    else:
        found = signals.position.nav_sat_fix(given_)
        assert (found.lat_deg, found.lon_deg) == pytest.approx(expected, nan_ok=True)


# -- laser -----------------------------------------------------------------------------------------------------------


def scan(ranges: Any, **others: Any) -> dict[str, Any]:
    laser: dict[str, Any] = message("LaserScan.ros1") | {"ranges": ranges} | others
    return laser


def over_cbor(laser: dict[str, Any]) -> Any:
    """As a bridge sends it with `compression: cbor`: arrays of float32 as typed arrays (RFC 8746)."""
    laser["ranges"] = cbor2.CBORTag(85, np.asarray(laser["ranges"], dtype="<f4").tobytes())
    return codec.decode(cbor2.dumps({"op": "publish", "topic": "/scan", "msg": laser}), is_binary=True)[0]["msg"]


def test_cbor_keeps_too_close_and_nothing_apart_json_does_not() -> None:
    kept = signals.scan.laser_scan(over_cbor(scan([1.0, INF, -INF, NAN])))
    assert kept.ranges_m.dtype == np.float32
    assert np.array_equal(kept.ranges_m, np.array([1, INF, -INF, NAN], dtype=np.float32), equal_nan=True)
    flattened = signals.scan.laser_scan(scan([1.0, None, None, None]))
    assert np.array_equal(flattened.ranges_m, np.array([1, NAN, NAN, NAN], dtype=np.float32), equal_nan=True)


ARRAYS: dict[str, tuple[Any, list[float]]] = {
    "none": ([], []),
    "one": ([5.0], [5.0]),
    "whole numbers": ([1, 2], [1.0, 2.0]),
    "only nulls": ([None, None], [NAN, NAN]),
    "farther than a float32": ([1e39, -1e39, 10**39], [INF, -INF, INF]),
    "float64": (np.array([1.5, 1e39]), [1.5, INF]),
    "big-endian": (np.array([1.5, INF], dtype=">f4"), [1.5, INF]),
    "float16": (np.array([1.5], dtype="<f2"), [1.5]),
    "millimetres": (np.array([1500], dtype="<u2"), [1500.0]),
    "a tuple": ((1.0, None), [1.0, NAN]),
}


@pytest.mark.parametrize(("ranges", "expected"), ARRAYS.values(), ids=ARRAYS)
def test_ranges_of_every_kind(ranges: Any, expected: list[float]) -> None:
    found = signals.scan.laser_scan(scan(ranges)).ranges_m
    assert found.dtype == np.float32
    assert np.array_equal(found, np.array(expected, dtype=np.float32), equal_nan=True)


SCANS: dict[str, tuple[dict[str, Any], str | None]] = {
    "the real SICK": (
        scan([5.0] * 181, angle_min=-math.pi / 2, angle_max=math.pi / 2, angle_increment=math.pi / 180),
        None,
    ),
    "its other half": (scan([5.0] * 180, angle_min=-1.562, angle_max=1.562, angle_increment=math.pi / 180), None),
    "a Hokuyo": (scan([5.0] * 681, angle_min=-2.08, angle_max=2.08, angle_increment=0.00613592), None),
    "clockwise": (scan([5.0] * 3, angle_min=0.02, angle_max=-0.02, angle_increment=-0.02), None),
    "all round from the back": (scan([5.0] * 360, angle_min=0.0, angle_max=6.2657, angle_increment=0.0174533), None),
    "as many beams as may be": (scan([5.0] * 65535, angle_increment=1e-4), None),
    "one beam without an angle": (scan([5.0], angle_increment=0.0), None),
    "no beams": (scan([]), None),
    "one beam too many": (scan([5.0] * 65536, angle_increment=1e-4), "more than 65535 beams"),
    "all beams in one": (scan([5.0] * 3, angle_increment=0.0), "angle_increment is zero"),
    "no increment": (scan([5.0] * 3, angle_increment=None), "angle_increment is not a number"),
    "no beginning": (scan([5.0] * 3, angle_min=None), "angle_min is not a number"),
    "degrees": (scan([5.0] * 181, angle_min=-90.0, angle_max=90.0, angle_increment=1.0), "angles beyond two turns"),
    "round and round": (scan([5.0] * 2000, angle_increment=0.1), "angles beyond two turns"),
    "an angle beyond floats of 32 bits": (scan([5.0], angle_min=1e300), "angles beyond two turns"),
    "an increment beyond them": (scan([], angle_increment=1e300), "angles beyond two turns"),
    "nothing may be measured": (scan([5.0], range_min=5.0, range_max=5.0), "range_min and range_max contradict"),
    "the limits changed over": (scan([5.0], range_min=81.0, range_max=0.1), "range_min and range_max contradict"),
    "below zero": (scan([5.0], range_min=-1.0), "range_min and range_max contradict"),
    "no limit below": (scan([5.0], range_min=None), "range_min is not a number"),
    "no limits given": (scan([5.0], range_min=0.0, range_max=0.0), "range_min and range_max contradict"),
    "texts": (scan([5.0, "5.0"]), "ranges holds something that is not a number"),
    "bools": (scan([5.0, True]), "ranges holds something that is not a number"),
    "lists": (scan([[5.0], [5.0]]), "ranges holds something that is not a number"),
    "numbers beyond floats": (scan([10**400]), "ranges holds something that is not a number"),
    "no list": (scan(5.0), "ranges is not a list"),
    "base64": (scan("AAAAAA=="), "ranges is not a list"),
    "an object": (scan({"0": 5.0}), "ranges is not a list"),
    "null": (scan(None), "ranges is missing"),
    "a table": (scan(np.ones((2, 2))), "ranges is not a list"),
    "an array of texts": (scan(np.array(["a"])), "ranges is not a list"),
    "an array of bools": (scan(np.array([True])), "ranges is not a list"),
}


@pytest.mark.parametrize(("laser", "why"), SCANS.values(), ids=SCANS)
def test_a_scan_is_one_or_is_refused(laser: dict[str, Any], why: str | None) -> None:
    if why is None:
        found = signals.scan.laser_scan(laser)
        assert found.beams == len(laser["ranges"])
        assert found.angle_increment_rad == laser["angle_increment"]
    else:
        with pytest.raises(Rejected, match=f"^{why}"):
            signals.scan.laser_scan(laser)


@pytest.mark.parametrize("value", [None, NAN, INF, float(np.finfo(np.float32).max), 1e300])
def test_a_range_without_an_end_is_infinite(value: Any) -> None:
    assert signals.scan.laser_scan(scan([5.0], range_max=value)).range_max_m == INF


@pytest.mark.parametrize("value", [None, NAN, INF, 0, -1.0])
def test_times_that_are_not_given_are_zero(value: Any) -> None:
    found = signals.scan.laser_scan(scan([5.0], time_increment=value, scan_time=value))
    assert (found.time_increment_s, found.scan_time_s) == (0.0, 0.0)


# -- diagnostics -----------------------------------------------------------------------------------------------------

LEVELS: dict[str, tuple[Any, int | None]] = {
    "a number": (2, 2),
    "base64": ("Ag==", 2),
    "base64 of OK": ("AA==", 0),
    "the byte as a character": ("\x02", 2),
    "its digit": ("3", 3),
    "bytes, as CBOR has them": (b"\x01", 1),
    "a list of one": ([1], 1),
    "a level of its own": (4, None),
    "below zero": (-1, None),
    "a float": (2.0, None),
    "true": (True, None),
    "null": (None, None),
    "a name": ("WARN", None),
    "a letter": ("A", None),
    "base64 of two bytes": ("AgI=", None),
    "base64 of a large byte": ("BA==", None),
    "nothing": ("", None),
    "no bytes": (b"", None),
    "two bytes": (b"\x01\x01", None),
    "an empty list": ([], None),
    "a list of two": ([1, 1], None),
    "an object": ({}, None),
    "a letter that is a digit elsewhere": ("²", None),
}


@pytest.mark.parametrize(("value", "level"), LEVELS.values(), ids=LEVELS)
def test_a_level_by_every_spelling_of_a_byte(value: Any, level: int | None) -> None:
    given_ = {"status": [{"name": "gps", "level": value, "message": "m"}]}
    if level is None:
        with pytest.raises(Rejected, match=r"^level is not one of OK, WARN, ERROR, STALE$"):
            signals.diagnostics.diagnostics(given_)
    else:
        assert signals.diagnostics.diagnostics(given_).components == (Component(name="gps", level=level, message="m"),)


def test_diagnostics_of_nothing_and_of_too_much() -> None:
    assert signals.diagnostics.diagnostics({"status": []}).components == ()
    assert len(signals.diagnostics.diagnostics({"status": [{"level": 0}] * 500}).components) == 500
    for rows, why in (
        (None, "not a list"),
        ({}, "not a list"),
        ([{"level": 0}] * 501, "more than 500"),
        ([5], "level"),
    ):
        with pytest.raises(Rejected, match=why):
            signals.diagnostics.diagnostics({"status": rows})


def test_names_and_words_of_any_length_and_kind() -> None:
    rows = [{"level": 0, "name": "n" * 9999, "message": "m" * 9999}, {"level": 1, "name": 5, "message": None}]
    long, odd = signals.diagnostics.diagnostics({"status": rows}).components
    assert (len(long.name), len(long.message)) == (200, 200)
    assert (odd.name, odd.message) == ("unnamed", "")


# -- whatever may come -----------------------------------------------------------------------------------------------

leaves = (
    st.none()
    | st.booleans()
    | st.integers(-(10**20), 10**20)
    | st.sampled_from([0, 1, -1, 2, 10**400, -(10**400), 2**63, NAN, INF, -INF, 1e300, 3.5e38, -0.0])
    | st.floats()
    | st.text(max_size=6)
    | st.sampled_from(["AA==", "Ag==", "NaN", "Infinity"])
    | st.binary(max_size=3)
    | st.sampled_from([np.float32(NAN), np.arange(3.0), np.ones((2, 2)), np.array(["a"]), cbor2.undefined])
)
anything = st.recursive(
    leaves,
    lambda inner: (
        st.lists(inner, max_size=10)
        | st.dictionaries(st.sampled_from(["x", "y", "z", "w", "data", "linear", "status", "header", "stamp"]), inner)
    ),
    max_leaves=15,
)


def is_proper(value: Any) -> None:
    """Whatever was accepted has a headline that is a finite number or honestly unknown, and can be encoded as JSON."""
    for field in dataclasses.fields(value):
        one = getattr(value, field.name)
        if isinstance(one, float) and not (isinstance(value, LaserScan) and field.name == "range_max_m"):
            is_no_place = isinstance(value, GpsFix) and value.status < 0 and field.name in ("lat_deg", "lon_deg")
            assert math.isfinite(one) or is_no_place, field.name
        if isinstance(one, int):
            assert abs(one) < 2**53
        if isinstance(one, str):
            assert len(one) <= 200
    if isinstance(value, LaserScan):
        assert value.ranges_m.ndim == 1
        assert value.ranges_m.dtype == np.float32


@settings(deadline=None)
@given(given_=anything)
def test_anything_at_all_is_a_proper_value_or_rejected(given_: Any) -> None:
    for read in DECODERS:
        refused_or_proper(read, given_)


def refused_or_proper(read: Callable[[Any], Any], given_: Any) -> None:
    message_fields.stamp_s(given_)
    try:
        value = read(given_)
    except Rejected as error:
        why = str(error)
    else:
        is_proper(value)
        return
    assert 0 < len(why) < 80


FILES = sorted(path.stem for path in MESSAGES.iterdir())


@settings(max_examples=300, deadline=None)
@given(data=st.data())
def test_a_real_message_with_anything_in_a_place_of_it(data: st.DataObject) -> None:
    """Nearly right is what a decoder is likeliest to stumble over."""
    name = data.draw(st.sampled_from(FILES))
    signal, kind, _ = next(row for shape, row in SHAPES.items() if shape.strip() == name.rpartition(".")[0])
    given_ = copy.deepcopy(REAL[name])
    place = given_
    while True:
        keys = list(place) if isinstance(place, dict) else list(range(len(place)))
        key = data.draw(st.sampled_from(keys))
        inner = place[key]
        if not isinstance(inner, (dict, list)) or not inner or data.draw(st.integers(0, 3)) == 0:
            break
        place = inner
    if isinstance(place, dict) and data.draw(st.booleans()):
        del place[key]
    else:
        place[key] = data.draw(leaves | st.lists(leaves, max_size=9) | st.just({}))
    refused_or_proper(decoder(signal, kind), given_)


REAL = {name: message(name) for name in FILES}


def test_headlines_are_fields_of_their_values() -> None:
    for signal, kind, value in SHAPES.values():
        headline = SIGNALS[signal].headline
        assert headline is None or hasattr(value, headline), kind


def test_the_fixtures_are_as_rosbridge_writes_them() -> None:
    """Stamps, `seq` and `byte` by version; only ROS 2 writes bare NaN."""
    for name in FILES:
        raw = (MESSAGES / f"{name}.json").read_text()
        assert ('"secs"' in raw, '"seq"' in raw) == (
            (True, True) if name.endswith("1") and "header" in raw else (False,) * 2
        )
        assert "NaN" not in raw or name.endswith("ros2")
        assert json.loads(raw)["op"] == "publish"
