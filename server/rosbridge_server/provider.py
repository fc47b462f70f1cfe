"""Services that a client of a bridge offers to the others."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection
from typing import Any

from server.judge.message import Json
from server.rosbridge_server.services import Service, ServiceFailed, Services


class Providers:
    """The services of one client. `send` takes an object for that client."""

    def __init__(self, services: Services, send: Callable[[Any], None]) -> None:
        self._services = services
        self._send = send
        self._counts: dict[str, int] = {}  # requests, by the name of the service
        self._waiting: dict[str, asyncio.Future[Json]] = {}

    @property
    def names(self) -> Collection[str]:
        """The services that the client offers."""
        return self._counts.keys()

    def advertise(self, operation: dict[str, Any], id: object) -> None:
        name, type = operation["service"], operation["type"]
        self._counts.setdefault(name, 0)
        self._services.add(Service(name=name, type=type, handler=lambda args: self._ask(name, args)))

    def unadvertise(self, operation: dict[str, Any], id: object) -> None:
        name = operation["service"]
        if self._counts.pop(name, None) is not None:
            self._services.remove(name)

    def respond(self, operation: dict[str, Any], id: object) -> bool:
        """Pass the client's answer on; False where no call waits for it."""
        future = self._waiting.pop(operation["id"], None)
        if future is None or future.done():
            return False
        if operation.get("result") is False:
            future.set_exception(ServiceFailed(str(operation["values"])))
        else:
            future.set_result(operation["values"])
        return True

    def close(self) -> None:
        """The client is gone: its services end, and whoever waits for one of them is told."""
        for name in self._counts:
            self._services.remove(name)
        self._counts.clear()
        for future in self._waiting.values():
            if not future.done():
                future.set_exception(ServiceFailed("the client that offers the service has gone"))
        self._waiting.clear()

    async def _ask(self, name: str, args: Json) -> Json:
        self._counts[name] = self._counts.get(name, 0) + 1
        request = f"service_request:{name}:{self._counts[name]}"
        future: asyncio.Future[Json] = asyncio.get_running_loop().create_future()
        self._waiting[request] = future
        self._send({"op": "call_service", "id": request, "service": name, "args": args})
        try:
            return await future
        finally:  # the caller may have gone
            self._waiting.pop(request, None)
