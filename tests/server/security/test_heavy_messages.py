"""A message beyond what is parsed, on a topic that is judged or only recorded, holds nothing up and costs no link."""

from __future__ import annotations

import asyncio
import contextlib
import sys
import time
from collections import Counter
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import cbor2
import numpy as np
import orjson
import pytest

from server.app.config import Config
from server.recording.read.read import open_recording
from server.rosbridge import codec
from server.rosbridge.codec import TooManyParts, Unreadable, decode
from server.rosbridge.raw_frame import raw_frame
from server.vehicle.vehicle import Vehicle
from tests.server.conftest import serving
from tests.server.security.heavy_bridge import JUDGED, MESSAGES, OTHER
from tests.server.viewer import viewer
from tests.tree import PROJECT

pytestmark = pytest.mark.world(n=22)

STALL_S = 0.25  # measured: 0.02 to 0.1 s


class HeavyBridge:
    """The bridge that sends heavy messages."""

    def __init__(self, process: asyncio.subprocess.Process, port: int) -> None:
        self._process = process
        self.address = f"ws://127.0.0.1:{port}"

    async def send(self, name: str, topic: str) -> None:
        """Sends it to the subscribers, once there is one."""
        while not await self._send(name, topic):
            await asyncio.sleep(0.1)

    async def _send(self, name: str, topic: str) -> int:
        assert self._process.stdin is not None
        assert self._process.stdout is not None
        self._process.stdin.write(f"{name} on {topic}\n".encode())
        await self._process.stdin.drain()
        async with asyncio.timeout(60):
            return int(await self._process.stdout.readline())


@contextlib.asynccontextmanager
async def heavy_bridge() -> AsyncIterator[HeavyBridge]:
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "tests.server.security.heavy_bridge"),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        cwd=PROJECT,
    )
    assert process.stdout is not None
    try:
        async with asyncio.timeout(30):
            yield HeavyBridge(process, int(await process.stdout.readline()))
    finally:
        process.kill()
        await process.wait()


class Stalls:
    """The longest time for which the loop did nothing else, as far as this process itself was at work (all threads):
    what other processes take of the processor is not counted."""

    def __init__(self) -> None:
        self.longest_s = 0.0

    async def watch(self) -> None:
        while True:
            before_s, worked_s = time.perf_counter(), time.process_time()
            await asyncio.sleep(0.005)
            stood_s = time.perf_counter() - before_s - 0.005
            self.longest_s = max(self.longest_s, min(stood_s, time.process_time() - worked_s))


@pytest.mark.field
async def test_no_heavy_message_stalls_the_loop_or_costs_the_link(tmp_path: Path) -> None:
    async with heavy_bridge() as bridge, contextlib.AsyncExitStack() as stack:
        config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)
        base = await stack.enter_async_context(serving(config))
        one = await stack.enter_async_context(viewer(base))
        await one.until(
            lambda: (
                one.states
                and one.states[-1]["session"]["phase"] == "monitoring"
                and one.states[-1]["recording"]["messages"] > 10
            ),
            within_s=20.0,
        )
        begun = len(one.states)
        stalls = Stalls()
        watcher = asyncio.create_task(stalls.watch())
        longest: dict[str, float] = {}
        tries: Counter[tuple[str, str]] = Counter()
        sent = [(OTHER, name) for name in MESSAGES] + [(JUDGED, name) for name in ("objects", "nan", "cbor lists")]
        for topic, name in sent:
            for _ in range(2):  # the second try is for a machine that was busy itself
                seen, stalls.longest_s = len(one.states), 0.0
                await bridge.send(name, topic)
                await one.until(lambda seen=seen: len(one.states) > seen + 4, within_s=20.0)  # type: ignore[misc]
                tries[topic, name] += 1
                longest[f"{name} on {topic}"] = stalls.longest_s
                if stalls.longest_s < STALL_S:
                    break
        watcher.cancel()
        assert max(longest.values()) < STALL_S, longest
        assert {state["session"]["phase"] for state in one.states[begun:]} == {"monitoring"}
        assert not [event for event in one.events if event["change"] in ("lost", "stalled")]
        last = one.states[-1]
        assert last["recording"]["dropped"] == 0
        assert (await one.ask(kind="disconnect"))["ok"] is True
        await one.until(lambda: one.states[-1]["recording"]["state"] == "off", within_s=20.0)
    recorded = next(tmp_path.rglob("*.mcap"))
    with open_recording([recorded]) as recording:
        counts = {name: topic.count for name, topic in recording.topics.items()}
    # what is text and too large to be parsed is kept as it came; of NaN and CBOR there is no text that is JSON
    assert counts[OTHER] == sum(tries[OTHER, name] for name in MESSAGES if not name.startswith("cbor"))


# -- what is known of a frame before it is parsed ---


@pytest.mark.parametrize(
    ("payload", "topic", "text"),
    [
        (b'{"op": "publish", "topic": "/a", "msg": {"x": 1}}', "/a", b'{"x": 1}'),
        (b'{"op":"publish","topic":"\\/a\\/b","msg":{"x":[]} }\n', "/a/b", b'{"x":[]}'),
        (b'{"op":"publish","topic":"/\\u00e9","msg":{}}', "/é", b"{}"),
        (b'{"op":"publish","topic":"/a","msg":3}', "/a", None),
    ],
)
def test_a_frame_says_its_topic_before_it_is_parsed(payload: bytes, topic: str, text: bytes | None) -> None:
    found = raw_frame(payload, False)
    assert found is not None
    assert (found.topic, found.json()) == (topic, text)
    assert found.message() == orjson.loads(payload)["msg"]


@pytest.mark.parametrize("length", [1, 22, 23, 24, 255, 256, 900])
def test_a_binary_frame_does_too(length: int) -> None:
    topic = "/" + "a" * (length - 1)
    found = raw_frame(cbor2.dumps({"op": "publish", "topic": topic, "msg": {"x": 1.5}}), True)
    assert found is not None
    assert (found.topic, found.message(), found.json()) == (topic, {"x": 1.5}, None)


@pytest.mark.parametrize(
    ("payload", "is_binary"),
    [
        (b"", False),
        (b"3", False),
        (b'{"op":"publish"}', False),
        (b'{"topic":"/a","op":"publish","msg":{}}', False),
        (b'{"op":"status","topic":"/a","msg":{}}', False),
        (b'{"op":"publish","topic":"' + b"a" * 2000 + b'","msg":{}}', False),
        (b'{"op":"publish","topic":"\\ud800","msg":{}}', False),
        (b'{"op":"publish","topic":"' + b"\\" * 900, False),
        (b"", True),
        (b"\xa3\x62op\x67publish\x65topic", True),
        (b"\xa3\x62op\x67publish\x65topic\x78\xff", True),
        (b"\xa3\x62op\x67publish\x65topic\x79\xff\xff", True),
        (b"\xa3\x62op\x67publish\x65topic\x62\xff\xff\x63msg\xa0", True),
        (cbor2.dumps({"op": "publish", "topic": 3, "msg": {}}), True),
    ],
)
def test_of_any_other_frame_nothing_is_known(payload: bytes, is_binary: bool) -> None:
    assert raw_frame(payload, is_binary) is None


def test_what_is_too_much_is_counted_before_it_is_parsed() -> None:
    for name, make in MESSAGES.items():
        made = make("/a")
        payload = made.encode() if isinstance(made, str) else made
        began_s = time.thread_time()
        with pytest.raises(Unreadable) as caught:
            decode(payload, is_binary=isinstance(made, bytes))
        assert time.thread_time() - began_s < 0.3, name
        assert isinstance(caught.value, TooManyParts) or name == "cbor cut off"


@pytest.mark.parametrize(
    ("message", "is_binary"),
    [
        ({"ranges": [1.5] * 100_000, "intensities": [0.25] * 100_000}, False),
        ({"points": [{"x": 1.0, "y": 2.0, "z": 3.0}] * 40_000}, False),
        ({"data": "x" * 5_000_000}, False),
        ({"data": bytes(10_000_000)}, True),
        ({"ranges": cbor2.CBORTag(85, np.zeros(1_000_000, "<f4").tobytes())}, True),
        ({"names": ["a"] * 40_000}, True),
    ],
)
def test_large_messages_of_real_cars_are_read(message: dict[str, Any], is_binary: bool) -> None:
    operation = {"op": "publish", "topic": "/a", "msg": message}
    payload = cbor2.dumps(operation) if is_binary else orjson.dumps(operation)
    took_s = []
    for _ in range(3):
        began_s = time.thread_time()
        decode(payload, is_binary)
        took_s.append(time.thread_time() - began_s)
    assert min(took_s) < STALL_S


def test_the_largest_frames_that_are_read_are_read_quickly() -> None:
    objects = b",".join([b'{"a":1.5}'] * (codec.MAX_CONTAINERS - 2))
    numbers = b",".join([b"1.25"] * codec.MAX_ELEMENTS)
    nan = b",".join([b"NaN", *[b"1.25"] * (codec.MAX_SLOW_ELEMENTS - 1)])
    for payload in (b"[" + objects + b"]", b"[" + numbers + b"]", b"[" + nan + b"]"):
        took_s = []
        for _ in range(3):
            began_s = time.thread_time()
            decode(b'{"op":"publish","msg":' + payload + b"}", False)
            took_s.append(time.thread_time() - began_s)
        assert min(took_s) < STALL_S


def test_the_collector_is_back_after_a_large_message() -> None:
    import gc

    assert gc.isenabled()
    decode(b'{"a":[' + b",".join([b"[]"] * 40_000) + b"]}", False)
    assert gc.isenabled()
    with pytest.raises(Unreadable):
        decode(b'{"a":[' + b",".join([b"[]"] * 40_000) + b"}", False)
    assert gc.isenabled()
