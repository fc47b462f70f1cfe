"""A proxy to a bridge that forwards what the bridge sends and, on demand, nothing that is sent to it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator

CHUNK = 65_536


class OneWay:
    """What a bridge does whose reading thread hangs while its publishing ones go on. Unlike the radio of the page's
    tests it lets what it held up die with the connection: a socket that was aborted brings nothing late."""

    def __init__(self, port: int) -> None:
        self._to = port
        self._open = asyncio.Event()
        self._open.set()

    def deafen(self) -> None:
        self._open.clear()

    def listen(self) -> None:
        self._open.set()

    async def carry(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        """One connection, both ways, until either side ends it; what was not passed on then is gone."""
        theirs, ours = await asyncio.open_connection("127.0.0.1", self._to)
        ways = (self._pass(reader, ours, can_be_deaf=True), self._pass(theirs, writer, can_be_deaf=False))
        both = {asyncio.create_task(way) for way in ways}
        try:
            await asyncio.wait(both, return_when=asyncio.FIRST_COMPLETED)
        finally:
            for task in both:
                task.cancel()
            for end in (writer, ours):
                end.transport.abort()

    async def _pass(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter, *, can_be_deaf: bool) -> None:
        with contextlib.suppress(ConnectionError):
            while chunk := await reader.read(CHUNK):
                if can_be_deaf:
                    await self._open.wait()
                writer.write(chunk)
                await writer.drain()


@contextlib.asynccontextmanager
async def one_way(port: int) -> AsyncIterator[tuple[OneWay, str]]:
    """The way, and the address to dial."""
    way = OneWay(port)
    server = await asyncio.start_server(way.carry, "127.0.0.1")
    try:
        yield way, f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}"
    finally:
        server.close()
