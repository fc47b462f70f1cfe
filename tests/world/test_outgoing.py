"""Nothing that is sent to a car's bridge can harm it: every frame is judged by what is known of real bridges."""

from __future__ import annotations

import asyncio
import contextlib
import json
import math
import re
import struct
import time
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from rosbags.interfaces import Nodetype

from server.judge.active_settings import ActiveSettings
from server.judge.settings import SettingsFile
from server.judge.topics import Source
from server.recording.read.schemas import standard
from server.rosbridge.address import parse
from server.rosbridge.link import RosLink
from server.rosbridge.live_source import LinkDown
from server.rosbridge.outgoing import PUBLISHED, SERVICES, NotAllowed, Outgoing
from server.rosbridge.subscription import Subscription
from server.slowdown.command_target import target_of, twist_message
from server.slowdown.controller import SlowDownController
from server.slowdown.guard_client import GuardClient
from server.slowdown.publisher import CommandPublisher
from server.vehicle import discovery
from server.vehicle.subscriptions import Subscriptions
from tests.server.link_listener import LinkListener
from tests.tree import RECORDINGS

pytestmark = pytest.mark.world(n=1)

TRANSCRIPTS = sorted((RECORDINGS / "rosbridge").glob("ros?/*.jsonl"))
NAME = re.compile(r"^(/[A-Za-z0-9_]+)+\Z")
RANGES = {"uint8": "B", "uint32": "I", "int32": "i", "float32": "f", "float64": "d"}
numbers = st.none() | st.floats() | st.integers() | st.booleans() | st.text(max_size=3)
hostile_names = ["", "/", "//", "/a//b", "/a/", "not a name!", "/ä", "/\ud800", "/a\n", "/\u202e", "*", "/a\0"]
hostile_types = [
    "Twist",
    "no_msgs/Such",
    "car_msgs/msg/Mixed",
    "geometry_msgs/msg/Twist",
    "geometry_msgs/Twist",
    "a/b/c",
]
hostile = st.text(max_size=40) | st.sampled_from([*hostile_names, *hostile_types, "/" + "x" * 9000])
anything = st.recursive(
    numbers | hostile, lambda inner: st.lists(inner, max_size=3) | st.dictionaries(hostile, inner, max_size=3)
)


class Wire:
    """The open socket of a link: what is written to it."""

    STATE_OPEN = state = 3
    pings = pongs = 0

    def __init__(self, answer: Callable[[dict[str, Any]], Any] = lambda operation: None) -> None:
        self.sent: list[bytes] = []
        self.answer = answer
        self.link: RosLink | None = None

    def sendMessage(self, frame: bytes, isBinary: bool = False) -> None:
        assert not isBinary
        self.sent.append(frame)
        operation = json.loads(frame)
        if operation.get("op") == "call_service" and self.link is not None:
            values = self.answer(operation)
            asyncio.get_running_loop().call_soon(
                self.link._calls.answered, {"id": operation["id"], "values": values, "result": values is not None}
            )

    def dropConnection(self, abort: bool = False) -> None:
        pass

    def sendPing(self, payload: bytes = b"") -> None:
        pass


def wired(answer: Callable[[dict[str, Any]], Any] = lambda operation: None) -> tuple[RosLink, Wire]:
    """A link on a socket that only writes down; to be made on a running loop."""
    link, wire = RosLink(parse("127.0.0.1"), LinkListener(), now=time.monotonic), Wire(answer)
    link._socket = wire  # type: ignore[assignment]
    link._listener = SimpleNamespace()  # type: ignore[assignment]
    wire.link = link
    return link, wire


def check_harmless(frames: list[bytes]) -> None:
    """Each frame against the facts of the transcripts, in the order they were sent on one connection."""
    types: dict[str, str] = {}
    for frame in frames:
        text = frame.decode()
        operation = json.loads(text, parse_constant=lambda token: pytest.fail(f"bare {token}"))
        assert isinstance(operation, dict), "a frame is an operation"
        op = operation["op"]
        assert op in {"subscribe", "unsubscribe", "advertise", "unadvertise", "publish", "call_service"}
        if op != "call_service":
            assert NAME.match(operation["topic"]), operation
        if op != "publish":
            assert isinstance(operation["id"], str)
        if op == "subscribe":
            assert operation["compression"] in ("none", "cbor")
            assert "fragment_size" not in operation
        if op == "advertise":
            types[operation["topic"]] = operation["type"]
        if op == "publish":
            check_packable(operation["msg"], types[operation["topic"]])
        if op == "call_service":
            assert operation["service"] in SERVICES
            if "message_details" in operation["service"]:
                assert "/msg/" not in operation["args"]["type"]
                assert operation["args"]["type"].count("/") == 1


def check_packable(message: Any, type: str) -> None:
    """Packs a message as ROS would, every field of its definition, with none left out or added."""
    version = 2 if "/msg/" in type else 1
    long = type if "/msg/" in type else type.replace("/", "/msg/")
    check_fields(message, long, standard(version).fielddefs, version)  # type: ignore[arg-type]


def check_fields(value: Any, type: str, definitions: Mapping[str, Any], version: int) -> None:
    if type == "builtin_interfaces/msg/Time":
        names = ("sec", "nanosec") if "sec" in value else ("secs", "nsecs")  # ROS 2 takes both
        assert tuple(value) == names
        for name, kind in zip(names, "II" if version == 1 else "iI", strict=True):
            struct.pack(f"<{kind}", value[name])
            assert value[name] >= 0
        return
    fields = dict(definitions[type][1])
    fields.pop("seq", None)  # the bridge counts
    assert isinstance(value, dict)
    assert value.keys() == fields.keys()
    for name, (kind, what) in fields.items():
        if kind == Nodetype.NAME:
            check_fields(value[name], what, definitions, version)
        elif what[0] == "string":
            value[name].encode()
        else:
            assert not isinstance(value[name], bool)
            struct.pack("<" + RANGES[what[0]], value[name])
            assert math.isfinite(value[name])


@pytest.mark.parametrize("type", PUBLISHED)
@pytest.mark.parametrize("version", [1, 2])
def test_the_table_of_messages_is_that_of_the_distribution(type: str, version: int) -> None:
    def fields(name: str) -> Any:
        if name == "builtin_interfaces/msg/Time":
            return "stamp"
        found = standard(version).fielddefs[name][1]  # type: ignore[arg-type]
        return {key: fields(what) if kind == Nodetype.NAME else what[0] for key, (kind, what) in found if key != "seq"}

    def table(entry: Any) -> Any:
        if isinstance(entry, Mapping):
            return {key: table(inner) for key, inner in entry.items()}
        fits = [name for name, one in {"string": "a", "float64": 0.5, "uint32": 2**32 - 1}.items() if _fits(entry, one)]
        return fits[0] if fits else "stamp"

    assert table(PUBLISHED[type]) == fields(type.replace("/", "/msg/"))


def _fits(check: Any, value: Any) -> bool:
    return callable(check) and bool(check(value))


UNFIT = {
    "an infinite speed": {"linear": {"x": math.inf, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}},
    "a field missing": {"linear": {"x": 1.0, "y": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}},
    "a field too many": {"linear": {}, "angular": {}, "speed": 1},
    "empty": {},
    "none": None,
    "a list": [],
}


@pytest.mark.parametrize("msg", UNFIT.values(), ids=UNFIT)
def test_a_message_that_is_not_whole_is_refused(msg: Any) -> None:
    gate = Outgoing()
    gate.frame({"op": "advertise", "id": "a", "topic": "/cmd_vel", "type": "geometry_msgs/Twist"})
    with pytest.raises(NotAllowed):
        gate.frame({"op": "publish", "topic": "/cmd_vel", "msg": msg})
    with pytest.raises(NotAllowed):
        gate.frame({"op": "publish", "topic": "/cmd_vel"})


@pytest.mark.parametrize("compression", ["cbor-raw", "png", "", None, 1, ["none"]])
def test_cbor_raw_and_png_are_never_requested(compression: Any) -> None:
    row = {"op": "subscribe", "id": "a", "topic": "/a", "throttle_rate": 0, "queue_length": 0}
    Outgoing().frame(row | {"compression": "cbor"})
    with pytest.raises(NotAllowed):
        Outgoing().frame(row | {"compression": compression})


@settings(max_examples=300, deadline=None)
@given(operation=anything)
def test_any_value_is_refused_or_harmless(operation: Any) -> None:
    with contextlib.suppress(NotAllowed):
        check_harmless([Outgoing().frame(operation)])


@settings(max_examples=400, deadline=None)
@given(
    op=st.sampled_from(["subscribe", "unsubscribe", "advertise", "publish", "call_service", "unadvertise"]),
    topic=st.just("/a") | hostile | numbers,
    type=st.sampled_from([*PUBLISHED, "geometry_msgs/msg/Twist"]) | hostile,
    fields=st.fixed_dictionaries(
        {},
        optional={
            "compression": st.sampled_from(["none", "cbor", "cbor-raw", "png"]) | numbers,
            "throttle_rate": numbers,
            "queue_length": numbers,
            "service": st.sampled_from([*SERVICES, "/rosapi/services", "/car/engage"]) | hostile,
            "args": st.dictionaries(st.sampled_from(["topic", "type", "node"]), hostile | numbers, max_size=2),
            "fragment_size": numbers,
            "msg": anything,
            "id": hostile | numbers,
        },
    ),
)
def test_any_operation_is_refused_or_harmless(op: str, topic: Any, type: str, fields: dict[str, Any]) -> None:
    gate, sent = Outgoing(), []
    for operation in (
        {"op": "advertise", "id": "a", "topic": topic, "type": type},
        {"op": op, "id": "a", "topic": topic, "type": type} | fields,
        {"op": op, "topic": topic} | fields,
        {"op": op} | fields,
    ):
        with contextlib.suppress(NotAllowed):
            sent.append(gate.frame(operation))
    check_harmless(sent)


@settings(max_examples=500, deadline=None)
@given(
    type=st.sampled_from(["geometry_msgs/Twist", "geometry_msgs/msg/TwistStamped", "geometry_msgs/TwistStamped"]),
    speed=numbers,
    tyre=numbers,
    stamp_ns=st.integers(),
    version=st.sampled_from([1, 2]),
)
def test_any_command_of_a_slow_down_is_refused_or_harmless(
    type: str, speed: Any, tyre: Any, stamp_ns: int, version: int
) -> None:
    async def run() -> list[bytes]:
        link, wire = wired()
        publisher = CommandPublisher()
        publisher.attach(link)
        kind: Any = type.rpartition("/")[2]
        message = twist_message(kind, speed, tyre, stamp_ns=stamp_ns, ros_version=version)
        fits = all(isinstance(x, float) and math.isfinite(x) for x in (speed, tyre))
        try:
            publisher.publish("/catvehicle/cmd_vel", type, message)
        except NotAllowed:
            assert not fits, "a sound command must reach the car, whatever this machine's clock shows"
        publisher.unadvertise_all()
        return wire.sent

    check_harmless(asyncio.run(run()))


@settings(max_examples=100, deadline=None)
@given(hold=numbers, beats=st.integers(0, 5))
def test_heartbeat_and_release_of_the_guard_are_refused_or_harmless(hold: Any, beats: int) -> None:
    async def run() -> list[bytes]:
        link, wire = wired()
        publisher = CommandPublisher()
        publisher.attach(link)
        guard = GuardClient(publisher)
        guard.tick(True, 0.0)
        guard._count = 2**32 - 3
        for _ in range(beats):
            guard.send_heartbeat(0.0)
        guard.release(hold)
        guard.end()
        return wire.sent

    check_harmless(asyncio.run(run()))


@settings(max_examples=150, deadline=None)
@given(
    topic=hostile | st.just("/catvehicle/cmd_vel"),
    type=hostile | st.just("geometry_msgs/Twist"),
    speed=st.floats(),
    tyre=st.floats(),
)
def test_a_whole_slow_down_on_any_command_topic_sends_nothing_harmful(
    topic: str, type: str, speed: float, tyre: float
) -> None:
    """From armed to released, with any speed and steering measured, on any topic a bridge offers."""

    async def run() -> list[bytes]:
        link, wire = wired()
        reading = SimpleNamespace(
            value=SimpleNamespace(speed_mps=speed, percent=tyre, tyre_angle_rad=tyre),
            received_s=10.0,
            age_s=lambda now_s: 0.0,
            is_fresh=lambda now_s: True,
        )
        snapshot = SimpleNamespace(get=lambda name: reading, now_s=10.0, link=SimpleNamespace(), readings={})
        slowing = SlowDownController(
            lambda *what, **more: None,
            now=lambda: 10.0,
            wall_ms=lambda: -5,
            snapshot=lambda: snapshot,  # type: ignore[return-value, arg-type]
            record=lambda record: None,
            number=0,
        )
        source = Source(signal="command", topic=topic, type=type, decode=None, note=None)
        way = target_of(phase="monitoring", sources={"command": source}, offered={topic: type})
        slowing.link_opened(link)
        slowing.sender.target = way
        if way.problem is None:
            slowing.sender.announce()
            slowing._life.arm(way, "x")
            with contextlib.suppress(ValueError):  # a ramp begins at a speed
                slowing._begin("x", "by hand", 10.0, pressed_s=None)
                slowing.sender.send()
        return wire.sent

    sent = asyncio.run(run())
    check_harmless(sent)


@settings(max_examples=150, deadline=None)
@given(
    topics=st.lists(hostile | st.just("/catvehicle/vel"), max_size=6),
    types=st.lists(hostile, max_size=6),
    also=st.sampled_from(["none", "light", "all"]),
)
def test_whatever_a_bridge_offers_nothing_harmful_is_requested_of_it(
    topics: list[str], types: list[str], also: Any
) -> None:
    """Subscriptions and questions about any names: those that are refused cost nothing else."""

    def answer(operation: dict[str, Any]) -> Any:
        if operation["service"].endswith("/topics") or "raw" in operation["service"]:
            return {"topics": [*topics, "/catvehicle/vel"], "types": [*types, "x"] if len(types) % 2 else types}
        return {"type": types[0] if types else "", "publishers": [], "subscribers": []}

    async def run() -> list[bytes]:
        link, wire = wired(answer)
        tuning = ActiveSettings(SettingsFile(None))
        talk = Subscriptions(link, tuning, now=time.monotonic, proved=lambda: None, recognised=lambda title: None)
        talk.record(also)
        await talk._look(link, link)
        await talk._look(link, link)
        if (learning := talk._definitions._task) is not None:
            await asyncio.gather(learning, return_exceptions=True)
        for topic in topics:
            await discovery.fetch_publishers(link, topic)
            link.subscribe(Subscription(topic=topic, type=types[0] if types else None))
        for row in link.subscriptions:
            link.unsubscribe(row.topic)
        talk.end()
        return wire.sent

    sent = asyncio.run(run())
    check_harmless(sent)
    assert any(b'"/rosapi/topics"' in frame for frame in sent)


async def test_a_refused_row_costs_no_other_and_a_refused_call_is_a_failed_one(
    caplog: pytest.LogCaptureFixture,
) -> None:
    link, wire = wired()
    link.subscribe(Subscription(topic="not a name!", type=None))
    link.subscribe(Subscription(topic="/good", type="std_msgs/String"))
    link.subscribe(Subscription(topic="/raw", type=None, compression="cbor-raw"))
    assert [row.topic for row in link.subscriptions] == ["/good"]
    assert len(wire.sent) == 1
    assert "not a name!" in caplog.text
    assert await discovery.fetch_publishers(link, "not a name!") is None
    assert len(wire.sent) == 1
    with pytest.raises(NotAllowed):
        link.send_now({"op": "publish", "topic": "/good", "msg": {}})
    link._socket = None
    with pytest.raises(LinkDown):
        link.send_now({"op": "publish", "topic": "/good", "msg": {}})


NEEDED = {"subscribe": {"id": "x", "compression": "none", "throttle_rate": 0, "queue_length": 0}}


@pytest.mark.skipif(not TRANSCRIPTS, reason="the transcripts of real bridges are not here")
@pytest.mark.parametrize("path", TRANSCRIPTS, ids=lambda path: f"{path.parent.name}/{path.stem}")
def test_what_a_real_bridge_reported_is_refused(path: Any) -> None:
    """Each frame of a transcript that the gate lets pass, completed with what we always send, did no harm there."""
    lines = [json.loads(line) for line in path.read_text().splitlines()][1:]
    gate, passed, refused = Outgoing(), 0, 0
    for number, line in enumerate(lines):
        if line.get("dir") != "out":
            continue
        try:
            operation = json.loads(line["text"])
            op = operation.get("op")
            if op in ("publish", "unsubscribe", "advertise", "unadvertise"):
                operation.setdefault("id", "x")
            if op == "publish":
                operation.pop("id")
            operation = (
                NEEDED.get(op, {}) | operation | ({"args": operation.get("args", {})} if "service" in operation else {})
            )
            gate.frame(operation)
        except (KeyError, ValueError, AttributeError, TypeError):
            refused += 1
            continue
        passed += 1
        after = lines[number + 1] if number + 1 < len(lines) else {}
        harm = re.search(r"exited|has ended|Exception in thread|exceeds|too large|argument out of range", str(after))
        assert harm is None or (op == "call_service" and "/car/" in str(operation)), (operation, after)
        if op == "publish":
            assert "ERROR" not in str(after.get("log", "")) or "context is invalid" in str(after), (operation, after)
    assert passed or refused
