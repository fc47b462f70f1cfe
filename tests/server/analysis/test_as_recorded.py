"""`catgraph check` judges our own recordings as the session did: recorded settings, pauses and phones count."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.analysis.rehearse import Rehearsed, rehearse
from server.judge.active_settings import SettingsOverride
from server.recording.read.read import open_recording
from tests.server.replay.test_recorded_events import event, record, toml

CHANGED = (6.0, "settings", {"toml": toml(5.0), "version": 2, "by": "Anna"})
PAUSED = (10.0, "alarms", event(10.0, "paused", alarm=None, by="Anna"))
RESUMED = (14.0, "alarms", event(14.0, "resumed", alarm=None, by="Anna"))


def judged(path: Path, override: SettingsOverride | None = None) -> Rehearsed:
    with open_recording([path]) as recording:
        return rehearse(recording, override=override)


def changes(found: Rehearsed, alarm: str = "speed_limit") -> list[tuple[str, float]]:
    return [(one.change, round(one.at_s, 1)) for one in found.transitions if one.alarm_id == alarm]


def test_a_recorded_change_of_settings_counts_from_its_moment(tmp_path: Path) -> None:
    found = judged(record(tmp_path / "a.mcap", [CHANGED]))
    assert [change for change, _ in changes(found)] == ["raised"]
    assert changes(found)[0][1] == pytest.approx(6.0, abs=1.2)
    assert found.tuning.limits.speed_limit.max_mps == 5.0
    assert found.override.name == "as recorded"


def test_a_recorded_pause_suppresses(tmp_path: Path) -> None:
    found = judged(record(tmp_path / "a.mcap", [CHANGED, PAUSED, RESUMED]))
    assert [change for change, _ in changes(found)] == ["raised", "suppressed", "unsuppressed"]
    assert [at_s for _, at_s in changes(found)][1:] == pytest.approx([10.0, 14.0], abs=0.11)


def test_a_file_of_settings_replaces_the_recorded_ones(tmp_path: Path) -> None:
    path = record(tmp_path / "a.mcap", [CHANGED, PAUSED, RESUMED])
    assert changes(judged(path, SettingsOverride(name="high.toml", values={"speed_limit.max_mps": 12.0}))) == []
    low = judged(path, SettingsOverride(name="low.toml", values={"speed_limit.max_mps": 4.0}))
    assert changes(low)[0][1] < 2.0
    assert low.override.name == "low.toml"


def test_a_recorded_phone_is_compared_with_the_car(tmp_path: Path) -> None:
    row = {"by": "Anna", "fix": None, "why": "denied", "handheld": True, "phone": "page-7"}
    found = judged(record(tmp_path / "a.mcap", [(at_s, "phone", row) for at_s in range(1, 20)]))
    assert found.snapshot.phone.count == 1


def test_a_recorded_choice_of_the_phone_counts(tmp_path: Path) -> None:
    phone = {"by": "Anna", "fix": None, "why": "denied", "handheld": True}
    rows = [(at_s, "phone", phone | {"phone": name}) for at_s in range(1, 20) for name in ("page-7", "page-8")]
    choice = (5.0, "alarms", event(5.0, "ride", alarm=None, by="Anna", phone="page-8"))
    assert judged(record(tmp_path / "a.mcap", rows)).snapshot.phone.phone == "page-7"
    assert judged(record(tmp_path / "b.mcap", [*rows, choice])).snapshot.phone.phone == "page-8"


def test_a_recorded_setting_that_is_unknown_costs_only_itself(tmp_path: Path) -> None:
    """Another version of catgraph recorded it: everything else that the operator had set still counts."""
    found = judged(record(tmp_path / "a.mcap", [], settings=toml(5.0) + "[limits.not_a_check]\nmax_mps = 1.0\n"))
    assert found.tuning.limits.speed_limit.max_mps == 5.0
    assert [note for note in found.notes if "cannot be used as they are" in note]
