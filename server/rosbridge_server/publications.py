"""What one client advertises and publishes."""

from __future__ import annotations

from typing import Any, Protocol

from server.rosbridge_server import fields
from server.rosbridge_server.encoding import Outgoing
from server.rosbridge_server.fields import Refused
from server.rosbridge_server.interface import ClientHost

MOST_ADVERTISED = 1_000  # topics
MOST_IDS = 100  # under which one topic is advertised


class Say(Protocol):
    """Sends a status message."""

    def __call__(self, level: str, text: str, id: object = None, /) -> None: ...


class Publications:
    """The operations raise Refused, and what makes a message unfit to be sent."""

    def __init__(self, bridge: ClientHost, say: Say) -> None:
        self._bridge = bridge
        self._say = say
        self._advertised: dict[str, set[object]] = {}  # topic → ids under which it was advertised
        self._told_of_times: set[str] = set()  # topics whose messages had times that ROS 1 leaves out

    def advertise(self, operation: dict[str, Any], id: object) -> None:
        name = fields.text(operation, "topic")
        type = self._bridge.message_type(fields.text(operation, "type"))
        topic = self._bridge.graph.find(name)
        if topic is not None and topic.type not in (None, type):
            raise Refused(f"{topic.name} has the type {topic.type}, not {type}")
        if len(self._advertised) >= MOST_ADVERTISED:
            raise Refused(f"a client may advertise {MOST_ADVERTISED} topics")
        topic = self._bridge.graph.find_or_make(name, type)
        self._bridge.note_type(topic.name, type)
        topic.publishers.add(self)
        topic.latches |= operation.get("latch") is True
        ids = self._advertised.setdefault(topic.name, set())
        if len(ids) < MOST_IDS:
            ids.add(id)
        self._say("info", f"advertised {topic.name}", id)

    def unadvertise(self, operation: dict[str, Any], id: object) -> None:
        topic = self._bridge.graph.find(fields.text(operation, "topic"))
        ids = None if topic is None else self._advertised.get(topic.name)
        if topic is None or ids is None:
            self._say("warning", "unadvertise: this topic was not advertised by this client", id)
            return
        ids.discard(id)
        if id is None or not ids:
            del self._advertised[topic.name]
            self._told_of_times.discard(topic.name)
            topic.publishers.discard(self)
            self._bridge.graph.tidy(topic)

    def publish(self, operation: dict[str, Any], id: object) -> None:
        topic = self._bridge.graph.find(fields.text(operation, "topic"))
        if topic is None or topic.type is None:
            raise Refused("this topic has no type yet: advertise it first")
        message = operation.get("msg", {})
        if not isinstance(message, dict):
            raise Refused("msg must be an object")
        if topic.name not in self._advertised:
            if len(self._advertised) >= MOST_ADVERTISED:
                raise Refused(f"a client may publish to {MOST_ADVERTISED} topics")
            self._advertised[topic.name] = {None}  # publishing makes a publisher, as in rosbridge
            topic.publishers.add(self)
        notes: list[str] = []
        message = self._bridge.types.complete(topic.type, message, self._bridge.now(), notes)
        if notes and topic.name not in self._told_of_times:
            self._told_of_times.add(topic.name)
            self._say("error", f"publish: {topic.name}: {'; '.join(notes[:3])}; this is not repeated", id)
        topic.published += 1
        header = message.get("header")
        if self._bridge.ros_version == 1 and isinstance(header, dict) and "seq" in header:
            header["seq"] = topic.published
        topic.distribute(Outgoing(self._bridge, topic.type, message))
        for callback in self._bridge.on_publish:
            callback(topic.name, topic.type, message)

    def close(self) -> None:
        """The client is gone."""
        for name in self._advertised:
            topic = self._bridge.graph.find(name)
            if topic is not None:
                topic.publishers.discard(self)
                self._bridge.graph.tidy(topic)
