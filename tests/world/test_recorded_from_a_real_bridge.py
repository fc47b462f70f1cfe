"""A car behind a bridge: what is recorded, what is named as missing, which topics carry signals."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Iterable
from pathlib import Path
from typing import Any

import pytest

from server.app.config import Config
from server.cli.main import main
from server.judge.message import RosVersion
from server.recording.folder import RecordingsFolder
from server.recording.read.read import open_recording
from server.rosbridge.live_source import CallFailed
from server.rosbridge.rosapi_client import ServiceCaller
from server.rosbridge_server.client_topics import Subscription
from server.rosbridge_server.encoding import Outgoing
from server.rosbridge_server.server import RosBridge
from server.vehicle import delivery, discovery
from server.vehicle.undelivered import CLIENT_COUNT, Passing
from server.vehicle.vehicle import Vehicle
from tests.server.cars import scan, twist
from tests.server.conftest import serving
from tests.server.rosbridge_server.conftest import bridging
from tests.server.rosbridge_server.probe import probing
from tests.server.viewer import Viewer, viewer
from tests.virtual_time import real_time

pytestmark = pytest.mark.virtual_time

FIXED, NAMES, FLAGS = "float64[3] fixed\n", "string[] names\n", "bool[] flags\n"
TF = "geometry_msgs/TransformStamped[] transforms\n"
SOON_S = 30.0


def spelled(type: str, version: RosVersion) -> str:
    return type if version == 1 else type.replace("/", "/msg/")


def header(version: RosVersion) -> dict[str, Any]:
    if version == 1:
        return {"seq": 0, "stamp": {"secs": 1, "nsecs": 0}, "frame_id": "map"}
    return {"stamp": {"sec": 1, "nanosec": 0}, "frame_id": "map"}


def messages(version: RosVersion) -> dict[str, tuple[str, str, dict[str, Any]]]:
    """Topic → type, its definition where the distribution has none, and a message."""
    zeros, none = {"x": 0.0, "y": 0.0, "z": 0.0}, {"x": 0.0, "y": 0.0, "z": 0.0, "w": 1.0}
    transform = {
        "header": header(version),
        "child_frame_id": "base",
        "transform": {"translation": zeros, "rotation": none},
    }
    return {
        "/catvehicle/vel": ("geometry_msgs/Twist", "", twist(4.2)),
        "/fixed": ("car_msgs/Fixed", FIXED, {"fixed": [1.0, 2.0, 3.0]}),
        "/names": ("car_msgs/Names", NAMES, {"names": ["a", "b"]}),
        "/flags": ("car_msgs/Flags", FLAGS, {"flags": [True, False]}),
        "/tf": ("tf2_msgs/TFMessage", "", {"transforms": [transform]}),
        "/floats": ("std_msgs/Float32MultiArray", "", {"layout": {"dim": [], "data_offset": 0}, "data": [1.0, 2.0]}),
        "/scan": ("sensor_msgs/LaserScan", "", scan([5.0] * 11) | {"header": header(version)}),
    }


@contextlib.asynccontextmanager
async def car(version: RosVersion, *, hz: float = 10.0) -> AsyncIterator[tuple[RosBridge, int]]:
    async with bridging(ros_version=version) as (bridge, port):
        published = messages(version)
        for topic, (type, definition, _) in published.items():
            text = definition or (TF_TEXT if "TFMessage" in type and version == 1 else "")
            bridge.advertise(topic, spelled(type, version), **({"definition": text} if text else {}))

        async def drive() -> None:
            while True:
                for topic, (_, _, message) in published.items():
                    bridge.publish(topic, message)
                await asyncio.sleep(1 / hz)

        driving = asyncio.create_task(drive())
        try:
            yield bridge, port
        finally:
            driving.cancel()


SEPARATOR = "=" * 80
TF_TEXT = f"""geometry_msgs/TransformStamped[] transforms
{SEPARATOR}
MSG: geometry_msgs/TransformStamped
Header header
string child_frame_id
Transform transform
{SEPARATOR}
MSG: std_msgs/Header
uint32 seq
time stamp
string frame_id
{SEPARATOR}
MSG: geometry_msgs/Transform
Vector3 translation
Quaternion rotation
{SEPARATOR}
MSG: geometry_msgs/Vector3
float64 x
float64 y
float64 z
{SEPARATOR}
MSG: geometry_msgs/Quaternion
float64 x
float64 y
float64 z
float64 w
"""


@contextlib.asynccontextmanager
async def watched(port: int, data: Path) -> AsyncIterator[Viewer]:
    config = Config(vehicles=(Vehicle(name="car", address=f"ws://127.0.0.1:{port}"),), data=data)
    async with serving(config) as base, viewer(base, name="Ann") as one:
        yield one


@pytest.mark.world(n=4)
@pytest.mark.world(n=5)
@pytest.mark.parametrize("version", [1, 2])
async def test_every_topic_is_recorded_as_its_type_and_exported_whole(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], version: RosVersion
) -> None:
    async with car(version) as (bridge, port), watched(port, tmp_path) as one:
        state = await one.state(lambda s: s["recording"]["messages"] > 200, SOON_S)
        assert {requested(bridge, topic) for topic in ("/fixed", "/names", "/flags")} == {"json"}  # lost as CBOR
        assert requested(bridge, "/scan") == "cbor"
        name = state["recording"]["name"]
        assert state["recording"]["as_json"] == 0
        await stop_recording(one)
    path = RecordingsFolder(tmp_path / "recordings").path_of(name)
    assert path is not None
    with open_recording([path]) as recording:
        counts = {topic: info.count for topic, info in recording.topics.items()}
        encodings = {channel.topic: channel.encoding for file in recording.files for channel in file.channels}
        definitions = {topic: info.definition for topic, info in recording.topics.items()}
        assert (recording.metadata["left_out"], recording.metadata["not_received"]) == ("", "")
    assert set(counts) == set(messages(version))
    assert min(counts.values()) >= 0.5 * counts["/catvehicle/vel"], counts
    native = "ros1" if version == 1 else "cdr"
    assert {encodings[topic] for topic in counts} == {native}
    assert definitions["/fixed"].strip() == FIXED.strip()
    for format in ("bag",) if version == 1 else ("bag", "ros2"):
        code = main(["export", str(path), "--format", format, "--out", str(tmp_path / f"out.{format}")])
        assert (code, capsys.readouterr().err) == (0, "")
    with open_recording([tmp_path / "out.bag"]) as bag:
        assert {topic: info.count for topic, info in bag.topics.items() if topic in counts} == counts


def requested(bridge: RosBridge, topic: str) -> str:
    """The encoding in which the one client wants a topic."""
    found = bridge.graph.find(topic)
    assert found is not None
    (subscription,) = found.subscribers
    assert isinstance(subscription, Subscription)
    (encoding,) = {one.encoding for one in subscription.requested_by_id.values()}
    return encoding


async def stop_recording(one: Viewer) -> None:
    """Disconnects the car, and returns when the file is closed."""
    async with real_time():
        assert (await one.ask(kind="disconnect"))["ok"]
        await one.state(lambda s: s["recording"]["state"] == "off", SOON_S)


def hasten(monkeypatch: pytest.MonkeyPatch) -> None:
    for name, value in (("RECORDED_AFTER_S", 1.0), ("RENEW_AFTER_S", 1.5), ("SILENT_AGAIN_S", 2.0)):
        monkeypatch.setattr(delivery, name, value)
    monkeypatch.setattr(delivery, "RECORDED_AGAIN_S", (2.0,))


def block(monkeypatch: pytest.MonkeyPatch, topics: Iterable[str]) -> set[str]:
    """Keeps all messages of these topics from every subscription, until its end even if the topic leaves the set."""
    blocked, without = set(topics), set[Subscription]()
    offer = Subscription.offer

    def offer_unless_blocked(subscription: Subscription, message: Outgoing) -> None:
        if subscription.spelling in blocked:
            without.add(subscription)
        if subscription not in without:
            offer(subscription, message)

    monkeypatch.setattr(Subscription, "offer", offer_unless_blocked)
    return blocked


@pytest.mark.world(n=4)
@pytest.mark.parametrize("version", [1, 2])
async def test_what_a_neighbour_blocks_is_named_and_comes_when_the_neighbour_has_gone(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, version: RosVersion
) -> None:
    """Another client can keep a real bridge from passing a topic on to us, until we subscribe again after its end."""
    hasten(monkeypatch)
    topics = ("/floats", "/catvehicle/vel")
    blocked = block(monkeypatch, topics)
    async with car(version) as (_, port):
        async with probing(port) as neighbour:
            async with watched(port, tmp_path) as one:
                state = await one.state(lambda s: len(s["recording"]["not_received"]) == 2, SOON_S)
                assert set(state["recording"]["not_received"]) == set(topics)
                note = await one.until(lambda: next((e for e in one.events if e["change"] == "not_received"), None))
                assert "/car)" in note["text"]
                blocked.clear()
                neighbour.socket.transport.abort()
                await one.state(
                    lambda s: not s["recording"]["not_received"] and s["signals"]["speed"]["freshness"] == "fresh",
                    SOON_S,
                )


@pytest.mark.world(n=4)
async def test_the_file_names_what_was_not_received(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    hasten(monkeypatch)
    async with car(1) as (bridge, port), watched(port, tmp_path) as one:
        bridge.advertise("/quiet", "std_msgs/Float64")
        state = await one.state(lambda s: s["recording"]["not_received"] == ["/quiet"], SOON_S)
        name = state["recording"]["name"]
        await stop_recording(one)
    path = RecordingsFolder(tmp_path / "recordings").path_of(name)
    assert path is not None
    with open_recording([path]) as recording:
        assert recording.metadata["not_received"] == "/quiet"


@pytest.mark.world(n=9)
@pytest.mark.parametrize("version", [1, 2])
async def test_a_topic_that_nobody_publishes_carries_no_signal_until_somebody_does(
    tmp_path: Path, version: RosVersion
) -> None:
    wrench = spelled("geometry_msgs/Wrench", version)
    zeros = {"x": 0.0, "y": 0.0, "z": 0.0}
    brake = lambda s: s["signals"]["brake"]  # noqa: E731
    async with car(version) as (bridge, port), probing(port) as listener:
        await listener.subscribe("/catvehicle/brake", type=wrench)
        async with watched(port, tmp_path) as one:
            state = await one.state(lambda s: brake(s)["note"] is not None, SOON_S)
            assert (brake(state)["topic"], brake(state)["freshness"]) == ("/catvehicle/brake", "not_published")
            assert brake(state)["note"] == "no node publishes it"
            state = await one.state(lambda s: s["session"]["connected_for_s"] > 7.0, SOON_S)
            assert not any(alarm["title"] == "Brake silent" for alarm in state["alarms"])
            assert brake(state)["freshness"] == "not_published"
            bridge.advertise("/catvehicle/brake", wrench)

            async def press() -> None:
                while True:
                    bridge.publish("/catvehicle/brake", {"force": zeros | {"x": 12.0}, "torque": zeros})
                    await asyncio.sleep(0.1)

            pressing = asyncio.create_task(press())
            try:
                await one.state(lambda s: brake(s)["freshness"] == "fresh", 20.0)
            finally:
                pressing.cancel()
            state = await one.state(lambda s: any(a["title"] == "Brake silent" for a in s["alarms"]), SOON_S)
            assert brake(state)["freshness"] == "stale", "a publisher that fell silent is no comfort"


@pytest.mark.world(n=4)
async def test_what_is_recorded_only_is_requested_though_rosapi_ended_before_its_definitions(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """rosapi named the topics, and ended before the recording began: they are recorded as far as they are known."""
    fetch_topics, has_ended = discovery.fetch_topics, False

    async def topics_while_it_lives(questions: ServiceCaller) -> discovery.Offer | None:
        return None if has_ended else await fetch_topics(questions)

    async def no_definitions(*_: object) -> dict[str, str]:
        raise CallFailed("Service /rosapi/topics_and_raw_types does not exist")

    monkeypatch.setattr(discovery, "fetch_topics", topics_while_it_lives)
    monkeypatch.setattr(discovery, "fetch_definitions", no_definitions)
    async with car(2) as (bridge, port), serving(Config(data=tmp_path)) as base, viewer(base, name="Ann") as one:
        assert (await one.ask(kind="set", values={"recording.automatic": 0}))["ok"]
        assert (await one.ask(kind="connect", address=f"127.0.0.1:{port}"))["ok"]
        await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh", SOON_S)
        has_ended = True
        assert (await one.ask(kind="record", on=True))["ok"]
        await one.state(lambda s: s["recording"]["messages"] > 50, SOON_S)
        async with asyncio.timeout(SOON_S):
            while not all((found := bridge.graph.find(topic)) and found.subscribers for topic in messages(2)):
                await asyncio.sleep(0.05)


@pytest.mark.world(n=4)
async def test_what_is_requested_before_its_definition_is_recorded_as_its_type(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """How many clients the bridge has: its first message comes at once, and definitions take a while."""
    fetch_definitions, may_answer = discovery.fetch_definitions, asyncio.Event()

    async def slow_definitions(*arguments: Any) -> dict[str, str]:
        await may_answer.wait()
        return await fetch_definitions(*arguments)

    monkeypatch.setattr(discovery, "fetch_definitions", slow_definitions)
    async with car(1) as (bridge, port):
        bridge.advertise("/catvehicle/brake", "geometry_msgs/Wrench")
        bridge.advertise(CLIENT_COUNT, "std_msgs/Int32", latch=True)
        bridge.publish(CLIENT_COUNT, {"data": 2})
        async with watched(port, tmp_path) as one:
            async with asyncio.timeout(SOON_S):
                while not (found := bridge.graph.find(CLIENT_COUNT)) or not found.subscribers:
                    await asyncio.sleep(0.05)
            before = (await one.state(lambda s: s["recording"]["messages"] > 5, SOON_S))["recording"]["messages"]
            state = await one.state(lambda s: s["recording"]["messages"] > before + 5, SOON_S)
            assert state["recording"]["as_json"] == 0
            may_answer.set()
            name = state["recording"]["name"]
            await stop_recording(one)
    path = RecordingsFolder(tmp_path / "recordings").path_of(name)
    assert path is not None
    with open_recording([path]) as recording:
        assert recording.topics[CLIENT_COUNT].type == "std_msgs/Int32"


@pytest.mark.world(n=8)
async def test_the_number_of_clients_is_read_also_where_its_topic_is_recorded(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """By it a neighbour that blocks a topic is named; on ROS 2 it comes after everything is subscribed to."""
    counted: list[Any] = []
    monkeypatch.setattr(Passing, "counted", lambda _, message: counted.append(message))
    async with car(2) as (bridge, port):
        bridge.advertise(CLIENT_COUNT, "std_msgs/msg/Int32")
        async with watched(port, tmp_path):
            async with asyncio.timeout(SOON_S):
                while not (found := bridge.graph.find("/tf")) or not found.subscribers:
                    await asyncio.sleep(0.05)
            async with asyncio.timeout(10):
                while {"data": 4} not in counted:
                    bridge.publish(CLIENT_COUNT, {"data": 4})
                    await asyncio.sleep(0.1)
