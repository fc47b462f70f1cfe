"""A TCP proxy on 127.0.0.1 that lets only so many bytes a second through towards the client."""

from __future__ import annotations

import asyncio
import contextlib
import socket
from collections.abc import AsyncIterator

PIECE_BYTES = 2_048
BUFFER_BYTES = 16_384  # of its sockets: what waits, waits with the sender as far as can be


class SlowProxy:
    """`rate_Bps` None: everything passes. It may be changed at any time."""

    def __init__(self, target_port: int, rate_Bps: float | None) -> None:
        self.rate_Bps = rate_Bps
        self.port = 0
        self._target_port = target_port
        self._pumps: set[asyncio.Task[None]] = set()

    async def serve(self) -> asyncio.Server:
        listener = socket.socket()
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        listener.setsockopt(socket.SOL_SOCKET, socket.SO_SNDBUF, BUFFER_BYTES)
        listener.bind(("127.0.0.1", 0))
        self.port = listener.getsockname()[1]
        return await asyncio.start_server(self._connected, sock=listener, limit=PIECE_BYTES)

    async def _connected(self, client: asyncio.StreamReader, to_client: asyncio.StreamWriter) -> None:
        onward = socket.socket()
        onward.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, BUFFER_BYTES)
        onward.setblocking(False)
        await asyncio.get_running_loop().sock_connect(onward, ("127.0.0.1", self._target_port))
        source, to_source = await asyncio.open_connection(sock=onward, limit=PIECE_BYTES)
        to_client.transport.set_write_buffer_limits(high=PIECE_BYTES)
        for pump in (self._pump(client, to_source, False), self._pump(source, to_client, True)):
            task = asyncio.ensure_future(pump)
            self._pumps.add(task)
            task.add_done_callback(self._pumps.discard)

    async def _pump(self, source: asyncio.StreamReader, target: asyncio.StreamWriter, is_slow: bool) -> None:
        loop = asyncio.get_running_loop()
        due_s = loop.time()
        with contextlib.suppress(OSError):
            while piece := await source.read(PIECE_BYTES):
                if is_slow and self.rate_Bps is not None:
                    due_s = max(due_s, loop.time()) + len(piece) / self.rate_Bps
                    await asyncio.sleep(due_s - loop.time())
                target.write(piece)
                await target.drain()
        target.close()

    async def stop(self) -> None:
        for pump in list(self._pumps):
            pump.cancel()
        await asyncio.gather(*self._pumps, return_exceptions=True)


@contextlib.asynccontextmanager
async def slow_proxy(target_port: int, rate_Bps: float | None) -> AsyncIterator[SlowProxy]:
    proxy = SlowProxy(target_port, rate_Bps)
    server = await proxy.serve()
    try:
        yield proxy
    finally:
        server.close()
        await proxy.stop()
