"""Services that a client of a real bridge offers to the others."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from server.judge.message import Json
from server.rosbridge_server.interface import ServiceHost
from server.rosbridge_server.services import Service


class Providers:
    """The services of one client. `send` takes an object for that client."""

    def __init__(self, bridge: ServiceHost, send: Callable[[Any], None]) -> None:
        self._bridge = bridge
        self._send = send
        self._counts: dict[str, int] = {}
        self._waiting: dict[str, asyncio.Future[Json]] = {}

    def advertise(self, operation: dict[str, Any], id: object) -> None:
        name, type = operation["service"], operation["type"]
        self._counts.setdefault(name, 0)
        self._bridge.services.add(Service(name=name, type=type, handler=lambda args: self._ask(name, args)))

    def unadvertise(self, operation: dict[str, Any], id: object) -> None:
        name = operation["service"]
        if self._counts.pop(name, None) is not None:
            self._bridge.services.remove(name)

    def respond(self, operation: dict[str, Any], id: object) -> None:
        future = self._waiting.pop(operation["id"], None)
        if future is not None and not future.done():
            future.set_result(operation["values"])

    def close(self) -> None:
        """The client is gone. Its services stay and never answer, as do the calls that wait."""

    async def _ask(self, name: str, args: Json) -> Json:
        self._counts[name] = self._counts.get(name, 0) + 1
        request = f"service_request:{name}:{self._counts[name]}"
        future: asyncio.Future[Json] = asyncio.get_running_loop().create_future()
        self._waiting[request] = future
        self._send({"op": "call_service", "id": request, "service": name, "args": args})
        return await future
