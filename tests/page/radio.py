"""The radio between phone and server: bytes pass, or hang in the air and come late."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator


class Radio:
    """Forwards every connection to one port. While it is cut, bytes wait; when it is mended they come late."""

    def __init__(self, port: int) -> None:
        self._port = port
        self._passes = asyncio.Event()
        self._passes.set()
        self._tasks: set[asyncio.Task[None]] = set()

    def cut(self) -> None:
        self._passes.clear()

    def mend(self) -> None:
        self._passes.set()

    @contextlib.asynccontextmanager
    async def on_air(self) -> AsyncIterator[str]:
        """Gives the address under which the server is reached."""
        listening = await asyncio.start_server(self._heard, "127.0.0.1", 0)
        try:
            yield f"http://127.0.0.1:{listening.sockets[0].getsockname()[1]}"
        finally:
            listening.close()
            for task in self._tasks:
                task.cancel()
            await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _heard(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        await self._passes.wait()
        try:
            far_reader, far_writer = await asyncio.open_connection("127.0.0.1", self._port)
        except OSError:
            writer.transport.abort()
            return
        for source, sink in ((reader, far_writer), (far_reader, writer)):
            task = asyncio.create_task(self._carry(source, sink))
            self._tasks.add(task)
            task.add_done_callback(self._tasks.discard)

    async def _carry(self, source: asyncio.StreamReader, sink: asyncio.StreamWriter) -> None:
        try:
            with contextlib.suppress(OSError):
                while data := await source.read(65536):
                    await self._passes.wait()
                    sink.write(data)
                    await sink.drain()
        finally:
            sink.transport.abort()
