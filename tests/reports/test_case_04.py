"""Case 04: a laser mounted backwards or upside down, as its transforms show."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.analysis.report import Report
from tests.reports.cases import judged, made, raised

NOTES = {
    "forwards": "by the car's transforms looking ahead, 0.30 m ahead of base_link",
    "backwards": "by the car's transforms turned by 180°, 0.30 m ahead of base_link",
    "upside-down": "by the car's transforms looking ahead, upside down, 0.30 m ahead of base_link",
}


@pytest.fixture(scope="module")
def bags() -> Path:
    return made("case_04_laser_mounted_backwards.py") / "04-laser-mounted-backwards"


def obstacle(report: Report) -> str | None:
    """The text with which an obstacle was announced first."""
    return next((one.trip_text for one in report.run.episodes if one.alarm_id == "obstacle"), None)


def note_of(report: Report) -> str | None:
    return next(row.note for row in report.signals() if row.name == "scan")


@pytest.mark.parametrize("name", NOTES)
def test_the_post_ahead_alarms_however_the_laser_is_mounted(bags: Path, name: str) -> None:
    report = judged(bags / f"{name}.bag")
    assert raised(report)["obstacle"] == pytest.approx(19.3, abs=0.2)
    text = obstacle(report) or ""
    assert text.startswith("Obstacle 4.9 m ahead, 5.0 m needed")
    assert "assumed" not in text
    assert (note_of(report) or "").endswith(NOTES[name])


def test_a_wall_behind_is_not_called_ahead(bags: Path) -> None:
    report = judged(bags / "backwards-wall-behind.bag")
    assert obstacle(report) is None


def test_what_stands_on_the_left_is_called_left_though_the_laser_is_upside_down(bags: Path) -> None:
    text = obstacle(judged(bags / "upside-down-post-left.bag")) or ""
    assert "° left" in text
    assert "right" not in text
