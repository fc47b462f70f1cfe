"""Encoders against the serializers of rosbags, byte by byte, on messages of every shape and both roads of a bridge."""

from __future__ import annotations

import base64
import math
from typing import Any

import cbor2
import numpy as np
import orjson
import pytest
from hypothesis import HealthCheck, given, settings
from rosbags.interfaces import Nodetype

from server.recording.read.decode import compile_decoder
from server.recording.read.encode import TypeMismatch, compile_encoder
from server.recording.read.errors import Undecodable
from server.rosbridge.codec import _typed_array, cbor_bytes, json_bytes
from tests.server.recording.bags import build, typestore
from tests.server.recording.read.test_decode import DEFINITIONS, ODD, messages_of

TYPES = [
    ODD,
    "sensor_msgs/msg/LaserScan",
    "diagnostic_msgs/msg/DiagnosticArray",
    "nav_msgs/msg/Odometry",
    "sensor_msgs/msg/NavSatFix",
    "sensor_msgs/msg/Imu",
    "std_msgs/msg/Empty",
    "sensor_msgs/msg/PointCloud2",
]


def raw_of(store: Any, version: int, type: str, content: dict[str, Any]) -> bytes:
    message = build(store, type, content)
    return bytes(store.serialize_ros1(message, type) if version == 1 else store.serialize_cdr(message, type))


def through_cbor(message: Any) -> Any:
    """What a bridge's CBOR makes of it: arrays of numbers are numpy, bytes are bytes."""
    return cbor2.loads(cbor_bytes(message), tag_hook=_typed_array)


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("type", TYPES)
def test_the_bytes_are_those_of_rosbags(version: int, type: str) -> None:
    store = typestore(version, DEFINITIONS)
    decode = compile_decoder(type, store.fielddefs, version)  # type: ignore[arg-type]
    encode = compile_encoder(type, store.fielddefs, version)  # type: ignore[arg-type]

    @settings(max_examples=80, deadline=None, suppress_health_check=list(HealthCheck))
    @given(content=messages_of(store, type))
    def compare(content: dict[str, Any]) -> None:
        content.pop("structure_needs_at_least_one_member", None)
        raw = raw_of(store, version, type, content)
        message = decode(raw)
        assert encode(message) == raw
        again = decode(encode(through_cbor(message)))  # a NaN among scalars has lost its sign and payload there
        assert json_bytes(again) == json_bytes(message)

    compare()


@pytest.mark.parametrize("version", [1, 2])
def test_json_gives_the_same_bytes_but_for_what_it_cannot_say(version: int) -> None:
    store = typestore(version, DEFINITIONS)
    type = "sensor_msgs/msg/LaserScan"
    encode = compile_encoder(type, store.fielddefs, version)  # type: ignore[arg-type]
    decode = compile_decoder(type, store.fielddefs, version)  # type: ignore[arg-type]
    content = {"angle_min": -1.5, "range_max": 81.0, "ranges": [0.1, math.nan, math.inf, -math.inf, 3.0]}
    message = decode(raw_of(store, version, type, content))
    recorded = orjson.loads(json_bytes(message))
    assert recorded["ranges"][1:4] == [None, None, None]
    ranges = decode(encode(recorded))["ranges"]
    assert ranges[0] == np.float32(0.1)
    assert np.isnan(ranges[1:4]).all(), "null is NaN, whichever of the three it was"
    assert decode(encode(through_cbor(message)))["ranges"].tobytes() == message["ranges"].tobytes()


def twist(**changes: Any) -> dict[str, Any]:
    return {"linear": {"x": 1.0, "y": 0, "z": None}, "angular": {"x": 0.0, "y": 0.0, "z": 0.5}} | changes


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize(
    ("type", "message"),
    [
        ("geometry_msgs/msg/Twist", {}),
        ("geometry_msgs/msg/Twist", []),
        ("geometry_msgs/msg/Twist", None),
        ("geometry_msgs/msg/Twist", {"linear": twist()["linear"]}),
        ("geometry_msgs/msg/Twist", twist(extra=1)),
        ("geometry_msgs/msg/Twist", twist(linear={"x": 1.0, "y": 0.0, "w": 0.0})),
        ("geometry_msgs/msg/Twist", twist(linear=[1.0, 0.0, 0.0])),
        ("geometry_msgs/msg/Twist", twist(linear={"x": "1.0", "y": 0.0, "z": 0.0})),
        ("geometry_msgs/msg/Twist", twist(linear={"x": True, "y": 0.0, "z": 0.0})),
        ("std_msgs/msg/Int32", {"data": 1.0}),
        ("std_msgs/msg/Int32", {"data": 2**31}),
        ("std_msgs/msg/Int32", {"data": None}),
        ("std_msgs/msg/Int32", {"data": True}),
        ("std_msgs/msg/Float32", {"data": 1e300}),
        ("std_msgs/msg/Float64", {"data": 10**400}),
        ("std_msgs/msg/Bool", {"data": "yes"}),
        ("std_msgs/msg/Bool", {"data": None}),
        ("std_msgs/msg/String", {"data": 7}),
        ("std_msgs/msg/String", {"data": "\ud800"}),
        ("std_msgs/msg/Byte", {"data": 256}),
        ("std_msgs/msg/Byte", {"data": "not base64"}),
        ("std_msgs/msg/Byte", {"data": [1]}),
        ("my_msgs/msg/Lists", {"b": [0, 256], "f": [], "i": [], "s": [], "o": []}),
        ("my_msgs/msg/Lists", {"b": "*", "f": [], "i": [], "s": [], "o": []}),
        ("my_msgs/msg/Lists", {"b": [], "f": ["1"], "i": [], "s": [], "o": []}),
        ("my_msgs/msg/Lists", {"b": [], "f": None, "i": [], "s": [], "o": []}),
        ("my_msgs/msg/Lists", {"b": [], "f": "1.0", "i": [], "s": [], "o": []}),
        ("my_msgs/msg/Lists", {"b": [], "f": [], "i": [1.5], "s": [], "o": []}),
        ("my_msgs/msg/Lists", {"b": [], "f": [], "i": [None], "s": [], "o": []}),
        ("my_msgs/msg/Lists", {"b": [], "f": [], "i": [], "s": [None], "o": []}),
        ("my_msgs/msg/Lists", {"b": [], "f": [], "i": [], "s": "abc", "o": []}),
        ("my_msgs/msg/Lists", {"b": [], "f": [], "i": [], "s": [], "o": [2]}),
        ("my_msgs/msg/Pair", {"p": [1.0]}),
        ("my_msgs/msg/Pair", {"p": [1.0, 2.0, 3.0]}),
        ("my_msgs/msg/Pair", {"p": np.zeros((1, 2), np.float32)}),
    ],
)
def test_what_is_not_of_its_type_is_refused(version: int, type: str, message: Any) -> None:
    more = {
        "my_msgs/msg/Lists": "uint8[] b\nfloat32[] f\nint16[] i\nstring[] s\nbool[] o\n",
        "my_msgs/msg/Pair": "float32[2] p\n",
    }
    store = typestore(version, more)
    with pytest.raises(TypeMismatch):
        compile_encoder(type, store.fielddefs, version)(message)  # type: ignore[arg-type]


def test_numbers_come_in_the_shapes_that_bridges_give_them() -> None:
    store = typestore(1, {"my_msgs/msg/Lists": "uint8[] b\nfloat32[] f\nbyte[] l\nbool[] o\n"})
    encode = compile_encoder("my_msgs/msg/Lists", store.fielddefs, 1)
    usual = {"b": b"\1\2", "f": [1.0, 2.0], "l": [1, -1], "o": [True, False]}
    expected = encode(usual)
    for change in (
        {"b": base64.b64encode(b"\1\2").decode()},
        {"b": [1, 2]},
        {"b": np.array([1, 2], np.uint8)},
        {"f": [1, 2]},
        {"f": np.array([1, 2], np.float32)},
        {"f": np.array([1, 2], ">f4")},
        {"f": np.array([1, 2], np.float64)},
        {"l": [1, 255]},
        {"l": np.array([1, -1], np.int8)},
        {"o": [1, 0]},
        {"o": np.array([True, False])},
    ):
        assert encode(usual | change) == expected, change
    level = compile_encoder("std_msgs/msg/Byte", store.fielddefs, 1)
    assert {level({"data": given}) for given in (2, "2", "\2", "Ag==", b"\2")} == {b"\2"}


def test_types_that_cannot_be_written_say_why() -> None:
    for version in (1, 2):
        for definitions, why in (
            ({}, "the definition of a/msg/B is missing"),
            ({"a/msg/B": ([], [("again", (Nodetype.NAME, "a/msg/B"))])}, "contains itself"),
            ({"a/msg/B": ([], [("x", (Nodetype.BASE, ("wstring", 0)))])}, "wstring are not supported"),
            ({"a/msg/B": ([], [("x", (Nodetype.SEQUENCE, ((Nodetype.BASE, ("float128", 0)), 0)))])}, "not supported"),
        ):
            with pytest.raises(Undecodable, match=why):
                compile_encoder("a/msg/B", definitions, version)  # type: ignore[arg-type]


def test_a_definition_cannot_smuggle_in_code() -> None:
    name = "x'] or __import__('os').abort() or v['"
    encode = compile_encoder("a/msg/B", {"a/msg/B": ([], [(name, (Nodetype.BASE, ("uint8", 0)))])}, 1)
    assert encode({name: 7}) == b"\x07"
