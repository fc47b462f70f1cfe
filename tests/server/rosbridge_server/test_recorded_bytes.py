"""Messages of a recording: their own bytes as cbor-raw, decoded only for those who get fields."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore

from server.judge.message import Json, Message, RosVersion
from server.recording.read.decode import Layout, RawMessage
from server.recording.read.errors import Undecodable
from server.recording.read.read import open_recording
from server.rosbridge_server.player import moved, play
from server.rosbridge_server.server import RosBridge
from tests.server.recording.bags import Drive, write_ros1, write_ros2
from tests.server.rosbridge_server.conftest import bridging
from tests.server.rosbridge_server.probe import Probe, probing

pytestmark = pytest.mark.virtual_time

STANDARD = {1: get_typestore(Stores.ROS1_NOETIC).fielddefs, 2: get_typestore(Stores.ROS2_HUMBLE).fielddefs}


class Recorded:
    """Messages of std_msgs/Int32 with a mark at their end, which no encoder would write; `decoded` counts."""

    def __init__(self, version: RosVersion = 1, definitions: dict[str, Any] | None = None) -> None:
        self.layout = Layout(version, definitions or dict(STANDARD[version]))
        self.decoded = 0

    def message(self, number: int) -> RawMessage:
        return RawMessage(bytes_of(number), self._decode, self.layout)

    def _decode(self, raw: bytes) -> Json:
        self.decoded += 1
        (number,) = struct.unpack_from("<i", raw)
        if number < 0:
            raise Undecodable("it is negative")
        return {"data": number}


def bytes_of(number: int) -> bytes:
    return struct.pack("<i", number) + b"mark"


async def test_recorded_bytes_are_sent_as_they_are_and_not_decoded(bridge: RosBridge, port: int, probe: Probe) -> None:
    bridge.advertise("/n", "std_msgs/Int32")
    recorded = Recorded()
    async with probing(port) as other:
        for one in (probe, other):
            await one.subscribe("/n", compression="cbor-raw")
        bridge.publish("/n", recorded.message(7))
        received = [await one.hear_raw() for one in (probe, other)]
    assert received[0] == received[1], "the same bytes for every client"
    bridge.publish("/n", recorded.message(8))
    assert (await probe.hear())["msg"]["bytes"] == bytes_of(8)
    assert recorded.decoded == 0


async def test_a_message_is_decoded_once_for_all_who_get_fields(bridge: RosBridge, port: int, probe: Probe) -> None:
    bridge.advertise("/n", "std_msgs/Int32")
    recorded = Recorded()
    async with probing(port) as other, probing(port) as raw:
        await probe.subscribe("/n")
        await other.subscribe("/n", compression="cbor")
        await raw.subscribe("/n", compression="cbor-raw")
        bridge.publish("/n", recorded.message(7))
        assert [(await one.hear())["msg"] for one in (probe, other)] == [{"data": 7}] * 2
        assert (await raw.hear())["msg"]["bytes"] == bytes_of(7)
    assert recorded.decoded == 1


@pytest.mark.parametrize("ahead", [0, 16])
async def test_a_message_that_cannot_be_decoded_is_reported_and_the_next_one_comes(
    bridge: RosBridge, port: int, probe: Probe, ahead: int
) -> None:
    bridge.advertise("/n", "std_msgs/Int32")
    recorded = Recorded()
    async with probing(port) as raw:
        await probe.subscribe("/n")
        await raw.subscribe("/n", compression="cbor-raw")
        numbers = (3, -1, -2, 4)
        messages = [
            Message(at_s=0.01 * at, topic="/n", type="std_msgs/Int32", message=recorded.message(number))
            for at, number in enumerate(numbers)
        ]
        assert await play(messages, bridge, ahead=ahead) == 4
        received = [await probe.hear() for _ in range(3)]
        assert [(await raw.hear())["msg"]["bytes"] for _ in numbers] == [bytes_of(number) for number in numbers]
    assert [one["op"] for one in received] == ["publish", "status", "publish"]
    assert received[1]["msg"] == "subscribe: /n cannot be sent as json: it is negative"
    assert received[2]["msg"] == {"data": 4}
    assert recorded.decoded == 4, "each once, also one that cannot be"


OTHER = {"std_msgs/msg/Int32": ([], [("data", STANDARD[1]["std_msgs/msg/Float64"][1][0][1])])}


@pytest.mark.parametrize("recorded", [Recorded(version=2), Recorded(definitions=OTHER)], ids=["ROS 2", "definition"])
async def test_bytes_of_another_definition_are_encoded_by_the_one_that_clients_get(
    bridge: RosBridge, probe: Probe, recorded: Recorded
) -> None:
    bridge.advertise("/n", "std_msgs/Int32")
    await probe.subscribe("/n", compression="cbor-raw")
    bridge.publish("/n", recorded.message(7))
    assert (await probe.hear())["msg"]["bytes"] == struct.pack("<i", 7)


async def test_what_is_sent_late_has_the_time_of_sending(bridge: RosBridge, probe: Probe) -> None:
    """Frames are prepared together, before they are due."""
    bridge.advertise("/n", "std_msgs/Int32")
    bridge.now = lambda: 1_000.0 + len(played)
    played: list[Message] = []
    await probe.subscribe("/n", compression="cbor-raw")
    recorded = Recorded()
    messages = [
        Message(at_s=float(at), topic="/n", type="std_msgs/Int32", message=recorded.message(at)) for at in range(5)
    ]
    await play(messages, bridge, ahead=8, on_message=played.append)
    received = [(await probe.hear())["msg"] for _ in messages]
    assert [(one["secs"], one["nsecs"]) for one in received] == [(1_000 + at, 0) for at in range(5)]
    assert [one["bytes"] for one in received] == [bytes_of(at) for at in range(5)]


@pytest.mark.parametrize(("now_s", "secs"), [(-1.0, 0), (2.0**33, 2**32 - 1)])
async def test_a_time_beyond_four_bytes_is_the_nearest_one(
    bridge: RosBridge, probe: Probe, now_s: float, secs: int
) -> None:
    bridge.advertise("/n", "std_msgs/Int32")
    bridge.now = lambda: now_s
    await probe.subscribe("/n", compression="cbor-raw")
    bridge.publish("/n", Recorded().message(7))
    assert (await probe.hear())["msg"]["secs"] == secs


def stamped(at_s: float) -> tuple[float, str, str, dict[str, Any]]:
    header = {"seq": 1, "stamp": {"sec": 100, "nanosec": 5}, "frame_id": "map"}
    return at_s, "/point", "geometry_msgs/msg/PointStamped", {"header": header, "point": {"x": 1.0, "y": 2.0, "z": 3.0}}


@pytest.mark.parametrize("version", [1, 2])
async def test_a_drive_is_the_same_in_every_encoding(tmp_path: Path, version: RosVersion) -> None:
    text = (0.5, "/text", "std_msgs/msg/String", {"data": "hi"})
    drive = Drive(messages=[stamped(0.0), text, stamped(1.0)])
    path = write_ros1(tmp_path / "drive.bag", drive) if version == 1 else write_ros2(tmp_path / "drive", drive)
    store = get_typestore(Stores.ROS1_NOETIC if version == 1 else Stores.ROS2_HUMBLE)
    with open_recording([path]) as recording:
        decoded = list(recording.messages())
        raw = list(recording.raw_messages())
        files = [data for source in recording.files for _, _, data in source.messages({0, 1, 2}, 0)]
        topics = recording.topics
    assert [(one.at_s, one.topic, one.type, dict(one.message)) for one in raw] == [
        (one.at_s, one.topic, one.type, one.message) for one in decoded
    ]
    async with bridging(ros_version=version) as (bridge, port), probing(port) as probe:
        for topic, info in topics.items():
            bridge.advertise(topic, info.type, info.definition)
            await probe.subscribe(topic, compression="cbor-raw")
        await play(raw, bridge, ahead=8)
        received = [await probe.hear() for _ in raw]
    assert [one["msg"]["bytes"] for one in received] == files
    read = store.deserialize_ros1 if version == 1 else store.deserialize_cdr
    point: Any = read(received[2]["msg"]["bytes"], "geometry_msgs/msg/PointStamped")
    assert (point.header.stamp.sec, point.header.frame_id, point.point.z) == (100, "map", 3.0)


def test_a_recorded_message_without_a_stamp_keeps_its_bytes_when_the_drive_is_repeated(tmp_path: Path) -> None:
    path = write_ros1(
        tmp_path / "drive.bag", Drive(messages=[stamped(0.0), (0.5, "/text", "std_msgs/msg/String", {"data": "hi"})])
    )
    with open_recording([path]) as recording:
        point, text = (one.message for one in recording.raw_messages())
    assert moved(text, 60.0) is text
    assert moved(point, 60.0)["header"]["stamp"] == {"secs": 160, "nsecs": 5}
    spoiled = Recorded().message(-1)
    assert moved(spoiled, 60.0) is spoiled
