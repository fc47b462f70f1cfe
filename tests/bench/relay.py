"""The least that serving many pages can cost in Python: the newest of every topic, pushed ten times a second.

A bare client on the bridge and a bare server for the pages. It judges nothing, keeps nothing, and what it pushes waits
in line for a slow page: it is here to be compared with, not to be used.
"""

from __future__ import annotations

import asyncio
import time
from typing import Any

import orjson
from websockets.asyncio.server import ServerConnection, broadcast, serve

from server.app.process import uvloop_runner
from server.simulator.messages import SCAN
from tests.bench.lean_socket import LeanSocket, open_socket
from tests.bench.orders import execute_orders, options

STATE_HZ = 10


class Relay:
    """Receives from one bridge and sends to all pages."""

    def __init__(self) -> None:
        self.pages: set[ServerConnection] = set()
        self._newest: dict[str, Any] = {}

    def receive(self, _: LeanSocket, payload: bytes, is_text: bool) -> None:
        if is_text:
            message = orjson.loads(payload)
            self._newest[message["topic"]] = message["msg"]

    async def serve_page(self, page: ServerConnection) -> None:
        self.pages.add(page)
        try:
            async for _ in page:
                pass
        finally:
            self.pages.discard(page)

    async def push(self) -> None:
        """Send to all pages, for ever. The frame begins as catgraph's does, so that the bench's pages accept it."""
        while True:
            await asyncio.sleep(1 / STATE_HZ)
            if self.pages and self._newest:
                head = {"kind": "state", "server": {"time_ms": time.time_ns() // 1_000_000}}
                fresh = {"signals": {"speed": {"freshness": "fresh"}}}
                broadcast(self.pages, orjson.dumps(head | fresh | {"newest": self._newest}).decode())


async def main(bridge: str, topics: list[str]) -> None:
    relay = Relay()
    client = await open_socket(bridge, relay.receive)
    for topic in topics:
        if topic != SCAN.topic:
            client.send(orjson.dumps({"op": "subscribe", "topic": topic}))
    client.send(orjson.dumps({"op": "subscribe", "topic": SCAN.topic, "compression": "cbor"}))
    async with serve(relay.serve_page, "127.0.0.1", 0) as server:
        pushing = asyncio.create_task(relay.push())
        try:
            await execute_orders({}, {"url": f"ws://127.0.0.1:{server.sockets[0].getsockname()[1]}/"})
        finally:
            pushing.cancel()
            client.abort()


if __name__ == "__main__":
    with uvloop_runner() as runner:
        runner.run(main(**options()))
