"""A real server of foxglove-sdk: a session judges and records its car, and commands it where it may."""

from __future__ import annotations

import asyncio
import struct
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path
from typing import Any

import foxglove
import pytest
from foxglove.websocket import Capability

from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.recording.folder import RecordingsFolder
from server.recording.read.read import open_recording
from server.rosbridge.address import parse
from server.rosbridge.link_listener import NOTE
from server.rosbridge.live_source import LinkDown
from server.rosbridge.outgoing import NotAllowed
from server.rosbridge.subscription import Subscription
from server.vehicle.foxglove.source import FoxgloveSource
from server.vehicle.session import Session
from server.vehicle.vehicle import Vehicle
from tests.server.link_listener import LinkListener, bridging, until
from tests.server.vehicle.foxglove.peer import FIX, ODOMETRY, SCAN, TWIST, Peer, fix, odometry, peer, scan

BOTH = (Capability.ClientPublish, Capability.ConnectionGraph)
SPEEDS = [round(4.3 + number / 100, 2) for number in range(30)]
COMMAND = {"linear": {"x": 1.5, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": -0.25}}


class Answers:
    """The marks of a link."""

    def __init__(self) -> None:
        self.requested: list[str] = []
        self.answered_s: list[tuple[float, float]] = []

    def open(self, at_s: float) -> None: ...
    def took(self, size: int) -> None: ...
    def sent(self, at_s: float) -> None: ...

    def answered(self, sent_s: float, at_s: float) -> None:
        self.answered_s.append((sent_s, at_s))

    def subscribe(self, topic: str, queue_length: int, throttle_s: float = 0.0) -> None:
        self.requested.append(topic)


@asynccontextmanager
async def linked(
    address: str, listener: LinkListener, *topics: str, marks: Answers | None = None
) -> AsyncIterator[FoxgloveSource]:
    source = FoxgloveSource(parse(address), listener, now=time.monotonic, marks=marks)
    for topic in topics:
        source.subscribe(Subscription(topic=topic, type=None))
    source.start()
    try:
        yield source
    finally:
        source.stop()


async def subscribed(source: FoxgloveSource, *topics: str) -> None:
    """Until these topics are, and the server has read it."""
    await until(lambda: {one.topic for one in source._rows.channels.values()} >= set(topics))
    source.ping()
    await until(lambda: source.unanswered == 0)


def is_another(source: FoxgloveSource, before: set[int]) -> bool:
    """Whether another channel is subscribed to than these."""
    return bool({one.id for one in source._rows.channels.values()} - before)


def came(listener: LinkListener, topic: str) -> list[Any]:
    return [message for name, message, _ in listener.all("message") if name == topic]


async def test_messages_of_each_encoding_come_and_no_other() -> None:
    listener = LinkListener()
    with peer() as car:
        car.offer("/odom", ODOMETRY, "cdr")
        car.offer("/fix", FIX, "ros1")
        car.offer("/scan", "sensor_msgs/msg/LaserScan", "json")
        car.offer("/other", FIX, "ros1")
        async with linked(car.address, listener, "/odom", "/fix", "/scan") as source:
            await listener.wait_for("opened")
            await subscribed(source, "/odom", "/fix", "/scan")
            now_ns = time.time_ns()
            car.publish("/other", fix(1, now_ns))
            car.publish("/odom", odometry(2, 4.2, now_ns))
            car.publish("/fix", fix(1, now_ns))
            car.publish("/scan", scan(2, now_ns))
            await listener.wait_for("message", 3)
            assert source.server_software == "peer"
    assert came(listener, "/odom")[0]["twist"]["twist"]["linear"]["x"] == 4.2
    assert came(listener, "/fix")[0]["header"]["stamp"] == fix(1, now_ns)["header"]["stamp"]
    assert came(listener, "/scan") == [scan(2, now_ns)]
    assert len(listener.all("message")) == 3
    assert listener.all("junk") == []


async def test_a_channel_that_comes_later_and_again_under_another_number_is_subscribed_to() -> None:
    listener = LinkListener()
    with peer() as car:
        async with linked(car.address, listener, "/odom") as source:
            await listener.wait_for("opened")
            assert await source.call("/rosapi/topics") == {"topics": [], "types": []}
            for number in range(1, 4):
                before = {one.id for one in source._rows.channels.values()}
                car.offer("/odom", ODOMETRY, "cdr")  # in place of the one before
                await until(partial(is_another, source, before))
                await subscribed(source, "/odom")
                car.publish("/odom", odometry(2, float(number), 1))
                await listener.wait_for("message", number)
            car.end("/odom")
            await until(lambda: not source._rows.channels)
            assert await source.call("/rosapi/topics") == {"topics": [], "types": []}
            assert await source.call("/rosapi/publishers", {"topic": "/odom"}) == {"publishers": []}
    assert [one["twist"]["twist"]["linear"]["x"] for one in came(listener, "/odom")] == [1.0, 2.0, 3.0]


async def test_what_cannot_be_read_is_reported_once_and_harms_nothing() -> None:
    listener = LinkListener()
    with peer() as car:
        car.offer_raw("/proto", "foxglove.LocationFix", "protobuf", "protobuf", b"\x0a\x00")
        car.offer_raw("/broken", "my_msgs/msg/Level", "cdr", "ros2msg", b"float64[ x")
        car.offer("/shape", "nav_msgs/msg/Odometry", "json")
        car.offer("/odom", ODOMETRY, "cdr")
        async with linked(car.address, listener, "/proto", "/broken", "/shape", "/odom") as source:
            await subscribed(source, "/shape", "/odom")
            for _ in range(3):
                car.publish("/shape", {"speed": 4.2})
            car.publish("/odom", odometry(2, 4.2, 1))
            await listener.wait_for("message")
            assert source.junk_count == 3
    notes = sorted(text for level, text in listener.all("status") if level == NOTE)
    assert [text.partition(" ")[0] for text in notes] == ["/broken", "/proto", "/shape"]
    assert "'protobuf' are not supported" in notes[1]
    assert "not in the shape of nav_msgs/msg/Odometry" in notes[2]
    assert [topic for topic, _, _ in listener.all("message")] == ["/odom"]


async def test_a_server_that_ends_and_returns_is_dialled_again() -> None:
    listener = LinkListener()
    with peer(BOTH, ["cdr"]) as car:
        car.offer("/odom", ODOMETRY, "cdr")
        async with linked(car.address, listener, "/odom") as source:
            await subscribed(source, "/odom")
            car.stop()
            problem = await listener.wait_for("closed")
            assert problem.code == "closed"
            assert "Foxglove's server" in problem.hint
            with pytest.raises(LinkDown):
                source.send_now({"op": "advertise", "id": "a", "topic": "/cmd", "type": TWIST})
            with pytest.raises(LinkDown):
                await source.call("/rosapi/topics")
            car.start()
            await listener.wait_for("opened", 2)
            await subscribed(source, "/odom")
            car.publish("/odom", odometry(2, 4.2, 1))
            await listener.wait_for("message")
            with pytest.raises(NotAllowed):  # nothing is left of what was advertised, nor was kept to be sent
                source.send_now({"op": "publish", "topic": "/cmd", "msg": COMMAND})
    assert car.listener.received == []


async def test_a_status_of_the_server_is_passed_on() -> None:
    listener = LinkListener()
    with peer() as car:
        async with linked(car.address, listener) as source:
            await listener.wait_for("opened")
            await source.call("/rosapi/topics")
            car.server.publish_status("the disk is nearly full", foxglove.StatusLevel.Warning)
            assert await listener.wait_for("status") == ("warning", "the disk is nearly full")


async def test_publishers_are_those_of_the_connection_graph() -> None:
    listener = LinkListener()
    with peer(BOTH, ["cdr"]) as car:
        car.offer("/odom", ODOMETRY, "cdr")
        graph = foxglove.ConnectionGraph()
        graph.set_published_topic("/odom", ["/ekf"])
        graph.set_subscribed_topic("/odom", ["/plan"])
        car.server.publish_connection_graph(graph)
        async with linked(car.address, listener) as source:
            await listener.wait_for("opened")
            await source.call("/rosapi/topics")
            await until(lambda: source._state.offered._subscribers)
            assert await source.call("/rosapi/publishers", {"topic": "/odom"}) == {"publishers": ["/ekf"]}
            assert await source.call("/rosapi/subscribers", {"topic": "/odom"}) == {"subscribers": ["/plan"]}


@pytest.mark.parametrize(
    ("encoding", "type", "raw"),
    [("cdr", "geometry_msgs/msg/Twist", b"\0\1\0\0"), ("ros1", TWIST, b"")],
)
async def test_a_command_arrives_with_its_bytes(encoding: str, type: str, raw: bytes) -> None:
    listener = LinkListener()
    with peer([Capability.ClientPublish], [encoding]) as car:
        car.offer("/odom", ODOMETRY, encoding)
        async with linked(car.address, listener) as source:
            await source_known(source, listener)
            assert source.command_problem is None
            source.send_now({"op": "advertise", "id": "a", "topic": "/cmd", "type": type})
            source.send_now({"op": "publish", "topic": "/cmd", "msg": COMMAND})
            source.ping()
            await until(lambda: car.listener.received and source.unanswered == 0)
            assert car.listener.advertised == [("/cmd", encoding, type)]
            assert [data for _, data in car.listener.received] == [raw + struct.pack("<6d", 1.5, 0, 0, 0, 0, -0.25)]
            source.send_now({"op": "unadvertise", "id": "a", "topic": "/cmd"})
            await until(lambda: car.listener.ended)
    assert listener.all("status") == []


async def source_known(source: FoxgloveSource, listener: LinkListener) -> None:
    await listener.wait_for("opened")
    await source.call("/rosapi/topics")


async def test_pings_are_answered_behind_the_messages() -> None:
    """Where messages flow, and where none comes."""
    listener, marks = LinkListener(), Answers()
    with peer() as car:
        car.offer("/odom", ODOMETRY, "cdr")
        async with linked(car.address, listener, "/odom", marks=marks) as source:
            await subscribed(source, "/odom")
            assert marks.requested == ["/odom"]
            await until(lambda: marks.answered_s)
            before = len(marks.answered_s)
            while len(marks.answered_s) < before + 3:
                car.publish("/odom", odometry(2, 4.2, 1))
                await asyncio.sleep(0.02)
    sent = [sent_s for sent_s, _ in marks.answered_s]
    assert sent == sorted(set(sent))
    assert all(sent_s <= at_s for sent_s, at_s in marks.answered_s)


async def test_a_rosbridge_is_no_foxglove_server() -> None:
    listener = LinkListener()
    async with bridging() as bridge, linked(f"foxglove://127.0.0.1:{bridge.port}", listener):
        problem = await listener.wait_for("failed")
    assert problem.code == "not_rosbridge"
    assert "not a Foxglove server" in problem.title
    assert listener.all("opened") == []


@asynccontextmanager
async def monitored(car: Peer, folder: Path | None = None) -> AsyncIterator[Session]:
    bus = LocalBus(Journal(None), now=time.monotonic)
    session = Session(
        Vehicle(name="car", address=car.address),
        bus,
        now=time.monotonic,
        wall_ms=lambda: time.time_ns() // 1_000_000,
        server=dict,  # type: ignore[arg-type]
        recordings=None if folder is None else RecordingsFolder(folder),
    )
    await session.start()
    try:
        yield session
    finally:
        session.disconnect(by="test")
        await session.stop()


async def drive(car: Peer, version: Any, until_true: Callable[[], Any]) -> None:
    """The car publishes, 20 times a second, until something is so."""
    deadline_s = time.monotonic() + 60.0
    while not until_true():
        assert time.monotonic() < deadline_s
        now_ns = time.time_ns()
        car.publish("/odom", odometry(version, 4.2, now_ns))
        car.publish("/fix", fix(version, now_ns))
        car.publish("/scan", scan(version, now_ns))
        await asyncio.sleep(0.05)


def state(session: Session) -> dict[str, Any]:
    found: dict[str, Any] = session.frame()  # type: ignore[assignment]
    return found


def is_live(session: Session) -> bool:
    signals = state(session)["signals"]
    return all(signals[name]["freshness"] == "fresh" for name in ("speed", "position", "scan"))


@pytest.mark.slow
@pytest.mark.parametrize(("version", "encoding"), [(1, "ros1"), (2, "cdr"), (2, "json")])
async def test_a_session_judges_and_records_the_car(tmp_path: Path, version: Any, encoding: str) -> None:
    types = {"/odom": ODOMETRY, "/fix": FIX, "/scan": SCAN}
    with peer() as car:
        for topic, type in types.items():
            car.offer(topic, type if encoding != "json" else type.replace("/", "/msg/"), encoding)
        async with monitored(car, tmp_path) as session:
            await drive(car, version, lambda: is_live(session))
            found = state(session)
            assert found["session"]["phase"] == "monitoring"
            assert found["session"]["ros_version"] == version
            assert found["signals"]["speed"]["value"]["speed_mps"] == 4.2
            await drive(car, version, lambda: session._parts.recording.part is not None)
            for speed_mps in SPEEDS:
                car.publish("/odom", odometry(version, speed_mps, time.time_ns()))
            await until(lambda: state(session)["signals"]["speed"]["value"]["speed_mps"] == SPEEDS[-1])
            car.stop()
            await until(lambda: state(session)["session"]["phase"] == "lost")
            car.start()
            await drive(car, version, lambda: state(session)["session"]["phase"] == "monitoring" and is_live(session))
    rows = []
    for path in sorted(tmp_path.rglob("*.mcap")):
        with open_recording([path]) as recording:
            rows += [(topic, type, message) for _, topic, type, message in recording.rows() if topic in types]
    assert {topic for topic, _, _ in rows} == set(types)
    speeds = [message["twist"]["twist"]["linear"]["x"] for topic, _, message in rows if topic == "/odom"]
    assert [speed for speed in speeds if speed != 4.2] == SPEEDS  # each message, once, in order
    assert {type for topic, type, _ in rows if topic == "/scan"} == {
        SCAN if version == 1 else SCAN.replace("/", "/msg/")
    }


@pytest.mark.parametrize(
    ("capabilities", "encodings", "why"),
    [((), None, "capability clientPublish"), (BOTH, ["protobuf"], "its encodings are protobuf")],
)
@pytest.mark.slow
async def test_the_slow_down_names_why_it_cannot_be_armed(
    capabilities: tuple[Capability, ...], encodings: list[str] | None, why: str
) -> None:
    with peer(capabilities, encodings) as car:
        for topic, type in {"/odom": ODOMETRY, "/fix": FIX, "/scan": SCAN, "/cmd_vel": TWIST}.items():
            car.offer(topic, type, "cdr")
        async with monitored(car) as session:
            await drive(car, 2, lambda: why in (state(session)["decelerate"]["why"] or ""))
