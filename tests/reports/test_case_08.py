"""A battery that is published in percent from 12 down to 0.6: its unit is decided once, and the alarm stands."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.analysis.report import Report, SignalRow
from server.judge.drive import Drive as JudgedDrive
from server.judge.offline import OfflineRun
from server.recording.event_channels import read_recorded_events
from server.recording.read.read import open_recording
from tests.reports.cases import judged, made, raised
from tests.server.recording.bags import Drive, Row, write_ros1

PERCENT = [max(0.6, 12.0 - second * 0.2) for second in range(120)]


def row(report: Report) -> SignalRow:
    return next(row for row in report.signals() if row.name == "fuel")


def level_of(report: Report) -> float | None:
    reading = report.run.snapshot.get("fuel")
    return None if reading is None else reading.value.value


def test_fuel_low_stands_until_the_end() -> None:
    report = judged(made("case_08_battery_percent.py") / "08-battery-percent" / "bag")
    assert raised(report)["fuel_low"] == pytest.approx(16.0, abs=1.0)
    assert [one.cleared_s for one in report.run.episodes if one.alarm_id == "fuel_low"] == [None]
    assert level_of(report) == pytest.approx(0.6)
    assert "published in 0 to 100 %, by its values" in str(row(report).note)


def battery(at_s: float, percentage: float) -> Row:
    return (at_s, "/battery_state", "sensor_msgs/msg/BatteryState", {"percentage": percentage, "present": True})


def bag(folder: Path, numbers: list[float]) -> Path:
    return write_ros1(folder / "b.bag", Drive(messages=[battery(float(n), one) for n, one in enumerate(numbers)]))


DRIVES: dict[str, tuple[list[float], bool, float | None]] = {
    "share, full": ([0.9 - n * 0.001 for n in range(120)], False, 78.1),
    "share, low": ([0.12 - n * 0.001 for n in range(120)], True, 0.1),
    "percent, full": ([90.0 - n * 0.1 for n in range(120)], False, 78.1),
    "percent, through 1": (PERCENT, True, 0.6),
    "percent, charged from below 1": (PERCENT[::-1], True, 12.0),
    "percent, only the last value above 1": ([0.6] * 119 + [3.0], True, 3.0),
    "neither": ([800.0] * 60 + [50.0] * 60, False, None),
}


@pytest.mark.parametrize(("numbers", "is_low", "last"), DRIVES.values(), ids=DRIVES)
def test_the_whole_drive_decides(tmp_path: Path, numbers: list[float], is_low: bool, last: float | None) -> None:
    report = judged(bag(tmp_path, numbers))
    assert ("fuel_low" in raised(report)) is is_low
    assert level_of(report) == (None if last is None else pytest.approx(last))


def test_a_replay_that_begins_at_the_end_has_the_same_unit(tmp_path: Path) -> None:
    with open_recording([bag(tmp_path, PERCENT)]) as recording:
        drive = JudgedDrive(recording, read_recorded_events(recording))
        run = OfflineRun(recording, drive, from_s=100.0)
        run.advance(119.0)
        reading = run.run_state.state.get("fuel")
        assert reading is not None
        assert reading.value.value == pytest.approx(0.6)
