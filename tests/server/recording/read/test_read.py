"""Recordings of every kind, read as one stream of messages."""

from __future__ import annotations

import os
import time
from pathlib import Path
from typing import Any, Literal

import numpy as np
import orjson
import pytest
from mcap.writer import Writer as McapWriter
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Writer as BagWriter

from server.recording.read.errors import Undecodable
from server.recording.read.read import RecordingUnreadable, open_recording
from tests.server.recording.bags import BEGIN_S, Drive, Row, build, typestore, write_ros1, write_ros2
from tests.server.recording.export.ours import OurFile, event

INT, TEXT, SCAN = "std_msgs/msg/Int32", "std_msgs/msg/String", "sensor_msgs/msg/LaserScan"
TWIST = "geometry_msgs/msg/Twist"
ROWS: list[Row] = [
    (0.0, "/text", TEXT, {"data": "begin"}),
    *((0.1 * n, "/n", INT, {"data": n}) for n in range(1, 10)),
    (
        1.0,
        "/scan",
        SCAN,
        {"header": {"stamp": {"sec": 5, "nanosec": 6}, "frame_id": "laser"}, "ranges": [1.0, float("nan")]},
    ),
]
SHORT = Drive(messages=ROWS)


def read(*paths: Path, start_s: float = 0.0) -> list[tuple[float, str, str, Any]]:
    with open_recording(list(paths)) as recording:
        return [(round(m.at_s - BEGIN_S, 6), m.topic, m.type, m.message) for m in recording.messages(start_s)]


def assert_is_short(path: Path, version: int) -> None:
    slash = "/msg/" if version == 2 else "/"
    with open_recording([path]) as recording:
        assert recording.ros_version == version
        assert {t: (i.type, i.count) for t, i in recording.topics.items()} == {
            "/text": (f"std_msgs{slash}String", 1),
            "/n": (f"std_msgs{slash}Int32", 9),
            "/scan": (f"sensor_msgs{slash}LaserScan", 1),
        }
        assert (recording.start_s, recording.duration_s, recording.count) == (BEGIN_S, 1.0, 11)
        assert (recording.notes, recording.rejected) == ([], {})
        messages = list(recording.messages())
    assert [m.message["data"] for m in messages[:-1]] == ["begin", *range(1, 10)]
    assert [round(m.at_s - BEGIN_S, 6) for m in messages] == [round(row[0], 6) for row in ROWS]
    scan = messages[-1].message
    names = ("secs", "nsecs") if version == 1 else ("sec", "nanosec")
    assert scan["header"]["stamp"] == dict(zip(names, (5, 6), strict=True))
    assert ("seq" in scan["header"]) == (version == 1)
    assert np.array_equal(scan["ranges"], np.array([1.0, np.nan], dtype=np.float32), equal_nan=True)


@pytest.mark.parametrize("compression", ["none", "bz2", "lz4"])
def test_ros_1_bags(tmp_path: Path, compression: Literal["none", "bz2", "lz4"]) -> None:
    bag = write_ros1(tmp_path / "a.bag", Drive(messages=ROWS, compression=compression, chunk_bytes=60))
    assert_is_short(bag, 1)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
@pytest.mark.parametrize("compression", ["none", "zstd"])
def test_ros_2_bags(tmp_path: Path, storage: Literal["mcap", "sqlite3"], compression: Literal["none", "zstd"]) -> None:
    assert_is_short(write_ros2(tmp_path / "bag", Drive(messages=ROWS, compression=compression), storage=storage), 2)


@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_bare_files_of_a_ros_2_bag(tmp_path: Path, storage: Literal["mcap", "sqlite3"]) -> None:
    folder = write_ros2(tmp_path / "bag", SHORT, storage=storage)
    [file] = [file for file in folder.iterdir() if file.suffix in (".mcap", ".db3")]
    assert_is_short(file, 2)
    odd_name = file.rename(tmp_path / f"a drive, no. 1{file.suffix}.recording")
    assert_is_short(odd_name, 2)
    odd_name.rename(file)
    (folder / "metadata.yaml").unlink()  # as a recorder leaves it that was killed
    assert_is_short(folder, 2)


@pytest.mark.parametrize("name", ["drive #3", "what?", "100%41", "Größe ü", "a b"])
@pytest.mark.parametrize("storage", ["mcap", "sqlite3"])
def test_names_as_people_give_them(tmp_path: Path, name: str, storage: Literal["mcap", "sqlite3"]) -> None:
    folder = write_ros2(tmp_path / "plain", SHORT, storage=storage).rename(tmp_path / name)
    assert_is_short(folder, 2)
    file = next(file for file in folder.iterdir() if file.suffix != ".yaml")
    assert_is_short(file.rename(folder / f"{name}{file.suffix}"), 2)
    assert_is_short(write_ros1(tmp_path / f"{name}.bag", SHORT), 1)


def test_a_single_bag_in_a_folder(tmp_path: Path) -> None:
    write_ros1(tmp_path / "only.bag", SHORT)
    assert_is_short(tmp_path, 1)


@pytest.mark.parametrize("profile", ["ros1", "", "odd"])
def test_ros_1_messages_in_an_mcap_file(tmp_path: Path, profile: str) -> None:
    store = typestore(1, {})
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile=profile)
        channels: dict[str, int] = {}
        for at_s, topic, type, message in ROWS:
            if topic not in channels:
                text = store.generate_msgdef(type, ros_version=1)[0].encode()
                schema = writer.register_schema(name=type.replace("/msg/", "/"), encoding="ros1msg", data=text)
                channels[topic] = writer.register_channel(topic=topic, message_encoding="ros1", schema_id=schema)
            raw = bytes(store.serialize_ros1(build(store, type, message), type))
            at_ns = BEGIN_S * 10**9 + round(at_s * 1e9)
            writer.add_message(channel_id=channels[topic], log_time=at_ns, publish_time=at_ns, data=raw)
        writer.finish()
    assert_is_short(path, 1)


def test_json_messages_in_an_mcap_file(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema(name="std_msgs/msg/Int32", encoding="jsonschema", data=b"{}")
        channel = writer.register_channel(topic="/n", message_encoding="json", schema_id=schema)
        other = writer.register_channel(topic="/p", message_encoding="protobuf", schema_id=schema)
        for number, raw in enumerate((b'{"data":1}', b"[1]", b"{", b'{"data":2}')):
            writer.add_message(channel_id=channel, log_time=number, publish_time=number, data=raw)
        writer.add_message(channel_id=other, log_time=1, publish_time=1, data=b"")
        writer.finish()
    with open_recording([path]) as recording:
        assert [m.message for m in recording.messages()] == [{"data": 1}, {"data": 2}]
        assert recording.rejected == {"/n": 2}
        assert [type(m.message) for m in recording.raw_messages()] == [dict] * 2, "JSON is not of ROS"
        assert recording.notes == ["/p (1 messages) is left out: messages encoded as 'protobuf' are not supported"]


def test_nan_in_the_json_of_others_is_a_value_that_is_not_a_number(tmp_path: Path) -> None:
    path = tmp_path / "a.mcap"
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start()
        schema = writer.register_schema(name="geometry_msgs/msg/Point", encoding="jsonschema", data=b"{}")
        channel = writer.register_channel(topic="/p", message_encoding="json", schema_id=schema)
        for number, raw in enumerate((b'{"x": NaN, "y": -Infinity, "z": 3.0}', b'{"x": NaN', b"[NaN]")):
            writer.add_message(channel_id=channel, log_time=number, publish_time=number, data=raw)
        writer.finish()
    with open_recording([path]) as recording:
        (point,) = [m.message for m in recording.messages()]
        assert recording.rejected == {"/p": 2}
    assert np.isnan(point["x"])
    assert (point["y"], point["z"]) == (-np.inf, 3.0)


def test_several_files_are_one_drive_in_time_order(tmp_path: Path) -> None:
    odd = write_ros1(tmp_path / "odd.bag", Drive(messages=[r for i, r in enumerate(ROWS) if i % 2]))
    even = write_ros1(tmp_path / "even.bag", Drive(messages=[r for i, r in enumerate(ROWS) if not i % 2]))
    with open_recording([odd, even]) as recording:
        assert recording.topics["/n"].count == 9
        assert (recording.start_s, recording.duration_s) == (BEGIN_S, 1.0)
        assert [round(m.at_s - BEGIN_S, 6) for m in recording.messages()] == [round(row[0], 6) for row in ROWS]


def test_versions_cannot_be_mixed(tmp_path: Path) -> None:
    one, two = write_ros1(tmp_path / "1.bag", SHORT), write_ros2(tmp_path / "2", SHORT)
    with pytest.raises(RecordingUnreadable, match="ROS 1 and ROS 2 cannot be read as one"):
        open_recording([one, two])


def test_what_cannot_be_read_with_the_requested_file_is_named(tmp_path: Path) -> None:
    one, two = write_ros1(tmp_path / "1.bag", SHORT), write_ros2(tmp_path / "2", SHORT)
    spoilt = tmp_path / "3.mcap"
    spoilt.write_bytes(b"spoilt")
    for named, other, version in ((one, two, 1), (two, one, 2), (spoilt, two, 1)):
        with open_recording([one, two, spoilt], required=named) as recording:
            assert (recording.ros_version, recording.topics["/n"].count) == (version, 9)
            damaged, mixed = recording.damage
            assert damaged.startswith("3.mcap ")
            assert mixed == f"{other.name} is of another version of ROS and cannot be read with {named.name}"
    with pytest.raises(RecordingUnreadable):
        open_recording([spoilt], required=spoilt)


def test_a_file_without_messages_of_the_car_has_no_version(tmp_path: Path) -> None:
    """As the first part of a recording that was begun before the version was known."""
    silent = OurFile(tmp_path / "drive.mcap", profile="ros1")
    silent.own(BEGIN_S * 1_000_000_000, "/catgraph/alarms", event(1, 5, "started", None))
    two = write_ros2(tmp_path / "drive_p2", SHORT)
    with open_recording([silent.close(), two]) as recording:
        assert (recording.ros_version, recording.notes, len(list(recording.messages()))) == (2, [], 11)
        assert len(list(recording.own("/catgraph/alarms"))) == 1


@pytest.mark.parametrize("kind", ["bag", "mcap", "sqlite3"])
def test_reading_can_begin_later_and_again(tmp_path: Path, kind: Any) -> None:
    drive = Drive(messages=ROWS, chunk_bytes=60)
    path = write_ros1(tmp_path / "a.bag", drive) if kind == "bag" else write_ros2(tmp_path / "a", drive, storage=kind)
    assert [row[3]["data"] for row in read(path, start_s=0.65)[:-1]] == [7, 8, 9]
    assert read(path, start_s=1.1) == []
    with open_recording([path]) as recording:
        first = recording.messages()
        assert next(first).message == {"data": "begin"}
        assert len(list(recording.messages())) == 11  # a second reader does not disturb
        assert len(list(first)) == 10


@pytest.mark.parametrize("kind", ["bag", "mcap", "sqlite3"])
def test_latched_topics_are_known(tmp_path: Path, kind: Any) -> None:
    drive = Drive(messages=ROWS, latched={"/text"})
    path = write_ros1(tmp_path / "a.bag", drive) if kind == "bag" else write_ros2(tmp_path / "a", drive, storage=kind)
    with open_recording([path]) as recording:
        assert {topic: info.is_latched for topic, info in recording.topics.items()} == {
            "/text": True,
            "/n": False,
            "/scan": False,
        }


@pytest.mark.parametrize("version", [1, 2])
def test_types_of_the_recording_s_own(tmp_path: Path, version: int) -> None:
    definitions = {
        "tank_msgs/msg/Fuel": "float64 litres\ntank_msgs/Cap cap\nuint8[] seal\n",
        "tank_msgs/msg/Cap": "bool is_open\n",
    }
    content = {"litres": 40.0, "cap": {"is_open": True}, "seal": [1, 2]}
    drive = Drive(messages=[(0.0, "/fuel", "tank_msgs/msg/Fuel", content)], definitions=definitions)
    path = write_ros1(tmp_path / "a.bag", drive) if version == 1 else write_ros2(tmp_path / "a", drive)
    [(_, _, type, message)] = read(path)
    assert type == ("tank_msgs/Fuel" if version == 1 else "tank_msgs/msg/Fuel")
    assert message == {"litres": 40.0, "cap": {"is_open": True}, "seal": b"\x01\x02"}
    with open_recording([path]) as recording:
        assert "float64 litres" in (recording.topics["/fuel"].definition or "")


def test_a_db3_file_without_definitions_reads_standard_types(tmp_path: Path) -> None:
    import apsw

    folder = write_ros2(tmp_path / "bag", Drive(messages=[*ROWS, (1.0, "/odd", INT, {"data": 1})]), storage="sqlite3")
    [file] = folder.glob("*.db3")
    database = apsw.Connection(str(file))
    database.execute("DROP TABLE message_definitions; UPDATE schema SET schema_version = 3")
    database.execute("UPDATE topics SET type = 'odd_msgs/msg/Unheard' WHERE name = '/odd'")
    database.close()
    with open_recording([file]) as recording:
        assert recording.count == 11
        assert recording.notes == ["/odd (1 messages) is left out: the definition of odd_msgs/msg/Unheard is missing"]
        assert len(list(recording.messages())) == 11


def test_a_topic_of_two_types_keeps_the_first(tmp_path: Path) -> None:
    one = write_ros1(tmp_path / "1.bag", Drive(messages=[(0.0, "/x", INT, {"data": 1})]))
    two = write_ros1(tmp_path / "2.bag", Drive(messages=[(1.0, "/x", "std_msgs/msg/UInt64", {"data": 2})]))
    with open_recording([one, two]) as recording:
        assert [m.message for m in recording.messages()] == [{"data": 1}]
        assert recording.notes == [
            "/x (1 messages) is left out: it has the type std_msgs/UInt64 and also std_msgs/Int32"
        ]


@pytest.mark.parametrize("types", [(TEXT, TWIST), (TWIST, TEXT)])
@pytest.mark.parametrize("is_one_file", [True, False])
def test_a_topic_of_two_types_is_read_as_the_one_that_a_signal_has(
    tmp_path: Path, types: tuple[str, str], is_one_file: bool
) -> None:
    contents: dict[str, dict[str, Any]] = {TEXT: {"data": "a"}, TWIST: {"linear": {"x": 3.0}}}
    drives = [Drive(messages=[(float(n), "/vel", type, contents[type])]) for n, type in enumerate(types)]
    if is_one_file:
        paths = [write_ros1_of_both(tmp_path / "both.bag", drives)]
    else:
        paths = [write_ros1(tmp_path / f"{n}.bag", drive) for n, drive in enumerate(drives)]
    with open_recording(paths) as recording:
        [message] = recording.messages()
        assert message.type == "geometry_msgs/Twist"
        assert message.message["linear"]["x"] == 3.0
        assert recording.notes == [
            "/vel (1 messages) is left out: it has the type std_msgs/String and also geometry_msgs/Twist"
        ]


STAMPED = "geometry_msgs/msg/TwistStamped"
FOREIGN = "my_msgs/msg/A"


@pytest.mark.parametrize(
    ("other", "encoding", "count"),
    [(STAMPED, "cdr", 0), (STAMPED, "protobuf", 1), (TEXT, "cdr", 1), (FOREIGN, "cdr", 1), (FOREIGN, "cdr", 0)],
)
@pytest.mark.parametrize("is_first", [True, False])
def test_a_type_without_messages_that_can_be_decoded_hides_no_other(
    tmp_path: Path, other: str, encoding: str, count: int, is_first: bool
) -> None:
    channels = [(other, encoding, [b"\0\1\0\0" + bytes(8)] * count), (TWIST, "cdr", [twist_of_3()])]
    with open_recording([write_mcap(tmp_path / "a.mcap", channels if is_first else channels[::-1])]) as recording:
        [message] = recording.messages()
        assert (message.type, message.message["linear"]["x"]) == (TWIST, 3.0)
        assert recording.topics["/vel"].count == 1
        assert len(recording.notes) == count


@pytest.mark.parametrize(("encoding", "count"), [("cdr", 0), ("protobuf", 1)])
@pytest.mark.parametrize("is_first", [True, False])
def test_a_speed_without_messages_that_can_be_decoded_hides_no_text(
    tmp_path: Path, encoding: str, count: int, is_first: bool
) -> None:
    text = b"\0\1\0\0\2\0\0\0x\0"
    channels = [(TEXT, "cdr", [text]), (TWIST, encoding, [twist_of_3()] * count)]
    with open_recording([write_mcap(tmp_path / "a.mcap", channels if is_first else channels[::-1])]) as recording:
        assert [(m.type, m.message) for m in recording.messages()] == [(TEXT, {"data": "x"})]
        left_out = "/vel (1 messages) is left out: messages encoded as 'protobuf' are not supported"
        assert recording.notes == [left_out] * count


def test_a_type_that_a_chosen_topic_is_read_of_ranks_above_one_that_no_signal_has(tmp_path: Path) -> None:
    float_type = "std_msgs/msg/Float64"
    of_number = (float_type, "cdr", [b"\0\1\0\0" + np.float64(3.0).tobytes()])
    channels = [(INT, "cdr", [b"\0\1\0\0" + bytes(4)]), of_number]
    with open_recording([write_mcap(tmp_path / "a.mcap", channels, "/of/no/name")]) as recording:
        assert [(m.type, m.message) for m in recording.messages()] == [(float_type, {"data": 3.0})]


def test_a_type_without_a_definition_hides_no_other_that_no_signal_has(tmp_path: Path) -> None:
    channels = [(FOREIGN, "cdr", [bytes(8)]), (INT, "cdr", [b"\0\1\0\0" + bytes(4)])]
    with open_recording([write_mcap(tmp_path / "a.mcap", channels)]) as recording:
        assert [(m.type, m.message) for m in recording.messages()] == [(INT, {"data": 0})]
        assert len(recording.notes) == 1


def twist_of_3() -> bytes:
    return b"\0\1\0\0" + np.array([3.0, 0, 0, 0, 0, 0]).tobytes()


def write_mcap(path: Path, channels: list[tuple[str, str, list[bytes]]], topic: str = "/vel") -> Path:
    """A file with these channels of one topic: type, encoding, messages."""
    definitions = {TWIST: b"Vector3 linear\nVector3 angular\n" + b"=" * 80 + b"\nMSG: geometry_msgs/Vector3\n"
                   b"float64 x\nfloat64 y\nfloat64 z\n", TEXT: b"string data\n", INT: b"int32 data\n",
                   FOREIGN: b"Missing one\n"}  # fmt: skip
    with path.open("wb") as file:
        writer = McapWriter(file)
        writer.start(profile="ros2")
        for number, (type, encoding, messages) in enumerate(channels):
            schema = writer.register_schema(type, "ros2msg", definitions.get(type, b""))
            channel = writer.register_channel(topic, encoding, schema)
            time_ns = (BEGIN_S + number) * 10**9
            for data in messages:
                writer.add_message(channel, time_ns, data, time_ns)
        writer.finish()  # type: ignore[no-untyped-call]
    return path


def test_a_type_of_a_database_that_is_spelled_as_in_ros_1_is_read(tmp_path: Path) -> None:
    import apsw

    rows: list[Row] = [(0.0, "/vel", TWIST, {"linear": {"x": 3.0}})]
    for number, table in enumerate(("topics SET type", "message_definitions SET topic_type")):
        folder = write_ros2(tmp_path / str(number), Drive(messages=rows), storage="sqlite3")
        [file] = folder.glob("*.db3")
        database = apsw.Connection(str(file))
        database.execute(f"UPDATE {table} = 'geometry_msgs/Twist'")
        database.close()
        [(_, _, type, message)] = read(file)
        assert (type, message["linear"]["x"]) == (TWIST, 3.0)


def test_files_that_spell_one_type_in_two_ways_are_read_as_one(tmp_path: Path) -> None:
    for number, type in enumerate(("geometry_msgs/Twist", TWIST)):
        with (tmp_path / f"{number}.mcap").open("wb") as file:
            writer = McapWriter(file)
            writer.start(profile="ros2")
            schema = writer.register_schema(type, "jsonschema", b"{}")
            channel = writer.register_channel("/vel", "json", schema)
            time_ns = (BEGIN_S + number) * 10**9
            writer.add_message(channel, time_ns, b'{"linear": {"x": 3.0}}', time_ns)
            writer.finish()  # type: ignore[no-untyped-call]
    found = read(tmp_path / "0.mcap", tmp_path / "1.mcap")
    assert [(topic, type) for _, topic, type, _ in found] == [("/vel", TWIST)] * 2


def write_ros1_of_both(path: Path, drives: list[Drive]) -> Path:
    store = typestore(1, {})
    with BagWriter(path) as writer:
        for drive in drives:
            for at_s, topic, type, message in drive.messages:
                connection = writer.add_connection(topic, type, typestore=store)
                raw = store.serialize_ros1(build(store, type, message), type)
                writer.write(connection, round((BEGIN_S + at_s) * 1e9), raw)
    return path


def test_a_message_that_does_not_decode_is_counted_and_left_out(tmp_path: Path) -> None:
    bag = write_ros1(tmp_path / "a.bag", SHORT)
    content = bag.read_bytes()
    at = content.index(b"begin")
    bag.write_bytes(content[: at - 4] + b"\xff\xff\xff\x7f" + content[at:])  # the string's length
    with open_recording([bag]) as recording:
        assert len(list(recording.messages())) == 10
        assert recording.rejected == {"/text": 1}
        assert "do not fit its type" in recording.why_rejected["/text"]


def test_an_undecodable_message_is_counted_once_when_its_fields_are_read(tmp_path: Path) -> None:
    bag = write_ros1(tmp_path / "a.bag", SHORT)
    content = bag.read_bytes()
    at = content.index(b"begin")
    bag.write_bytes(content[: at - 4] + b"\xff\xff\xff\x7f" + content[at:])
    with open_recording([bag]) as recording:
        raw = [m.message for m in recording.raw_messages() if m.topic == "/text"]
        assert recording.rejected == {}
        for _ in range(2):
            with pytest.raises(Undecodable, match="do not fit its type"):
                dict(raw[0])
        assert recording.rejected == {"/text": 1}
        assert "do not fit its type" in recording.why_rejected["/text"]


def test_a_recording_without_messages_is_no_mistake(tmp_path: Path) -> None:
    with open_recording([write_ros1(tmp_path / "a.bag", Drive(messages=[]))]) as recording:
        assert (recording.count, recording.duration_s, list(recording.messages())) == (0, 0.0, [])


def test_text_that_is_not_utf_8_is_still_text(tmp_path: Path) -> None:
    bag = write_ros1(tmp_path / "a.bag", SHORT)
    bag.write_bytes(bag.read_bytes().replace(b"begin", b"\xff\xfein\0"))
    assert read(bag)[0][3]["data"].endswith("in\0")


def test_closing_frees_the_file(tmp_path: Path) -> None:
    bag = write_ros1(tmp_path / "a.bag", SHORT)
    before = len(os.listdir("/proc/self/fd"))
    for _ in range(3):
        with open_recording([bag]) as recording:
            next(iter(recording.messages()))
        with pytest.raises(RecordingUnreadable):
            open_recording([bag, tmp_path / "nowhere.bag"])
    assert len(os.listdir("/proc/self/fd")) == before


REAL = ("catvehicle_2016-06-01.bag", "catvehicle_2016-06-01_mcap", "lidar/scan_tools_hokuyo_demo.bag")


@pytest.mark.parametrize("file", REAL)
def test_real_drives_hold_what_rosbags_finds(recordings: Path, file: str) -> None:
    with AnyReader([recordings / file]) as theirs, open_recording([recordings / file]) as ours:
        assert ours.count == theirs.message_count
        for mine, (connection, time_ns, raw) in zip(ours.messages(), theirs.messages(), strict=True):
            assert (mine.at_s, mine.topic) == (time_ns / 1e9, connection.topic)
            other = theirs.deserialize(raw, connection.msgtype)
            if connection.topic.endswith("/vel"):
                assert mine.message["linear"]["x"] == other.linear.x  # type: ignore[attr-defined]
            if connection.msgtype == SCAN:
                assert np.array_equal(mine.message["ranges"], other.ranges)  # type: ignore[attr-defined]


def test_the_real_drive_is_as_its_readme_describes(recordings: Path) -> None:
    with open_recording([recordings / REAL[0]]) as recording:
        assert (recording.ros_version, recording.count, len(recording.topics)) == (1, 14_228, 9)
        assert recording.duration_s == pytest.approx(55.9, abs=0.1)
        speeds, brakes, commands = [], [], []
        for message in recording.messages():
            match message.topic:
                case "/catvehicle/vel":
                    speeds.append(message.message["linear"]["x"])
                case "/catvehicle/brake":
                    brakes.append(message.message["force"]["x"])
                case "/catvehicle/cmd_vel":
                    commands.append(message.message["angular"]["z"])
    assert max(speeds) == pytest.approx(4.23, abs=0.01)
    assert max(brakes) == pytest.approx(22.35, abs=0.01)
    assert np.isnan(commands).all()
    assert orjson.dumps({"z": commands[0]}) == b'{"z":null}'


@pytest.mark.field
@pytest.mark.parametrize("file", REAL[:2])
def test_reading_is_far_faster_than_driving(recordings: Path, file: str) -> None:
    best_s = 9.9
    for _ in range(3):
        began = time.process_time()
        with open_recording([recordings / file]) as recording:
            count = sum(1 for _ in recording.messages())
        best_s = min(best_s, time.process_time() - began)
    assert count == 14_228
    assert recording.duration_s / best_s > 300


def test_a_file_with_another_one_behind_it_is_not_whole(tmp_path: Path) -> None:
    rows: list[Row] = [(n / 10, "/text", "std_msgs/msg/String", {"data": "x" * n}) for n in range(20)]
    one = write_ros2(tmp_path / "one", Drive(messages=rows[:5])) / "one.mcap"
    other = write_ros2(tmp_path / "other", Drive(messages=rows[5:])) / "other.mcap"
    both = tmp_path / "both.mcap"
    both.write_bytes(one.read_bytes() + other.read_bytes())
    with open_recording([both]) as recording:
        assert len(list(recording.rows())) == 5
        assert [sentence for sentence in recording.damage if "left out" in sentence]
