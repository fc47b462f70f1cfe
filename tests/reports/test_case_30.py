"""A topic of a usual name and a type that cannot be read, beside a good odometry: the odometry is the speed."""

from __future__ import annotations

import pytest

from tests.reports.cases import judged, made, raised


def test_a_readable_source_beats_an_unreadable_one_of_a_better_name() -> None:
    report = judged(made("case_30_twist_with_covariance.py") / "30-twist-with-covariance" / "bag")
    row = next(row for row in report.signals() if row.name == "speed")
    assert row.topic == "/odom"
    assert row.highest == pytest.approx(15.0, abs=0.2)
    assert "speed_limit" in raised(report)
