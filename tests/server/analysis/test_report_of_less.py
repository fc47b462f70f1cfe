"""The drive's report where a file lacks its end, or more."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from server.analysis.drive import sheet
from server.analysis.drive.axis import dated_time
from server.analysis.drive.drive_report import write_drive_page
from server.analysis.drive.tables import write_report_json
from server.recording.read.read import open_recording
from tests.server.analysis.test_drive_report import text_of
from tests.server.recording.drive.story import BEGIN_MS, recorded


@pytest.mark.parametrize("has_next", [False, True])
def test_a_part_without_its_end_is_a_time_without_a_record(tmp_path: Path, has_next: bool) -> None:
    first = recorded(tmp_path, [], name="s1.mcap", length_s=60.0, session="s1")
    raw = first.read_bytes()
    first.write_bytes(raw[: len(raw) * 2 // 3])
    paths = [first]
    if has_next:
        paths.append(recorded(tmp_path, [], name="s1_p2.mcap", from_s=90.0, length_s=10.0, session="s1", part="2"))
    with open_recording(paths) as recording:
        write_drive_page(recording, tmp_path / "page.html", name="drive")
        write_report_json(recording, tmp_path / "report.json", name="drive")
        cut_ms = round(recording.files[0].end_ns / 1e6)
    text = text_of(tmp_path / "page.html")
    assert "Alarms, time to acknowledge none in what was recorded" in text
    (one,) = json.loads((tmp_path / "report.json").read_text())["no_record"]
    assert BEGIN_MS + 10_000 < one["from_ms"] < BEGIN_MS + 50_000
    assert one["from_ms"] == pytest.approx(cut_ms, abs=1)
    assert one["to_ms"] == (BEGIN_MS + 90_000 if has_next else None)


def test_where_a_file_lacks_more_than_a_time_nothing_is_said_to_be_none(tmp_path: Path) -> None:
    whole: dict[str, Any] = {"no_record": [], "damage": [], "chain": [{"is_broken": False}]}
    assert not sheet._is_partial(whole)
    for name, value in (("no_record", [{}]), ("damage", ["s1_p2.mcap is missing"]), ("chain", [{"is_broken": True}])):
        assert sheet._is_partial(whole | {name: value}), name


def test_a_time_of_another_day_names_the_day() -> None:
    assert dated_time(BEGIN_MS + 1000, BEGIN_MS) == "22:13:21"
    assert dated_time(BEGIN_MS + 7_200_000, BEGIN_MS) == "15 Nov 2023, 00:13:20"
    assert dated_time(1e20, BEGIN_MS) == "–"
