"""Recorded drives whose sources agree or not, judged as `catgraph check` does."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from monitor.check import Verdict
from server.analysis.report import Report
from tests.reports.cases import judged
from tests.server.recording.bags import Drive, Row, write_ros1, write_ros2

OWN = {"speed_sources", "position_receiver", "position_sources", "gps_drift", "gps_jump"}
SECONDS = 40


def trip(t: float) -> float:
    """Stands for 8 s, speeds up to 15 m/s, brakes from 28 s on, stands."""
    return max(0.0, min(15.0, 3.0 * (t - 8.0), 15.0 - 3.0 * (t - 28.0)))


Way = Callable[[float], float]


def drive(
    *,
    wheels: Way | None = trip,
    truth: Way = trip,
    sigma_m: float = 0.3,
    filtered: bool = False,
    status: Callable[[float], int] = lambda t: 0,
    velocity: bool = False,
    odometry: Way | None = None,
) -> list[Row]:
    """Wheels on /vehicle/twist at 20 Hz, a receiver on /gps/fix at 5 Hz and what else there may be; northwards."""
    noise, way_m, odometry_m = random.Random(3), 0.0, 0.0
    rows: list[Row] = []
    for step in range(SECONDS * 20):
        t = step / 20
        way_m += truth(t) / 20
        if wheels is not None:
            mps = wheels(t)
            rows.append(
                (t, "/vehicle/twist", "geometry_msgs/msg/Twist", {"linear": {"x": mps + 0.01 * math.sin(step)}})
            )
        if step % 4 == 0:
            north = way_m + noise.gauss(0.0, 0.03)
            rows.append((t + 0.001, "/gps/fix", "sensor_msgs/msg/NavSatFix", fix(north, sigma_m, status(t))))
            if velocity:
                rows.append(
                    (t + 0.002, "/gps/vel", "geometry_msgs/msg/TwistStamped", {"twist": {"linear": {"y": truth(t)}}})
                )
        if filtered and step % 2 == 0:
            rows.append((t + 0.003, "/fix", "sensor_msgs/msg/NavSatFix", fix(way_m, sigma_m, 0)))
        if odometry is not None:
            odometry_m += odometry(t) / 20
            pose = {"pose": {"position": {"x": odometry_m}, "orientation": {"w": 1.0}}}
            rows.append((t + 0.004, "/lio", "nav_msgs/msg/Odometry", {"pose": pose, "child_frame_id": "base"}))
    return rows


def fix(north_m: float, sigma_m: float, status: int) -> dict[str, Any]:
    variance = sigma_m**2
    return {
        "status": {"status": status},
        "latitude": 48.2 + math.degrees(north_m / 6_370_000.0),
        "longitude": 11.5,
        "position_covariance": [variance, 0.0, 0.0, 0.0, variance, 0.0, 0.0, 0.0, variance],
        "position_covariance_type": 2,
    }


def check(folder: Path, rows: list[Row]) -> tuple[Report, list[str]]:
    report = judged(write_ros1(folder / "drive.bag", Drive(messages=rows)))
    return report, [one.alarm_id for one in report.run.transitions if one.announces and one.alarm_id in OWN]


def texts(report: Report, alarm: str) -> list[str]:
    return [one.text for one in report.run.transitions if one.announces and one.alarm_id == alarm]


@pytest.mark.parametrize(
    "made",
    [
        {},
        {"velocity": True, "odometry": trip, "filtered": True},  # a velocity in east and north; a twist nobody fills
        {"wheels": lambda t: -trip(t)},  # reversing
        {"status": lambda t: -1 if 14.0 < t < 20.0 else 0},  # a tunnel
        {"sigma_m": 5.0},
        {"wheels": lambda t: 0.0, "truth": lambda t: 0.0},
    ],
)
def test_a_healthy_drive_raises_none_of_them(tmp_path: Path, made: dict[str, Any]) -> None:
    report, raised = check(tmp_path, drive(**made))
    assert raised == []
    (agree,) = (timeline for timeline in report.run.timelines if timeline.label == "Speeds agree")
    assert (agree.seconds(Verdict.OK) > 20.0) is ("sigma_m" not in made)  # too poor to compare
    assert report.run.crashes == ()


def test_wheels_that_stay_at_zero_are_contradicted_by_the_position(tmp_path: Path) -> None:
    report, raised = check(tmp_path, drive(wheels=lambda t: 0.0))
    assert raised == ["speed_sources"]
    (text,) = texts(report, "speed_sources")
    assert text.startswith("Speed 0.0 m/s by /vehicle/twist, but ")
    assert text.endswith(" m/s by GPS")


def test_without_a_fix_another_odometry_contradicts_them(tmp_path: Path) -> None:
    rows = drive(wheels=lambda t: 0.0, status=lambda t: -1, odometry=trip)
    report, raised = check(tmp_path, rows)
    assert raised == ["speed_sources"]
    assert texts(report, "speed_sources")[0].endswith(" m/s by the poses of /lio")


def test_a_fix_lost_at_the_receiver_is_noticed_behind_the_filter(tmp_path: Path) -> None:
    report, raised = check(tmp_path, drive(filtered=True, status=lambda t: -1 if 14.0 < t < 25.0 else 0))
    assert raised == ["position_receiver"]
    assert texts(report, "position_receiver") == ["No fix at /gps/fix; the position of /fix continues without it"]


def test_a_receiver_that_dies_is_noticed(tmp_path: Path) -> None:
    rows = [row for row in drive(filtered=True) if row[1] != "/gps/fix" or row[0] < 12.0]
    report, raised = check(tmp_path, rows)
    assert raised == ["position_receiver"]
    assert "Nothing from /gps/fix for " in texts(report, "position_receiver")[0]


def test_a_filter_that_parts_from_its_receiver_is_noticed(tmp_path: Path) -> None:
    rows = [
        (t, topic, kind, message | {"longitude": 11.5 + 2.5e-5 * min(20.0, max(0.0, t - 12.0))})
        if topic == "/fix"
        else (t, topic, kind, message)
        for t, topic, kind, message in drive(filtered=True)
    ]
    _, raised = check(tmp_path, rows)
    assert raised == ["position_sources"]


def test_where_there_is_one_source_it_is_not_checked(tmp_path: Path) -> None:
    rows = [row for row in drive() if row[1] == "/vehicle/twist"]
    report, raised = check(tmp_path, rows)
    assert raised == []
    (agree,) = (timeline for timeline in report.run.timelines if timeline.label == "Speeds agree")
    assert agree.seconds(Verdict.OK) == 0.0


def test_a_bag_of_ros_2_is_judged_alike(tmp_path: Path) -> None:
    report = judged(write_ros2(tmp_path / "drive", Drive(messages=drive(wheels=lambda t: 0.0))))
    assert [one.alarm_id for one in report.run.transitions if one.announces and one.alarm_id in OWN] == [
        "speed_sources"
    ]
