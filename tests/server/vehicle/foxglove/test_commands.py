"""What is sent to a Foxglove server: only what the gate allows, in an encoding that the server takes."""

from __future__ import annotations

import struct
from typing import Any

import orjson
import pytest

from server.rosbridge.live_source import LinkDown
from server.rosbridge.outgoing import NotAllowed
from server.vehicle.foxglove.commands import CLIENT_PUBLISH, Commands
from server.vehicle.foxglove.protocol import ServerInfo

TWIST: dict[str, Any] = {"linear": {"x": 1.5, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": -0.25}}
NUMBERS = struct.pack("<6d", 1.5, 0.0, 0.0, 0.0, 0.0, -0.25)
ADVERTISE = {"op": "advertise", "id": "a", "topic": "/cmd", "type": "geometry_msgs/msg/Twist"}
PUBLISH = {"op": "publish", "topic": "/cmd", "msg": TWIST}


def commands(*encodings: str, can_publish: bool = True) -> Commands:
    return Commands(ServerInfo("b", frozenset({CLIENT_PUBLISH} if can_publish else ()), encodings, ""))


def channel_of(frame: tuple[bytes, bool]) -> dict[str, Any]:
    assert not frame[1]
    found: dict[str, Any] = orjson.loads(frame[0])["channels"][0]
    return found


@pytest.mark.parametrize(
    ("encodings", "offered", "type", "encoding", "name", "raw"),
    [
        (("cdr", "json"), ("cdr",), "geometry_msgs/msg/Twist", "cdr", "geometry_msgs/msg/Twist", b"\0\1\0\0" + NUMBERS),
        (("ros1",), ("ros1",), "geometry_msgs/Twist", "ros1", "geometry_msgs/Twist", NUMBERS),
        (("cdr", "ros1"), ("ros1",), "geometry_msgs/Twist", "ros1", "geometry_msgs/Twist", NUMBERS),
        (
            ("json",),
            ("cdr",),
            "geometry_msgs/msg/Twist",
            "json",
            "geometry_msgs/msg/Twist",
            orjson.dumps(TWIST),
        ),
    ],
)
def test_a_command_is_written(
    encodings: tuple[str, ...], offered: tuple[str, ...], type: str, encoding: str, name: str, raw: bytes
) -> None:
    one = commands(*encodings)
    assert one.problem(offered) is None
    row = channel_of(one.frames(ADVERTISE | {"type": type}, offered))
    assert (row["id"], row["topic"], row["encoding"], row["schemaName"]) == (1, "/cmd", encoding, name)
    assert ("schema" in row) is (encoding != "json")
    assert one.frames(PUBLISH, offered) == (b"\x01\x01\x00\x00\x00" + raw, True)
    frame, is_binary = one.frames({"op": "unadvertise", "id": "a", "topic": "/cmd"}, offered)
    assert (orjson.loads(frame), is_binary) == ({"op": "unadvertise", "channelIds": [1]}, False)
    with pytest.raises(NotAllowed):
        one.frames(PUBLISH, offered)
    assert channel_of(one.frames(ADVERTISE | {"type": type}, offered))["id"] == 2


def test_a_header_of_ros_1_has_a_number() -> None:
    one = commands("ros1")
    one.frames(ADVERTISE | {"type": "geometry_msgs/TwistStamped"}, ("ros1",))
    stamped = {"header": {"stamp": {"secs": 7, "nsecs": 9}, "frame_id": "a"}, "twist": TWIST}
    frame, _ = one.frames({"op": "publish", "topic": "/cmd", "msg": stamped}, ("ros1",))
    assert frame[5:] == struct.pack("<IIII", 0, 7, 9, 1) + b"a" + NUMBERS


@pytest.mark.parametrize(
    ("one", "offered", "why"),
    [
        (commands("cdr", can_publish=False), ("cdr",), "clientPublish"),
        (commands(), ("cdr",), "its encodings are none"),
        (commands("protobuf"), ("cdr",), "its encodings are protobuf"),
        (commands("ros1"), ("cdr",), "its encodings are ros1"),
    ],
)
def test_a_server_that_takes_nothing_is_sent_nothing(one: Commands, offered: tuple[str, ...], why: str) -> None:
    problem = one.problem(offered)
    assert problem is not None
    assert why in problem
    with pytest.raises(NotAllowed, match=why):
        one.frames(ADVERTISE, offered)


def test_while_no_channel_is_known_a_server_is_not_blamed() -> None:
    """After it was dialled again: its capabilities come first."""
    one = commands("cdr", "ros1")
    assert one.problem(()) is None
    with pytest.raises(LinkDown):
        one.frames(ADVERTISE, ())
    with pytest.raises(NotAllowed):
        one.frames(PUBLISH, ())
    one.frames(ADVERTISE, ("cdr",))
    assert one.problem(()) is None
    for offered in ((), ("protobuf",)):  # what is advertised goes on
        assert one.frames(PUBLISH, offered)[0].endswith(NUMBERS)
    assert channel_of(commands("cdr", "json").frames(ADVERTISE, ()))["encoding"] == "json"


@pytest.mark.parametrize(
    "operation",
    [
        PUBLISH,
        ADVERTISE | {"type": "std_msgs/msg/String"},
        ADVERTISE | {"topic": "no topic"},
        {"op": "call_service", "id": "a", "service": "/rosapi/topics", "args": {}},
        {"op": "unadvertise", "topic": "/cmd"},
    ],
)
def test_what_the_gate_refuses_is_not_sent(operation: dict[str, Any]) -> None:
    with pytest.raises(NotAllowed):
        commands("cdr").frames(operation, ("cdr",))
