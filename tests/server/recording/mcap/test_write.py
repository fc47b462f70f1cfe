"""What is written is read again: by our own reader, and by the tools that others made."""

from __future__ import annotations

import gc
import math
import tracemalloc
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson
import pytest
from mcap.reader import make_reader

from server.judge.message import RosVersion
from server.recording.folder import writing_path
from server.recording.mcap import write
from server.recording.mcap.write import PartFile
from server.recording.own import own_schema
from server.recording.read.read import open_recording
from server.recording.read.schemas import Schema, TypeBook, text_of_details
from tests.server.recording.bags import typestore

AT_NS = 1_700_000_000_000_000_000
MORE = {
    "my_msgs/Odd": "Header header\nmy_msgs/Part[] parts\n" + "=" * 80 + "\nMSG: my_msgs/Part\nfloat32 x\nstring y\n"
}
CHANNELS = 12
FLUSHES_A_MINUTE = 300  # the recorder's: every 0.2 s
MOST_MB_AN_HOUR = 1.0
SCHEMA = Schema(
    name="std_msgs/Float32", encoding="ros1msg", message_encoding="ros1", data=b"float32 data\n", encode=None
)


def header(version: int, n: int) -> dict[str, Any]:
    if version == 1:
        return {"seq": 41 + n, "stamp": {"secs": 1, "nsecs": 999_999_999}, "frame_id": "base"}
    return {"stamp": {"sec": 1, "nanosec": 999_999_999}, "frame_id": "base"}


def typed(book: TypeBook, type: str) -> Schema:
    found = book.schema(type)
    assert found is not None
    assert found.encode is not None
    return found


def written(path: Path, version: RosVersion, *, n: int = 5) -> PartFile:
    """A file with a standard type, one of a bridge's, one without a definition, and our own entries; not closed yet."""
    book = TypeBook(version)
    book.learn(MORE)
    file = PartFile(path, profile=f"ros{version}", metadata={"vehicle": "car", "part": "1"})
    fix, odd = typed(book, "geometry_msgs/TwistStamped"), typed(book, "my_msgs/msg/Odd")
    loose = book.loose("his_msgs/Secret")
    assert book.schema("his_msgs/Secret") is None
    v = {"x": 1.5, "y": 0.0, "z": None}
    for i in range(n):
        at_ns = AT_NS + i * 10_000_000
        message = {"header": header(version, i), "twist": {"linear": v, "angular": v}}
        assert fix.encode
        assert odd.encode
        file.add(file.channel("/vel", fix), at_ns, fix.encode(message))
        other = {"header": header(version, i), "parts": [{"x": i, "y": "é"}] * i}
        file.add(file.channel("/odd", odd), at_ns, odd.encode(other))
        file.add(file.channel("/secret", loose), at_ns, orjson.dumps({"a": i}))
        file.add(file.channel("/catgraph/alarms", own_schema("alarms")), at_ns, orjson.dumps({"n": i, "time_ms": 1}))
        if i % 2:
            file.flush()
    return file


@pytest.mark.parametrize("version", [1, 2])
def test_our_own_reader_gives_what_was_written(tmp_path: Path, version: RosVersion) -> None:
    path = tmp_path / "car" / "car_1.mcap"
    file = written(path, version)
    assert not path.exists()
    assert path.with_name("car_1.mcap.writing").exists()
    assert file.close(ended="closed") == path
    assert [each.name for each in path.parent.iterdir()] == ["car_1.mcap"]
    with open_recording([path]) as recording:
        assert recording.ros_version == version
        assert recording.metadata == {"vehicle": "car", "part": "1", "ended": "closed"}
        spelled = "my_msgs/Odd" if version == 1 else "my_msgs/msg/Odd"
        assert {name: (topic.type.rpartition("/")[2], topic.count) for name, topic in recording.topics.items()} == {
            "/vel": ("TwistStamped", 5),
            "/odd": ("Odd", 5),
            "/secret": ("Secret", 5),
        }
        assert recording.topics["/odd"].type == spelled
        definition = recording.topics["/odd"].definition or ""
        assert definition.startswith(MORE["my_msgs/Odd"])
        assert "MSG: std_msgs/Header" in definition, "what the bridge's text did not bring stands in the file too"
        assert recording.topics["/secret"].definition is None
        messages = list(recording.messages())
        assert [m.topic for m in messages] == ["/vel", "/odd", "/secret"] * 5
        last = messages[-3].message
        assert last["header"] == header(version, 4)
        assert math.isnan(last["twist"]["linear"]["z"])
        assert messages[-2].message["parts"] == [{"x": 4.0, "y": "é"}] * 4
        assert messages[-1].message == {"a": 4}
        assert messages[-1].at_s == pytest.approx(AT_NS / 1e9 + 0.04, abs=1e-6)
        assert [(round(at_s - AT_NS / 1e9, 3), entry["n"]) for at_s, entry in recording.own("/catgraph/alarms")] == [
            (i / 100, i) for i in range(5)
        ]
        assert list(recording.own("/vel")) == [], "what the car sent is not ours"
        assert recording.damage == []
        assert recording.notes == []


@pytest.mark.parametrize("version", [1, 2])
def test_others_read_it_too(tmp_path: Path, version: RosVersion) -> None:
    path = written(tmp_path / "car_1.mcap", version).close(ended="closed")
    with path.open("rb") as raw:
        reader = make_reader(raw, validate_crcs=True)
        rows = [(channel.topic, message.log_time, message.sequence) for _, channel, message in reader.iter_messages()]
        header_ = reader.get_header()
        assert (header_.profile, header_.library.split()[0]) == (f"ros{version}", "catgraph")
        summary = reader.get_summary()
        assert summary is not None
        assert {channel.message_encoding for channel in summary.channels.values()} == {
            "json",
            "ros1" if version == 1 else "cdr",
        }
        assert all(index.message_index_offsets for index in summary.chunk_indexes), "Foxglove finds messages by these"
    assert len(rows) == 20
    assert rows[:4] == [(topic, AT_NS, 1) for topic in ("/vel", "/odd", "/secret", "/catgraph/alarms")], (
        "sequence counts the messages of a channel"
    )
    store = typestore(version, {"my_msgs/msg/Odd": MORE["my_msgs/Odd"]})
    read = store.deserialize_ros1 if version == 1 else store.deserialize_cdr
    with path.open("rb") as raw:
        odd = [m.data for _, c, m in make_reader(raw).iter_messages(topics=["/odd"]) if c.message_encoding != "json"]
    assert read(odd[-1], "my_msgs/msg/Odd").header.stamp.nanosec == 999_999_999
    assert read(odd[-1], "my_msgs/msg/Odd").parts[3].y == "é"


@pytest.mark.parametrize("version", [1, 2])
def test_what_was_flushed_is_readable_while_it_is_written(tmp_path: Path, version: RosVersion) -> None:
    path = tmp_path / "car_1.mcap"
    file = written(path, version)  # the last row is not flushed
    with open_recording([path.with_name("car_1.mcap.writing")]) as recording:
        assert recording.ros_version == version
        assert recording.metadata == {"vehicle": "car", "part": "1"}
        assert recording.topics["/vel"].count == 4
        assert len(list(recording.own("/catgraph/alarms"))) == 4
    file.abandon()


def test_a_name_is_not_taken_twice(tmp_path: Path) -> None:
    path = tmp_path / "car_1.mcap"
    written(path, 1).close(ended="closed")
    with pytest.raises(FileExistsError):
        written(path, 1)
    half = written(tmp_path / "car_2.mcap", 1)
    with pytest.raises(FileExistsError):
        written(tmp_path / "car_2.mcap", 1)
    half.abandon()


def test_a_topic_that_changes_its_type_has_a_channel_of_each(tmp_path: Path) -> None:
    book = TypeBook(1)
    file = PartFile(tmp_path / "a.mcap", profile="ros1", metadata={})
    f32, f64 = typed(book, "std_msgs/Float32"), typed(book, "std_msgs/Float64")
    assert file.channel("/d", f32) == file.channel("/d", f32)
    assert file.channel("/d", f32) != file.channel("/d", f64)
    assert file.channel("/d", f32) != file.channel("/e", f32)
    assert file.channel("/d", book.loose("std_msgs/Float32")) not in (file.channel("/d", f32), file.channel("/d", f64))
    file.abandon()


def test_a_type_whose_definition_became_known_has_a_channel_of_each(tmp_path: Path) -> None:
    """Bytes that another definition describes could not be read."""
    file = PartFile(tmp_path / "a.mcap", profile="ros1", metadata={"vehicle": "car", "part": "1"})
    other = replace(SCHEMA, data=b"float32 data\nfloat32 more\n")
    first, second = file.channel("/level", SCHEMA), file.channel("/level", other)
    assert (file.channel("/level", SCHEMA), file.channel("/level", other)) == (first, second)
    assert first != second
    file.add(first, AT_NS, b"1234")
    file.add(second, AT_NS, b"12345678")
    path = file.close(ended="closed", why="")
    with path.open("rb") as stream:
        read = {message.data: schema.data for schema, _, message in make_reader(stream).iter_messages() if schema}
    assert read == {b"1234": SCHEMA.data, b"12345678": other.data}


@pytest.mark.parametrize("version", [1, 2])
def test_misfits_beside_their_topic_are_read_with_it(tmp_path: Path, version: RosVersion) -> None:
    book = TypeBook(version)
    path = tmp_path / "a.mcap"
    file = PartFile(path, profile=f"ros{version}", metadata={})
    f32 = typed(book, "std_msgs/Float32")
    assert f32.encode
    file.add(file.channel("/d", f32), AT_NS, f32.encode({"data": 1.0}))
    file.add(file.channel("/d", book.loose("std_msgs/Float32")), AT_NS + 1, b'{"data":"x"}')
    file.close()
    with open_recording([path]) as recording:
        assert [m.message for m in recording.messages()] == [{"data": 1.0}, {"data": "x"}]
        assert recording.topics["/d"].definition == f32.data.decode()


def test_a_definition_that_makes_no_sense_falls_back_on_the_distribution() -> None:
    book = TypeBook(1)
    book.learn({"std_msgs/Float32": "this is { no definition", "a/B": "float32 x\nmissing_msgs/Part p\n", "c/D": ""})
    assert typed(book, "std_msgs/Float32").data == b"float32 data\n"
    assert book.schema("a/B") is None
    assert book.schema("c/D") is None
    assert book.schema("") is None
    assert book.schema(None) is None
    book.learn({"a/B": "float32 x\n"})
    assert typed(book, "a/B").encode is not None


DETAILS = {
    "typedefs": [
        {
            "type": "my_msgs/Odd",
            "fieldnames": ["header", "parts", "cov", "at"],
            "fieldtypes": ["std_msgs/Header", "my_msgs/Part", "float64", "time"],
            "fieldarraylen": [-1, 0, 9, -1],
            "examples": ["{}", "[]", "[]", "{}"],
            "constnames": ["OK"],
            "constvalues": ["0"],
        },
        {"type": "std_msgs/Header", "fieldnames": ["seq", "stamp", "frame_id"],
         "fieldtypes": ["uint32", "time", "string"], "fieldarraylen": [-1, -1, -1]},
        {"type": "time", "fieldnames": ["secs", "nsecs"], "fieldtypes": ["int32", "int32"], "fieldarraylen": [-1, -1]},
        {"type": "my_msgs/Part", "fieldnames": ["x"], "fieldtypes": ["float32"], "fieldarraylen": [-1]},
    ]
}  # fmt: skip


def test_a_definition_is_made_of_what_rosapi_returns_for_a_type() -> None:
    text = text_of_details(DETAILS)
    assert text is not None
    book = TypeBook(1)
    book.learn({"my_msgs/Odd": text})
    schema = typed(book, "my_msgs/Odd")
    assert schema.encode is not None
    message = {"header": header(1, 0), "parts": [{"x": 1}], "cov": [0.0] * 9, "at": {"secs": 3, "nsecs": 4}}
    assert len(schema.encode(message)) == 4 + 8 + 4 + 4 + 4 + 4 + 72 + 8


@pytest.mark.parametrize(
    "details",
    [None, {}, [], "text", {"typedefs": "x"}, {"typedefs": []}, {"typedefs": [None]}, {"typedefs": [{"type": 1}]},
     {"typedefs": [{"type": "a/B", "fieldnames": ["x"], "fieldtypes": [], "fieldarraylen": []}]},
     {"typedefs": [{"type": "a/B", "fieldnames": ["x"], "fieldtypes": [1], "fieldarraylen": [0]}]},
     {"typedefs": [{"type": "a/B", "fieldnames": ["x"], "fieldtypes": ["int8"], "fieldarraylen": ["0"]}]}],
)  # fmt: skip
def test_details_that_make_no_sense_are_none(details: Any) -> None:
    assert text_of_details(details) is None


def record(file: PartFile, first: int, flushes: int) -> None:
    """So many flushes' worth of a car's messages, from a moment that is a number of flushes."""
    for n in range(first, first + flushes):
        for channel in range(CHANNELS):
            file.add(file.channel(f"/topic{channel}", SCHEMA), 1_700_000_000_000_000_000 + n * 200_000_000, b"\0\0\0\0")
        file.flush()


def part(folder: Path) -> PartFile:
    return PartFile(folder / "car_20231114T221320Z.mcap", profile="ros1", metadata={"vehicle": "car"})


@pytest.mark.world(n=25)
def test_an_hour_of_recording_keeps_less_than_a_megabyte(tmp_path: Path) -> None:
    file = part(tmp_path)
    tracemalloc.start()
    try:
        record(file, 0, FLUSHES_A_MINUTE)
        gc.collect()
        before, _ = tracemalloc.get_traced_memory()
        record(file, FLUSHES_A_MINUTE, 3 * FLUSHES_A_MINUTE)
        gc.collect()
        after, _ = tracemalloc.get_traced_memory()
    finally:
        tracemalloc.stop()
        file.abandon()
    assert (after - before) * 20 / 1e6 < MOST_MB_AN_HOUR


@pytest.mark.world(n=25)
def test_the_finished_file_is_byte_for_byte_what_the_library_writes_from_its_own_list(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    ours = part(tmp_path)
    record(ours, 0, 130)
    written = ours.close(ended="by hand").read_bytes()
    monkeypatch.setattr(write, "ChunkIndexes", lambda _: [])
    theirs = part(tmp_path / "list")
    record(theirs, 0, 130)
    assert written == theirs.close(ended="by hand").read_bytes()
    with (tmp_path / "car_20231114T221320Z.mcap").open("rb") as file:
        summary = make_reader(file).get_summary()
    assert summary is not None
    assert len(summary.chunk_indexes) == 130
    assert all(len(index.message_index_offsets) == CHANNELS for index in summary.chunk_indexes)


def test_a_file_with_fewer_chunks_than_were_written_is_not_completed(tmp_path: Path) -> None:
    file = part(tmp_path)
    record(file, 0, 3)
    with writing_path(file.path).open("r+b") as damaged:
        damaged.truncate(200)
        damaged.truncate(file.size)
    with pytest.raises(OSError, match="chunks instead of 3"):
        file.close()
    assert not file.path.exists()
    assert writing_path(file.path).exists()
