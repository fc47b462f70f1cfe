"""Recordings as ROS 2 bags: opened by rosbags, the car's messages byte for byte, catgraph's own as text."""

from __future__ import annotations

import json
import zipfile
from pathlib import Path
from typing import Any

import pytest
from rosbags.highlevel import AnyReader
from rosbags.rosbag2 import Reader as Reader2
from rosbags.typesys import get_types_from_msg

from server.recording.export.export_format import ExportRefused, Outcome
from server.recording.export.formats.ros2_bag import write_ros2_bag
from server.recording.read.read import open_recording
from tests.server.recording.bags import BEGIN_S, Drive, Row, write_ros1, write_ros2
from tests.server.recording.export.ours import OurFile, as_ours, event

TEXT, INT, SCAN = "std_msgs/msg/String", "std_msgs/msg/Int32", "sensor_msgs/msg/LaserScan"
NS = BEGIN_S * 10**9


def export(source: Path, folder: Path, **options: Any) -> tuple[Outcome, Path]:
    """What came of it, and the bag unpacked."""
    with open_recording([source]) as recording:
        outcome = write_ros2_bag(recording, folder / "out.zip", **options)
    with zipfile.ZipFile(folder / "out.zip") as packed:
        assert packed.testzip() is None
        packed.extractall(folder / "out")
    (bag,) = (folder / "out").iterdir()
    return outcome, bag


def rows(bag: Path) -> list[tuple[str, str, int, bytes]]:
    with AnyReader([bag]) as reader:
        return [(c.topic, c.msgtype, at_ns, bytes(raw)) for c, at_ns, raw in reader.messages()]


def test_a_real_drive_recorded_and_exported_equals_the_original(recordings: Path, tmp_path: Path) -> None:
    original = recordings / "catvehicle_2016-06-01_mcap"
    raised = event(1, NS // 10**6, "raised")
    ours = as_ours(original, tmp_path / "ours.mcap", [(NS, "/catgraph/alarms", raised)])
    outcome, bag = export(ours, tmp_path, with_own=False)
    assert outcome.notes == []
    assert rows(bag) == rows(original)
    assert len(rows(bag)) == outcome.entries == 14_228
    with Reader2(bag) as reader, Reader2(original) as before:
        assert {c.topic: c.digest for c in reader.connections} == {c.topic: c.digest for c in before.connections}


def test_our_own_channels_are_text_in_it_and_every_message_is_understood(tmp_path: Path) -> None:
    drive: list[Row] = [(0.1 * n, "/n", INT, {"data": n}) for n in range(5)]
    drive.append((0.2, "/scan", SCAN, {"ranges": [1.0, float("inf"), float("nan")]}))
    source = write_ros2(tmp_path / "in", Drive(messages=drive, latched={"/n"}))
    raised = event(1, NS // 10**6, "raised", text="5.2 m/s, über 5.0")
    ours = as_ours(source, tmp_path / "ours.mcap", [(NS + 10**8, "/catgraph/alarms", raised)])
    outcome, bag = export(ours, tmp_path, name="catgraph/../drive of Monday")
    assert bag.name == "catgraph_.._drive_of_Monday"
    with AnyReader([bag]) as reader:
        read = [(c, reader.deserialize(raw, c.msgtype)) for c, _, raw in reader.messages()]
        assert {c.topic for c in reader.connections} == {"/n", "/scan", "/catgraph/alarms"}
        qos = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
    assert len(read) == outcome.entries == 7
    assert [m.data for c, m in read if c.topic == "/n"] == [0, 1, 2, 3, 4]
    (alarm,) = (json.loads(m.data) for c, m in read if c.topic == "/catgraph/alarms")
    assert alarm["text"] == raised["text"]
    assert qos["/n"][0].durability.name == "TRANSIENT_LOCAL"
    assert qos["/scan"] == []


def test_it_is_read_again_by_catgraph(tmp_path: Path) -> None:
    source = write_ros2(tmp_path / "in", Drive(messages=[(0.0, "/n", INT, {"data": 7})]))
    _, bag = export(as_ours(source, tmp_path / "ours.mcap"), tmp_path)
    with open_recording([bag]) as again:
        assert [(m.topic, m.type, m.message) for m in again.messages()] == [("/n", INT, {"data": 7})]


def test_a_type_of_its_own_brings_its_definition(tmp_path: Path) -> None:
    text = "std_msgs/Header header\nfloat32[3] wheel\nInner[] inner\n" + "=" * 80 + "\nMSG: my_msgs/Inner\nstring s\n"
    rows: list[Row] = [(0.0, "/a", "my_msgs/msg/A", {"inner": [{"s": "x"}], "wheel": [1, 2, 3]})]
    source = write_ros2(tmp_path / "in", Drive(messages=rows, definitions={"my_msgs/msg/A": text}))
    _, bag = export(as_ours(source, tmp_path / "ours.mcap"), tmp_path)
    with AnyReader([bag]) as reader:
        ((connection, _, raw),) = reader.messages()
        message: Any = reader.deserialize(raw, connection.msgtype)
    assert ([*message.wheel], message.inner[0].s) == ([1.0, 2.0, 3.0], "x")
    assert "my_msgs/msg/Inner" in get_types_from_msg(connection.msgdef.data, "my_msgs/msg/A")


def test_what_cannot_stand_in_it_is_named(tmp_path: Path) -> None:
    made = OurFile(tmp_path / "ours.mcap", profile="ros2")
    made.write(NS, "/n", INT, "int32 data", "cdr", b"\0\1\0\0\7\0\0\0")
    made.write(NS + 1, "/n", INT, "", "json", b'{"data": "seven"}')
    made.write(NS + 2, "/n", TEXT, "string data", "cdr", b"\0\1\0\0\2\0\0\0a\0")
    made.write(NS + 3, "/odd", "my_msgs/msg/Odd", "what is this", "cdr", b"\0\1\0\0")
    made.close()
    outcome, bag = export(tmp_path / "ours.mcap", tmp_path)
    assert outcome.notes == [
        "/n (1 messages) is left out: it was recorded as JSON: its type's definition was unknown, "
        "or it did not match it.",
        "/n (1 messages) is left out: the topic has the type std_msgs/msg/Int32 here.",
        "/odd (1 messages) is left out: the definition of my_msgs/msg/Odd is missing or cannot be understood.",
    ]
    assert [row[0] for row in rows(bag)] == ["/n"]


def test_refusals(tmp_path: Path) -> None:
    ros1 = write_ros1(tmp_path / "a.bag", Drive(messages=[(0.0, "/n", INT, {"data": 1})]))
    with pytest.raises(ExportRefused, match="export a ROS 1 bag"):
        export(ros1, tmp_path)
    made = OurFile(tmp_path / "ours.mcap", profile="ros2")
    made.write(NS, "/n", INT, "", "json", b'{"data": "seven"}')
    made.close()
    with pytest.raises(ExportRefused, match="Nothing in this recording"):
        export(tmp_path / "ours.mcap", tmp_path)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["a.bag", "ours.mcap"]
