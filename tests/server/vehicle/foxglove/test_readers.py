"""Messages of each encoding become the dicts of rosbridge; what cannot be read has a reason."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import orjson
import pytest

from server.recording.read.errors import Undecodable
from server.recording.read.schemas import TypeBook
from server.vehicle.foxglove.protocol import Channel
from server.vehicle.foxglove.readers import reader_of, why_unreadable
from tests.server.vehicle.foxglove.peer import FIX, ODOMETRY, SCAN, fix, odometry, scan

STAMP_NS = 1_700_000_000_250_000_000
MESSAGES = {ODOMETRY: lambda version: odometry(version, 4.2, STAMP_NS), FIX: lambda version: fix(version, STAMP_NS)}


def channel(type: str, encoding: str, schema_encoding: str = "", schema: str = "") -> Channel:
    return Channel(id=1, topic="/a", encoding=encoding, type=type, schema=schema, schema_encoding=schema_encoding)


def plain(value: Any) -> Any:
    return orjson.loads(orjson.dumps(value, option=orjson.OPT_SERIALIZE_NUMPY))


@pytest.mark.parametrize("version", [1, 2])
@pytest.mark.parametrize("type", MESSAGES)
@pytest.mark.parametrize("has_schema", [True, False])
def test_ros_messages_are_read(version: Any, type: str, has_schema: bool) -> None:
    known = TypeBook(version).schema(type)
    assert known is not None
    assert known.encode is not None
    message = MESSAGES[type](version)
    text = known.data.decode() if has_schema else ""
    offered = channel(known.name, known.message_encoding, known.encoding if has_schema else "", text)
    assert plain(reader_of(offered)(known.encode(message))) == message


def test_an_idl_schema_is_read() -> None:
    idl = "module my_msgs { module msg { struct Level { double value; string<5> name; }; }; };"
    read = reader_of(channel("my_msgs/msg/Level", "cdr", "ros2idl", f"{'=' * 80}\nIDL: my_msgs/msg/Level\n{idl}"))
    assert read(b"\x00\x01\x00\x00" + b"\x00\x00\x00\x00\x00\x00\xf8\x3f" + b"\x02\x00\x00\x00a\x00") == {
        "value": 1.5,
        "name": "a",
    }


def test_json_in_the_shape_of_its_type_is_read() -> None:
    message = scan(2, STAMP_NS)
    read = reader_of(channel("sensor_msgs/msg/LaserScan", "json", "jsonschema", "{}"))
    assert read(orjson.dumps(message)) == message
    assert reader_of(channel("my_msgs/msg/Unknown", "json"))(b'{"data": 1}') == {"data": 1}


@pytest.mark.parametrize("payload", [b'{"ranges": []}', b"[]", b"x", orjson.dumps(scan(1, STAMP_NS))])
def test_json_of_another_shape_is_refused(payload: bytes) -> None:
    read = reader_of(channel("sensor_msgs/msg/LaserScan", "json", "jsonschema", "{}"))
    with pytest.raises(Undecodable):
        read(payload)
    assert read(orjson.dumps(scan(2, STAMP_NS)))["angle_min"] == -1.5


@pytest.mark.parametrize(
    ("offered", "why"),
    [
        (channel("foxglove.LocationFix", "json", "jsonschema"), "no message of ROS"),
        (channel("", "json"), "not named"),
        (channel("foxglove.LocationFix", "protobuf", "protobuf"), "'protobuf' are not supported"),
        (channel("std_msgs/String", "ros1", "ros2msg"), "'ros2msg' is not supported"),
        (channel("LocationFix", "cdr", "ros2msg"), "no message of ROS"),
    ],
)
def test_what_is_not_supported_is_named(offered: Channel, why: str) -> None:
    assert why in (why_unreadable(offered) or "")
    with pytest.raises(Undecodable, match=why):
        reader_of(offered)


@pytest.mark.parametrize("schema", ["float64", "my_msgs/Other other", "string data\n" * 5000, "\x00", "float64[ x"])
def test_a_schema_that_cannot_be_read_has_a_reason(schema: str) -> None:
    offered = channel("my_msgs/msg/Level", "cdr", "ros2msg", schema)
    assert why_unreadable(offered) is None
    with pytest.raises(Undecodable):
        reader_of(offered)
    with pytest.raises(Undecodable):
        reader_of(replace(offered, schema_encoding="ros2idl"))


def test_bytes_that_do_not_fit_are_refused() -> None:
    known = TypeBook(2).schema(SCAN)
    assert known is not None
    read = reader_of(channel(known.name, "cdr", "ros2msg", known.data.decode()))
    for payload in (b"", b"\x00\x01\x00\x00", b"\x00\x01\x00\x00\xff\xff"):
        with pytest.raises(Undecodable):
            read(payload)
