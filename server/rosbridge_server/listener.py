"""The listening socket and all sockets that came from it: opened, frozen, killed and revived together."""

from __future__ import annotations

import asyncio
import errno
import logging
import os
from collections.abc import Awaitable, Callable
from http import HTTPStatus
from typing import Any, cast

from websockets.asyncio.server import Server, ServerConnection, serve
from websockets.http11 import Request, Response
from websockets.server import ServerProtocol

from server.rosbridge_server.connection import Connection, WriteTogether

WRITE_LIMIT = 65_536  # bytes in a socket's own buffer before its client counts as slow
EXTRA_SOCKETS = 32  # sockets beyond the clients: handshakes on their way, and refusals

# Failed handshakes of unknown clients are not worth a line on the terminal.
_quiet = logging.getLogger("catgraph.bridge.wire")
_quiet.addHandler(logging.NullHandler())
_quiet.propagate = False


class CannotListen(Exception):
    """The address or port is not available; the text is one sentence for a person."""


class Listener:
    """Accepts WebSocket clients on one address and passes each to `serve_client`."""

    def __init__(
        self,
        serve_client: Callable[[Connection], Awaitable[None]],
        *,
        max_clients: int,
        max_message_bytes: int,
    ) -> None:
        self._serve_client = serve_client
        self._max_clients = max_clients
        self._max_message_bytes = max_message_bytes
        self._server: Server | None = None
        self._sockets: set[Connection] = set()
        self._clients = 0
        self.is_frozen = False
        self.together = WriteTogether()

    @property
    def clients(self) -> int:
        """Clients that have completed the WebSocket handshake."""
        return self._clients

    async def open(self, host: str, port: int) -> int:
        """Start to listen and return the port, a free one where `port` is 0. Raises CannotListen."""
        if self._server is not None:
            raise RuntimeError("already listening")
        if not 0 <= port <= 65535:
            raise CannotListen(f"{port} is not a port: it must be between 1 and 65535")
        try:
            self._server = await serve(
                cast("Callable[[ServerConnection], Awaitable[None]]", self._serve),
                host,
                port,
                compression=None,  # as rosbridge; frames are shared between clients
                open_timeout=None,  # the connection has its own clock, which stops while frozen
                ping_interval=None,
                close_timeout=1.0,
                max_size=self._max_message_bytes,
                write_limit=WRITE_LIMIT,
                process_request=self._reject,
                server_header=None,
                logger=_quiet,
                create_connection=cast("type[ServerConnection]", self._make_connection),
            )
        except (OSError, UnicodeError) as error:
            raise CannotListen(_why(host, port, error)) from None
        sockets = list(self._server.sockets)
        return int(sockets[0].getsockname()[1])

    async def close(self, *, abruptly: bool) -> None:
        """End every connection: with a closing handshake, or as a killed process would."""
        server, self._server = self._server, None
        if server is None:
            return
        self.thaw()
        if abruptly:
            server.close(close_connections=False)
            for connection in list(self._sockets):
                connection.transport.abort()
        else:
            server.close()
        try:
            await asyncio.wait_for(server.wait_closed(), 3.0)
        except TimeoutError:  # a client that does not read
            for connection in list(self._sockets):
                connection.transport.abort()
            await server.wait_closed()

    def freeze(self) -> None:
        self.is_frozen = True
        for connection in list(self._sockets):
            connection.freeze()

    def thaw(self) -> None:
        if not self.is_frozen:
            return
        self.is_frozen = False
        for connection in list(self._sockets):
            connection.thaw()

    def admit(self, connection: Connection) -> bool:
        if len(self._sockets) >= self._max_clients + EXTRA_SOCKETS:
            return False
        self._sockets.add(connection)
        return True

    def forget(self, connection: Connection) -> None:
        self._sockets.discard(connection)

    def _make_connection(self, protocol: ServerProtocol, server: Server, **options: Any) -> Connection:
        return Connection(self, protocol, server, **options)

    def _reject(self, connection: ServerConnection, request: Request) -> Response | None:
        if self._clients >= self._max_clients:
            return connection.respond(HTTPStatus.SERVICE_UNAVAILABLE, "This bridge has reached its limit of clients.\n")
        return None

    async def _serve(self, connection: Connection) -> None:
        self._clients += 1
        try:
            await self._serve_client(connection)
        finally:
            self._clients -= 1


def _why(host: str, port: int, error: OSError | UnicodeError) -> str:
    where = f"port {port} on {host}"
    match getattr(error, "errno", None):
        case errno.EADDRINUSE:
            return f"{where} is already in use by another program"
        case errno.EACCES | errno.EPERM:
            return f"{where} needs rights that this user does not have: use a port above 1023"
        case errno.EADDRNOTAVAIL:
            return f"{host} is not an address of this machine"
        case int(number) if number > 0 and isinstance(error, OSError) and error.args and number == error.args[0]:
            return f"cannot listen on {where}: {os.strerror(number)}"
        case _:
            return f"{host} is not an address of this machine"
