"""Two lasers: without TF none is taken, and the operator is prompted; with the answer the pallet ahead alarms."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.analysis.check_recording import CANNOT, CRITICAL, CheckOptions, check_recording
from server.analysis.thresholds import read_override
from tests.reports.cases import judged, made, raised

GENERATOR, FOLDER = "case_03_back_laser_first.py", "03-back-laser-first"
FRONT, BACK = "/front_2d_lidar/scan", "/back_2d_lidar/scan"


def drive(name: str) -> Path:
    return made(GENERATOR) / FOLDER / name


@pytest.mark.parametrize("name", ["object-ahead", "dock-behind"])
def test_without_tf_no_laser_is_taken_and_the_operator_is_prompted(name: str) -> None:
    report = judged(drive(name))
    assert "scan" not in report.run.sources
    (question,) = report.run.questions
    assert (question["signal"], question["words"]) == ("scan", "Two lasers: which one faces forward?")
    assert [one["value"] for one in question["options"]] == [FRONT, BACK]
    assert "obstacle" not in raised(report)
    (why,) = {one.why for one in report.run.unchecked if one.check_id == "obstacle"}
    assert why == "Laser: two lasers, none chosen"


def test_the_check_is_not_done_until_it_is_answered(tmp_path: Path) -> None:
    checked = check_recording([drive("object-ahead")], CheckOptions(), lambda *_: None)
    assert checked.code == CANNOT
    assert f'[topics] scan = "{FRONT}"' in checked.errors[0]
    settings = tmp_path / "settings.toml"
    settings.write_text(f'[topics]\nscan = "{FRONT}"\n')
    answered = CheckOptions(overrides=[read_override(settings)])
    assert check_recording([drive("object-ahead")], answered, lambda *_: None).code == CRITICAL
    assert check_recording([drive("dock-behind")], answered, lambda *_: None).code == 0
