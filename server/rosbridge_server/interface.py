"""What the parts of a bridge need of the bridge itself, each no more than it uses."""

from __future__ import annotations

from collections.abc import Callable
from typing import Literal, Protocol

from server.judge.message import Json
from server.rosbridge_server.graph import Graph, Topic
from server.rosbridge_server.outbox import Counters
from server.rosbridge_server.real.options import RealOptions
from server.rosbridge_server.services import Handler, Services
from server.rosbridge_server.types import RosContext

Like = Literal["helpful", "real"]


class TypeSource(RosContext, Protocol):
    """The types that can be loaded."""

    def advertised_types(self) -> set[str]: ...


class TopicHost(TypeSource, Protocol):
    """The topics, with the types they have and had."""

    graph: Graph
    down: str | None

    def known_type(self, topic: str) -> str | None: ...

    def note_type(self, topic: str, type: str | None) -> None: ...

    def deliver(self, topic: Topic, type: str, message: Json, *, latches: bool = False) -> None: ...


class ServiceHost(RosContext, Protocol):
    """The services, with the nodes that offer them."""

    services: Services
    dead_nodes: set[str]
    down: str | None


class RosapiHost(TypeSource, Protocol):
    """Everything that rosapi reports on."""

    node: str
    graph: Graph
    services: Services
    parameters: dict[str, object]
    like: Like
    real: RealOptions

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


class ClientHost(RosContext, Protocol):
    """What serves a helpful client."""

    graph: Graph
    services: Services
    counters: Counters
    max_message_bytes: int
    on_publish: list[Callable[[str, str, Json], None]]

    def message_type(self, name: str) -> str: ...

    def subscribed(self, topic: str) -> None: ...
