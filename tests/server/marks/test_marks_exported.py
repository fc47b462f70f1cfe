"""Marks in what is made of a recording: tables, tracks, clips, bags; recorded ones and those that came later."""

from __future__ import annotations

import csv
import io
import zipfile
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import orjson
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader

from server.protocol.marks import DriveMark
from server.recording.catalog import annotations as annotation_store
from server.recording.export.clip import Window, write_clip
from server.recording.export.formats.bag import write_bag
from server.recording.export.formats.csv_zip import write_csv_zip
from server.recording.export.formats.geojson import write_geojson
from server.recording.export.formats.gpx import write_gpx
from server.recording.export.formats.ros2_bag import write_ros2_bag
from server.recording.marks.recorded import read_marks, read_media
from server.recording.marks.rows import entry
from server.recording.read.read import open_recording
from server.recording.verify import verify
from server.replay.timeline import read_timeline_events
from tests.server.marks.media_samples import PHOTO, VOICE
from tests.server.recording.bags import BEGIN_S, Drive, write_ros1, write_ros2
from tests.server.recording.export.ours import Own, as_ours

FIX = "sensor_msgs/msg/NavSatFix"
NS = BEGIN_S * 10**9
GPX = {"g": "http://www.topografix.com/GPX/1/1"}
HOSTILE = '=cmd|"/c calc"!A0 <b>&</desc>'


def mark(id: str, at_s: float, **more: Any) -> DriveMark:
    row: DriveMark = {
        "mark": id, "marked_ms": round((BEGIN_S + at_s) * 1000), "category": None, "words": "", "voice": False,
        "photo": False, "source": "page", "by": "Ana",
    }  # fmt: skip
    return {**row, **more}  # type: ignore[typeddict-item]


def as_event(row: DriveMark, change: str = "mark", at_s: float | None = None) -> Own:
    at_ms = row["marked_ms"] if at_s is None else (BEGIN_S + at_s) * 1000
    return round(at_ms * 1e6), "/catgraph/marks", entry(row, change)


@pytest.fixture
def drive(tmp_path: Path) -> Path:
    """Four seconds with positions; three marks in the file, of which one was taken back, and one beside it."""
    where = {"status": {"status": 0}, "longitude": -110.0, "altitude": 700.0}
    rows = [(0.1 * n, "/gps_fix", FIX, {**where, "latitude": 32.0 + n * 1e-5}) for n in range(40)]
    first, gone = mark("first", 1.0, words=HOSTILE, category="Planner"), mark("gone", 1.5)
    path = as_ours(
        write_ros1(tmp_path / "in.bag", Drive(messages=rows)),
        tmp_path / "ours.mcap",
        [as_event(first), as_event(gone), as_event(gone, "mark_removed", 1.6), as_event(mark("far", 3.5))],
    )
    annotation_store.write_marks(path, [mark("late", 2.0, words="late words", voice=True)], [])
    folder = annotation_store.media_beside(path)
    folder.mkdir()
    (folder / "late.voice.webm").write_bytes(VOICE)
    (folder / "first.photo.jpg").write_bytes(PHOTO)
    return path


def test_a_recording_and_its_replay_have_them_in_order(drive: Path) -> None:
    rows = read_marks(drive)
    assert [(row["mark"], row["at_s"], row["late"]) for row in rows] == [
        ("first", 1.0, False),
        ("late", 2.0, True),
        ("far", 3.5, False),
    ]
    assert read_timeline_events(lambda: open_recording([drive])).flags == rows
    found = read_media(drive, "late", "voice")
    assert found is not None
    assert found[1] == VOICE


def test_the_tables_have_all_and_no_formula(drive: Path, tmp_path: Path) -> None:
    with open_recording([drive]) as recording:
        write_csv_zip(recording, tmp_path / "out.zip")
    with zipfile.ZipFile(tmp_path / "out.zip") as packed:
        rows = list(csv.DictReader(io.StringIO(packed.read("marks.csv").decode())))
        assert packed.read("marks/late.voice.webm") == VOICE
        assert packed.read("marks/first.photo.jpg") == PHOTO
        assert "marks.csv" in packed.read("README.txt").decode()
    assert [(row["mark"], row["words"], row["late"]) for row in rows] == [
        ("first", f"'{HOSTILE}", "False"),
        ("late", "late words", "True"),
        ("far", "", "False"),
    ]
    assert rows[0]["since start [s]"] == "1.000000"


def test_the_tracks_have_a_point_for_each(drive: Path, tmp_path: Path) -> None:
    with open_recording([drive]) as recording:
        write_gpx(recording, tmp_path / "out.gpx")
        write_geojson(recording, tmp_path / "out.geojson")
    points = ElementTree.parse(tmp_path / "out.gpx").getroot().findall("g:wpt", GPX)
    assert [(one.findtext("g:name", None, GPX), one.findtext("g:desc", None, GPX)) for one in points] == [
        ("Planner", HOSTILE),
        ("late words", "late words"),
        ("Mark", ""),
    ]
    assert {one.findtext("g:type", None, GPX) for one in points} == {"mark"}
    features = orjson.loads((tmp_path / "out.geojson").read_bytes())["features"]
    marks = [one["properties"] for one in features if one["properties"]["kind"] == "mark"]
    assert [(one["mark"], one["text"], one["late"]) for one in marks] == [
        ("first", HOSTILE, False),
        ("late", "late words", True),
        ("far", "", False),
    ]


def test_a_clip_has_those_of_its_span_with_their_media(drive: Path, tmp_path: Path) -> None:
    window = Window(at_ns=round((BEGIN_S + 1.5) * 1e9), before_s=1.0, after_s=1.0)
    with open_recording([drive]) as recording:
        write_clip(recording, tmp_path / "clip.mcap", window, clip_of="ours")
    clip = tmp_path / "clip.mcap"
    assert [(row["mark"], row["words"], row["late"]) for row in read_marks(clip)] == [
        ("first", HOSTILE, False),
        ("late", "late words", False),
    ]
    with clip.open("rb") as file:
        found = {one.name: one.data for one in make_reader(file, validate_crcs=True).iter_attachments()}
    assert found == {"mark-late.voice.webm": VOICE, "mark-first.photo.jpg": PHOTO}
    assert verify(clip).state == "intact"


def entries(bag: Path) -> list[tuple[float, str, str, str]]:
    """Seconds since the beginning, change, mark and words of what a bag holds of marks."""
    with AnyReader([bag]) as reader:
        marks = [one for one in reader.connections if one.topic == "/catgraph/marks"]
        rows = [
            (at_ns, orjson.loads(reader.deserialize(raw, of.msgtype).data)) for of, at_ns, raw in reader.messages(marks)
        ]
    return [((at_ns - NS) / 1e9, row["change"], row["mark"], row["words"]) for at_ns, row in rows]


def test_a_bag_of_either_ros_has_them_as_messages_at_their_moments(drive: Path, tmp_path: Path) -> None:
    late = [mark("late", 2.0, words="late words"), mark("first", 1.0, words="changed"), mark("after", 99.0)]
    annotation_store.write_marks(drive, late, ["far"])
    with open_recording([drive]) as recording:
        outcome = write_bag(recording, tmp_path / "out.bag")
        assert write_bag(recording, tmp_path / "bare.bag", with_own=False).notices == []
    assert outcome.notes == []
    assert outcome.notices == [
        "4 messages of catgraph were added: marks and descriptions that came after the recording was complete."
    ]
    found = entries(tmp_path / "out.bag")
    assert [row[:3] for row in found] == [
        (1.0, "mark", "first"),
        (1.0, "mark_changed", "first"),
        (1.5, "mark", "gone"),
        (1.6, "mark_removed", "gone"),
        (2.0, "mark", "late"),
        (3.5, "mark", "far"),
        (3.5, "mark_removed", "far"),
        (3.9, "mark", "after"),
    ]
    assert (found[1][3], found[4][3]) == ("changed", "late words")


def test_a_ros2_bag_too_also_where_the_recording_has_no_mark(tmp_path: Path) -> None:
    rows = [(0.1 * n, "/gps_fix", FIX, {"latitude": 32.0}) for n in range(20)]
    path = as_ours(write_ros2(tmp_path / "in", Drive(messages=rows)), tmp_path / "ours.mcap")
    annotation_store.write_marks(path, [mark("late", 1.0, words="late words", photo=True)], [])
    with open_recording([path]) as recording:
        outcome = write_ros2_bag(recording, tmp_path / "out.zip")
    assert outcome.notes == ["Voice notes and photos of marks do not fit a bag: the CSV tables have them."]
    with zipfile.ZipFile(tmp_path / "out.zip") as packed:
        packed.extractall(tmp_path / "out")
    (bag,) = (tmp_path / "out").iterdir()
    assert entries(bag) == [(1.0, "mark", "late", "late words")]


def test_what_is_no_mark_in_a_file_is_left_out(drive: Path) -> None:
    beside = annotation_store.beside(drive)
    beside.write_bytes(
        orjson.dumps({"title": "Lap", "marks": [1, {}, {"mark": "../x", "marked_ms": 1}], "removed": [None, "first"]})
    )
    assert [row["mark"] for row in read_marks(drive)] == ["far"]
    assert annotation_store.read(drive).title == "Lap"
