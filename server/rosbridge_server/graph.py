"""The topics and services of one bridge: their types, publishers, subscribers and providers."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from dataclasses import dataclass, field
from typing import Any, Protocol

from server.judge.message import Json
from server.judge.ros_names import canonical_name
from server.rosbridge_server.encoding import Outgoing

SOURCE = "source"  # the recording or the car behind the bridge, as a publisher

Handler = Callable[[Json], "Json | Awaitable[Json]"]


class Subscriber(Protocol):
    """Takes the messages of one topic."""

    def offer(self, message: Outgoing, /) -> None: ...

    def prepare(self, message: Outgoing, /) -> None: ...


class Owner(Protocol):
    """The owner of a subscriber."""

    def type_became(self, topic: Topic, subscription: Any, /) -> None: ...


@dataclass(slots=True, kw_only=True)
class Topic:
    """One topic with at least one publisher or subscriber."""

    name: str
    type: str | None  # canonical; None: only subscribed to, by clients that named no type
    latches: bool = False
    latched: Outgoing | None = None  # the newest message, for later subscribers
    published: int = 0  # messages of clients: the seq of their headers in ROS 1
    publishers: set[object] = field(default_factory=set)  # SOURCE and clients
    subscribers: dict[Subscriber, Owner] = field(default_factory=dict)

    def distribute(self, message: Outgoing) -> None:
        """Send a message to every subscriber; none can block another."""
        if self.latches:
            self.latched = message
        for subscription in self.subscribers:
            subscription.offer(message)


class Graph:
    """Finds topics by any spelling of their name."""

    def __init__(self) -> None:
        self._topics: dict[str, Topic] = {}
        self._spellings: dict[str, Topic] = {}

    def find(self, name: str) -> Topic | None:
        """The topic of this name in any spelling. Raises BadName."""
        found = self._spellings.get(name)
        return found if found is not None else self._topics.get(canonical_name(name))

    def find_or_make(self, name: str, type: str | None) -> Topic:
        """The topic, which has the type given here if it had none before. Raises BadName."""
        topic = self.find(name)
        if topic is None:
            full = canonical_name(name)
            topic = self._topics[full] = Topic(name=full, type=type)
            self._spellings[full] = topic
        if topic.type is None:
            topic.type = type
        return topic

    def tidy(self, topic: Topic) -> None:
        """Drop a topic without publishers and subscribers."""
        if not topic.publishers:
            topic.latches, topic.latched = False, None
            if not topic.subscribers:
                self._topics.pop(topic.name, None)
                self._spellings.pop(topic.name, None)

    def topics(self) -> list[Topic]:
        return sorted(self._topics.values(), key=lambda topic: topic.name)


class ServiceFailed(Exception):
    """The call cannot be answered; the text is sent to the caller with `result: false`."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Service:
    name: str
    type: str
    handler: Handler
    arguments: tuple[str, ...] = ()  # names of the arguments in order, for callers that send a list
    request: str | None = None  # .msg text of the request, by which the arguments are checked
    response: str | None = None  # .msg text of the response, for queries of rosapi
    node: str = ""  # the provider


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
