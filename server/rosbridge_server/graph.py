"""The topics of one bridge: who publishes them, who listens, and of which type they are."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any, Protocol

from server.judge.ros_names import canonical_name
from server.rosbridge_server.encoding import Outgoing

SOURCE = "source"  # the recording or the car behind the bridge, as a publisher


class Subscriber(Protocol):
    """Takes the messages of one topic."""

    def offer(self, message: Outgoing, /) -> None: ...


class Owner(Protocol):
    """The owner of a subscriber."""

    def type_became(self, topic: Topic, subscription: Any, /) -> None: ...


@dataclass(slots=True, kw_only=True)
class Topic:
    """One topic with at least one publisher or subscriber."""

    name: str
    type: str | None  # canonical; None: only subscribed to, by clients that named no type
    latches: bool = False
    latched: Outgoing | None = None  # the newest message, for those who come later
    published: int = 0  # messages of clients: the seq of their headers in ROS 1
    publishers: set[object] = field(default_factory=set)  # SOURCE and clients
    subscribers: dict[Subscriber, Owner] = field(default_factory=dict)

    def distribute(self, message: Outgoing) -> None:
        """Hands a message to every subscriber; none can hold up another."""
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
