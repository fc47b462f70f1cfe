"""One port for TLS and plain HTTP: the first byte of a connection decides which.

`192.168.4.1:8000` typed into a phone is http, and a TLS port would not answer at all. The byte is peeked at; a
connection that starts with 22 (RFC 8446 5.1) is served by TLS, any other by the instruction page.
If the loop cannot wait on a socket (Windows), a plain connection ends as on any TLS port.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import logging
import socket
import ssl
from collections import Counter
from collections.abc import Callable

from server.system import loopback

log = logging.getLogger("catgraph.tls")

_HANDSHAKE = 22
UNDECIDED = 256  # connections that have sent nothing yet or are in their handshake; the next one ends the eldest
DECIDE_S = 10.0  # browsers open spare connections and send nothing on them

Factory = Callable[[], asyncio.Protocol]


class TlsSniffer:
    """Accepts on a listening socket and leads each connection to one of two protocols."""

    def __init__(
        self,
        listening: socket.socket,
        context: ssl.SSLContext,
        *,
        secure: Factory,
        plain: Factory,
        most: int,
        connected: Callable[[str], int],
    ) -> None:
        """`most`: connections from one address, those included that are not through their handshake;
        `connected(address)`: how many are."""
        self._most = most
        self._connected = connected
        self._from: Counter[str] = Counter()  # undecided and in their handshake, by address
        self._listening = listening
        self._context = context
        self._secure = secure
        self._plain = plain
        self._entering: dict[asyncio.Task[None], None] = {}  # eldest first

    async def run(self) -> None:
        """Accepts until cancelled."""
        loop = asyncio.get_running_loop()
        self._listening.setblocking(False)
        try:
            while True:
                try:
                    sock, peer = await loop.sock_accept(self._listening)
                except OSError as why:  # out of files, or gone before it was taken
                    log.warning("a connection could not be taken: %s", why)
                    await asyncio.sleep(0.2)
                    continue
                address = str(peer[0]) if isinstance(peer, tuple) else ""
                if self._has_too_many(address):
                    sock.close()
                    continue
                if len(self._entering) >= UNDECIDED:
                    next(iter(self._entering)).cancel()
                task = asyncio.create_task(self._enter(sock), name="enter")
                self._entering[task] = None
                self._from[address] += 1
                task.add_done_callback(functools.partial(self._entered, address))
        finally:
            for task in tuple(self._entering):
                task.cancel()

    def _entered(self, address: str, done: asyncio.Task[None]) -> None:
        self._entering.pop(done, None)
        self._from -= Counter((address,))

    def _has_too_many(self, address: str) -> bool:
        """A handshake that does not come to its end is a connection like any other. This machine's are not counted."""
        return not loopback.is_loopback(address) and self._from[address] + self._connected(address) >= self._most

    async def _enter(self, sock: socket.socket) -> None:
        sock.setblocking(False)
        with contextlib.suppress(OSError):
            sock.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
        is_led = False
        try:
            async with asyncio.timeout(DECIDE_S):
                first = await _first_byte(sock)
            if first is None:
                return
            loop = asyncio.get_running_loop()
            is_led = True  # the transport closes it from here on
            if first == _HANDSHAKE:
                await loop.connect_accepted_socket(
                    self._secure, sock, ssl=self._context, ssl_handshake_timeout=DECIDE_S, ssl_shutdown_timeout=2.0
                )
            else:
                await loop.connect_accepted_socket(self._plain, sock)
        except (OSError, TimeoutError):
            pass  # a scan of ports, a browser that does not trust us yet, a phone out of range: no news
        finally:
            if not is_led:
                sock.close()


async def _first_byte(sock: socket.socket) -> int | None:
    """Wait for the first byte without reading it; None: closed without data. Raises OSError."""
    loop = asyncio.get_running_loop()
    while True:
        readable = loop.create_future()
        loop.add_reader(sock, _fulfil, readable)
        try:
            await readable
        finally:
            loop.remove_reader(sock)
        try:
            seen = sock.recv(1, socket.MSG_PEEK)
        except BlockingIOError:
            continue
        return seen[0] if seen else None


def _fulfil(readable: asyncio.Future[None]) -> None:
    if not readable.done():
        readable.set_result(None)
