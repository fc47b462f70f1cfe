"""What one client of a real bridge subscribes to, advertises and publishes."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Protocol

from server.judge.message import RosVersion
from server.rosbridge_server.real.operation_fields import ADVERTISE, SUBSCRIBE, TOPIC, check
from server.rosbridge_server.real.options import RealOptions, is_open
from server.rosbridge_server.real.publishers import Publishers
from server.rosbridge_server.real.subscribers import Subscribers
from server.rosbridge_server.real.subscription import Asked, RealSubscription


class Host(Protocol):
    """The bridge, as the topics of a client need it."""

    ros_version: RosVersion
    real: RealOptions
    subscribers: Subscribers
    publishers: Publishers

    def subscribed(self, topic: str) -> None: ...


class ClientTopics:
    """`send` takes an object to be written as JSON, or the bytes of a binary frame.

    The operations raise what the real bridge writes to its log.
    """

    def __init__(self, bridge: Host, send: Callable[[Any], None]) -> None:
        self._bridge = bridge
        self._send = send
        self._subscriptions: dict[str, RealSubscription] = {}
        self._advertised: dict[str, set[object]] = {}
        self._published: set[str] = set()

    def subscribe(self, operation: dict[str, Any], id: Any) -> None:
        check(operation, SUBSCRIBE)
        spelling = operation["topic"]
        if not self._is_open(spelling):
            return
        subscription = self._subscriptions.get(spelling)
        if subscription is None:
            subscription = RealSubscription(spelling, self._bridge.ros_version, self._send)
            self._subscriptions[spelling] = subscription
        compression = operation.get("compression", "none")
        subscription.asked[id] = Asked(
            throttle_s=operation.get("throttle_rate", 0) / 1000.0,
            queue_length=operation.get("queue_length", 0),
            compression=compression,
        )
        subscription.settle()
        is_raw = compression == "cbor-raw"
        self._bridge.subscribers.subscribe(spelling, subscription, operation.get("type"), is_raw=is_raw)
        self._bridge.subscribed(spelling)

    def unsubscribe(self, operation: dict[str, Any], id: Any) -> None:
        check(operation, (TOPIC,))
        spelling = operation["topic"]
        subscription = self._subscriptions.get(spelling)
        if subscription is None:
            return
        if id is None:
            subscription.asked.clear()
        else:
            subscription.asked.pop(id, None)
        if subscription.asked:
            subscription.settle()
        else:
            self._bridge.subscribers.unsubscribe(spelling, subscription)
            subscription.close()
            del self._subscriptions[spelling]

    def advertise(self, operation: dict[str, Any], id: Any) -> None:
        check(operation, ADVERTISE)
        spelling = operation["topic"]
        if not self._is_open(spelling):
            return
        ids = self._advertised.setdefault(spelling, set())
        latches = operation.get("latch") is True
        self._bridge.publishers.register(self, spelling, operation["type"], latches=latches)
        ids.add(id)

    def unadvertise(self, operation: dict[str, Any], id: Any) -> None:
        check(operation, (TOPIC,))
        spelling = operation["topic"]
        ids = self._advertised.get(spelling)
        if ids is None or not self._is_open(spelling):
            return
        if id is None:
            ids.clear()
        else:
            ids.discard(id)
        if not ids:
            del self._advertised[spelling]
            self._bridge.publishers.unregister(self, spelling)

    def publish(self, operation: dict[str, Any], id: Any) -> None:
        check(operation, (TOPIC,))
        spelling = operation["topic"]
        if not self._is_open(spelling):
            return
        latches = operation.get("latch") is True
        self._bridge.publishers.register(self, spelling, None, latches=latches)
        self._published.add(spelling)
        self._bridge.publishers.publish(self, spelling, operation.get("msg", {}), latches=latches)

    def close(self) -> None:
        """The client is gone. Its publishers stay a while."""
        for spelling in list(self._subscriptions):
            self._end(spelling)
        for spelling in (*self._advertised, *self._published):
            self._bridge.publishers.unregister(self, spelling)

    def _end(self, spelling: str) -> None:
        subscription = self._subscriptions.pop(spelling)
        subscription.close()
        try:
            self._bridge.subscribers.unsubscribe(spelling, subscription)
        except KeyError:
            return

    def _is_open(self, name: str) -> bool:
        return is_open(name, self._bridge.real.topics_glob)
