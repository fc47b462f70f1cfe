"""What the clients of a real bridge share: one ROS subscriber for each spelling of a topic, with one type."""

from __future__ import annotations

from typing import Protocol

from server.judge.ros_names import canonical_name
from server.rosbridge_server.encoding import Outgoing
from server.rosbridge_server.graph import Topic
from server.rosbridge_server.interface import TopicHost
from server.rosbridge_server.real.loader import load
from server.rosbridge_server.real.outgoing import RealOutgoing
from server.rosbridge_server.real.shape import Lost


class Listening(Protocol):
    """One client's subscription to one topic."""

    def on_message(self, message: RealOutgoing) -> None: ...


class Conflict(Exception):
    """The real bridge refuses a type. The text is its own."""


class RosSubscriber:
    """Accepts messages of one type. One that is muted passes nothing on, for as long as it lives."""

    def __init__(self, topic: Topic, type: str | None, *, is_muted: bool = False) -> None:
        self.topic = topic
        self.type = type  # None: any
        self.is_muted = is_muted
        self.clients: list[Listening] = []

    def offer(self, message: Outgoing) -> None:
        if self.is_muted or not isinstance(message, RealOutgoing) or self.type not in (None, message.type):
            return
        for client in list(self.clients):
            try:
                client.on_message(message)
            except Lost:  # the real bridge writes a line to its log
                continue

    def type_became(self, topic: Topic, subscription: object) -> None:
        """The topic has a publisher now, perhaps of another type: this subscriber keeps its own."""


class Subscribers:
    """All ROS subscribers of one bridge."""

    def __init__(self, bridge: TopicHost) -> None:
        self._bridge = bridge
        self._found: dict[str, RosSubscriber] = {}
        self._muted: set[str] = set()

    def mute(self, topic: str) -> None:
        """Clients of this topic get no messages from now on."""
        self._muted.add(topic)
        for found in self._found.values():
            found.is_muted |= found.topic.name == topic

    def unmute(self, topic: str) -> None:
        """Whoever subscribes from now on gets messages; the subscriptions made while it was muted stay without."""
        self._muted.discard(topic)

    def subscribe(self, spelling: str, client: Listening, type: str | None, *, is_raw: bool) -> None:
        """Raises Conflict, BadName and what the loader raises."""
        found = self._found.get(spelling)
        if found is None:
            found = self._found[spelling] = self._make(spelling, type, is_raw=is_raw)
        elif self._bridge.ros_version == 2 and client not in found.clients:
            found.clients.append(client)  # before its type is looked at, as there
        if type is not None and found.type is not None:
            wanted = load(self._bridge, type)
            if found.type != wanted:
                raise Conflict(
                    f"Tried to register topic {spelling} with type {type} "
                    f"but it is already established with type {found.type}"
                )
        if client not in found.clients:
            found.clients.append(client)
        self._show_latched(found, client)

    def unsubscribe(self, spelling: str, client: Listening) -> None:
        """Raises KeyError where ROS 1 does: the client never got in."""
        found = self._found.get(spelling)
        if found is None:
            return
        if client in found.clients:
            found.clients.remove(client)
        elif self._bridge.ros_version == 1:
            raise KeyError(spelling)
        if not found.clients:
            del self._found[spelling]
            found.topic.subscribers.pop(found, None)
            self._bridge.graph.tidy(found.topic)

    def _make(self, spelling: str, type: str | None, *, is_raw: bool) -> RosSubscriber:
        if self._bridge.down is not None:
            raise Conflict(self._bridge.down)
        full = canonical_name(spelling)
        known = self._bridge.known_type(full)
        if type is None and known is None and not (is_raw and self._bridge.ros_version == 1):
            raise Conflict(f"Cannot infer topic type for topic {spelling} as it is not yet advertised")
        wanted = known if type is None else load(self._bridge, type)
        if known is not None and known != wanted:
            raise Conflict(
                f"Tried to register topic {spelling} with type {wanted} but it is already established with type {known}"
            )
        topic = self._bridge.graph.find_or_make(full, wanted)
        found = RosSubscriber(topic, wanted, is_muted=full in self._muted)
        topic.subscribers[found] = found
        self._bridge.note_type(full, wanted)
        return found

    def _show_latched(self, found: RosSubscriber, client: Listening) -> None:
        latched = found.topic.latched
        if isinstance(latched, RealOutgoing) and not found.is_muted and found.type in (None, latched.type):
            try:
                client.on_message(latched)
            except Lost:
                return
