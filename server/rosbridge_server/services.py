"""Services by name, as a client calls them."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from server.judge.message import Json
from server.judge.ros_names import canonical_name

Handler = Callable[[Json], "Json | Awaitable[Json]"]


class ServiceFailed(Exception):
    """The call cannot be answered; the text is sent to the caller with `result: false`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Service:
    name: str
    type: str
    handler: Handler
    arguments: tuple[str, ...] = ()  # names of the arguments in order, for callers that send a list
    request: str | None = None  # .msg text of the request: a bridge like the real one checks the arguments by it
    response: str | None = None  # .msg text of the response, for those who ask rosapi
    node: str = ""  # who offers it


class Services:
    """All services of one bridge."""

    def __init__(self) -> None:
        self._services: dict[str, Service] = {}

    def add(self, service: Service) -> None:
        self._services[canonical_name(service.name)] = service

    def remove(self, name: str) -> None:
        self._services.pop(canonical_name(name), None)

    def all(self) -> list[Service]:
        return [self._services[name] for name in self.names()]

    def find(self, name: str) -> Service | None:
        return self._services.get(canonical_name(name))

    def names(self) -> list[str]:
        return sorted(self._services)

    def call(self, name: str, args: Any) -> Json | Awaitable[Json]:
        """Calls the service. Raises ServiceFailed, BadName or whatever the handler raises."""
        service = self.find(name)
        if service is None:
            raise ServiceFailed(f"Service {canonical_name(name)} does not exist")
        if args is None:
            args = {}
        elif isinstance(args, list):
            args = dict(zip(service.arguments, args, strict=False))
        elif not isinstance(args, dict):
            raise ServiceFailed("args must be an object or a list")
        return service.handler(args)
