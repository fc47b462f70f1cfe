"""The topics of one client: what it advertises and publishes, and which messages it gets of those it subscribes to."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from typing import Any, Protocol

from server.rosbridge.codec import Unencodable
from server.rosbridge_server import fields
from server.rosbridge_server.encoding import Encoding, Outgoing
from server.rosbridge_server.fields import Refused
from server.rosbridge_server.interface import ClientHost
from server.rosbridge_server.outbox import Counters, Lane, Outbox
from server.rosbridge_server.shape import Lost

MOST_ADVERTISED = 1_000  # topics
MOST_IDS = 100  # under which one topic is advertised

STRONGEST: tuple[Encoding, ...] = ("cbor-raw", "cbor", "png", "json")


class Say(Protocol):
    """Sends a status message."""

    def __call__(self, level: str, text: str, id: object = None, /) -> None: ...


class Publications:
    """The topics that one client advertises and publishes.

    The operations raise Refused, and what makes a message unfit to be sent.
    """

    def __init__(self, bridge: ClientHost, say: Say) -> None:
        self._bridge = bridge
        self._say = say
        self._advertised: dict[str, set[object]] = {}  # topic → ids under which it was advertised
        self._reported_times: set[str] = set()  # topics whose messages had times that ROS 1 leaves out

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
            self._reported_times.discard(topic.name)
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
        if notes and topic.name not in self._reported_times:
            self._reported_times.add(topic.name)
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


@dataclass(frozen=True, slots=True, kw_only=True)
class SubscriptionRequest:
    """The request of one subscribe operation."""

    type: str | None  # canonical; None: whatever the topic has
    throttle_s: float
    queue_length: int  # 0: no limit but the client's byte limit
    encoding: Encoding


class Subscription:
    """One client's subscription to one topic: which messages it gets, how often and in which encoding.

    A client can subscribe to a topic several times under several ids, and gets each message once, as from rosbridge:
    with the highest requested rate and the shortest queue, in the first of STRONGEST that any request is for.
    """

    def __init__(
        self,
        spelling: str,
        outbox: Outbox,
        counters: Counters,
        loop: asyncio.AbstractEventLoop,
        on_lost: Callable[[str], None],
    ) -> None:
        """`on_lost` receives why messages cannot be sent in the requested encoding, once for each encoding."""
        self.spelling = spelling  # the topic's name as this client writes it
        self.requested_by_id: dict[object, SubscriptionRequest] = {}
        self.fragment_size: int | None = None  # characters of text in one frame
        self._is_muted = False  # the topic has another type than the requested one
        self._on_lost = on_lost
        self._lost_as: set[Encoding] = set()
        self._outbox = outbox
        self._counters = counters
        self._loop = loop
        self._lane = Lane(0)
        self._throttle_s = 0.0
        self._encoding: Encoding = "json"
        self._next_at = 0.0  # on the loop's clock: no message before
        self._held: deque[bytes] = deque()  # waiting for the throttle, not for the socket
        self._timer: asyncio.TimerHandle | None = None

    def settle(self, type: str | None) -> None:
        """Apply the requests after they, or the topic's type, changed."""
        requested_by_id = self.requested_by_id.values()
        self._is_muted = type is not None and all(requested.type not in (None, type) for requested in requested_by_id)
        self._throttle_s = min((requested.throttle_s for requested in requested_by_id), default=0.0)
        self._lane.limit = min((requested.queue_length for requested in requested_by_id), default=0)
        wanted = {requested.encoding for requested in requested_by_id}
        self._encoding = next((encoding for encoding in STRONGEST if encoding in wanted), "json")
        if not self._throttle_s or not self._lane.limit:
            self._release_all()

    def offer(self, message: Outgoing) -> None:
        """Sends, holds or leaves out one message."""
        if self._is_muted:
            return
        try:
            self._offer(message)
        except Lost as why:
            if self._encoding not in self._lost_as:
                self._lost_as.add(self._encoding)
                self._on_lost(f"{self.spelling} cannot be sent as {self._encoding}: {why}")

    def prepare(self, message: Outgoing) -> None:
        """Has a message encoded that will be offered; what cannot be encoded is reported when it is offered."""
        if not self._is_muted and not self._throttle_s:  # a throttle may leave it out
            with suppress(Lost, Unencodable):
                message.prepare(self.spelling, self._encoding, self.fragment_size)

    def _offer(self, message: Outgoing) -> None:
        if not self._throttle_s:
            self._outbox.send(self._lane, self._frames(message))
            return
        now = self._loop.time()
        if now >= self._next_at and not self._held:
            self._next_at = now + self._throttle_s
            self._outbox.send(self._lane, self._frames(message))
        elif not self._lane.limit:
            self._counters.throttled += 1
        else:
            self._held.append(self._frames(message))
            if len(self._held) > self._lane.limit:
                self._held.popleft()
                self._counters.throttled += 1
            if self._timer is None:
                self._timer = self._loop.call_at(self._next_at, self._release_one)

    def _frames(self, message: Outgoing) -> bytes:
        return message.frames(self.spelling, self._encoding, self.fragment_size)

    def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._held.clear()
        self._outbox.forget(self._lane)

    def _release_one(self) -> None:
        self._timer = None
        if not self._held:
            return
        self._next_at = self._loop.time() + self._throttle_s
        self._outbox.send(self._lane, self._held.popleft())
        if self._held:
            self._timer = self._loop.call_at(self._next_at, self._release_one)

    def _release_all(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        while self._held:
            self._outbox.send(self._lane, self._held.popleft())
