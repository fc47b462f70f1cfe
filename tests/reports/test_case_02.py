"""An odometry whose twist is never filled: the other one is the speed, and alone there is none, with the reason."""

from __future__ import annotations

import pytest

from server.analysis.report import to_choose
from tests.reports.cases import judged, made

GENERATOR, FOLDER = "case_02_odometry_without_twist.py", "02-odometry-without-twist"


@pytest.mark.parametrize("drive", ["both", "lio_sam"])
def test_the_odometry_with_a_twist_is_the_speed(drive: str) -> None:
    report = judged(made(GENERATOR) / FOLDER / f"{drive}.bag")
    row = next(row for row in report.signals() if row.name == "speed")
    assert row.topic == "/odom"
    assert (row.lowest, row.highest) == pytest.approx((0.0, 15.0))


def test_alone_the_speed_is_not_known_and_the_reason_is_given() -> None:
    report = judged(made(GENERATOR) / FOLDER / "lidar-only.bag")
    why = "/Odometry has no speed: its twist is zero while its pose moves"
    row = next(row for row in report.signals() if row.name == "speed")
    assert (row.topic, row.why, row.highest) == (None, why, None)
    assert to_choose(report.run) == [f"Speed: {why}."]
    assert f"Speed: {why}" in {one.why for one in report.run.unchecked}
    odometry = report.run.snapshot.readings["odometry"]
    assert odometry.value.speed_mps is None
    assert odometry.value.x_m > 200.0
