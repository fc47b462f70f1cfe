"""uvicorn's side of a connection, with what uvicorn does not limit: how long a head may take, how many come from one
address; and with our headers on the one answer that no application ever sees. Written against uvicorn 0.54 and
websockets 17.

Messages to pages are compressed once for all pages that got the same before. A message may refer to what the page got
before (RFC 7692). A state of 16 kB differs from the previous one by a few hundred bytes: with the previous one as its
dictionary it has 0.5 kB after 90 µs. No page has a compressor of its own, which would be 256 kB, and the result is the
same for every page that got the same. Short messages are sent as they are, so that they part no two pages.
"""

from __future__ import annotations

import asyncio
import itertools
import logging
import socket
import weakref
import zlib
from asyncio.transports import Transport
from collections.abc import Iterable, Sequence
from typing import Any

import h11
from uvicorn._types import ASGISendEvent
from uvicorn.protocols.http.h11_impl import H11Protocol, RequestResponseCycle
from uvicorn.protocols.websockets.websockets_sansio_impl import WebSocketsSansIOProtocol
from websockets.extensions.permessage_deflate import PerMessageDeflate, ServerPerMessageDeflateFactory
from websockets.frames import CTRL_OPCODES, Frame, Opcode
from websockets.typing import ExtensionParameter

from server.protocol.rate_limit import Limits
from server.system import loopback
from server.web.middleware.errors import problem
from server.web.middleware.headers import FOR_ALL, FOR_DOCUMENTS

DEFLATE: dict[str, Any] = {"level": 6, "memLevel": 6}
FROM_PAGES_BITS = 12  # of the window for what a page sends: little
SHORTEST = 128  # bytes; an offer or an answer gains nothing
KIND = 14  # bytes with which messages of one kind begin: {"kind":"state
ENDS = 200  # bytes at both ends, where the time is and so two messages differ: all of a state take 20 µs to hash
EMPTY_BLOCK = b"\x00\x00\xff\xff"  # the end of a message in zlib's output, which is not sent (RFC 7692, 7.2.1)


class SentMessage:
    """What at least one page got and may still be referred to."""

    __slots__ = ("__weakref__", "compressed", "data", "number")

    def __init__(self, data: bytes, number: int) -> None:
        self.data = data
        self.number = number
        self.compressed: dict[tuple[int, ...], bytes] = {}  # by the page's window and the messages it refers to


class SentMessages:
    """Of all pages. One that is in no page's window any more is gone."""

    def __init__(self) -> None:
        self._messages: weakref.WeakValueDictionary[tuple[int, bytes, bytes], SentMessage] = (
            weakref.WeakValueDictionary()
        )
        self._numbers = itertools.count()

    def __len__(self) -> int:
        return len(self._messages)

    def get(self, data: bytes) -> SentMessage:
        key = (len(data), data[:ENDS], data[-ENDS:])
        found = self._messages.get(key)
        if found is None or found.data != data:
            found = self._messages[key] = SentMessage(data, next(self._numbers))
        return found


class SharedDeflate(PerMessageDeflate):
    """What one page and the server agreed on; it compresses by `messages`, and decompresses as its base class does."""

    def __init__(self, agreed: PerMessageDeflate, messages: SentMessages) -> None:
        super().__init__(
            agreed.remote_no_context_takeover,
            True,  # the base class makes no compressor
            agreed.remote_max_window_bits,
            agreed.local_max_window_bits,
        )
        self._window = 0 if agreed.local_no_context_takeover else 1 << agreed.local_max_window_bits
        self._messages = messages
        self._before: list[SentMessage] = []  # what begins in the page's window, and the newest; the newest last
        self._size = 0  # bytes of them

    def encode(self, frame: Frame) -> Frame:
        """The frame as it is sent: compressed where it is a whole message that is long enough."""
        if frame.opcode in CTRL_OPCODES or frame.opcode is Opcode.CONT or not frame.fin or len(frame.data) < SHORTEST:
            return frame
        message = self._messages.get(bytes(frame.data))
        base = self._base(message.data[:KIND])
        key = (self.local_max_window_bits, *(one.number for one in base))
        compressed = message.compressed.get(key)
        if compressed is None:
            compressed = message.compressed[key] = self._compressed(message, b"".join(one.data for one in base))
        self._remember(message)
        return Frame(frame.opcode, compressed, rsv1=True)

    def _base(self, kind: bytes) -> list[SentMessage]:
        """What the page got from the last message of this kind on; nothing where that is out of its window."""
        for k in range(len(self._before) - 1, -1, -1):
            if self._before[k].data[:KIND] == kind:
                return self._before[k:] if self._window else []
        return []

    def _remember(self, message: SentMessage) -> None:
        self._before.append(message)
        self._size += len(message.data)
        while len(self._before) > 1 and self._size - len(self._before[0].data) >= self._window:
            self._size -= len(self._before.pop(0).data)

    def _compressed(self, message: SentMessage, before: bytes) -> bytes:
        dictionary: dict[str, Any] = {"zdict": before} if before else {}  # zlib takes as much of its end as it can use
        compressor = zlib.compressobj(wbits=-self.local_max_window_bits, **DEFLATE, **dictionary)
        return (compressor.compress(message.data) + compressor.flush(zlib.Z_SYNC_FLUSH)).removesuffix(EMPTY_BLOCK)


class SharedDeflateFactory(ServerPerMessageDeflateFactory):
    """The extension as it is offered to a page."""

    def __init__(self, messages: SentMessages) -> None:
        super().__init__(client_max_window_bits=FROM_PAGES_BITS)
        self._messages = messages

    def process_request_params(
        self, params: Sequence[ExtensionParameter], accepted_extensions: Any
    ) -> tuple[list[ExtensionParameter], PerMessageDeflate]:
        answer, agreed = super().process_request_params(params, accepted_extensions)
        return answer, SharedDeflate(agreed, self._messages)


class PageSocket(WebSocketsSansIOProtocol):
    """uvicorn's WebSocket, which compresses as the module describes."""

    messages = SentMessages()  # of all servers of the process: it has results of a function, and nothing else

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.conn.available_extensions = [SharedDeflateFactory(self.messages)]

    async def send(self, message: ASGISendEvent) -> None:
        await super().send(message)
        if message["type"] == "websocket.http.response.body" and not message.get("more_body", False):
            self.handshake_complete = True  # else uvicorn logs each refusal as a fault of the application


# What strangers do to a port is no news for the person at the terminal.
_quiet = logging.getLogger("catgraph.web.wire")
_quiet.addHandler(logging.NullHandler())
_quiet.propagate = False


def options(limits: Limits) -> dict[str, Any]:
    """uvicorn's settings for connections, beside the address."""
    return {
        "http": type("PageRequests", (PageRequests,), {"limits": limits}),
        "h11_max_incomplete_event_size": limits.head_bytes,
        "ws": PageSocket,
        "ws_max_size": 64 * 1024,  # what a page may send at once
        "ws_ping_interval": 5.0,  # a phone that is out of range is disconnected
        "ws_ping_timeout": 10.0,
        "proxy_headers": False,  # the peer is never taken from a header that anybody can write
        "server_header": False,
        "access_log": False,
        "log_level": "warning",
        "log_config": None,  # its lines are written as ours are
        "lifespan": "on",
    }


def has_two_lengths(headers: Iterable[tuple[bytes, bytes]]) -> bool:
    """Whether a request states the length of its body in two ways."""
    return {b"content-length", b"transfer-encoding"} <= {name for name, _ in headers}


class PageRequests(H11Protocol):
    """One connection."""

    limits: Limits

    def __init__(self, *args: Any, **kwargs: Any) -> None:
        super().__init__(*args, **kwargs)
        self.logger = _quiet if self.logger.name == "uvicorn.error" else self.logger
        self._head_due: asyncio.TimerHandle | None = None

    def connection_made(self, transport: Transport) -> None:  # type: ignore[override]
        super().connection_made(transport)
        if self._is_one_too_many():
            transport.abort()
            return
        line = transport.get_extra_info("socket")
        if line is not None and line.family in (socket.AF_INET, socket.AF_INET6):
            # Head and body go out as two writes: else the second waits 40 ms for the first to be acknowledged.
            line.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        self._await_head()

    def connection_lost(self, exc: Exception | None) -> None:
        self._head_came()
        super().connection_lost(exc)

    def data_received(self, data: bytes) -> None:
        if self._is_between_requests() and self._is_head_too_long(data):
            self.send_400_response("The request's header is too long.")
            return
        super().data_received(data)

    def handle_events(self) -> None:
        super().handle_events()
        if self._is_between_requests():
            if self.conn.trailing_data[0] and self._head_due is None:  # a head has started
                self._await_head()
        else:
            self._head_came()
            request = self._request()
            if request is not None and has_two_lengths(self.headers or ()):
                request.keep_alive = False  # a proxy may have read another end of it (RFC 9112, 6.1)

    def send_400_response(self, msg: str) -> None:
        request = self._request()
        if request is not None and not request.response_complete:
            request.disconnected = True  # the rest of it is invalid: this is its answer, and there is no other
            request.message_event.set()
        try:
            answer = problem(400, msg)
            headers = {**answer.headers, "Connection": "close"} | FOR_ALL | FOR_DOCUMENTS
            head = [(name.lower(), value) for name, value in headers.items()]
            self.transport.write(self.conn.send(h11.Response(status_code=400, headers=head, reason="Bad Request")))
            self.transport.write(self.conn.send(h11.Data(data=bytes(answer.body))))
            self.transport.write(self.conn.send(h11.EndOfMessage()))
        except h11.LocalProtocolError:
            pass  # during a response no error can be sent
        self.transport.close()

    def _request(self) -> RequestResponseCycle | None:
        """The newest request of this connection; None: there was none."""
        return self.cycle

    def _is_between_requests(self) -> bool:
        return self.conn.their_state is h11.IDLE

    def _is_head_too_long(self, data: bytes) -> bool:
        """h11 limits only a head whose end has not arrived."""
        begun = self.conn.trailing_data[0]
        if len(begun) + len(data) <= self.limits.head_bytes:
            return False
        return (begun + data).find(b"\r\n\r\n", 0, self.limits.head_bytes) < 0

    def _await_head(self) -> None:
        self._head_due = self.loop.call_later(self.limits.head_s, self._head_did_not_come)

    def _head_came(self) -> None:
        if self._head_due is not None:
            self._head_due.cancel()
            self._head_due = None

    def _head_did_not_come(self) -> None:
        self._head_due = None
        if self._is_between_requests():
            self.transport.abort()

    def _is_one_too_many(self) -> bool:
        """A test of many pages runs on this machine; a port of this machine that is forwarded is its owner's own."""
        if self.client is None or loopback.is_loopback(self.client[0]):
            return False
        return connected(self.connections, self.client[0]) > self.limits.connections


def connected(connections: Iterable[object], address: str) -> int:
    """How many of uvicorn's connections come from an address."""
    clients = (getattr(one, "client", None) for one in connections)
    return sum(1 for client in clients if client is not None and client[0] == address)
