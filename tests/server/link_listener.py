"""The listener of a link in tests, and small servers for it."""

from __future__ import annotations

import asyncio
import contextlib
import socket
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator
from typing import Any

import orjson
from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from server.rosbridge.address import parse
from server.rosbridge.connection_errors import Problem
from server.rosbridge.link import RosLink

Handler = Callable[[asyncio.StreamReader, asyncio.StreamWriter], Awaitable[None]]


class LinkListener:
    """Records the callbacks of a link."""

    def __init__(self) -> None:
        self.received: list[tuple[str, Any]] = []
        self._noted = asyncio.Event()

    def link_opened(self) -> None:
        self._note("opened", None)

    def link_closed(self, problem: Problem) -> None:
        self._note("closed", problem)

    def dial_failed(self, problem: Problem) -> None:
        self._note("failed", problem)

    def message_received(self, topic: str, message: Any, note: str | None) -> None:
        self._note("message", (topic, message, note))

    def status_received(self, level: str, text: str) -> None:
        self._note("status", (level, text))

    def junk_received(self, why: str) -> None:
        self._note("junk", why)

    def large_skipped(self, topic: str | None, size: int) -> None:
        self._note("large", (topic, size))

    def all(self, kind: str) -> list[Any]:
        return [what for name, what in self.received if name == kind]

    async def wait_for(self, kind: str, count: int = 1, *, within_s: float = 20.0) -> Any:
        """What was received the `count`-th time."""
        try:
            async with asyncio.timeout(within_s):
                while len(self.all(kind)) < count:
                    self._noted.clear()
                    await self._noted.wait()
        except TimeoutError:
            raise AssertionError(f"no {kind}: {self.received}") from None
        return self.all(kind)[count - 1]

    def _note(self, kind: str, what: Any) -> None:
        self.received.append((kind, what))
        self._noted.set()


async def until(
    condition: Callable[[], Any], *, within_s: float = 20.0, or_say: Callable[[], str] = lambda: "it did not happen"
) -> None:
    deadline_s = time.monotonic() + within_s
    while not condition():
        assert time.monotonic() < deadline_s, or_say()
        await asyncio.sleep(0.005)


@contextlib.asynccontextmanager
async def linked(address: str, listener: LinkListener) -> AsyncIterator[RosLink]:
    """A started link, stopped at the end, without a callback after that."""
    link = RosLink(parse(address), listener, now=time.monotonic)
    link.start()
    try:
        yield link
    finally:
        link.stop()
        received = len(listener.received)
        for _ in range(10):
            await asyncio.sleep(0)
        assert len(listener.received) == received


class Bridge:
    """A WebSocket server that records the operations of each connection, and sends what the test sends."""

    def __init__(self) -> None:
        self.port = 0
        self.connections: list[list[dict[str, Any]]] = []
        self.sockets: list[ServerConnection] = []
        self.answer: Callable[[dict[str, Any]], dict[str, Any] | None] = lambda operation: None
        self.hangs_up = False  # as soon as a connection has sent an operation

    @property
    def address(self) -> str:
        return f"ws://127.0.0.1:{self.port}"

    @property
    def socket(self) -> ServerConnection:
        return self.sockets[-1]

    @property
    def operations(self) -> list[dict[str, Any]]:
        """Of the newest connection."""
        return self.connections[-1] if self.connections else []

    async def say(self, operation: Any) -> None:
        """One frame: bytes are binary, text is text, anything else is JSON."""
        if not isinstance(operation, (bytes, str)):
            operation = orjson.dumps(operation).decode()
        await self.socket.send(operation)

    async def serve(self, connection: ServerConnection) -> None:
        operations: list[dict[str, Any]] = []
        self.connections.append(operations)
        self.sockets.append(connection)
        with contextlib.suppress(ConnectionClosed):
            async for text in connection:
                operation = orjson.loads(text)
                operations.append(operation)
                answer = self.answer(operation)
                if answer is not None:
                    await connection.send(orjson.dumps(answer).decode())
                if self.hangs_up:
                    connection.transport.abort()


@contextlib.asynccontextmanager
async def bridging(port: int = 0, **options: Any) -> AsyncIterator[Bridge]:
    bridge = Bridge()
    options = {"ping_interval": None, "close_timeout": 0.2, "max_size": None, "compression": None} | options
    async with serve(bridge.serve, "127.0.0.1", port, **options) as server:
        bridge.port = next(iter(server.sockets)).getsockname()[1]
        yield bridge
        for socket in bridge.sockets:
            socket.transport.abort()


@contextlib.asynccontextmanager
async def answering(handler: Handler, **options: Any) -> AsyncIterator[int]:
    """A raw TCP server, on 127.0.0.1 unless `sock` is given; yields its port."""
    serving: dict[asyncio.Task[None], asyncio.StreamWriter] = {}

    async def handle(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        task = asyncio.current_task()
        assert task is not None
        serving[task] = writer
        with contextlib.suppress(ConnectionError, EOFError, asyncio.LimitOverrunError, asyncio.CancelledError):
            await handler(reader, writer)

    where: dict[str, Any] = {} if "sock" in options else {"host": "127.0.0.1", "port": 0}
    server = await asyncio.start_server(handle, **(where | options))
    try:
        yield server.sockets[0].getsockname()[1]
    finally:
        server.close()
        for task, writer in serving.items():
            writer.transport.abort()
            task.cancel()
        await asyncio.gather(*serving)


def text_frame(text: bytes, *, opcode: int = 1, final: bool = True) -> bytes:
    """A frame as a server sends it (RFC 6455, 5.2)."""
    head = bytes([0x80 * final | opcode])
    if len(text) < 126:
        return head + bytes([len(text)]) + text
    if len(text) < 2**16:
        return head + b"\x7e" + len(text).to_bytes(2, "big") + text
    return head + b"\x7f" + len(text).to_bytes(8, "big") + text


async def accept(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
    """The server's half of the WebSocket handshake (RFC 6455), by hand."""
    from websockets.utils import accept_key

    request = (await reader.readuntil(b"\r\n\r\n")).decode()
    key = next(line.partition(":")[2].strip() for line in request.splitlines() if line.startswith("Sec-WebSocket-Key"))
    writer.write(
        b"HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n"
        b"Sec-WebSocket-Accept: " + accept_key(key).encode() + b"\r\n\r\n"
    )


@contextlib.contextmanager
def black_hole() -> Iterator[int]:
    """A port that takes no more connections and refuses none: its queue is full, as of a machine out of range."""
    with contextlib.ExitStack() as held:
        listening = held.enter_context(socket.socket())
        listening.bind(("127.0.0.1", 0))
        listening.listen(0)
        for _ in range(4):
            waiting = held.enter_context(socket.socket())
            waiting.setblocking(False)
            waiting.connect_ex(listening.getsockname())
        yield listening.getsockname()[1]
