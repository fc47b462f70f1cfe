"""A bridge client for the tests of the simulated car."""

from __future__ import annotations

import asyncio
import itertools
import time
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import orjson
import pytest
from websockets.asyncio.client import ClientConnection, connect

from server.simulator.service import CarService

PATIENCE_S = 20.0  # the longest any answer may take on a busy machine


class BridgeClient:
    """Speaks rosbridge over one plain WebSocket."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket
        self._ids = itertools.count()

    async def send(self, **operation: Any) -> None:
        await self._socket.send(orjson.dumps(operation).decode())

    async def receive(self) -> dict[str, Any]:
        raw = await asyncio.wait_for(self._socket.recv(), PATIENCE_S)
        answer: dict[str, Any] = orjson.loads(raw)
        return answer

    async def listen(self) -> None:
        """Takes whatever comes until the connection ends."""
        while True:
            await self._socket.recv()

    async def subscribe(self, *topics: str) -> None:
        for topic in topics:
            await self.send(op="subscribe", topic=topic)

    async def next(self, topic: str, wanted: Callable[[Any], bool] = lambda message: True) -> Any:
        """The next message of a topic that is as wanted."""
        async with asyncio.timeout(PATIENCE_S):
            while True:
                answer = await self.receive()
                if answer["op"] == "publish" and answer["topic"] == topic and wanted(answer["msg"]):
                    return answer["msg"]

    async def call(self, service: str, **args: Any) -> dict[str, Any]:
        """The whole answer to a service call."""
        id = str(next(self._ids))
        await self.send(op="call_service", id=id, service=service, args=args)
        async with asyncio.timeout(PATIENCE_S):
            while True:
                answer = await self.receive()
                if answer["op"] == "service_response" and answer["id"] == id:
                    return answer


@asynccontextmanager
async def bridge_client(port: int) -> AsyncIterator[BridgeClient]:
    # no bound on what waits unread: a client that does not read cannot say goodbye either
    async with connect(f"ws://127.0.0.1:{port}", max_size=None, max_queue=None) as socket:
        yield BridgeClient(socket)


async def until(is_so: Callable[[], bool]) -> None:
    """Waits for something that nobody announces."""
    async with asyncio.timeout(PATIENCE_S):
        while not is_so():
            await asyncio.sleep(0.01)


@asynccontextmanager
async def running_car(**options: Any) -> AsyncIterator[tuple[CarService, int]]:
    service = CarService(**{"clock": time.time} | options)
    port = await service.start()
    try:
        yield service, port
    finally:
        await service.stop()


@pytest.fixture
async def car() -> AsyncIterator[tuple[CarService, int]]:
    """A simulated car at real speed and its port."""
    async with running_car() as found:
        yield found
