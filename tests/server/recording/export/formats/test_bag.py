"""Recordings as ROS 1 bags: equal message for message, understood by the readers of others and by ROS itself."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any, Literal

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.highlevel import AnyReader
from rosbags.rosbag1 import Reader as Reader1

from server.recording.export import to_ros1
from server.recording.export.bag_file import CHUNK_BYTES, BagFile, BagTimeOutOfRange
from server.recording.export.export_format import ExportRefused, Outcome
from server.recording.export.formats.bag import write_bag
from server.recording.read.read import open_recording
from tests.server.recording.bags import BEGIN_S, Drive, Row, write_ros1, write_ros2
from tests.server.recording.export.ours import OurFile, as_ours, event

TEXT, INT, SCAN = "std_msgs/msg/String", "std_msgs/msg/Int32", "sensor_msgs/msg/LaserScan"
MICROSECOND = 1e-6
COMPRESSIONS: tuple[Literal["none", "bz2", "lz4"], ...] = ("none", "bz2", "lz4")


def export(source: Path, path: Path, **options: Any) -> Outcome:
    with open_recording([source]) as recording:
        return write_bag(recording, path, **options)


def equal(one: Any, other: Any) -> bool:
    """Values field by field; NaN is itself, ±Inf keep their sign, arrays keep their kind."""
    if isinstance(one, dict):
        return isinstance(other, dict) and one.keys() == other.keys() and all(equal(one[k], other[k]) for k in one)
    if isinstance(one, np.ndarray):
        return (
            isinstance(other, np.ndarray)
            and one.dtype == other.dtype
            and np.array_equal(one, other, equal_nan=one.dtype.kind == "f")
        )
    if isinstance(one, list):
        return isinstance(other, list) and len(one) == len(other) and all(map(equal, one, other))
    if isinstance(one, float):
        return isinstance(other, float) and (one == other or (one != one and other != other))
    return type(one) is type(other) and bool(one == other)


def as_ros1(value: Any) -> Any:
    """A ROS 2 message as its ROS 1 counterpart is spelled; what a header's `seq` was, nobody knows: 0."""
    if isinstance(value, dict):
        if value.keys() == {"sec", "nanosec"}:
            return {"secs": value["sec"], "nsecs": value["nanosec"]}
        found = {name: as_ros1(inner) for name, inner in value.items()}
        return {"seq": 0, **found} if found.keys() == {"stamp", "frame_id"} else found
    return [as_ros1(inner) for inner in value] if isinstance(value, list) else value


def assert_same(source: Path, exported: Path) -> int:
    """All messages in their order: topic, type, every field, time of reception to a microsecond."""
    count = 0
    with open_recording([source]) as before, open_recording([exported]) as after:
        assert {topic: info.count for topic, info in before.topics.items()} == {
            topic: info.count for topic, info in after.topics.items()
        }
        for old, new in zip(before.messages(), after.messages(), strict=True):
            count += 1
            assert (old.topic, old.type.replace("/msg/", "/")) == (new.topic, new.type)
            assert abs(old.at_s - new.at_s) <= MICROSECOND
            message = old.message if before.ros_version == 1 else as_ros1(old.message)
            assert equal(message, new.message), (old, new)
    return count


@pytest.mark.parametrize("compression", COMPRESSIONS)
@pytest.mark.parametrize(
    "name", ["catvehicle_2016-06-01.bag", "catvehicle_2016-06-01_mcap", "lidar/scan_tools_hokuyo_demo.bag"]
)
def test_a_real_drive_recorded_and_exported_equals_the_original(
    recordings: Path, tmp_path: Path, name: str, compression: Literal["none", "bz2", "lz4"]
) -> None:
    ours = as_ours(recordings / name, tmp_path / "ours.mcap")
    outcome = export(ours, tmp_path / "out.bag", compression=compression)
    assert outcome.notes == []
    assert assert_same(recordings / name, tmp_path / "out.bag") == outcome.entries >= 360


def test_sums_and_definitions_of_a_real_drive_stay(recordings: Path, tmp_path: Path) -> None:
    original = recordings / "catvehicle_2016-06-01.bag"
    export(as_ours(original, tmp_path / "ours.mcap"), tmp_path / "one.bag")
    export(as_ours(recordings / "catvehicle_2016-06-01_mcap", tmp_path / "ours2.mcap"), tmp_path / "two.bag")

    def declared(path: Path) -> dict[str, tuple[str, str, str]]:
        with Reader1(path) as bag:
            return {c.topic: (c.msgtype, c.digest, c.msgdef.data) for c in bag.connections}

    assert declared(tmp_path / "one.bag") == declared(original)
    assert {t: d[:2] for t, d in declared(tmp_path / "two.bag").items()} == {
        t: d[:2] for t, d in declared(original).items()
    }


ODD = [float("nan"), float("inf"), float("-inf"), 0.0, -0.0, 1e-45, 3.4e38]


@pytest.mark.parametrize("version", [1, 2])
def test_nan_and_infinities_stay_apart(tmp_path: Path, version: int) -> None:
    drive = Drive(
        messages=[(0.0, "/scan", SCAN, {"ranges": ODD, "angle_min": float("nan"), "range_max": float("inf")})]
    )
    write = write_ros1 if version == 1 else write_ros2
    source = write(tmp_path / f"in{'.bag' if version == 1 else ''}", drive)
    export(as_ours(source, tmp_path / "ours.mcap"), tmp_path / "out.bag")
    assert assert_same(source, tmp_path / "out.bag") == 1
    with open_recording([tmp_path / "out.bag"]) as after:
        (message,) = after.messages()
    assert np.array_equal(message.message["ranges"], np.array(ODD, np.float32), equal_nan=True)
    assert np.signbit(message.message["ranges"][4])


SCALARS = {
    "bool": st.booleans(),
    "int8": st.integers(-128, 127),
    "uint8": st.integers(0, 255),
    "int16": st.integers(-(2**15), 2**15 - 1),
    "uint32": st.integers(0, 2**32 - 1),
    "int64": st.integers(-(2**63), 2**63 - 1),
    "uint64": st.integers(0, 2**64 - 1),
    "float32": st.floats(width=32),
    "float64": st.floats(),
    "string": st.text(st.characters(exclude_characters="\0", exclude_categories=("Cs",)), max_size=20),
}


@st.composite
def typed(draw: st.DrawFn) -> tuple[str, list[dict[str, Any]]]:
    """A message type with any fields in any order, and messages of it."""
    kinds = draw(
        st.lists(
            st.tuples(st.sampled_from(sorted(SCALARS)), st.sampled_from(["", "[]", "[3]"])), min_size=1, max_size=8
        )
    )
    text = "\n".join(["std_msgs/Header header", *(f"{kind}{shape} f{n}" for n, (kind, shape) in enumerate(kinds))])

    def values(kind: str, shape: str) -> st.SearchStrategy[Any]:
        if not shape:
            return SCALARS[kind]
        return st.lists(SCALARS[kind], min_size=3 if shape == "[3]" else 0, max_size=3)

    one = st.fixed_dictionaries(
        {
            "header": st.fixed_dictionaries(
                {
                    "stamp": st.fixed_dictionaries(
                        {"sec": st.integers(0, 2**31 - 1), "nanosec": st.integers(0, 10**9 - 1)}
                    ),
                    "frame_id": SCALARS["string"],
                }
            )
        }
        | {f"f{n}": values(kind, shape) for n, (kind, shape) in enumerate(kinds)}
    )
    return text, draw(st.lists(one, min_size=1, max_size=3))


@settings(
    max_examples=25, deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow]
)
@given(typed())
def test_any_ros_2_type_becomes_the_same_values_in_ros_1(
    tmp_path_factory: pytest.TempPathFactory, made: tuple[str, list[dict[str, Any]]]
) -> None:
    text, messages = made
    folder = tmp_path_factory.mktemp("any")
    rows: list[Row] = [(0.1 * n, "/any", "my_msgs/msg/Any", message) for n, message in enumerate(messages)]
    source = write_ros2(folder / "in", Drive(messages=rows, definitions={"my_msgs/msg/Any": text}))
    outcome = export(source, folder / "out.bag")
    assert (outcome.entries, outcome.notes) == (len(messages), [])
    assert assert_same(source, folder / "out.bag") == len(messages)
    with AnyReader([folder / "out.bag"]) as other:  # which reads it by the definition in the bag
        assert len(list(other.messages())) == len(messages)


def test_types_that_ros_1_knows_take_its_sum(tmp_path: Path) -> None:
    tree = {"transforms": [{"child_frame_id": "laser"}]}
    rows: list[Row] = [(0.0, "/tf", "tf2_msgs/msg/TFMessage", tree), (0.1, "/go", "std_msgs/msg/Empty", {})]
    export(write_ros2(tmp_path / "in", Drive(messages=rows)), tmp_path / "out.bag")
    with Reader1(tmp_path / "out.bag") as bag:
        assert {c.topic: c.digest for c in bag.connections} == {
            "/tf": "94810edda583a504dfda3829e70d7eec",  # as wiki.ros.org/tf2_msgs has it
            "/go": "d41d8cd98f00b204e9800998ecf8427e",
        }
    assert assert_same(tmp_path / "in", tmp_path / "out.bag") == 2


def test_what_ros_1_has_no_place_for_is_named(tmp_path: Path) -> None:
    definitions = {"my_msgs/msg/Wide": "wstring data\nint32 n"}
    made = OurFile(tmp_path / "ours.mcap", profile="ros2")
    made.write(BEGIN_S * 10**9, "/n", INT, "int32 data", "cdr", b"\0\1\0\0\7\0\0\0")
    made.write(BEGIN_S * 10**9, "/wide", "my_msgs/msg/Wide", definitions["my_msgs/msg/Wide"], "cdr", bytes(20))
    made.write(BEGIN_S * 10**9, "/odd", "my_msgs/msg/Odd", "", "json", b'{"a":1}')
    made.write(BEGIN_S * 10**9 + 5, "/n", INT, "int32 data", "cdr", b"\0\1\0\0\7")
    outcome = export(made.close(), tmp_path / "out.bag")
    assert outcome.entries == 1
    notes = "\n".join(outcome.notes)
    assert "/wide (1 messages) is left out" in notes
    assert "/odd (1 messages) is left out: it was recorded as JSON" in notes
    assert "1 messages on /n are left out: its 5 bytes do not fit its type." in notes


@pytest.mark.parametrize("behind", [b"\0" * 4, b"\xff" * 8])
@pytest.mark.parametrize("type", ["std_msgs/msg/Int32", "my_msgs/msg/Number"])
@pytest.mark.parametrize("order", ["little", "big"])
def test_of_a_message_with_bytes_behind_its_last_field_the_fields_are_kept(
    tmp_path: Path, behind: bytes, type: str, order: Literal["little", "big"]
) -> None:
    head = b"\0\1\0\0" if order == "little" else b"\0\0\0\0"
    made = OurFile(tmp_path / "ours.mcap", profile="ros2")
    for number, rest in enumerate([b"", behind, behind]):
        data = head + number.to_bytes(4, order) + rest
        made.write(BEGIN_S * 10**9 + number, "/n", type, "int32 data", "cdr", data)
    outcome = export(made.close(), tmp_path / "out.bag")
    assert outcome.entries == 3
    assert "2 messages on /n have bytes behind their last field: these are left out." in outcome.notes
    with open_recording([tmp_path / "out.bag"]) as after:
        assert [message.message for message in after.messages()] == [{"data": 0}, {"data": 1}, {"data": 2}]


def test_fixed_arrays_longer_than_the_bytes_or_the_bound_are_refused(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(to_ros1, "MAX_FIELDS", 20)
    types = {
        "/long": ("my_msgs/msg/Long", "float64[40] data"),
        "/many": ("my_msgs/msg/Many", "string[40] data"),
    }
    made = OurFile(tmp_path / "ours.mcap", profile="ros2")
    made.write(BEGIN_S * 10**9, "/n", INT, "int32 data", "cdr", b"\0\1\0\0\7\0\0\0")
    for topic, (type, definition) in types.items():
        made.write(BEGIN_S * 10**9, topic, type, definition, "cdr", b"\0\1\0\0" + bytes(8))
    outcome = export(made.close(), tmp_path / "out.bag")
    assert outcome.entries == 1
    assert "1 messages on /long are left out: its 12 bytes do not fit its type." in outcome.notes
    assert "/many (1 messages) is left out: its definition has too many fields." in outcome.notes


def test_fields_without_a_place_are_named(tmp_path: Path) -> None:
    marker = {"ns": "a", "text": "b", "mesh_file": {"filename": "c"}}
    rows: list[Row] = [(0.0, "/mark", "visualization_msgs/msg/Marker", marker)]
    outcome = export(write_ros2(tmp_path / "in", Drive(messages=rows)), tmp_path / "out.bag")
    assert outcome.entries == 1
    assert "visualization_msgs/Marker.mesh_file" in outcome.notes[0]
    assert "left out of /mark" in outcome.notes[0]
    with open_recording([tmp_path / "out.bag"]) as after:
        (message,) = after.messages()
    assert (message.message["ns"], message.message["text"]) == ("a", "b")


@pytest.mark.parametrize("with_own", [True, False])
def test_our_own_channels_are_text_or_left_out(tmp_path: Path, with_own: bool) -> None:
    source = write_ros1(
        tmp_path / "in.bag", Drive(messages=[(0.0, "/n", INT, {"data": 1}), (2.0, "/n", INT, {"data": 2})])
    )
    alarm = event(1, BEGIN_S * 1000 + 1000, "raised", text="3.2 m/s, limit 3.0 m/s – zu schnell")
    ours = as_ours(source, tmp_path / "ours.mcap", [(BEGIN_S * 10**9 + 10**9, "/catgraph/alarms", alarm)])
    outcome = export(ours, tmp_path / "out.bag", with_own=with_own)
    with open_recording([tmp_path / "out.bag"]) as after:
        found = [(m.topic, m.type, m.message["data"]) for m in after.messages() if m.topic != "/n"]
        rows = [m.message["data"] for m in after.messages() if m.topic == "/n"]
    assert rows == [1, 2]
    assert outcome.entries == (3 if with_own else 2)
    if not with_own:
        assert found == []
    else:
        ((topic, type, data),) = found
        assert (topic, type) == ("/catgraph/alarms", "std_msgs/String")
        assert json.loads(data) == {"time_ms": BEGIN_S * 1000 + 1000} | alarm


def test_latched_topics_stay_latched(tmp_path: Path) -> None:
    rows: list[Row] = [(0.0, "/map", TEXT, {"data": "x"}), (0.1, "/n", INT, {"data": 1})]
    source = write_ros2(tmp_path / "in", Drive(messages=rows, latched={"/map"}))
    export(source, tmp_path / "out.bag")
    with Reader1(tmp_path / "out.bag") as bag:
        assert {c.topic: c.ext.latching for c in bag.connections} == {"/map": 1, "/n": 0}


def test_several_files_of_one_drive_are_one_bag(tmp_path: Path) -> None:
    one = write_ros1(tmp_path / "a.bag", Drive(messages=[(0.0, "/n", INT, {"data": 0}), (2.0, "/n", INT, {"data": 2})]))
    two = write_ros1(tmp_path / "b.bag", Drive(messages=[(1.0, "/n", INT, {"data": 1}), (3.0, "/n", INT, {"data": 3})]))
    with open_recording([one, two]) as recording:
        write_bag(recording, tmp_path / "out.bag")
    with open_recording([tmp_path / "out.bag"]) as after:
        assert [m.message["data"] for m in after.messages()] == [0, 1, 2, 3]
    with Reader1(tmp_path / "out.bag") as bag:
        assert len(bag.connections) == 1


def test_an_empty_recording_is_refused(tmp_path: Path) -> None:
    with pytest.raises(ExportRefused, match="Nothing in this recording"):
        export(OurFile(tmp_path / "ours.mcap").close(), tmp_path / "out.bag")


def test_a_bag_has_many_small_chunks_and_an_index(tmp_path: Path) -> None:
    bag = BagFile(tmp_path / "out.bag")
    number = bag.add_connection("/x", "std_msgs/String", "992ce8a1687cec8c8bd883ec73ca41d1", "string data\n")
    text = b"x" * 1000
    for n in range(3000):
        bag.write(number, 10**18 + n * 10**6, (1000).to_bytes(4, "little") + text)
    bag.close()
    with Reader1(tmp_path / "out.bag") as other:
        assert other.message_count == 3000
        assert len(other.chunks) == 3000 * 1050 // CHUNK_BYTES + 1
        assert (other.start_time, other.end_time - 1) == (10**18, 10**18 + 2999 * 10**6)


@pytest.mark.parametrize(
    ("time_ns", "fits"), [(-1, False), (0, True), (2**32 * 10**9 - 1, True), (2**32 * 10**9, False)]
)
def test_times_that_no_bag_can_hold(tmp_path: Path, time_ns: int, fits: bool) -> None:
    bag = BagFile(tmp_path / "out.bag")
    number = bag.add_connection("/x", "std_msgs/Empty", "d41d8cd98f00b204e9800998ecf8427e", "")
    if fits:
        bag.write(number, time_ns, b"")
    else:
        with pytest.raises(BagTimeOutOfRange):
            bag.write(number, time_ns, b"")
    bag.close()


def test_a_standard_type_from_a_bridge_has_its_true_sum(tmp_path: Path) -> None:
    """A bridge tells fields and no constants, and without them the sum would be another."""
    definition = (
        "std_msgs/Header header\nsensor_msgs/NavSatStatus status\nfloat64 latitude\nfloat64 longitude\n"
        "float64 altitude\nfloat64[9] position_covariance\nuint8 position_covariance_type\n"
        f"{'=' * 80}\nMSG: std_msgs/Header\nuint32 seq\ntime stamp\nstring frame_id\n"
        f"{'=' * 80}\nMSG: sensor_msgs/NavSatStatus\nint8 status\nuint16 service\n"
    )
    made = OurFile(tmp_path / "ours.mcap")
    made.write(BEGIN_S * 10**9, "/fix", "sensor_msgs/NavSatFix", definition, "ros1", bytes(116))
    export(made.close(), tmp_path / "out.bag")
    with Reader1(tmp_path / "out.bag") as bag:
        (connection,) = bag.connections
        assert connection.digest == "2d3a8cd499b9b4a0249fb98fd05cfa48"
        assert "COVARIANCE_TYPE_KNOWN" in connection.msgdef.data
