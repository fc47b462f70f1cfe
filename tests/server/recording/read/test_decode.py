"""Decoders against the ones of rosbags, field by field, on messages of every shape."""

from __future__ import annotations

import contextlib
import dataclasses
import math
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype

from server.recording.read.decode import compile_decoder
from server.recording.read.errors import Undecodable
from tests.server.recording.bags import build, typestore

ODD = "my_msgs/msg/Odd"
DEFINITIONS = {
    ODD: """
bool flag
float64 far
string text
uint8 tiny
int64[] longs
string[] texts
float32[3] triple
uint8[] blob
char[2] letters
int16 small
my_msgs/Inner[] inners
my_msgs/Inner[2] pair
float64 last
bool[] flags
byte level
duration span
uint16 after
""",
    "my_msgs/msg/Inner": "uint8 a\nfloat64 b\nstring c\nint32[] d\ntime at\n",
}
RANGES = {
    "byte": (-128, 127), "char": (0, 255), "int8": (-128, 127), "uint8": (0, 255), "int16": (-(2**15), 2**15 - 1),
    "uint16": (0, 2**16 - 1), "int32": (-(2**31), 2**31 - 1), "uint32": (0, 2**32 - 1), "int64": (-(2**63), 2**63 - 1),
    "uint64": (0, 2**64 - 1),
}  # fmt: skip


def plain(message: Any, version: int) -> Any:
    """A message of rosbags in the shape that is expected of ours."""
    if dataclasses.is_dataclass(message):
        type = message.__msgtype__  # type: ignore[attr-defined]
        if version == 1 and type in ("builtin_interfaces/msg/Time", "builtin_interfaces/msg/Duration"):
            return {"secs": message.sec, "nsecs": message.nanosec}  # type: ignore[attr-defined]
        names = [f.name for f in dataclasses.fields(message) if f.name != "__msgtype__" and not f.name.isupper()]
        return {n: plain(getattr(message, n), version) for n in names if n != "structure_needs_at_least_one_member"}
    if isinstance(message, list):
        return [plain(item, version) for item in message]
    return bytes(message) if isinstance(message, np.ndarray) and message.dtype == np.uint8 else message


def assert_same(ours: Any, theirs: Any) -> None:
    if isinstance(theirs, dict):
        assert list(ours) == list(theirs)
        for name in theirs:
            assert_same(ours[name], theirs[name])
    elif isinstance(theirs, np.ndarray):
        assert isinstance(ours, np.ndarray)
        assert ours.dtype == theirs.dtype
        assert np.array_equal(ours, theirs, equal_nan=theirs.dtype.kind == "f")
    elif isinstance(theirs, list):
        assert len(ours) == len(theirs)
        for mine, other in zip(ours, theirs, strict=True):
            assert_same(mine, other)
    elif isinstance(theirs, float) and math.isnan(theirs):
        assert math.isnan(ours)
    else:
        assert type(ours) is type(theirs)
        assert ours == theirs


def messages_of(store: Any, type: str) -> st.SearchStrategy[dict[str, Any]]:
    return st.fixed_dictionaries({name: values_of(store, field) for name, field in store.fielddefs[type][1]})


def values_of(store: Any, field: Any) -> st.SearchStrategy[Any]:
    kind, what = field
    if kind == Nodetype.NAME:
        if what.endswith(("/Time", "/Duration")):  # of one sign in ROS 1, of another in ROS 2
            return st.fixed_dictionaries({"sec": st.integers(0, 2**31 - 1), "nanosec": st.integers(0, 10**9 - 1)})
        return messages_of(store, what)
    if kind == Nodetype.BASE:
        match what[0]:
            case "bool":
                return st.booleans()
            case "string":
                return st.text(st.characters(exclude_categories=["Cs"], exclude_characters="\0"), max_size=9)
            case "float32":
                return st.floats(width=32)
            case "float64":
                return st.floats()
            case name:
                return st.integers(*RANGES[name])
    item, length = what
    low, high = (length, length) if kind == Nodetype.ARRAY else (0, 4)
    return st.lists(values_of(store, item), min_size=low, max_size=high)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize(
    "type",
    [
        ODD,
        "sensor_msgs/msg/LaserScan",
        "diagnostic_msgs/msg/DiagnosticArray",
        "nav_msgs/msg/Odometry",
        "std_msgs/msg/Empty",
    ],
)
def test_every_message_reads_as_rosbags_reads_it(version: int, type: str) -> None:
    store = typestore(version, DEFINITIONS)
    decode = compile_decoder(type, store.fielddefs, version)  # type: ignore[arg-type]

    @settings(max_examples=60, deadline=None, suppress_health_check=list(HealthCheck))
    @given(content=messages_of(store, type), little=st.booleans())
    def compare(content: dict[str, Any], little: bool) -> None:
        message = build(store, type, content)
        if version == 1:
            raw = bytes(store.serialize_ros1(message, type))
            theirs = store.deserialize_ros1(raw, type)
        else:
            raw = bytes(store.serialize_cdr(message, type, little_endian=little))
            theirs = store.deserialize_cdr(raw, type)
        assert_same(decode(raw), plain(theirs, version))

    compare()


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("type", [ODD, "sensor_msgs/msg/LaserScan", "diagnostic_msgs/msg/DiagnosticArray"])
def test_bytes_that_do_not_fit_are_refused_and_nothing_else(version: int, type: str) -> None:
    store = typestore(version, DEFINITIONS)
    decode = compile_decoder(type, store.fielddefs, version)  # type: ignore[arg-type]

    @settings(max_examples=300, deadline=None, suppress_health_check=list(HealthCheck))
    @given(raw=st.binary(max_size=300), head=st.sampled_from([b"", b"\0\1\0\0", b"\0\0\0\0"]))
    def try_to(raw: bytes, head: bytes) -> None:
        with contextlib.suppress(Undecodable):
            assert isinstance(decode(head + raw), dict)

    try_to()


@pytest.mark.parametrize("version", [1, 2])
def test_a_message_cut_anywhere_is_refused(version: int) -> None:
    store = typestore(version, {})
    type = "diagnostic_msgs/msg/DiagnosticArray"
    status = {
        "level": 2,
        "name": "lidar",
        "message": "blind",
        "hardware_id": "x",
        "values": [{"key": "a", "value": "b"}],
    }
    message = build(store, type, {"status": [status, status]})
    raw = bytes(store.serialize_ros1(message, type) if version == 1 else store.serialize_cdr(message, type))
    decode = compile_decoder(type, store.fielddefs, version)  # type: ignore[arg-type]
    assert decode(raw)["status"][1]["values"] == [{"key": "a", "value": "b"}]
    for size in range(len(raw)):
        with pytest.raises(Undecodable):
            decode(raw[:size])


def test_arrays_are_copies_that_may_be_kept() -> None:
    store = typestore(1, {})
    type = "sensor_msgs/msg/LaserScan"
    raw = bytearray(store.serialize_ros1(build(store, type, {"ranges": [1.0, 2.0]}), type))
    ranges = compile_decoder(type, store.fielddefs, 1)(bytes(raw))["ranges"]
    assert ranges.flags.aligned
    assert ranges.flags.owndata
    assert ranges.flags.writeable


@pytest.mark.parametrize(
    ("definitions", "why"),
    [
        ({}, "the definition of a/msg/B is missing"),
        ({"a/msg/B": ([], [("c", (Nodetype.NAME, "a/msg/C"))])}, "the definition of a/msg/C is missing"),
        ({"a/msg/B": ([], [("again", (Nodetype.NAME, "a/msg/B"))])}, "contains itself"),
        ({"a/msg/B": ([], [("x", (Nodetype.BASE, ("float128", 0)))])}, "fields of the kind float128 are not supported"),
        ({"a/msg/B": ([], [("x", (Nodetype.BASE, ("wstring", 0)))])}, "fields of the kind wstring are not supported"),
    ],
)
def test_types_that_cannot_be_read_say_why(definitions: dict[str, Any], why: str) -> None:
    for version in (1, 2):
        with pytest.raises(Undecodable, match=why):
            compile_decoder("a/msg/B", definitions, version)  # type: ignore[arg-type]


def test_a_definition_cannot_smuggle_in_code() -> None:
    name = "x'] or 1 / 0 or v['"
    decode = compile_decoder("a/msg/B", {"a/msg/B": ([], [(name, (Nodetype.BASE, ("uint8", 0)))])}, 1)
    assert decode(b"\x07") == {name: 7}


def test_other_encodings_are_named() -> None:
    decode = compile_decoder("std_msgs/msg/Int32", typestore(2, {}).fielddefs, 2)
    for raw in (b"", b"\0", b"\0\3\0\0\1\0\0\0", b"{}"):
        with pytest.raises(Undecodable, match="is not plain CDR"):
            decode(raw)


def test_a_list_that_is_longer_than_what_is_left_is_refused() -> None:
    definitions = {
        "a/msg/B": ([], [("voids", (Nodetype.SEQUENCE, ((Nodetype.NAME, "a/msg/Void"), 0)))]),
        "a/msg/Void": ([], []),
    }
    with pytest.raises(Undecodable):
        compile_decoder("a/msg/B", definitions, 1)(b"\5\0\0\0")
