"""uvicorn's side of a connection, with what uvicorn does not limit: how long a head may take, how many come from one
address; and with our headers on the one answer that no application ever sees. Written against uvicorn 0.54.
"""

from __future__ import annotations

import asyncio
import ipaddress
import logging
import socket
from asyncio.transports import Transport
from collections.abc import Iterable
from typing import Any

import h11
from uvicorn.protocols.http.h11_impl import H11Protocol

from server.protocol.rate_limit import Limits
from server.web.compression import PageSocket
from server.web.middleware.errors import problem
from server.web.middleware.headers import FOR_ALL, FOR_DOCUMENTS

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

    def send_400_response(self, msg: str) -> None:
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
        if self.client is None or is_loopback(self.client[0]):
            return False
        return connected(self.connections, self.client[0]) > self.limits.connections


def connected(connections: Iterable[object], address: str) -> int:
    """How many of uvicorn's connections come from an address."""
    clients = (getattr(one, "client", None) for one in connections)
    return sum(1 for client in clients if client is not None and client[0] == address)


def is_loopback(address: str) -> bool:
    try:
        return ipaddress.ip_address(address.partition("%")[0]).is_loopback
    except ValueError:
        return False
