"""What is published in one block is written to each client with few calls, in order and within the limits."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any

import pytest

from server.judge.message import Message
from server.rosbridge_server.connection import TOGETHER_BYTES, Connection, WriteTogether
from server.rosbridge_server.listener import WRITE_LIMIT
from server.rosbridge_server.player import play
from server.rosbridge_server.server import RosBridge
from tests.server.rosbridge_server.probe import Probe, probing

pytestmark = pytest.mark.virtual_time


class Watched:
    """A transport whose calls of `write` are counted."""

    def __init__(self, transport: asyncio.Transport) -> None:
        self._transport = transport
        self.sizes: list[int] = []
        self.largest_buffer = 0

    def write(self, data: bytes) -> None:
        self.sizes.append(len(data))
        self._transport.write(data)
        self.largest_buffer = max(self.largest_buffer, self._transport.get_write_buffer_size())

    def __getattr__(self, name: str) -> Any:
        return getattr(self._transport, name)


@pytest.fixture
def made(monkeypatch: pytest.MonkeyPatch) -> list[Connection]:
    """The bridge's connections, in order."""
    connections: list[Connection] = []
    original = Connection.connection_made

    def note(self: Connection, transport: asyncio.BaseTransport) -> None:
        connections.append(self)
        original(self, transport)

    monkeypatch.setattr(Connection, "connection_made", note)
    return connections


@pytest.fixture
def watched(made: list[Connection], probe: Probe) -> Watched:
    made[0].transport = transport = Watched(made[0].transport)  # type: ignore[assignment]
    return transport


def numbers(count: int, period_s: float) -> list[Message]:
    return [Message(at_s=at * period_s, topic="/n", type="std_msgs/Int32", message={"data": at}) for at in range(count)]


async def test_messages_that_are_due_together_are_one_write(bridge: RosBridge, watched: Watched, probe: Probe) -> None:
    bridge.advertise("/n", "std_msgs/Int32")
    await probe.subscribe("/n")
    watched.sizes.clear()
    await play(numbers(20, period_s=0.0), bridge, ahead=64)
    assert len(watched.sizes) < 5  # one, unless the machine is so slow that others get a turn
    assert [(await probe.hear())["msg"]["data"] for _ in range(20)] == list(range(20))


async def test_large_messages_do_not_wait_for_each_other(bridge: RosBridge, watched: Watched, probe: Probe) -> None:
    bridge.advertise("/text", "std_msgs/String")
    await probe.subscribe("/text")
    watched.sizes.clear()
    with bridge.writing_together:
        for _ in range(3):
            bridge.publish("/text", {"data": "x" * TOGETHER_BYTES})
        assert len(watched.sizes) == 3


async def test_a_client_that_does_not_read_is_as_slow_as_without_a_block(
    bridge: RosBridge, watched: Watched, probe: Probe
) -> None:
    bridge.advertise("/text", "std_msgs/String")
    await probe.subscribe("/text")
    probe.socket.transport.pause_reading()
    with bridge.writing_together:
        for number in range(20_000):
            bridge.publish("/text", {"data": f"{number} {'x' * 1_000}"})
    assert WRITE_LIMIT < watched.largest_buffer < WRITE_LIMIT + 2 * TOGETHER_BYTES
    assert bridge.dropped > 0, "the rest waits within the client's limit"
    probe.socket.transport.resume_reading()
    received = [int((await probe.hear())["msg"]["data"].split()[0]) for _ in range(20_000 - bridge.dropped)]
    assert received == sorted(received)
    assert received[-1] == 19_999


async def test_who_subscribes_after_a_message_was_encoded_gets_it_too(
    bridge: RosBridge, port: int, probe: Probe
) -> None:
    bridge.advertise("/n", "std_msgs/Int32")
    await probe.subscribe("/n")
    playing = asyncio.ensure_future(play(numbers(6, period_s=1.0), bridge, ahead=8))
    assert (await probe.hear())["msg"] == {"data": 0}
    async with probing(port) as late:
        await late.send(op="subscribe", topic="/n", compression="cbor")
        received = [await late.hear() for _ in range(3)]
    await playing
    first = received[0]["msg"]["data"]
    assert first < 3
    assert [one["msg"]["data"] for one in received] == [first, first + 1, first + 2]


def test_a_connection_that_fails_does_not_keep_the_others_from_writing() -> None:
    class One:
        def __init__(self, *, fails: bool) -> None:
            self.fails = fails
            self.written = 0
            self.transport = SimpleNamespace(abort=lambda: setattr(self, "is_aborted", True))
            self.is_aborted = False

        def write_together(self) -> None:
            if self.fails:
                raise OSError("gone")
            self.written += 1

    together = WriteTogether()
    first, second = One(fails=True), One(fails=False)
    with together:
        together.add(first)  # type: ignore[arg-type]
        together.add(second)  # type: ignore[arg-type]
    assert (first.is_aborted, second.written, second.is_aborted) == (True, 1, False)
