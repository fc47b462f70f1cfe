"""Dials one rosbridge for ever: resolves, tries each address, does the handshake, waits, tries again.

It takes the place of roslibpy's factory, whose back-off grows to an hour, whose dialling has no time-out, takes the
first address that accepts and cannot be abandoned.
"""

from __future__ import annotations

import asyncio
import contextlib
import ipaddress
import logging
import socket as sockets
import ssl
from collections.abc import Sequence
from typing import Any, Protocol

import roslibpy
from roslibpy.comm.comm_asyncio import AsyncioRosBridgeClientFactory

from server.rosbridge.address import Address, BadAddress, refuse_forbidden
from server.rosbridge.live_source import NoWebSocket
from server.rosbridge.websocket import BridgeProtocol
from server.system.supervision import Supervisor

log = logging.getLogger("catgraph.link")

LOOKUP_TIMEOUT_S = 4.0
DIAL_TIMEOUT_S = 4.0  # over all addresses of a host, but at least a second for each
HANDSHAKE_TIMEOUT_S = 3.0
FIRST_RETRY_S = 0.2
LAST_RETRY_S = 2.0
RETRY_GROWTH = 1.7
STEADY_S = 2.0  # a connection that held this long was one; the next is tried for at once
MAX_ADDRESSES = 4


class DialOwner(Protocol):
    """Who owns the connection that is dialled."""

    attempts: int

    def is_current(self, socket: BridgeProtocol) -> bool: ...
    def dial_failed(self, error: Exception) -> None: ...


class OwnLoop:
    """What roslibpy calls an event loop manager, around the loop that already runs."""

    def __init__(self) -> None:
        self.loop = asyncio.get_running_loop()

    def run(self) -> None:
        """The loop runs already."""


class Dialer(AsyncioRosBridgeClientFactory):  # type: ignore[misc]
    """Dials one address for ever, on our loop, until it is stopped: one task, so that there is never a second one."""

    protocol = BridgeProtocol

    def __init__(self, address: Address, owner: DialOwner, protocols: Sequence[str] = ()) -> None:
        """`protocols`: the subprotocols that are offered, the best first."""
        url = address.websocket_url
        self._manager = OwnLoop()
        super(AsyncioRosBridgeClientFactory, self).__init__(url, protocols=list(protocols), loop=self._manager.loop)
        self._proto = None
        self._proto_lock = contextlib.nullcontext()  # one loop, one thread: nothing to lock
        self._stop = False
        self._retry_count = 0
        self._reconnect_delay = FIRST_RETRY_S
        self.owner = owner
        self._address = address
        self._lookup: asyncio.Task[Any] | None = None
        self._tls: ssl.SSLContext | None = None
        self._supervisor = Supervisor(f"link to {url}")
        self._hurry = asyncio.Event()
        # No permessage-deflate is offered: it would cost the car's computer more than it saves the network.
        self.setProtocolOptions(
            openHandshakeTimeout=0,  # 0: not by autobahn's timers
            closeHandshakeTimeout=0,
            serverConnectionDropTimeout=0,
            tcpNoDelay=True,
            utf8validateIncoming=False,  # orjson refuses what is not UTF-8
            failByDrop=True,
        )

    def connect(self) -> None:
        if not self._stop and not self._supervisor.keeps("dial"):
            self._supervisor.keep("dial", self._connect_async)

    async def _connect_async(self) -> None:
        delay_s = FIRST_RETRY_S
        while True:
            try:
                connection = await self._dial()
            except Exception as error:  # whatever it was, the next try must come
                if not isinstance(error, (OSError, ValueError)):
                    log.exception("dialling failed unexpectedly: address=%s", self.url)
                self.owner.dial_failed(error)
            else:
                opened_s = self._manager.loop.time()
                await connection.gone.wait()
                if self._manager.loop.time() - opened_s >= STEADY_S:
                    delay_s = FIRST_RETRY_S
            self._hurry.clear()
            with contextlib.suppress(TimeoutError):
                async with asyncio.timeout(delay_s):
                    await self._hurry.wait()
            delay_s = FIRST_RETRY_S if self._hurry.is_set() else min(delay_s * RETRY_GROWTH, LAST_RETRY_S)

    def _schedule_reconnect(self) -> None:
        """Not by a timer: `_connect_async` goes round."""

    def retry_now(self) -> None:
        """Dials at once if it is waiting for its next try."""
        self._hurry.set()

    def stop(self) -> None:
        """No further try, nothing left behind."""
        self._stop = True
        self._supervisor.end("dial")
        if self._lookup is not None:
            self._lookup.cancel()

    async def _dial(self) -> BridgeProtocol:
        """Resolve the host, refuse forbidden addresses, and dial the checked ones in turn until a handshake succeeds.
        Raises the most informative error."""
        self.owner.attempts += 1
        found = await self._addresses()
        failures: list[Exception] = []
        for ip in found:
            try:
                refuse_forbidden(ip)
                return await self._dial_one(ip, max(DIAL_TIMEOUT_S / len(found), 1.0))
            except (OSError, ValueError) as error:
                failures.append(error)
        raise min(failures, key=_rank, default=OSError("the host has no address"))

    async def _addresses(self) -> list[str]:
        host = self._address.host
        with contextlib.suppress(ValueError):
            return [str(ipaddress.ip_address(host))]
        if self._lookup is None:  # one that takes longer is waited for again at the next try, not started again
            self._lookup = asyncio.ensure_future(_look_up(host, self._address.port))
            self._lookup.add_done_callback(lambda task: task.cancelled() or task.exception())
        try:
            async with asyncio.timeout(LOOKUP_TIMEOUT_S):
                found = await asyncio.shield(self._lookup)
        except TimeoutError:
            raise sockets.gaierror(sockets.EAI_AGAIN, "no name server answers") from None
        finally:
            if self._lookup.done():
                self._lookup = None
        return list(dict.fromkeys(str(sockaddr[0]) for *_, sockaddr in found))[:MAX_ADDRESSES]

    async def _dial_one(self, ip: str, within_s: float) -> BridgeProtocol:
        loop = asyncio.get_running_loop()
        secure: dict[str, Any] = {}
        if self._address.secure:
            self._tls = self._tls or ssl.create_default_context()
            secure = {"ssl": self._tls, "server_hostname": self._address.host}
        async with asyncio.timeout(within_s):
            _, connection = await loop.create_connection(self, ip, self._address.port, **secure)
        assert isinstance(connection, BridgeProtocol)
        reason = "timeout"
        try:
            async with asyncio.timeout(HANDSHAKE_TIMEOUT_S):
                await connection.settled.wait()
            reason = str(connection.wasNotCleanReason)
        except TimeoutError:
            pass
        finally:
            if not self.owner.is_current(connection):
                connection.dropConnection(abort=True)
        if not connection.was_accepted:
            raise NoWebSocket(reason, bytes(connection.data[:2000]))
        return connection


async def _look_up(host: str, port: int) -> Any:
    return await asyncio.get_running_loop().getaddrinfo(host, port, type=sockets.SOCK_STREAM)


def _rank(error: Exception) -> int:
    """The most informative of several errors: that of the dial that got farthest."""
    kinds = (NoWebSocket, ssl.SSLError, ConnectionRefusedError, ConnectionError, TimeoutError, OSError, BadAddress)
    return next((rank for rank, kind in enumerate(kinds) if isinstance(error, kind)), len(kinds))


class RosClient(roslibpy.Ros):  # type: ignore[misc]
    """roslibpy's client around our dialer."""

    def __init__(self, address: Address, owner: DialOwner) -> None:
        self._id_counter = 0
        self.factory = Dialer(address, owner)
        self.is_connecting = False
