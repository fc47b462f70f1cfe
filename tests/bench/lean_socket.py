"""A WebSocket client with nothing around it: the `websockets` library's protocol on a bare asyncio transport.

Less work a frame than that library's own client, so that what is measured is the server and not its viewers.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from urllib.parse import urlsplit

from websockets.client import ClientProtocol
from websockets.extensions.permessage_deflate import ClientPerMessageDeflateFactory
from websockets.frames import Frame, Opcode
from websockets.protocol import State
from websockets.uri import parse_uri

LARGEST_FRAME = 2**24
OPENS_WITHIN_S = 20.0
Hear = Callable[["LeanSocket", bytes, bool], None]


class LeanSocket(asyncio.Protocol):
    """Calls `hear(socket, payload, is_text)` for each message, perhaps before `open_socket` has returned."""

    def __init__(self, url: str, hear: Hear | None, *, deflate: bool) -> None:
        extensions = (
            [ClientPerMessageDeflateFactory(client_max_window_bits=True)] if deflate else None
        )  # an empty list would send an empty header
        self._protocol = ClientProtocol(parse_uri(url), extensions=extensions, max_size=LARGEST_FRAME)
        self._hear = hear  # None: what comes after the handshake is thrown away unread
        self._transport: asyncio.Transport | None = None
        self.opened: asyncio.Future[None] = asyncio.get_running_loop().create_future()
        self.bytes_in = self.bytes_out = 0
        self.is_closed = False

    def send(self, text: bytes) -> None:
        self._protocol.send_text(text)
        self._flush()

    def pause(self) -> None:
        """Reads no more, not even pings: as a phone out of range."""
        if self._transport is not None and not self.is_closed:
            self._transport.pause_reading()

    def resume(self) -> None:
        if self._transport is not None and not self.is_closed:
            self._transport.resume_reading()

    def abort(self) -> None:
        if self._transport is not None:
            self._transport.abort()

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self._transport = transport  # type: ignore[assignment]
        self._protocol.send_request(self._protocol.connect())
        self._flush()

    def data_received(self, data: bytes) -> None:
        self.bytes_in += len(data)
        if self._hear is None and self.opened.done():
            return
        self._protocol.receive_data(data)
        if not self.opened.done():
            if self._protocol.handshake_exc is not None:
                self.opened.set_exception(self._protocol.handshake_exc)
            elif self._protocol.state is not State.CONNECTING:
                self.opened.set_result(None)
        for event in self._protocol.events_received():
            if isinstance(event, Frame) and event.opcode in (Opcode.TEXT, Opcode.BINARY) and self._hear:
                self._hear(self, bytes(event.data), event.opcode is Opcode.TEXT)
        self._flush()

    def connection_lost(self, exc: Exception | None) -> None:
        self.is_closed = True
        if not self.opened.done():
            self.opened.set_exception(exc or ConnectionError("closed before the handshake was over"))

    def _flush(self) -> None:
        if self._transport is not None:
            for data in self._protocol.data_to_send():
                if data:
                    self.bytes_out += len(data)
                    self._transport.write(data)


async def open_socket(url: str, hear: Hear | None = None, *, deflate: bool = False) -> LeanSocket:
    """An open socket. Raises OSError, TimeoutError and what a failed handshake raises."""
    parts = urlsplit(url)
    loop = asyncio.get_running_loop()
    _, socket = await loop.create_connection(lambda: LeanSocket(url, hear, deflate=deflate), parts.hostname, parts.port)
    async with asyncio.timeout(OPENS_WITHIN_S):
        await socket.opened
    return socket
