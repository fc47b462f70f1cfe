"""Services that a client of a bridge offers to the others."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Callable, Collection
from typing import Any

from server.judge.message import Json
from server.rosbridge_server.services import Service, ServiceFailed, Services


class Providers:
    """The services of one client. `send` takes an object for that client."""

    def __init__(self, services: Services, send: Callable[[Any], None]) -> None:
        self._services = services
        self._send = send
        self.names: set[str] = set()  # the services that the client offers
        self._numbers = itertools.count(1)  # never again from 1: a late answer must not fit another call
        self._waiting: dict[str, tuple[str, asyncio.Future[Json]]] = {}  # service and answer, by the id of the request

    def advertise(self, operation: dict[str, Any], id: object) -> None:
        name, type = operation["service"], operation["type"]
        self.names.add(name)
        self._services.add(Service(name=name, type=type, handler=lambda args: self._ask(name, args)))

    def unadvertise(self, operation: dict[str, Any], id: object) -> None:
        name = operation["service"]
        if name in self.names:
            self._end([name], f"the service {name} was withdrawn")

    def respond(self, operation: dict[str, Any], id: object) -> bool:
        """Pass the client's answer on; False where no call waits for it."""
        _, future = self._waiting.pop(operation["id"], (None, None))
        if future is None or future.done():
            return False
        if operation.get("result") is False:
            future.set_exception(ServiceFailed(str(operation["values"])))
        else:
            future.set_result(operation["values"])
        return True

    def close(self) -> None:
        """The client is gone: its services end, and whoever waits for one of them is told."""
        self._end(list(self.names), "the client that offers the service has gone")

    def _end(self, names: Collection[str], why: str) -> None:
        for name in names:
            self.names.discard(name)
            self._services.remove(name)
        for service, future in self._waiting.values():
            if service in names and not future.done():
                future.set_exception(ServiceFailed(why))

    async def _ask(self, name: str, args: Json) -> Json:
        request = f"service_request:{name}:{next(self._numbers)}"
        future: asyncio.Future[Json] = asyncio.get_running_loop().create_future()
        self._waiting[request] = (name, future)
        try:
            self._send({"op": "call_service", "id": request, "service": name, "args": args})
            return await future
        finally:  # the caller may have gone
            self._waiting.pop(request, None)
