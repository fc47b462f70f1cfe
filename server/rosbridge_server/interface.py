"""What the parts of a bridge need of the bridge itself, each no more than it uses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Protocol

from server.judge.message import Json
from server.rosbridge_server.graph import Graph, Handler, Services
from server.rosbridge_server.outbox import Counters
from server.rosbridge_server.types import RosContext


class TypeSource(RosContext, Protocol):
    """The types that can be loaded."""

    def advertised_types(self) -> set[str]: ...


class ServiceHost(RosContext, Protocol):
    """The services that can be called."""

    services: Services


class RosapiHost(TypeSource, ServiceHost, Protocol):
    """Everything that rosapi reports on."""

    node: str
    graph: Graph
    parameters: dict[str, object]

    def types_seen(self) -> dict[str, str]: ...

    def add_service(
        self,
        name: str,
        type: str,
        handler: Handler,
        arguments: tuple[str, ...] = (),
        *,
        request: str | None = None,
        response: str | None = None,
        node: str | None = None,
    ) -> None: ...


class ClientHost(ServiceHost, Protocol):
    """What serves a client."""

    graph: Graph
    counters: Counters
    max_message_bytes: int
    fragment_size: int | None
    on_publish: list[Callable[[str, str, Json], None]]

    def message_type(self, name: str) -> str: ...

    def note_type(self, topic: str, type: str | None) -> None: ...

    def subscribed(self, topic: str) -> None: ...
