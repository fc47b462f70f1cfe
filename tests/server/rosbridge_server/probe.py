"""A rosbridge client without a library: what it sends and receives is exactly what is transmitted."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator, Callable
from typing import Any

import cbor2
import websockets

Operation = dict[str, Any]


class Probe:
    """One connection, read by hand."""

    def __init__(self, socket: websockets.ClientConnection) -> None:
        self.socket = socket

    async def send(self, **operation: Any) -> None:
        await self.socket.send(json.dumps(operation))

    async def send_text(self, text: str | bytes) -> None:
        await self.socket.send(text, text=True)

    async def hear(self, within_s: float = 20.0) -> Operation:
        """The next message, whether JSON or CBOR."""
        return decoded(await asyncio.wait_for(self.socket.recv(), within_s))

    async def hear_raw(self, within_s: float = 20.0) -> str | bytes:
        return await asyncio.wait_for(self.socket.recv(), within_s)

    async def hear_op(self, op: str, within_s: float = 20.0) -> Operation:
        """The next message of this kind; others are passed over."""
        while True:
            message = await self.hear(within_s)
            if message["op"] == op:
                return message

    async def hears_nothing(self, for_s: float = 0.15) -> bool:
        with contextlib.suppress(TimeoutError):
            await asyncio.wait_for(self.socket.recv(), for_s)
            return False
        return True

    async def call(self, service: str, args: Any = None) -> Operation:
        await self.send(op="call_service", service=service, args=args or {}, id="call")
        return await self.hear_op("service_response")

    async def subscribe(self, topic: str, **more: Any) -> None:
        """Subscribes, and returns when the bridge has done it."""
        await self.send(op="subscribe", topic=topic, **more)
        await self.settle()

    async def settle(self) -> None:
        """Returns when the bridge has handled all that was sent: it answers in order."""
        await self.send(op="call_service", service="/rosapi/get_time", id="settle")
        while (await self.hear()).get("id") != "settle":
            pass


def decoded(message: str | bytes) -> Operation:
    return json.loads(message, parse_constant=_refuse) if isinstance(message, str) else cbor2.loads(message)


def _refuse(token: str) -> float:
    raise AssertionError(f"{token} is not JSON")


@contextlib.asynccontextmanager
async def probing(port: int, **options: Any) -> AsyncIterator[Probe]:
    async with websockets.connect(f"ws://127.0.0.1:{port}", max_size=None, ping_interval=None, **options) as socket:
        yield Probe(socket)


async def until(condition: Callable[[], bool], within_s: float = 20.0) -> None:
    """Waits for something that another task does."""
    async with asyncio.timeout(within_s):
        while not condition():
            await asyncio.sleep(0.005)
