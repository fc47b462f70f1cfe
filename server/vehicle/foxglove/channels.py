"""What a Foxglove server offers, and its answers to the questions that a session puts to rosapi. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from server.rosbridge.live_source import CallFailed
from server.vehicle.foxglove.protocol import Channel, GraphUpdate

UNKNOWN_NODE = "unknown node"  # who publishes what is offered, where the server lists no nodes
MAX_OFFERED = 5000


class Offered:
    """Of one connection. A topic has one type, that of its newest channel; channels of other types are left."""

    def __init__(self) -> None:
        self.channels: dict[int, Channel] = {}
        self.has_graph = False  # whether the server lists the nodes
        self.is_full = False  # a channel was left out
        self._ours: set[str] = set()  # topics that nobody offered before we advertised them
        self._publishers: dict[str, tuple[str, ...]] = {}
        self._subscribers: dict[str, tuple[str, ...]] = {}

    def advertised(self, channels: Iterable[Channel]) -> list[Channel]:
        """Takes channels; returns those that are new, or another than before under the same number."""
        new = []
        for channel in channels:
            if self.channels.get(channel.id) == channel:
                continue
            self.channels.pop(channel.id, None)  # the newest stands last
            if len(self.channels) >= MAX_OFFERED:
                self.is_full = True
                continue
            self.channels[channel.id] = channel
            new.append(channel)
        return new

    def unadvertised(self, ids: Iterable[int]) -> list[Channel]:
        """The channels that are gone now."""
        return [self.channels.pop(id) for id in ids if id in self.channels]

    def announced(self, topic: str) -> None:
        """We advertise a topic: a bridge may offer it to us from then on, as that of a publisher."""
        if self.type_of(topic) is None:
            self._ours.add(topic)

    def withdrawn(self, topic: str) -> None:
        """We do not advertise it any more."""
        self._ours.discard(topic)

    def graph(self, update: GraphUpdate) -> None:
        """Which nodes publish and subscribe to what; the rest stays as it was."""
        for topic in update.removed:
            self._publishers.pop(topic, None)
            self._subscribers.pop(topic, None)
        for known, changed in ((self._publishers, update.publishers), (self._subscribers, update.subscribers)):
            known.update(changed)
            while len(known) > MAX_OFFERED:
                del known[next(iter(known))]

    def encodings(self) -> frozenset[str]:
        """Those of the messages that are offered."""
        return frozenset(one.encoding for one in self.channels.values())

    def type_of(self, topic: str) -> str | None:
        """None: it is not offered."""
        return next((one.type for one in reversed(self.channels.values()) if one.topic == topic), None)

    def of(self, topic: str) -> list[Channel]:
        """The channels of a topic that have its type."""
        type = self.type_of(topic)
        return [one for one in self.channels.values() if one.topic == topic and one.type == type]

    def answer(self, service: str, arguments: Mapping[str, Any]) -> dict[str, Any]:
        """As rosapi answers. Raises CallFailed where it is not known."""
        topic = str(arguments.get("topic", ""))
        match service:
            case "/rosapi/topics":
                types = {one.topic: one.type for one in self.channels.values()}
                return {"topics": [*types], "types": [*types.values()]}
            case "/rosapi/topics_and_raw_types":
                found = {one.topic: one for one in self.channels.values()}
                return {
                    "topics": [*found],
                    "types": [one.type for one in found.values()],
                    "typedefs_full_text": [_definition(one) for one in found.values()],
                }
            case "/rosapi/topic_type" if (type := self.type_of(topic)) is not None:
                return {"type": type}
            case "/rosapi/get_time":
                return {}  # the server is there; it has no clock that can be read
            case "/rosapi/publishers" if self.has_graph or topic not in self._ours:
                return {"publishers": self._nodes_that_publish(topic)}
            case "/rosapi/subscribers" if self.has_graph:
                return {"subscribers": [*self._subscribers.get(topic, ())]}
        raise CallFailed(f"a Foxglove server does not answer {service}")

    def _nodes_that_publish(self, topic: str) -> list[str]:
        found = self._publishers.get(topic, ())
        return [*found] or ([UNKNOWN_NODE] if self.type_of(topic) is not None else [])


def _definition(channel: Channel) -> str:
    """The .msg text of a type; where there is none, what rosapi of ROS 2 has in its place."""
    is_text = channel.encoding in ("cdr", "ros1") and channel.schema_encoding in ("ros1msg", "ros2msg", "")
    # An empty text is that of an unknown type too; a standard type without fields is known without it.
    return channel.schema if is_text and channel.schema else "# failed to get full definition text"
