"""An IMU that declares its acceleration or its orientation as not measured: both come from what is measured."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest

from server.analysis.report import Report, SignalRow
from tests.reports.cases import judged, made, raised
from tests.server.recording.bags import Drive, Row, write_ros1


def row(report: Report, name: str) -> SignalRow:
    return next(row for row in report.signals() if row.name == name)


def test_a_gyro_has_the_acceleration_of_the_wheels() -> None:
    gyro = judged(made("case_07_imu_minus_one.py") / "07-imu-minus-one" / "gyro-only")
    without = judged(made("case_07_imu_minus_one_2.py") / "07-imu-minus-one" / "without-imu")
    found, expected = row(gyro, "acceleration"), row(without, "acceleration")
    assert (found.lowest, found.highest) == pytest.approx((expected.lowest, expected.highest))
    assert found.highest == pytest.approx(2.25, abs=0.05)
    assert found.note == "2000 of 2000 not measured (linear_acceleration_covariance[0] is -1)"
    assert found.rejected == 0
    assert raised(gyro) == raised(without)


def imu(at_s: float, topic: str, *, acceleration: float = 0.0, orientation: float = 0.0, x: float = 1.0) -> Row:
    """`acceleration` and `orientation` are element 0 of their covariance."""
    fields = {
        "orientation": {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0},
        "orientation_covariance": [orientation, *[0.0] * 8],
        "linear_acceleration": {"x": x},
        "linear_acceleration_covariance": [acceleration, *[0.0] * 8],
    }
    return (at_s, topic, "sensor_msgs/msg/Imu", fields)


def speed(at_s: float, mps: float) -> Row:
    return (at_s, "/vel", "geometry_msgs/msg/Twist", {"linear": {"x": mps}})


def drive(folder: Path, rows: list[Row]) -> Any:
    wheels = [speed(number / 20, 0.5 * number / 20) for number in range(max(200, len(rows)))]
    report = judged(write_ros1(folder / "imu.bag", Drive(messages=[*wheels, *rows])))
    return report, report.run.snapshot.readings.get("acceleration"), report.run.snapshot.readings.get("heading")


@pytest.mark.parametrize(("first", "x"), [(0.0, 1.0), (0.04, 1.0), (-2.0, 1.0), (-1.0, 0.5)])
def test_only_minus_one_is_not_measured(tmp_path: Path, first: float, x: float) -> None:
    _, acceleration, _ = drive(tmp_path, [imu(n / 20, "/imu/data", acceleration=first) for n in range(200)])
    assert acceleration.value.acceleration_mps2 == pytest.approx(x, abs=0.02)
    assert acceleration.derived_from == (None if x == 1.0 else "speed")


def test_what_is_measured_at_first_and_then_no_more_is_derived_again(tmp_path: Path) -> None:
    # The last value is fresh for 10 s: at 5 s its rate is not settled.
    rows = [imu(n / 20, "/imu/data", acceleration=0.0 if n < 100 else -1.0) for n in range(310)]
    report, acceleration, _ = drive(tmp_path, rows)
    assert acceleration.derived_from == "speed"
    assert "signal_unusable.acceleration" not in raised(report)
    assert "signal_stale.acceleration" not in raised(report)


def test_an_imu_without_orientation_has_no_heading(tmp_path: Path) -> None:
    rows = [imu(n / 20, "/heading", orientation=-1.0) for n in range(200)]
    report, _, heading = drive(tmp_path, rows)
    assert heading is None
    assert "200 of 200 not measured (orientation_covariance[0] is -1)" in str(row(report, "heading").note)
    assert "signal_unusable.heading" not in raised(report)


def test_an_imu_with_orientation_has_one(tmp_path: Path) -> None:
    _, _, heading = drive(tmp_path, [imu(n / 20, "/heading") for n in range(200)])
    assert heading.value.heading_deg == pytest.approx(90.0)
