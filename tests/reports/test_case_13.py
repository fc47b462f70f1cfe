"""Components of the car's diagnostics that report seldom are healthy; one that stops is not."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.analysis.report import Report
from tests.reports.cases import judged, made, raised
from tests.server.recording.bags import Drive, Row, write_ros1

ALLOWED = {"not_moving"}  # the car stands


def test_healthy_components_with_their_own_periods_give_no_warning() -> None:
    report = judged(made("case_13_slow_diagnostics.py") / "13-slow-diagnostics" / "slow.bag")
    assert set(raised(report)) <= ALLOWED


def reports(name: str, at_s: list[float], level: int = 0) -> list[Row]:
    fields = {"status": [{"level": level, "name": name, "message": "OK"}]}
    return [(one, "/diagnostics", "diagnostic_msgs/msg/DiagnosticArray", fields) for one in at_s]


def every(period_s: float, until_s: float, from_s: float = 0.0) -> list[float]:
    return [from_s + number * period_s for number in range(int((until_s - from_s) / period_s) + 1)]


def drive(folder: Path, rows: list[Row], length_s: float) -> Report:
    speed: list[Row] = [
        (number / 5, "/vel", "geometry_msgs/msg/Twist", {"linear": {"x": 0.0}}) for number in range(int(5 * length_s))
    ]
    return judged(write_ros1(folder / "diagnostics.bag", Drive(messages=[*speed, *rows])))


@pytest.mark.parametrize("period_s", [10.0, 30.0, 120.0])
def test_a_slow_component_alone_on_the_topic_gives_no_warning(tmp_path: Path, period_s: float) -> None:
    report = drive(tmp_path, reports("disk", every(period_s, 2.5 * period_s, 3.0)), 2.5 * period_s)
    assert set(raised(report)) <= ALLOWED


@pytest.mark.parametrize("period_s", [1.0, 10.0, 20.0])
def test_a_component_that_stops_is_named(tmp_path: Path, period_s: float) -> None:
    last_s = max(5 * period_s, 10.0)
    length_s = last_s + 5 * period_s + 10.0
    rows = [*reports("ekf", every(1.0, length_s)), *reports("disk", every(period_s, last_s))]
    report = drive(tmp_path, rows, length_s)
    assert raised(report)["diagnostics_error"] == pytest.approx(last_s + max(5.0, 3 * period_s), abs=1.5)
    alarm = next(one for one in report.run.episodes if one.alarm_id == "diagnostics_error")
    assert alarm.causes == ("disk",)


@pytest.mark.parametrize("period_s", [1.0, 10.0])
def test_a_topic_that_stops_is_silent(tmp_path: Path, period_s: float) -> None:
    report = drive(tmp_path, reports("disk", every(period_s, 40.0)), 100.0)
    assert raised(report)["signal_stale.diagnostics"] == pytest.approx(40.0 + max(10.0, 3 * period_s), abs=2.5)


def test_what_a_component_reports_is_shown_at_once_and_for_as_long_as_it_holds(tmp_path: Path) -> None:
    rows = [*reports("ekf", every(1.0, 100.0)), *reports("fan", [20.0], level=2)]
    report = drive(tmp_path, rows, 100.0)
    alarm = next(one for one in report.run.episodes if one.alarm_id == "diagnostics_error")
    assert alarm.raised_s == pytest.approx(20.0, abs=0.5)
    assert alarm.cleared_s is None
