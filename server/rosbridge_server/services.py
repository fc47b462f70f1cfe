"""Services by name, as a client calls them."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass

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
    request: str | None = None  # .msg text of the request, by which the arguments are checked
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

    def find_exactly(self, name: str) -> Service | None:
        """The service whose full name is this, spelled in full."""
        return self._services.get(name)

    def names(self) -> list[str]:
        return sorted(self._services)
