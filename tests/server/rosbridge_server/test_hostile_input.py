"""Ten thousand frames that no good client would send harm nothing."""

from __future__ import annotations

import asyncio
import json
import random
import time
from collections.abc import Callable
from typing import Any

import pytest
import websockets
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from websockets.frames import Frame, Opcode

from server.rosbridge_server.client import Client
from server.rosbridge_server.server import RosBridge
from tests.server.rosbridge_server.probe import Probe

FRAMES = 10_000
OPS = [
    "subscribe", "unsubscribe", "advertise", "unadvertise", "publish", "call_service", "set_level", "fragment",
    "service_response", "png", "auth", "", "SUBSCRIBE", "__class__",
]  # fmt: skip
FIELDS = [
    "op", "id", "topic", "type", "msg", "service", "args", "throttle_rate", "queue_length", "compression", "level",
    "data", "num", "total", "fragment_size", "latch", "header", "linear",
]  # fmt: skip
NUMBERS = ["NaN", "-Infinity", "1e999", "9" * 5_000]
VALUES: list[Any] = [
    None, True, False, 0, -1, 1.5, 2**53, -(2**70), 10**30, "", "/", "/vel", "vel", "x" * 2_000, "/rosapi/topics",
    "geometry_msgs/Twist", "geometry_msgs/msg/Twist", "cbor", "cbor-raw", "png", "none", "\ud83d", "\0", "💥" * 50,
    [], {}, [[]], [None], {"": None}, {"x": 1e308}, {"linear": {"x": []}}, ["/vel"], {"topic": ["/vel"]},
]  # fmt: skip


def random_frames(seed: int, count: int) -> list[str | bytes]:
    """Deterministic: bytes, cut JSON, depth, huge ids and every field with every kind of value."""
    dice = random.Random(seed)

    def operation() -> str:
        made = {field: dice.choice(VALUES) for field in dice.sample(FIELDS, dice.randint(1, 6))}
        made["op"] = dice.choice(OPS)
        if dice.random() < 0.5:
            made["topic"] = "/vel"
        return json.dumps(made)

    def cut() -> str:
        text = operation()
        return text[: dice.randrange(len(text))]

    kinds: list[Callable[[], str | bytes]] = [
        operation,
        operation,
        operation,
        cut,
        lambda: dice.randbytes(dice.randrange(300)),
        lambda: "[" * dice.randrange(2_000),
        lambda: '{"a":' * dice.randrange(3_000) + "1" + "}" * dice.randrange(3_000),
        lambda: json.dumps({"op": "publish", "topic": "/vel", "id": "x" * dice.randrange(30_000), "msg": {}}),
        lambda: f'{{"op":"publish","topic":"/vel","msg":{{"linear":{{"x":{dice.choice(NUMBERS)}}}}}}}',
        lambda: json.dumps(
            {"op": "fragment", "id": dice.randrange(50), "num": dice.randrange(5), "total": 3, "data": cut()}
        ),
        lambda: json.dumps(
            {
                "op": "call_service",
                "service": f"/rosapi/{dice.choice(['topics', 'topic_type', 'nodes', ''])}",
                "args": dice.choice(VALUES),
            }
        ),
        lambda: json.dumps({"op": "subscribe", "topic": f"/t{dice.randrange(5_000)}", "id": dice.randrange(10)}),
    ]
    return [dice.choice(kinds)() for _ in range(count)]


async def send_all(port: int, frames: list[str | bytes]) -> int:
    """Sends them as one client and reads the answers, each of which must be JSON; how many came."""
    answers = 0
    async with websockets.connect(f"ws://127.0.0.1:{port}", max_size=None, ping_interval=None) as socket:

        async def read() -> None:
            nonlocal answers
            async for answer in socket:
                assert isinstance(answer, str)
                answers += 1
                if json.loads(answer).get("id") == "the end":
                    return

        reading = asyncio.create_task(read())
        for frame in frames:
            await socket.send(frame)
        await socket.send(json.dumps({"op": "call_service", "service": "/rosapi/get_time", "id": "the end"}))
        await asyncio.wait_for(reading, 20)
    return answers


async def test_ten_thousand_malformed_frames_harm_nothing(
    bridge: RosBridge, port: int, probe: Probe, caplog: pytest.LogCaptureFixture
) -> None:
    bridge.advertise("/vel", "geometry_msgs/Twist")
    await probe.subscribe("/other", type="std_msgs/Int32")
    answers = [await send_all(port, random_frames(seed, FRAMES // 20)) for seed in range(20)]
    assert sum(answers) > FRAMES // 3  # each error is reported, unless a frame happened to turn reports off
    bridge.advertise("/other", "std_msgs/Int32")
    bridge.publish("/other", {"data": 7})
    assert (await probe.hear())["msg"] == {"data": 7}
    assert (await probe.call("/rosapi/topics"))["values"] == {
        "topics": ["/other", "/vel"],
        "types": ["std_msgs/Int32", "geometry_msgs/Twist"],
    }
    assert bridge.clients == 1
    assert [record for record in caplog.records if record.name.startswith(("catgraph", "websockets"))] == []


json_values = st.recursive(
    st.none() | st.booleans() | st.integers() | st.floats() | st.text() | st.sampled_from(VALUES),
    lambda inner: st.lists(inner, max_size=4) | st.dictionaries(st.sampled_from(FIELDS) | st.text(), inner, max_size=5),
    max_leaves=12,
)
operations = st.builds(
    lambda fields, op: {**fields, "op": op},
    st.dictionaries(st.sampled_from(FIELDS), json_values, max_size=8),
    st.sampled_from(OPS) | json_values,
)


class DeafSocket:
    """A connection that takes everything and is never full."""

    is_ready = True
    is_drained = True
    on_ready: Any = None
    on_lost: Any = None

    def __init__(self) -> None:
        self.frames: list[bytes] = []

    def write(self, frame: bytes) -> None:
        self.frames.append(frame)


@settings(max_examples=100, deadline=None, suppress_health_check=list(HealthCheck))
@given(sequence=st.lists(operations, min_size=1, max_size=6))
def test_no_sequence_of_operations_fails_inside(sequence: list[dict[str, Any]]) -> None:
    async def handle() -> None:
        bridge = RosBridge()
        bridge.advertise("/vel", "geometry_msgs/Twist")
        socket = DeafSocket()
        client = Client(bridge, socket)  # type: ignore[arg-type]
        for operation in sequence:
            client.handle(json.dumps(operation).encode("utf-8", "replace"))
            client.say("none", "", None)
        assert not any(b"internal error" in frame for frame in socket.frames)
        client.leave()
        assert [topic.name for topic in bridge.graph.topics()] == ["/vel"]

    asyncio.run(handle())


async def test_a_flood_from_one_client_leaves_the_others_their_turn(bridge: RosBridge, probe: Probe) -> None:
    handled = 0

    def toil(args: object) -> dict[str, Any]:
        nonlocal handled
        handled += 1
        ends = time.thread_time() + 0.0002
        while time.thread_time() < ends:
            pass
        return {}

    bridge.add_service("/toil", "demo/Toil", toil)
    call = json.dumps({"op": "call_service", "service": "/toil"}).encode()
    probe.socket.transport.write(b"".join(Frame(Opcode.TEXT, call).serialize(mask=True) for _ in range(3_000)))
    longest_s, last = 0.0, time.thread_time()  # our own time: other programs' turns do not count
    while handled < 3_000:  # others' turns
        await asyncio.sleep(0)
        now = time.thread_time()
        longest_s, last = max(longest_s, now - last), now
    assert longest_s < 0.35  # all at once they would take 0.6 s
    probe.socket.transport.abort()  # the answers are of no interest
