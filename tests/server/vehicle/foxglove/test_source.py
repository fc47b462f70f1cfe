"""The source before servers that do what that of foxglove-sdk does not: messages in parts, types that change."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from typing import Any

import orjson
import pytest
from websockets.asyncio.server import ServerConnection, serve

from server.rosbridge.link_listener import NOTE
from server.rosbridge.websocket import MAX_MESSAGE_BYTES
from server.vehicle.foxglove import protocol, server_state
from tests.server.link_listener import LinkListener, until
from tests.server.vehicle.foxglove.test_server import linked

STRING = {"schemaName": "std_msgs/String", "schema": "string data\n", "schemaEncoding": "ros1msg"}
TEXT = {"id": 1, "topic": "/a", "encoding": "ros1", **STRING}
HELLO = b"\x05\x00\x00\x00hello"
INFO = {"op": "serverInfo", "name": "s", "capabilities": ["clientPublish"], "supportedEncodings": ["ros1"]}


class Server:
    """Of one connection: writes down what it is sent."""

    def __init__(self) -> None:
        self.port = 0
        self.socket: ServerConnection | None = None
        self.operations: list[dict[str, Any]] = []

    async def say(self, operation: dict[str, Any]) -> None:
        assert self.socket is not None
        await self.socket.send(orjson.dumps(operation).decode())

    async def message(self, subscription: int, payload: bytes) -> None:
        assert self.socket is not None
        await self.socket.send(head(subscription) + payload)

    def all(self, op: str) -> list[Any]:
        return [one for one in self.operations if one["op"] == op]


def head(subscription: int) -> bytes:
    return struct.pack("<BIQ", 1, subscription, 7)


@asynccontextmanager
async def serving(greet: Callable[[Server], Awaitable[None]]) -> AsyncIterator[Server]:
    server = Server()

    async def handle(socket: ServerConnection) -> None:
        server.socket = socket
        await greet(server)
        async for text in socket:
            server.operations.append(orjson.loads(text))

    async with serve(handle, "127.0.0.1", 0, subprotocols=["foxglove.websocket.v1"]) as listening:  # type: ignore[list-item]
        server.port = next(iter(listening.sockets)).getsockname()[1]
        yield server


async def offers_text(server: Server) -> None:
    await server.say(INFO)
    await server.say({"op": "advertise", "channels": [TEXT]})


async def test_answers_between_the_parts_of_a_message_are_known_as_such() -> None:
    listener = LinkListener()
    rest = asyncio.Event()
    answers: list[bool] = []
    skipped: list[int] = []

    async def parts() -> AsyncIterator[bytes]:
        yield head(1) + HELLO[:6]
        await rest.wait()
        yield HELLO[6:]

    async with serving(offers_text) as server, linked(f"foxglove://127.0.0.1:{server.port}", listener, "/a") as source:
        source._delay = _Spied(answers, skipped)  # type: ignore[assignment]
        await until(lambda: server.all("subscribe"))
        assert server.socket is not None
        await until(lambda: answers)
        assert not any(answers)
        sending = asyncio.create_task(server.socket.send(parts()))
        await until(lambda: sum(answers) >= 3)
        rest.set()
        await sending
        assert (await listener.wait_for("message"))[:2] == ("/a", {"data": "hello"})
        count = len(answers)
        await until(lambda: len(answers) > count)
        assert not answers[-1]
        await server.socket.send(head(1) + bytes(MAX_MESSAGE_BYTES))
        assert (await listener.wait_for("large"))[0] == "/a"
    assert skipped == [1]


class _Spied:
    """A `Delay` that is followed."""

    is_followed = True

    def __init__(self, answers: list[bool], skipped: list[int]) -> None:
        self._answers = answers
        self._skipped = skipped

    def pong(self, sent_s: float, *, is_in_message: bool) -> None:
        self._answers.append(is_in_message)

    def skipped(self) -> None:
        self._skipped.append(1)

    def __getattr__(self, name: str) -> Callable[..., None]:
        return lambda *arguments: None


async def test_a_subscription_goes_on_where_a_kept_sample_is_wanted() -> None:
    listener = LinkListener()
    async with serving(offers_text) as server, linked(f"foxglove://127.0.0.1:{server.port}", listener, "/a") as source:
        await until(lambda: server.all("subscribe"))
        assert source.again("/a") is False
        await server.message(1, HELLO)
        await listener.wait_for("message")
        assert [one["op"] for one in server.operations] == ["subscribe"]
        source.renew("/a")
        await until(lambda: len(server.operations) == 3)
    assert [one["op"] for one in server.operations] == ["subscribe", "unsubscribe", "subscribe"]


async def test_of_a_topic_with_two_types_only_the_newest_one_is_given() -> None:
    listener = LinkListener()
    bool_ = {"schemaName": "std_msgs/Bool", "schema": "bool data\n", "schemaEncoding": "ros1msg"}
    async with serving(offers_text) as server, linked(f"foxglove://127.0.0.1:{server.port}", listener, "/a"):
        await until(lambda: server.all("subscribe"))
        await server.say({"op": "advertise", "channels": [TEXT | bool_ | {"id": 2}]})
        await until(lambda: len(server.all("subscribe")) == 2)
        assert server.all("unsubscribe") == [{"op": "unsubscribe", "subscriptionIds": [1]}]
        await server.message(1, HELLO)  # it was under way
        await server.message(2, b"\x01")
        await listener.wait_for("message")
        await server.say({"op": "unadvertise", "channelIds": [2]})
        await until(lambda: len(server.all("subscribe")) == 3)
    assert [message for _, message, _ in listener.all("message")] == [{"data": True}]
    assert server.all("subscribe")[2]["subscriptions"] == [{"id": 3, "channelId": 1}]


@pytest.mark.parametrize("limit", [(server_state, "MAX_OFFERED"), (protocol, "MAX_CHANNELS")])
async def test_channels_beyond_the_limit_are_reported(monkeypatch: pytest.MonkeyPatch, limit: tuple[Any, str]) -> None:
    monkeypatch.setattr(*limit, 2)
    listener = LinkListener()

    async def greet(server: Server) -> None:
        await server.say(INFO)
        rows = [TEXT | {"id": number, "topic": f"/{number}"} for number in range(3)]
        await server.say({"op": "advertise", "channels": rows})

    async with serving(greet) as server, linked(f"foxglove://127.0.0.1:{server.port}", listener) as source:
        level, text = await listener.wait_for("status")
        assert (await source.call("/rosapi/topics"))["topics"] == ["/0", "/1"]
    assert level == NOTE
    assert "the others are not received" in text
    assert listener.all("junk") == []


async def test_a_server_that_has_not_listed_its_channels_yet_does_not_refuse_commands() -> None:
    listener = LinkListener()

    async def greet(server: Server) -> None:
        await server.say(INFO)

    async with serving(greet) as server, linked(f"foxglove://127.0.0.1:{server.port}", listener) as source:
        await listener.wait_for("opened")
        await until(lambda: source.server_software == "s")
        assert source.command_problem is None
        await server.say({"op": "advertise", "channels": [TEXT]})
        await source.call("/rosapi/topics")
        source.send_now({"op": "advertise", "id": "a", "topic": "/cmd", "type": "geometry_msgs/Twist"})
        await until(lambda: server.all("advertise"))
        await server.say({"op": "advertise", "channels": [TEXT | {"id": 9, "topic": "/cmd"}]})
        await until(lambda: source._state.offered.type_of("/cmd"))
        with pytest.raises(Exception, match="does not answer /rosapi/publishers"):
            await source.call("/rosapi/publishers", {"topic": "/cmd"})


async def test_frames_that_are_none_are_counted_and_cost_nothing_else() -> None:
    listener = LinkListener()
    frames: list[str | bytes] = ["{", b"\x01\x00", b"\x01" + bytes(12), '{"op":"advertise"}', '{"op":"serverInfo"}']

    async def greet(server: Server) -> None:
        assert server.socket is not None
        for frame in frames:
            await server.socket.send(frame)

    async with serving(greet) as server, linked(f"foxglove://127.0.0.1:{server.port}", listener) as source:
        await listener.wait_for("opened")
        assert await source.call("/rosapi/topics", timeout_s=20.0) == {"topics": [], "types": []}
        assert source.junk_count == 3
        assert source.command_problem is not None
        assert "clientPublish" in source.command_problem
    assert listener.all("message") == []
