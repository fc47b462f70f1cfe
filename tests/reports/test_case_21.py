"""Pedals as plain numbers from 0 to 1: their unit is requested, and with the answer both fully down alarm."""

from __future__ import annotations

import zipfile
from pathlib import Path

import pytest

from server.analysis import summary
from server.analysis.rehearse import rehearse
from server.analysis.report import Report
from server.analysis.thresholds import read_override
from server.judge.active_settings import SettingsOverride
from server.judge.drive import Drive as JudgedDrive
from server.judge.offline import OfflineRun
from server.recording.event_channels import read_recorded_events
from server.recording.export.formats.csv_zip import write_csv_zip
from server.recording.read.read import open_recording
from server.replay import replay_frames
from tests.reports.cases import judged, made, raised
from tests.server.recording.bags import Drive, Row, write_ros1
from tests.server.recording.export.ours import as_ours

UNKNOWN = "unit unknown: 0 to 1 or 0 to 100 %"


@pytest.fixture(scope="module")
def bag() -> Path:
    return made("case_21_pedals_of_one.py") / "21-pedals-of-one" / "pedals.bag"


def checked(path: Path, **units: str) -> Report:
    with open_recording([path]) as recording:
        run = rehearse(recording, override=SettingsOverride(units=units))
        return Report(files=[str(path)], recording=recording, run=run)


def never_checked(report: Report) -> dict[str, str]:
    return {one.check_id: one.why for one in report.run.unchecked}


def test_without_an_answer_the_pedals_are_never_checked_and_the_report_has_the_question(bag: Path) -> None:
    report = judged(bag)
    assert never_checked(report)["pedals"] == f"Brake: {UNKNOWN}"
    text = summary.text(report)
    assert 'Choose it in the file for --settings: [units] brake = "share" or "percent".' in text
    assert 'Choose it in the file for --settings: [units] accelerator = "share" or "percent".' in text
    assert all(row.lowest is None for row in report.signals() if row.name in ("brake", "accelerator"))
    assert "signal_unusable.brake" not in raised(report)


def test_the_answer_in_a_file_is_enough_for_the_alarm(bag: Path, tmp_path: Path) -> None:
    file = tmp_path / "units.toml"
    file.write_text('[units]\nbrake = "share"\naccelerator = "share"\n', encoding="utf-8")
    with open_recording([bag]) as recording:
        run = rehearse(recording, override=read_override(file))
    episode = next(one for one in run.episodes if one.alarm_id == "pedals")
    assert episode.raised_s == pytest.approx(12.35, abs=0.1)
    assert episode.worst is not None
    assert episode.worst.text == "Brake 100 %, accelerator 100 %"


def test_as_percent_they_are_hardly_pressed(bag: Path) -> None:
    report = checked(bag, brake="percent", accelerator="percent")
    assert "pedals" not in raised(report)
    assert "pedals" not in never_checked(report)


def test_one_answer_of_two_is_not_enough(bag: Path) -> None:
    assert never_checked(checked(bag, brake="share"))["pedals"] == f"Accelerator: {UNKNOWN}"


@pytest.mark.parametrize("from_s", [0.0, 2.0, 13.0])
def test_a_replay_has_the_question_wherever_it_begins(bag: Path, from_s: float) -> None:
    with open_recording([bag]) as recording:
        run = OfflineRun(recording, JudgedDrive(recording, read_recorded_events(recording)), from_s=from_s)
        run.advance(from_s + 1.0)
        shown = replay_frames.frame(run, vehicle="car", name="x", settings_version=1, track_number=1)
    brake = shown["signals"]["brake"]
    assert (brake["freshness"], brake["value"], brake["unit"], brake["note"]) == ("not_measured", None, "", UNKNOWN)
    assert [(one["signal"], one["kind"]) for one in shown["questions"]] == [("brake", "unit"), ("accelerator", "unit")]
    assert [one["value"] for one in shown["questions"][0]["options"]] == ["share", "percent"]
    assert shown["questions"][0]["options"][0]["why"] == "highest so far 100 % (1 as published)"


def pedals(folder: Path, numbers: list[float]) -> Path:
    rows: list[Row] = []
    for n, number in enumerate(numbers):
        rows += [(n / 20, f"/{name}", "std_msgs/msg/Float32", {"data": number}) for name in ("brake", "throttle")]
        rows.append((n / 20, "/vel", "geometry_msgs/msg/Twist", {"linear": {"x": 3.0 + n % 2}}))
    return write_ros1(folder / "pedals.bag", Drive(messages=rows))


OTHERS: dict[str, tuple[list[float], str]] = {
    "percent, Nm or bar": ([0.0] * 40 + [0.4, 0.8] + [60.0] * 80, "0 to 100 % or Nm or bar"),
    "the same, late": ([0.5] * 100 + [60.0] * 60, "0 to 100 % or Nm or bar"),
    "newton metres": ([0.0] * 40 + [60.0] * 60 + [220.0] * 60, "Nm or bar"),
    "two publishers": ([0.3, 30.0] * 80, "values of two units alternate, as of two publishers on one topic"),
    "below zero": ([-1.0, 1.0] * 60, "values below zero"),
}


@pytest.mark.parametrize(("numbers", "why"), OTHERS.values(), ids=OTHERS)
def test_other_units_of_pedals(tmp_path: Path, numbers: list[float], why: str) -> None:
    report = judged(pedals(tmp_path, numbers))
    assert "pedals" not in raised(report)
    assert never_checked(report)["pedals"] == f"Brake: unit unknown: {why}"


def test_a_brake_in_nm_is_not_checked_and_the_report_names_the_reason(tmp_path: Path) -> None:
    report = checked(pedals(tmp_path, [0.0] * 40 + [60.0] * 80), brake="nm", accelerator="percent")
    reason = "in Nm, which cannot be converted to %"
    assert "pedals" not in raised(report)
    assert never_checked(report)["pedals"] == f"Brake: {reason}"
    assert f"Brake (/brake): {reason}. It is not evaluated." in summary.text(report)


def test_pedals_that_rest_are_checked(tmp_path: Path) -> None:
    report = judged(pedals(tmp_path, [0.0] * 100))
    assert "pedals" not in never_checked(report)
    assert not [note for note in report.run.notes if "unit" in note]


def exported(bag: Path, into: Path) -> tuple[dict[str, list[str]], list[str]]:
    """The lines of each file of the export, and its notes."""
    with open_recording([bag]) as recording:
        outcome = write_csv_zip(recording, into)
    with zipfile.ZipFile(into) as packed:
        files = {name: packed.read(name).decode().splitlines() for name in packed.namelist()}
    return files, [*outcome.notes, *outcome.notices]


def test_an_export_has_the_numbers_and_reports_that_their_unit_is_unknown(bag: Path, tmp_path: Path) -> None:
    files, notes = exported(bag, tmp_path / "pedals.zip")
    lines = files["brake-unit-unknown.csv"]
    assert lines[0].endswith(",as published [unit unknown]")
    assert len(lines) == 601
    assert lines[300].endswith(",1.0")
    assert "brake.csv" not in files
    assert f"600 of 600 messages for brake: {UNKNOWN}." in notes
    assert "their unit is not known" in "\n".join(files["README.txt"])


def test_an_export_names_the_unit_that_the_operator_chose(tmp_path: Path) -> None:
    bag = pedals(tmp_path, [0.0] * 40 + [60.0] * 80)
    chosen = '[units]\nbrake = "nm"\n'
    ours = as_ours(bag, tmp_path / "ours.mcap", settings=chosen)
    files, _ = exported(ours, tmp_path / "pedals.zip")
    lines = files["brake-in-nm.csv"]
    assert lines[0].endswith(",as published [Nm]")
    assert [line.rsplit(",", 1)[1] for line in (lines[1], lines[-1])] == ["0.0", "60.0"]
    assert "brake-unit-unknown.csv" not in files
    assert "Brake, the numbers as they were published: in Nm." in "\n".join(files["README.txt"])


def test_an_export_in_a_decided_unit_is_in_the_unit_of_the_signal(tmp_path: Path) -> None:
    battery = "sensor_msgs/msg/BatteryState"
    rows: list[Row] = [
        (n / 20, "/battery_state", battery, {"present": True, "percentage": one}) for n, one in enumerate([0.5, 60.0])
    ]
    files, _ = exported(write_ros1(tmp_path / "battery.bag", Drive(messages=rows)), tmp_path / "battery.zip")
    assert [line.rsplit(",", 2)[1] for line in files["fuel.csv"]] == ["level", "0.5", "60.0"]
    assert "fuel-unit-unknown.csv" not in files
