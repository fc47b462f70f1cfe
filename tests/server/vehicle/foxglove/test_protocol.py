"""What a Foxglove server sends is read, and what is no such thing is refused with a reason."""

from __future__ import annotations

import struct
from typing import Any

import orjson
import pytest

from server.vehicle.foxglove import protocol
from server.vehicle.foxglove.protocol import (
    Advertise,
    BadFrame,
    Channel,
    GraphUpdate,
    MessageData,
    Other,
    ServerInfo,
    Status,
    Unadvertise,
    read,
)

ROW = {"id": 1, "topic": "/a", "encoding": "cdr", "schemaName": "std_msgs/msg/String", "schema": "string data"}
CHANNEL = Channel(
    id=1, topic="/a", encoding="cdr", type="std_msgs/msg/String", schema="string data", schema_encoding="ros2msg"
)


def text(op: str, **fields: Any) -> bytes:
    return orjson.dumps({"op": op, **fields})


@pytest.mark.parametrize(
    ("frame", "found"),
    [
        (
            text("serverInfo", name="b", capabilities=["clientPublish"], supportedEncodings=["cdr"], sessionId="7"),
            ServerInfo("b", frozenset({"clientPublish"}), ("cdr",), "7"),
        ),
        (text("serverInfo"), ServerInfo("", frozenset(), (), "")),
        (text("serverInfo", name=7, capabilities="x", supportedEncodings=[1]), ServerInfo("", frozenset(), (), "")),
        (text("status", level=1, message="slow"), Status("warning", "slow")),
        (text("status", level=2, message="full", id="x"), Status("error", "full")),
        (text("status", level="high", message="odd"), Status("info", "odd")),
        (text("advertise", channels=[ROW | {"schemaEncoding": "ros2msg"}]), Advertise((CHANNEL,), 0, 0)),
        (text("unadvertise", channelIds=[1, -1, "2", True, 3]), Unadvertise((1, 3))),
        (
            text(
                "connectionGraphUpdate",
                publishedTopics=[{"name": "/a", "publisherIds": ["/n"]}, {"name": 7}],
                subscribedTopics=[{"name": "/b", "subscriberIds": ["/m", 3]}],
                removedTopics=["/c"],
            ),
            GraphUpdate({"/a": ("/n",)}, {"/b": ("/m",)}, ("/c",)),
        ),
        (text("connectionGraphUpdate"), GraphUpdate({}, {}, ())),
        (text("parameterValues", parameters=[]), Other("parameterValues")),
    ],
)
def test_text_is_read(frame: bytes, found: protocol.Received) -> None:
    assert read(frame, False) == found


def test_a_message_is_read() -> None:
    frame = struct.pack("<BIQ", 1, 9, 1_700_000_000_000_000_001) + b"\x00\x01"
    assert read(frame, True) == MessageData(9, 1_700_000_000_000_000_001, b"\x00\x01")
    assert read(frame[:13], True) == MessageData(9, 1_700_000_000_000_000_001, b"")
    assert protocol.subscription_of(frame) == 9
    assert protocol.subscription_of(b"\x02" + frame[1:]) is None
    assert protocol.subscription_of(frame[:12]) is None


def test_a_time_is_nothing_to_act_on() -> None:
    assert read(struct.pack("<BQ", 2, 5), True) == Other("binary 2")


@pytest.mark.parametrize(
    ("frame", "is_binary", "why"),
    [
        (b"", True, "empty"),
        (b"\x01\x00\x00\x00\x00", True, "too short"),
        (b"\xff", False, "not JSON"),
        (b"[]", False, "not an operation"),
        (b'{"op":7}', False, "not an operation"),
        (text("advertise"), False, "without channels"),
        (text("unadvertise", channelIds=1), False, "without channels"),
    ],
)
def test_what_is_no_frame_has_a_reason(frame: bytes, is_binary: bool, why: str) -> None:
    with pytest.raises(BadFrame, match=why):
        read(frame, is_binary)


@pytest.mark.parametrize(
    "change",
    [
        {"id": -1}, {"id": 2**32}, {"id": True}, {"id": "1"}, {"topic": ""}, {"topic": 7}, {"topic": "/" + "a" * 300},
        {"encoding": None}, {"schemaName": ["x"]}, {"schema": 7}, {"schema": "x" * (protocol.MAX_SCHEMA + 1)},
        {"schemaEncoding": 7},
    ],
)  # fmt: skip
def test_a_channel_that_cannot_be_read_costs_no_other(change: dict[str, Any]) -> None:
    found = read(text("advertise", channels=[ROW | change, 7, ROW | {"id": 2}]), False)
    assert isinstance(found, Advertise)
    assert [one.id for one in found.channels] == [2]
    assert found.invalid == 2


def test_operations_are_written() -> None:
    assert orjson.loads(protocol.subscribe([(1, 5), (2, 6)])) == {
        "op": "subscribe",
        "subscriptions": [{"id": 1, "channelId": 5}, {"id": 2, "channelId": 6}],
    }
    assert orjson.loads(protocol.unsubscribe([1, 2])) == {"op": "unsubscribe", "subscriptionIds": [1, 2]}
    assert orjson.loads(protocol.unadvertise(3)) == {"op": "unadvertise", "channelIds": [3]}
    assert orjson.loads(protocol.advertise(CHANNEL)) == {
        "op": "advertise",
        "channels": [ROW | {"schemaEncoding": "ros2msg"}],
    }
    assert protocol.message(258, b"\x07") == b"\x01\x02\x01\x00\x00\x07"
