"""One client's socket: a websockets connection that can be frozen, is bounded and writes ready-made frames."""

from __future__ import annotations

import asyncio
import logging
import socket
from collections.abc import Callable
from typing import Any, Protocol

from websockets.asyncio.server import Server, ServerConnection
from websockets.protocol import State
from websockets.server import ServerProtocol

_log = logging.getLogger("catgraph.bridge")

HANDSHAKE_S = 10.0  # a socket that has not become a WebSocket by then is closed
LARGEST_BUFFER = 4_000_000  # bytes of pongs: beyond, the peer floods us with pings and does not read
TOGETHER_BYTES = 16_384  # small frames that are written with one call
KEEPALIVE_S = 30  # TCP's own probe finds peers that vanished; rosbridge itself sends no pings


class Admission(Protocol):
    """The listener, as a connection that came from it needs it."""

    is_frozen: bool
    together: WriteTogether

    def admit(self, connection: Connection, /) -> bool: ...

    def forget(self, connection: Connection, /) -> None: ...


class WriteTogether:
    """A block that does not wait: each connection writes at its end, with one system call, what it is given in it."""

    def __init__(self) -> None:
        self.is_open = False
        self._connections: list[Connection] = []

    def add(self, connection: Connection) -> None:
        self._connections.append(connection)

    def __enter__(self) -> None:
        self.is_open = True

    def __exit__(self, *_: object) -> None:
        self.is_open = False
        connections, self._connections = self._connections, []
        for connection in connections:
            try:
                connection.write_together()
            except Exception:  # one client's connection; the others get theirs
                connection.transport.abort()
                _log.exception("A client's connection failed while messages were written to it")


class Connection(ServerConnection):
    """While frozen it neither reads nor answers anything, pings and handshakes included, as a stopped process would."""

    def __init__(self, listener: Admission, protocol: ServerProtocol, server: Server, **options: Any) -> None:
        super().__init__(protocol, server, **options)
        self._listener = listener
        self.awake = asyncio.Event()  # not frozen
        self.awake.set()
        self._unread = bytearray()
        self._unwritten: list[bytes] = []  # frames, only within a block of WriteTogether
        self._unwritten_bytes = 0
        self._pong_bytes = 0  # written since the socket's buffer was last empty
        self._deadline: asyncio.TimerHandle | None = None  # of the handshake
        self.on_ready: Callable[[], None] | None = None
        self.on_lost: Callable[[], None] | None = None

    @property
    def is_ready(self) -> bool:
        """Open, not frozen, and with room in the socket's buffer."""
        return (
            not self.paused
            and self.awake.is_set()
            and self.protocol.state is State.OPEN
            and not self.transport.is_closing()
        )

    @property
    def is_drained(self) -> bool:
        """All that was written has gone to the system, or never will."""
        return self.transport.is_closing() or self.transport.get_write_buffer_size() == 0

    def write(self, frame: bytes) -> None:
        """Writes one whole frame. Frames are never split here, so they cannot fall into the middle of another."""
        together = self._listener.together
        if not together.is_open:
            self.transport.write(frame)
            return
        if not self._unwritten:
            together.add(self)
        self._unwritten.append(frame)
        self._unwritten_bytes += len(frame)
        if self._unwritten_bytes > TOGETHER_BYTES:
            self.write_together()

    def write_together(self) -> None:
        """Writes the frames that were kept back."""
        frames, self._unwritten, self._unwritten_bytes = self._unwritten, [], 0
        if frames:
            self.transport.write(frames[0] if len(frames) == 1 else b"".join(frames))

    def freeze(self) -> None:
        self.awake.clear()
        self.transport.pause_reading()

    def thaw(self) -> None:
        self.awake.set()
        unread = bytes(self._unread)
        self._unread.clear()
        if unread:
            self.data_received(unread)
        if not self.recv_messages.paused and not self.transport.is_closing():
            self.transport.resume_reading()
        self._notify_ready()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        super().connection_made(transport)
        _keep_alive(transport.get_extra_info("socket"))
        if not self._listener.admit(self):
            self.transport.abort()
            return
        if self._listener.is_frozen:
            self.freeze()
        self._deadline = self.loop.call_later(HANDSHAKE_S, self._end_handshake)

    def connection_lost(self, exc: Exception | None) -> None:
        self._listener.forget(self)
        if self._deadline is not None:
            self._deadline.cancel()
        super().connection_lost(exc)
        self.awake.set()
        if self.on_lost is not None:
            self.on_lost()

    def data_received(self, data: bytes) -> None:
        if not self.awake.is_set():  # websockets may have resumed reading by itself
            self._unread += data
            self.transport.pause_reading()
            return
        before = self.transport.get_write_buffer_size()
        super().data_received(data)
        after = self.transport.get_write_buffer_size()
        self._pong_bytes = self._pong_bytes + max(0, after - before) if after else 0  # messages may be large
        if self._pong_bytes > LARGEST_BUFFER:
            self.transport.abort()

    def resume_writing(self) -> None:
        super().resume_writing()
        self._notify_ready()

    def _notify_ready(self) -> None:
        if self.on_ready is not None:
            self.on_ready()

    def _end_handshake(self) -> None:
        if self.protocol.state is not State.CONNECTING:
            return
        if not self.awake.is_set():
            self._deadline = self.loop.call_later(HANDSHAKE_S, self._end_handshake)
        else:
            self.transport.abort()


def _keep_alive(sock: socket.socket) -> None:
    sock.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
    for name in ("TCP_KEEPIDLE", "TCP_KEEPINTVL"):
        if hasattr(socket, name):  # not on every system
            sock.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), KEEPALIVE_S)
