"""One client of the bridge: handles its operations, keeps its subscriptions, sends replies."""

from __future__ import annotations

import asyncio
import logging
import time
from collections.abc import Callable
from typing import Any

from websockets.exceptions import ConnectionClosed

from server.judge.message import Json
from server.judge.ros_names import BadName, canonical_name, canonical_type
from server.rosbridge.codec import Unencodable
from server.rosbridge_server import fields
from server.rosbridge_server.calls import Calls, Providers
from server.rosbridge_server.client_topics import Publications, Subscription, SubscriptionRequest
from server.rosbridge_server.connection import Connection
from server.rosbridge_server.encoding import Encoding, json_frames
from server.rosbridge_server.fields import Fragments, Refused
from server.rosbridge_server.graph import Topic
from server.rosbridge_server.interface import ClientHost
from server.rosbridge_server.outbox import Outbox

_log = logging.getLogger("catgraph.bridge")

LEVELS = ("info", "warning", "error", "none")
MOST_SUBSCRIPTIONS = 1_000
MOST_WISHES = 100  # subscribe operations for one topic under different ids
MOST_OFFERED = 100  # services
BACKLOG_BYTES = 16_000_000  # messages that may wait for one client
REPLY_BYTES = 1_000_000  # replies that may wait before reading from the client stops
TURN_S = 0.005  # one client's flood holds the loop no longer than this
NOT_OURS = {
    "advertise_action", "unadvertise_action", "send_action_goal", "cancel_action_goal",
    "action_feedback", "action_result", "auth",
}  # fmt: skip


class Client:
    """One client, for the time of its connection; the bridge holds the topics, the client its requests."""

    def __init__(self, bridge: ClientHost, connection: Connection) -> None:
        self._bridge = bridge
        self._connection = connection
        self._outbox = Outbox(connection, bridge.counters, limit_bytes=BACKLOG_BYTES)
        self._fragments = Fragments(limit_bytes=bridge.max_message_bytes)
        self._level = "error"
        self._subscriptions: dict[str, Subscription] = {}
        self._fragment_size = bridge.fragment_size
        self._calls = Calls(bridge, self._reply)
        self._providers = Providers(bridge.services, self._reply)
        self._publications = Publications(bridge, self.say)
        self._may_listen = asyncio.Event()
        self._may_listen.set()
        self._operations: dict[str, Callable[[dict[str, Any], object], None]] = {
            "subscribe": self._subscribe,
            "unsubscribe": self._unsubscribe,
            "advertise": self._publications.advertise,
            "unadvertise": self._publications.unadvertise,
            "publish": self._publications.publish,
            "call_service": self._calls.call,
            "advertise_service": self._advertise_service,
            "unadvertise_service": self._unadvertise_service,
            "service_response": self._service_response,
            "set_level": self._set_level,
            "status_level": self._set_level,
            "fragment": self._fragment,
        }
        connection.on_ready = self._outbox.flush
        connection.on_lost = self._outbox.close  # also ends our waiting for a client that does not read
        self._outbox.on_replies_gone = self._may_listen.set

    async def run(self) -> None:
        """Serve the client until it disconnects."""
        turn_ends = time.monotonic() + TURN_S
        try:
            while True:
                raw = await self._connection.recv()  # text that is not UTF-8 ends the connection with 1007
                await self._connection.awake.wait()
                self.handle(raw)
                if self._outbox.reply_bytes > REPLY_BYTES:
                    self._may_listen.clear()
                    await self._may_listen.wait()
                if time.monotonic() > turn_ends:
                    await asyncio.sleep(0)
                    turn_ends = time.monotonic() + TURN_S
        except ConnectionClosed:
            pass
        finally:
            self.leave()

    @property
    def is_drained(self) -> bool:
        """All that was meant for this client has left us."""
        return self._outbox.is_empty and self._connection.is_drained

    def handle(self, raw: str | bytes, *, whole: bool = False) -> None:
        """Execute one frame, or send the reason why not. No input of a client can raise."""
        id: object = None
        op = ""
        try:
            operation = fields.parse(raw)
            id = fields.id_of(operation)
            op = fields.text(operation, "op")
            if op == "fragment" and whole:
                raise Refused("a fragment cannot hold fragments")
            handler = self._operations.get(op)
            if handler is None:
                raise Refused(_unknown(op, self._operations))
            self._note_fragment_size(operation.get("fragment_size"))
            handler(operation, id)
        except (Refused, BadName, Unencodable) as error:
            self.say("error", f"{op[:40]}: {error}" if op else str(error), id)
        except Exception:  # our own mistake must not cost the client its connection
            _log.exception("operation failed: op=%r", op[:40])
            self.say("error", f"{op[:40]}: internal error of the bridge", id)

    def say(self, level: str, text: str, id: object = None) -> None:
        """Sends a status message, if the client wants those of this level."""
        if LEVELS.index(level) < LEVELS.index(self._level):
            return
        status: dict[str, Any] = {"op": "status", "level": level, "msg": text}
        if id is not None:
            status["id"] = id
        self._reply(status)

    def _reply(self, message: Json) -> None:
        self._outbox.reply(json_frames(message, self._fragment_size))

    def _note_fragment_size(self, size: object) -> None:
        """Of any operation, for all that is sent from now on."""
        if type(size) is int and size > 0:
            self._fragment_size = size
            for subscription in self._subscriptions.values():
                subscription.fragment_size = size

    def _subscribe(self, operation: dict[str, Any], id: object) -> None:
        spelling = fields.text(operation, "topic")
        wanted = fields.optional_text(operation, "type")
        remarks: list[str] = []
        requested = SubscriptionRequest(
            type=None if wanted is None else self._bridge.message_type(wanted),
            throttle_s=_count(operation, "throttle_rate", remarks) / 1000.0,
            queue_length=_count(operation, "queue_length", remarks),
            encoding=_encoding(fields.text(operation, "compression", "none"), remarks),
        )
        subscription = self._subscriptions.get(spelling)
        if subscription is None and len(self._subscriptions) >= MOST_SUBSCRIPTIONS:
            raise Refused(f"a client may subscribe to {MOST_SUBSCRIPTIONS} topics")
        known = self._bridge.graph.find(spelling)
        if known is not None and known.type is not None and requested.type not in (None, known.type):
            raise Refused(f"{known.name} has the type {known.type}, not {requested.type}")
        if subscription is None:
            subscription = Subscription(
                spelling,
                self._outbox,
                self._bridge.counters,
                asyncio.get_running_loop(),
                on_lost=lambda why: self.say("error", f"subscribe: {why}"),
            )
            subscription.fragment_size = self._fragment_size
            self._subscriptions[spelling] = subscription
        elif id not in subscription.requested_by_id and len(subscription.requested_by_id) >= MOST_WISHES:
            raise Refused(f"a client may subscribe {MOST_WISHES} times to one topic")
        subscription.requested_by_id[id] = requested
        topic = self._bridge.graph.find_or_make(spelling, requested.type)
        self._bridge.note_type(topic.name, topic.type)
        subscription.settle(topic.type)
        if subscription not in topic.subscribers:
            topic.subscribers[subscription] = self
        if topic.latched is not None:  # with each subscription, as of a real bridge
            subscription.offer(topic.latched)
        self._bridge.subscribed(topic.name)
        for remark in remarks:
            self.say("error", f"subscribe: {remark}", id)
        if topic.type is None:
            self.say("warning", f"subscribe: {topic.name} does not exist yet, and no type was given", id)
        self.say("info", f"subscribed to {topic.name}", id)

    def _unsubscribe(self, operation: dict[str, Any], id: object) -> None:
        spelling = fields.text(operation, "topic")
        subscription = self._subscriptions.get(spelling)
        if subscription is None:
            self.say("warning", f"unsubscribe: not subscribed to {spelling[:100]}", id)
            return
        if id is None:
            subscription.requested_by_id.clear()
        else:
            subscription.requested_by_id.pop(id, None)
        if subscription.requested_by_id:
            topic = self._bridge.graph.find(spelling)
            subscription.settle(topic.type if topic else None)
        else:
            self._end(spelling)
        self.say("info", f"unsubscribed from {spelling[:100]}", id)

    def _advertise_service(self, operation: dict[str, Any], id: object) -> None:
        name, type = fields.text(operation, "service"), fields.text(operation, "type")
        name, type = canonical_name(name), canonical_type(type, self._bridge.ros_version, "srv")
        if name not in self._providers.names:
            if self._bridge.services.find(name) is not None:
                raise Refused(f"another node offers {name}")
            if len(self._providers.names) >= MOST_OFFERED:
                raise Refused(f"a client may offer {MOST_OFFERED} services")
        self._providers.advertise({"service": name, "type": type}, id)
        self.say("info", f"advertised {name}", id)

    def _unadvertise_service(self, operation: dict[str, Any], id: object) -> None:
        name = canonical_name(fields.text(operation, "service"))
        if name not in self._providers.names:
            self.say("warning", f"unadvertise_service: {name} is not offered by this client", id)
            return
        self._providers.unadvertise({"service": name}, id)

    def _service_response(self, operation: dict[str, Any], id: object) -> None:
        fields.text(operation, "id")
        if not self._providers.respond({"values": {}, **operation}, id):
            raise Refused("no call with this id waits for an answer")

    def _set_level(self, operation: dict[str, Any], id: object) -> None:
        level = fields.text(operation, "level")
        if level not in LEVELS:
            raise Refused(f"the level must be one of {', '.join(LEVELS)}")
        self._level = level

    def _fragment(self, operation: dict[str, Any], id: object) -> None:
        whole = self._fragments.add(operation)
        if whole is not None:
            self.handle(whole, whole=True)

    def type_became(self, topic: Topic, subscription: Subscription) -> None:
        """The topic exists now: clients that requested another type get an error and no data."""
        subscription.settle(topic.type)
        for id, requested in subscription.requested_by_id.items():
            if requested.type not in (None, topic.type):
                self.say("error", f"subscribe: {topic.name} has the type {topic.type}, not {requested.type}", id)

    def _end(self, spelling: str) -> None:
        subscription = self._subscriptions.pop(spelling)
        subscription.close()
        topic = self._bridge.graph.find(spelling)
        if topic is not None:
            topic.subscribers.pop(subscription, None)
            self._bridge.graph.tidy(topic)

    def leave(self) -> None:
        """The client is gone, and all that it subscribed to, advertised and offered ends."""
        self._connection.on_ready = self._connection.on_lost = None
        self._calls.close()
        self._providers.close()
        self._outbox.close()
        for spelling in list(self._subscriptions):
            self._end(spelling)
        self._publications.close()


def _count(operation: dict[str, Any], name: str, remarks: list[str]) -> int:
    """A number that rosbridge takes as 0 where it is below."""
    value = operation.get(name)
    if isinstance(value, int | float) and value < 0:
        remarks.append(f"the field {name} must be a number, 0 or more: it is taken as 0")
        return 0
    return fields.whole_number(operation, name, 0)


def _encoding(compression: str, remarks: list[str]) -> Encoding:
    match compression:
        case "none":
            return "json"
        case "cbor" | "cbor-raw" | "png":
            return compression
        case _:
            remarks.append(f"compression {compression[:40]!r} is not offered here, but none, cbor, cbor-raw and png")
            return "json"


def _unknown(op: str, known: dict[str, Any]) -> str:
    if op in NOT_OURS:
        return "this bridge does not do that"
    return f"unknown operation: there are {', '.join(known)}"
