"""The ROS publishers that a real bridge keeps for its clients: shared, and kept ten seconds."""

from __future__ import annotations

import asyncio
from typing import Any

from server.judge.ros_names import canonical_name
from server.rosbridge_server.graph import Topic
from server.rosbridge_server.interface import TopicHost
from server.rosbridge_server.real.convert import Converter
from server.rosbridge_server.real.loader import load
from server.rosbridge_server.real.subscribers import Conflict

KEPT_S = 10.0  # after the last client of a publisher has gone
BRIDGE = "bridge"  # as a publisher in the graph


class RosPublisher:
    """One for each spelling of a topic; `clients` are all that ever used it and have not gone."""

    def __init__(self, topic: Topic, type: str, *, latches: bool) -> None:
        self.topic = topic
        self.type = type
        self.latches = latches
        self.clients: set[object] = set()
        self.count = 0


class Publishers:
    """All ROS publishers of one bridge."""

    def __init__(self, bridge: TopicHost) -> None:
        self._bridge = bridge
        self._found: dict[str, RosPublisher] = {}
        self._timers: dict[str, asyncio.TimerHandle] = {}

    def register(self, client: object, spelling: str, type: str | None, *, latches: bool) -> None:
        """Raises Conflict, BadName and what the loader raises."""
        found = self._found.get(spelling)
        if found is None:
            found = self._found[spelling] = self._make(spelling, type, latches=latches)
        if type is not None and load(self._bridge, type) != found.type:
            raise Conflict(
                f"Tried to register topic {spelling} with type {type} "
                f"but it is already established with type {found.type}"
            )
        found.clients.add(client)

    def unregister(self, client: object, spelling: str) -> None:
        found = self._found.get(spelling)
        if found is None:
            return
        found.clients.discard(client)
        timer = self._timers.pop(spelling, None)
        if timer is not None:
            timer.cancel()
        self._timers[spelling] = asyncio.get_running_loop().call_later(KEPT_S, self._end, spelling)

    def publish(self, client: object, spelling: str, given: Any, *, latches: bool) -> None:
        """Raises Conflict and Unfit: what the real bridge only writes to its log."""
        self.register(client, spelling, None, latches=latches)
        found = self._found[spelling]
        definitions = self._bridge.types.definitions(found.type)
        if definitions is None:
            message = given
        else:
            long = self._bridge.types.long_name(found.type)
            converter = Converter(long, definitions, self._bridge.ros_version, self._bridge.now)
            found.count += 1
            message = converter.message(given)
            header = message.get("header")
            if self._bridge.ros_version == 1 and isinstance(header, dict) and "seq" in header:
                header["seq"] = found.count
        self._bridge.deliver(found.topic, found.type, message, latches=found.latches)

    def close(self) -> None:
        for timer in self._timers.values():
            timer.cancel()
        self._timers.clear()

    def _make(self, spelling: str, type: str | None, *, latches: bool) -> RosPublisher:
        if self._bridge.down is not None:
            raise Conflict(self._bridge.down)
        full = canonical_name(spelling)
        known = self._bridge.known_type(full)
        if type is None and known is None:
            raise Conflict(f"Cannot infer topic type for topic {spelling} as it is not yet advertised")
        wanted = known if type is None else load(self._bridge, type)
        if known is not None and known != wanted:
            raise Conflict(
                f"Tried to register topic {spelling} with type {wanted} but it is already established with type {known}"
            )
        assert wanted is not None
        topic = self._bridge.graph.find_or_make(full, wanted)
        topic.publishers.add(BRIDGE)
        self._bridge.note_type(full, wanted)
        return RosPublisher(topic, wanted, latches=latches)

    def _end(self, spelling: str) -> None:
        self._timers.pop(spelling, None)
        found = self._found[spelling]
        if found.clients:
            return
        del self._found[spelling]
        if not any(other.topic is found.topic for other in self._found.values()):
            found.topic.publishers.discard(BRIDGE)
            self._bridge.graph.tidy(found.topic)
