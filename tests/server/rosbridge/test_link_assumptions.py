"""What the link assumes of roslibpy and of autobahn below it: another version fails here."""

from __future__ import annotations

import ast
import asyncio
import contextlib
import inspect
from collections.abc import Callable
from importlib.metadata import version
from typing import Any

import pytest
import roslibpy
from autobahn.asyncio.websocket import WebSocketClientFactory
from autobahn.exception import Disconnected
from autobahn.websocket.protocol import WebSocketClientProtocol, WebSocketProtocol
from roslibpy.comm.comm_asyncio import AsyncioRosBridgeClientFactory, AsyncioRosBridgeProtocol

from server.rosbridge.link import ASSUMPTIONS
from tests.server.link_listener import accept, answering, bridging, text_frame, until

pytestmark = pytest.mark.virtual_time

HELD: dict[str, Callable[..., Any]] = {}


def holds(name: str) -> Callable[[Callable[..., Any]], Callable[..., Any]]:
    def note(test: Callable[..., Any]) -> Callable[..., Any]:
        HELD[name] = test
        return test

    return note


def test_each_assumption_has_a_test() -> None:
    assert set(HELD) == set(ASSUMPTIONS)


class Manager:
    """As little of a manager as the link gives the factory."""

    def __init__(self) -> None:
        self.loop = asyncio.get_running_loop()


class Spy(AsyncioRosBridgeProtocol):  # type: ignore[misc]
    """roslibpy's protocol that writes down in which order autobahn calls it."""

    def __init__(self) -> None:
        super().__init__()
        self.calls: list[str] = []

    def _note(self, name: str) -> None:
        self.calls.append(name)

    def onOpen(self) -> None:
        self._note("onOpen")
        super().onOpen()

    def onClose(self, wasClean: bool, code: int | None, reason: str | None) -> None:
        self._note("onClose")
        super().onClose(wasClean, code, reason)

    def onMessageBegin(self, isBinary: bool) -> None:
        self._note(f"begin {isBinary}")
        super().onMessageBegin(isBinary)

    def onMessageFrameBegin(self, length: int) -> None:
        self._note(f"frame {length}")
        super().onMessageFrameBegin(length)
        self._note(f"total {self.message_data_total_length}")

    def onMessageFrameData(self, payload: bytes) -> None:
        self._note(f"data {len(payload)}")
        super().onMessageFrameData(payload)

    def onMessageFrameEnd(self) -> None:
        self._note("frame end")
        super().onMessageFrameEnd()

    def onMessageEnd(self) -> None:
        self._note(f"end {b''.join(self.message_data)!r} {self.message_is_binary}")


class SpyFactory(AsyncioRosBridgeClientFactory):  # type: ignore[misc]
    """roslibpy's factory made as the link makes it."""

    protocol = Spy

    def __init__(self, url: str) -> None:
        self._manager = Manager()
        super(AsyncioRosBridgeClientFactory, self).__init__(url, loop=self._manager.loop)
        self._proto = None
        self._proto_lock = contextlib.nullcontext()
        self._stop = False
        self.calls: list[str] = []

    def ready(self, proto: Any) -> None:
        self.calls.append("ready")
        super().ready(proto)

    def connection_lost(self, proto: Any) -> None:
        self.calls.append("lost")
        super().connection_lost(proto)

    def _schedule_reconnect(self) -> None:
        self.calls.append("reconnect")


async def dial(port: int) -> tuple[Spy, SpyFactory]:
    factory = SpyFactory(f"ws://127.0.0.1:{port}")
    _, protocol = await asyncio.get_running_loop().create_connection(factory, "127.0.0.1", port)
    assert isinstance(protocol, Spy)
    return protocol, factory


@holds("roslibpy")
def test_the_version_is_the_one_it_was_written_against() -> None:
    assert version("roslibpy") == ASSUMPTIONS["roslibpy"]


@holds("manager")
async def test_the_loop_is_the_one_that_is_given() -> None:
    loop = asyncio.get_running_loop()
    assert WebSocketClientFactory("ws://127.0.0.1:1", loop=loop).loop is loop
    factory = SpyFactory("ws://127.0.0.1:1")
    assert factory.loop is loop
    assert factory.manager is factory._manager  # and no shared one with a thread is made


@holds("factory")
async def test_it_dials_in_one_place_and_tries_again_by_one_way() -> None:
    source = inspect.getsource(AsyncioRosBridgeClientFactory)
    tree = ast.parse(source)

    def who(called: str) -> list[str]:
        return [
            method.name
            for method in ast.walk(tree)
            if isinstance(method, (ast.FunctionDef, ast.AsyncFunctionDef))
            for node in ast.walk(method)
            if isinstance(node, ast.Attribute) and node.attr == called
        ]

    assert who("create_connection") == ["_connect_async"]
    assert who("_connect_async") == ["_open_connection"]
    assert sorted(who("_open_connection")) == ["_schedule_reconnect", "connect"]
    assert sorted(who("_schedule_reconnect")) == ["_connect_async", "connection_lost"]
    async with bridging() as bridge:
        protocol, factory = await dial(bridge.port)
        await until(lambda: factory.calls == ["ready"])
        bridge.socket.transport.abort()
        await until(lambda: factory.calls == ["ready", "lost", "reconnect"])
        assert protocol.calls == ["onOpen", "onClose"]


@holds("protocol")
async def test_it_is_called_for_the_opening_and_once_for_the_end_opened_or_not() -> None:
    async with bridging() as bridge:
        protocol, factory = await dial(bridge.port)
        await until(lambda: factory.calls == ["ready"])
        protocol.dropConnection(abort=True)
        protocol.dropConnection(abort=True)
        await until(lambda: "lost" in factory.calls)
        await asyncio.sleep(0.05)
        assert protocol.calls == ["onOpen", "onClose"]

    async def hang_up(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.close()

    async with answering(hang_up) as port:
        protocol, factory = await dial(port)
        await until(lambda: "lost" in factory.calls)
        assert protocol.calls == ["onClose"]
        assert protocol.wasNotCleanReason

    async def refuse(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"HTTP/1.1 404 Not Found\r\n\r\n")

    async with answering(refuse) as port:
        protocol, factory = await dial(port)
        await until(lambda: "lost" in factory.calls)
        assert protocol.calls == ["onClose"]
        assert protocol.wasNotCleanReason == "WebSocket connection upgrade failed [404]: Not Found"


@holds("frames")
async def test_a_message_comes_frame_by_frame() -> None:
    async def speak(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await accept(reader, writer)
        writer.write(text_frame(b"abc", final=False) + text_frame(b"de", opcode=0) + text_frame(b"\xff", opcode=2))
        await asyncio.sleep(5)

    async with answering(speak) as port:
        protocol, _ = await dial(port)
        await until(lambda: len(protocol.calls) >= 14)
        assert protocol.calls == [
            "onOpen",
            *("begin False", "frame 3", "total 3", "data 3", "frame end"),
            *("frame 2", "total 5", "data 2", "frame end", "end b'abcde' False"),
            *("begin True", "frame 1", "total 1", "data 1", "frame end", "end b'\\xff' True"),
        ]
        protocol.dropConnection(abort=True)
        assert WebSocketProtocol.onMessageEnd.__code__.co_names.count("_onMessage") == 1  # what the link leaves out


@holds("state")
async def test_the_state_shows_whether_it_is_open() -> None:
    async def say_goodbye(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await accept(reader, writer)
        await asyncio.sleep(0.05)
        writer.write(text_frame(b"\x03\xe8", opcode=8))
        await asyncio.sleep(5)

    async with answering(say_goodbye) as port:
        protocol, _ = await dial(port)
        assert protocol.state == protocol.STATE_CONNECTING
        with pytest.raises(Disconnected):
            protocol.sendMessage(b"{}")
        await until(lambda: protocol.state == protocol.STATE_OPEN)
        protocol.sendMessage(b"{}")
        await until(lambda: protocol.state == protocol.STATE_CLOSING)
        with pytest.raises(Disconnected):
            protocol.sendMessage(b"{}")
        protocol.sendPing()  # no answer, no error
        protocol.dropConnection(abort=True)
        assert protocol.state == protocol.STATE_CLOSED


@holds("unread")
async def test_what_was_answered_to_the_handshake_is_still_there() -> None:
    async def speak(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        writer.write(b"SSH-2.0")
        await asyncio.sleep(0.05)
        writer.write(b"-Open\r\n\r\n")
        await asyncio.sleep(5)

    async with answering(speak) as port:
        protocol, _ = await dial(port)
        await until(lambda: "onClose" in protocol.calls)
        assert protocol.data == b"SSH-2.0-Open\r\n\r\n"


@holds("ros")
def test_the_client_sets_three_things_and_dials() -> None:
    body = ast.parse(inspect.getsource(roslibpy.Ros.__init__).lstrip()).body[0]
    assert isinstance(body, ast.FunctionDef)
    kept = [
        target.attr
        for node in ast.walk(body)
        if isinstance(node, ast.Assign)
        for target in node.targets
        if isinstance(target, ast.Attribute)
    ]
    assert kept == ["_id_counter", "factory", "is_connecting"]
    last = body.body[-1]
    assert ast.unparse(last) == "self.connect()"


def test_why_autobahns_own_pings_are_not_used() -> None:
    """Its timers round down to whole seconds. Should this fail, they may have become usable."""
    import txaio

    source = inspect.getsource(type(txaio.make_batched_timer(0.2)).call_later)
    assert "int(now + delay) * 1000" in source
    assert "_batched_timer.call_later" in inspect.getsource(WebSocketClientProtocol.processHandshake)
