"""A GPS driver's /vel in east and north: the wheels are the speed, or the way made where there is nothing else."""

from __future__ import annotations

import math
from pathlib import Path

import pytest

from tests.reports.cases import judged, made
from tests.server.recording.bags import Drive, Row, write_ros1

MPS = 15.0
FOLDER = "01-nmea-vel"


@pytest.mark.parametrize("course", ["000", "090", "180", "270"])
def test_beside_the_wheels_a_velocity_in_east_and_north_is_not_the_speed(course: str) -> None:
    report = judged(made("case_01_nmea_vel.py") / FOLDER / f"course{course}.bag")
    row = next(row for row in report.signals() if row.name == "speed")
    assert (row.topic, row.why) == ("/odom", "the only speed along the car")
    assert (row.lowest, row.highest) == pytest.approx((0.0, MPS))
    assert not {"gps_drift", "gps_jump"} & {one.alarm_id for one in report.run.episodes}


def test_alone_it_is_the_way_made() -> None:
    report = judged(made("case_01_nmea_vel.py") / FOLDER / "course000-without-odom.bag")
    row = next(row for row in report.signals() if row.name == "speed")
    assert row.topic == "/vel"
    assert row.highest == pytest.approx(MPS)
    assert row.note == "its velocity is east and north: the way made, without a sign"


def vel(at_s: float, mps: float, course_deg: float, frame: str) -> Row:
    course = math.radians(course_deg)
    linear = {"x": mps * math.sin(course), "y": mps * math.cos(course), "z": 0.0}
    header = {"seq": 0, "stamp": {"sec": int(at_s), "nanosec": 0}, "frame_id": frame}
    twist = {"linear": linear, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}
    return (at_s, "/vel", "geometry_msgs/msg/TwistStamped", {"header": header, "twist": twist})


@pytest.mark.parametrize("course_deg", [0.0, 45.0, 90.0, 180.0, 260.0, 270.0])
@pytest.mark.parametrize("frame", ["gps", "gnss_link", "navsat", "map", "gps0", "GPS_antenna"])
def test_alone_in_a_frame_of_the_earth_it_is_never_negative(tmp_path: Path, course_deg: float, frame: str) -> None:
    rows = [vel(n / 10, min(MPS, n / 10), course_deg, frame) for n in range(200)]
    report = judged(write_ros1(tmp_path / "vel.bag", Drive(messages=rows)))
    row = next(row for row in report.signals() if row.name == "speed")
    assert (row.lowest, row.highest) == pytest.approx((0.0, MPS))


def test_in_the_frame_of_the_car_reversing_stays_negative(tmp_path: Path) -> None:
    rows = [vel(n / 10, -2.0, 90.0, "base_link") for n in range(100)]
    report = judged(write_ros1(tmp_path / "vel.bag", Drive(messages=rows)))
    row = next(row for row in report.signals() if row.name == "speed")
    assert row.highest == pytest.approx(-2.0)
