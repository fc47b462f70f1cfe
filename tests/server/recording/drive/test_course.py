"""The course of a drive: even steps of distance and of time, nothing in a gap."""

from __future__ import annotations

from pathlib import Path

import pytest

from monitor.values import GpsFix, MotionCommand
from server.protocol.logbook import Course
from server.protocol.marks import DriveMark
from server.recording.drive.course import MOST_EVENTS, course_of, joined, with_marks
from server.recording.drive.facts import DriveFacts, read_facts
from server.recording.drive.motion import Motion
from server.recording.read.read import open_recording
from tests.server.recording.drive.story import LOST_S, METRE_DEG, SECOND, SPEED_MPS, in_two_parts, recorded


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


def test_the_errors_are_on_the_way() -> None:
    motion = Motion(10.0)
    for n in range(100):
        if n < 50:
            motion.value_decoded("command", MotionCommand(speed_mps=2.5, tyre_angle_rad=None), n / 10, None)
        motion._drive(2.0, n / 10)
        motion.value_decoded("position", GpsFix(lat_deg=0, lon_deg=0, sigma_m=0.4 if n < 80 else None), n / 10, None)
    found = course_of(DriveFacts(start_ms=0, end_ms=10_000, log=None, motion=motion, late=[]))["time"]
    at = {
        round(at_s, 1): (follow, gps)
        for at_s, follow, gps in zip(found["t"], found["follow"], found["gps"], strict=True)
    }
    assert (at[2.0], at[7.0], at[9.6]) == ((-0.5, 0.4), (None, 0.4), (None, None))


def test_the_parts_of_a_drive_are_one_course(tmp_path: Path) -> None:
    courses = []
    for path in in_two_parts(tmp_path):
        with open_recording([path]) as recording:
            courses.append(course_of(read_facts(recording)))
    found = joined(courses)
    assert (found["length_s"], found["length_m"]) == (210.0, pytest.approx(1800, abs=15))
    time, way = found["time"], found["way"]
    between = [n for n, at_s in enumerate(time["t"]) if 121 < at_s < SECOND[0] - 1]
    assert len(between) > 30
    assert {(time["speed"][n], time["lat"][n], time["m"][n]) for n in between} == {(None, None, None)}
    i = next(n for n, at_s in enumerate(time["t"]) if at_s > 180)
    assert (time["lon"][i] or 0) / METRE_DEG == pytest.approx(time["t"][i] * SPEED_MPS, abs=5)
    metres = [at_m for at_m in way["m"] if at_m is not None]
    assert metres == sorted(metres)
    assert way["t"][-1] == pytest.approx(210, abs=1.5)
    assert [event["t"] for event in found["events"] if event["kind"] == "intervention"] == [80.0, 170.0]


def test_a_drive_whose_events_are_not_known_is_marked(tmp_path: Path) -> None:
    with open_recording([recorded(tmp_path)]) as recording:
        known = course_of(read_facts(recording))
    of_others = course_of(DriveFacts(start_ms=0, end_ms=10_000, log=None, motion=Motion(10.0), late=[]))
    found = [
        (one["are_interventions_known"], one["are_alarms_known"], one["are_events_cut"])
        for one in (known, of_others, joined([known, of_others]))
    ]
    assert found == [(True, True, False), (False, False, False), (False, False, False)]
    many = joined(
        [{**known, "events": known["events"][:1] * 200}, known, {**known, "events": known["events"][:1] * 99}]
    )
    assert (len(many["events"]), many["are_events_cut"]) == (MOST_EVENTS, True)
    assert joined([many, known])["are_events_cut"]
    assert with_marks(many, [])["are_events_cut"]


def test_a_part_without_a_distance_ends_no_comparison_by_distance(tmp_path: Path) -> None:
    with open_recording([recorded(tmp_path)]) as recording:
        known = course_of(read_facts(recording))
    start_ms = known["start_ms"]
    silent = course_of(
        DriveFacts(start_ms=start_ms + 130_000, end_ms=start_ms + 140_000, log=None, motion=Motion(10.0), late=[])
    )
    assert silent["length_m"] is None
    later: Course = {**known, "start_ms": start_ms + 150_000}
    found = joined([known, silent, later])
    length_m = known["length_m"] or 0.0
    assert found["length_m"] == pytest.approx(2 * length_m)
    way = found["way"]
    i = next(n for n, at_m in enumerate(way["m"]) if at_m is not None and at_m > length_m + 300)
    assert way["t"][i] == pytest.approx(150 + 30, abs=2)
    assert way["speed"][i] == SPEED_MPS
    assert joined([silent, known])["way"]["speed"].count(SPEED_MPS) > 100
    assert joined([{**known, "length_m": 1200.0}, silent])["way"]["t"][-1] < 121
    assert joined([silent, silent])["length_m"] is None
