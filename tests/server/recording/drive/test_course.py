"""The course of a drive: even steps of distance and of time, nothing in a gap."""

from __future__ import annotations

from pathlib import Path

import pytest

from server.protocol.marks import DriveMark
from server.recording.drive.course import course_of, with_marks
from server.recording.drive.facts import read_facts
from server.recording.read.read import open_recording
from tests.server.recording.drive.story import LOST_S, METRE_DEG, SPEED_MPS, recorded


def test_it_is_where_the_car_was(tmp_path: Path) -> None:
    with open_recording([recorded(tmp_path)]) as recording:
        found = course_of(read_facts(recording))
    way, time = found["way"], found["time"]
    assert found["step_m"] == pytest.approx(2.0, abs=0.1)
    for at_s in (20.0, 50.0, 100.0):
        i = min(range(len(time["t"])), key=lambda n: abs(time["t"][n] - at_s))
        lon, metres = time["lon"][i], time["m"][i]
        assert lon is not None
        assert metres is not None
        assert lon / METRE_DEG == pytest.approx(time["t"][i] * SPEED_MPS, abs=0.5)
        assert metres == pytest.approx(time["t"][i] * SPEED_MPS, abs=6)  # its smoothing begins half a second late
        assert time["speed"][i] == SPEED_MPS
    lost = [i for i, at_s in enumerate(way["t"]) if LOST_S[0] + 1.1 < at_s < LOST_S[1] - 0.1]
    assert len(lost) > 10
    assert {way["speed"][i] for i in lost} == {None}
    assert {way["lat"][i] for i in lost} == {None}
    assert [(one["kind"], one["t"]) for one in found["events"]] == [
        ("critical", 20.0),
        ("mark", 33.33),
        ("warning", 45.0),
        ("mark", 50.0),
        ("intervention", 80.0),
    ]


def test_marks_that_came_later_are_on_the_way(tmp_path: Path) -> None:
    with open_recording([recorded(tmp_path)]) as recording:
        found = course_of(read_facts(recording))
    rows: list[DriveMark] = [
        {
            "mark": name, "marked_ms": found["start_ms"] + at_ms, "category": None, "words": name, "voice": False,
            "photo": False, "source": "page", "by": None,
        }
        for name, at_ms in (("late", 30_000), ("elsewhere", 999_000))
    ]  # fmt: skip
    marks = [event for event in with_marks(found, rows)["events"] if event["kind"] == "mark"]
    assert [(event["t"], event["text"]) for event in marks] == [(30.0, "late")]
    assert marks[0]["m"] == pytest.approx(300, abs=5)
