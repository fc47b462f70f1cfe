"""One client of a bridge that behaves as the real one: no status, no mercy."""

from __future__ import annotations

import asyncio
import fnmatch
import json
import logging
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

from websockets.exceptions import ConnectionClosed

from server.rosbridge_server.connection import Connection
from server.rosbridge_server.encoding import binary_frame, text_frame
from server.rosbridge_server.outbox import Lane, Outbox
from server.rosbridge_server.real import text as writing
from server.rosbridge_server.real.calls import Failure, NoAnswer, call
from server.rosbridge_server.real.intake import Deaf, Intake
from server.rosbridge_server.real.provider import Providers
from server.rosbridge_server.real.shape import Lost
from server.rosbridge_server.real.subscription import Asked, RealSubscription

if TYPE_CHECKING:
    from server.rosbridge_server.server import RosBridge

BACKLOG_BYTES = 64_000_000
DEFAULT_BYTES = 10_000_000  # ROS 2: the longest frame that comes in, and that goes out in one piece
_log = logging.getLogger("catgraph.bridge.real")

TOPIC = (True, "topic", str)
SUBSCRIBE = (
    TOPIC, (False, "type", str), (False, "throttle_rate", int), (False, "fragment_size", int),
    (False, "queue_length", int), (False, "compression", str),
)  # fmt: skip
ADVERTISE = (TOPIC, (True, "type", str))
CALL = ((True, "service", str), (False, "fragment_size", (int, type(None))), (False, "compression", str))


class Wrong(Exception):
    """An operation that the real bridge refuses in its own log."""


class RealClient:
    """Lives as long as its connection."""

    def __init__(self, bridge: RosBridge, connection: Connection) -> None:
        self._bridge = bridge
        self._connection = connection
        self._outbox = Outbox(connection, bridge.counters, limit_bytes=BACKLOG_BYTES)
        self._lane = Lane(0)
        self._intake = Intake()
        self._is_deaf = False
        self._fragment_size: Any = bridge.real.max_message_bytes or (DEFAULT_BYTES if bridge.ros_version == 2 else None)
        self._subscriptions: dict[str, RealSubscription] = {}
        self._advertised: dict[str, set[object]] = {}
        self._published: set[str] = set()
        self._providers = Providers(bridge, self.send)
        self._calls: set[asyncio.Task[None]] = set()
        self._blocking: asyncio.Task[None] | None = None  # ROS 2: the call that all else waits for
        self._waiting: list[str] = []  # frames that came meanwhile
        self._operations: dict[str, Callable[[dict[str, Any], Any], None]] = {
            "subscribe": self._subscribe,
            "unsubscribe": self._unsubscribe,
            "advertise": self._advertise,
            "unadvertise": self._unadvertise,
            "publish": self._publish,
            "call_service": self._call,
            "fragment": self._fragment,
            "advertise_service": self._providers.advertise,
            "unadvertise_service": self._providers.unadvertise,
            "service_response": self._providers.respond,
        }
        connection.on_ready = self._outbox.flush
        connection.on_lost = self._outbox.close

    @property
    def is_drained(self) -> bool:
        return self._outbox.is_empty and self._connection.is_drained

    async def run(self) -> None:
        """Serves the client until it goes."""
        try:
            while True:
                raw = await self._connection.recv()
                await self._connection.awake.wait()
                if not self.take(raw):
                    await self._connection.close(1009, "message too big")
        except ConnectionClosed:
            pass
        finally:
            self.leave()

    def take(self, raw: str | bytes) -> bool:
        """Does what a frame asks for; False where it is too long."""
        limit = self._bridge.real.max_message_bytes or DEFAULT_BYTES
        if self._bridge.ros_version == 2 and len(raw if isinstance(raw, bytes) else raw.encode()) > limit:
            return False
        if isinstance(raw, bytes):
            if self._bridge.ros_version == 1:
                raw = str(raw)  # as Python shows bytes; JSON in it is found between its brackets
            else:
                try:
                    raw = raw.decode()
                except UnicodeDecodeError:
                    self._connection.drop()
                    return True
        if self._bridge.ros_version == 1 and self._bridge.real.authenticate and self._refuses(raw):
            return True
        self.incoming(raw)
        return True

    def incoming(self, text: str) -> None:
        """Does what the text asks for, as far as it is whole."""
        if self._is_deaf:
            return
        if self._blocking is not None:
            self._waiting.append(text)
            return
        self._intake.add(text)
        try:
            while True:
                operation = self._intake.next()
                if operation is None or not self._do(operation) or not self._intake.has_more():
                    return
        except Deaf as why:
            _log.debug("a client is deaf now: %s", why)
            self._is_deaf = True

    def send(self, message: Any) -> None:
        """Sends an object as JSON, in fragments where it is long, or the bytes of a binary frame."""
        if self._fragment_size is not None and not isinstance(self._fragment_size, int | float):
            return  # the real one fails at the comparison, at every message from then on
        if isinstance(message, bytes):
            if self._fragment_size is None or len(message) <= self._fragment_size:  # else the real one fails
                self._outbox.send(self._lane, binary_frame(message))
            return
        try:
            text = writing.dumps(message, self._bridge.ros_version)
        except Lost:
            return
        if self._fragment_size is None or len(text) <= self._fragment_size:
            self._write(text)
            return
        if isinstance(self._fragment_size, int) and self._fragment_size > 0:
            id = message.get("id")
            for piece in writing.fragments(text, self._fragment_size, 0 if id is None else id):
                self._write(writing.dumps(piece, self._bridge.ros_version))

    def leave(self) -> None:
        """The client is gone. Its publishers stay a while."""
        self._connection.on_ready = self._connection.on_lost = None
        self._outbox.close()
        for task in self._calls:
            task.cancel()
        for spelling in list(self._subscriptions):
            self._end(spelling)
        for spelling in (*self._advertised, *self._published):
            self._bridge.publishers.unregister(self, spelling)
        self._providers.close()

    def _write(self, text: str) -> None:
        self._outbox.send(self._lane, text_frame(text.encode("utf-8", "surrogatepass")))

    def _do(self, operation: dict[str, Any]) -> bool:
        """Does one operation; False where the real bridge stops reading what stands behind it. Raises Deaf."""
        op = operation.get("op")
        if isinstance(op, dict | list):
            raise Deaf(f"unhashable type: {type(op).__name__!r}")
        handler = self._operations.get(op) if isinstance(op, str) else None
        if handler is None:
            return False
        if "fragment_size" in operation:
            self._fragment_size = operation["fragment_size"]
        if "png" in operation and "msg" not in operation:
            raise Deaf("'msg'")
        try:
            handler(operation, operation.get("id"))
        except Exception as why:  # the real bridge writes it to its log and tells nobody
            _log.debug("%s: %s", op, why)
        return True

    def _refuses(self, raw: str) -> bool:
        """A bridge with authenticate:=true closes on any JSON that is no auth; auth itself is no operation here."""
        try:
            is_auth = json.loads(raw)["op"] == "auth"
        except (ValueError, TypeError, KeyError, RecursionError):
            return False
        if not is_auth:
            self._connection.close_without_code()
        return not is_auth

    def _is_open(self, name: str, globs: tuple[str, ...]) -> bool:
        return not globs or any(fnmatch.fnmatch(name, glob) for glob in globs)

    def _subscribe(self, operation: dict[str, Any], id: Any) -> None:
        _check(operation, SUBSCRIBE)
        spelling = operation["topic"]
        if not self._is_open(spelling, self._bridge.real.topics_glob):
            return
        subscription = self._subscriptions.get(spelling)
        if subscription is None:
            subscription = RealSubscription(spelling, self._bridge.ros_version, self.send)
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

    def _unsubscribe(self, operation: dict[str, Any], id: Any) -> None:
        _check(operation, (TOPIC,))
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

    def _end(self, spelling: str) -> None:
        subscription = self._subscriptions.pop(spelling)
        subscription.close()
        try:
            self._bridge.subscribers.unsubscribe(spelling, subscription)
        except KeyError:
            return

    def _advertise(self, operation: dict[str, Any], id: Any) -> None:
        _check(operation, ADVERTISE)
        spelling = operation["topic"]
        if not self._is_open(spelling, self._bridge.real.topics_glob):
            return
        ids = self._advertised.setdefault(spelling, set())
        latches = operation.get("latch") is True
        self._bridge.publishers.register(self, spelling, operation["type"], latches=latches)
        ids.add(id)

    def _unadvertise(self, operation: dict[str, Any], id: Any) -> None:
        _check(operation, (TOPIC,))
        spelling = operation["topic"]
        ids = self._advertised.get(spelling)
        if ids is None or not self._is_open(spelling, self._bridge.real.topics_glob):
            return
        if id is None:
            ids.clear()
        else:
            ids.discard(id)
        if not ids:
            del self._advertised[spelling]
            self._bridge.publishers.unregister(self, spelling)

    def _publish(self, operation: dict[str, Any], id: Any) -> None:
        _check(operation, (TOPIC,))
        spelling = operation["topic"]
        if not self._is_open(spelling, self._bridge.real.topics_glob):
            return
        latches = operation.get("latch") is True
        self._bridge.publishers.register(self, spelling, None, latches=latches)
        self._published.add(spelling)
        self._bridge.publishers.publish(self, spelling, operation.get("msg", {}), latches=latches)

    def _call(self, operation: dict[str, Any], id: Any) -> None:
        _check(operation, CALL)
        service = operation["service"]
        globs = self._bridge.real.services_glob
        if globs and not self._is_open(service, (*globs, "/rosapi/*")):
            return
        name, _, tail = service.partition("#")
        task = asyncio.ensure_future(
            self._answer(service, name, operation.get("args", []), (tail or None) if id is None else id)
        )
        self._calls.add(task)
        task.add_done_callback(self._calls.discard)
        if self._bridge.ros_version == 2:
            self._blocking = task

    async def _answer(self, service: str, name: str, args: Any, id: Any) -> None:
        try:
            response = {"values": await call(self._bridge, name, args), "result": True}
        except NoAnswer:
            return  # in ROS 2 the connection waits for ever
        except Failure as why:
            response = {"values": str(why), "result": False}
        named = {"op": "service_response", "service": service, **response}
        self.send(named if id is None else {**named, "id": id})
        if self._bridge.ros_version == 2:
            self._go_on()

    def _go_on(self) -> None:
        self._blocking = None
        while self._waiting and self._blocking is None:
            self.incoming(self._waiting.pop(0))

    def _fragment(self, operation: dict[str, Any], id: Any) -> None:
        whole = self._bridge.fragments.add(operation)
        if whole is not None:
            self.incoming(whole)


def _check(operation: dict[str, Any], wanted: tuple[tuple[bool, str, Any], ...]) -> None:
    for is_needed, name, kinds in wanted:
        if name not in operation:
            if is_needed:
                raise Wrong(f"Expected a {name} field but none was found.")
        elif not isinstance(operation[name], kinds):
            raise Wrong(f"Expected field {name} to be one of {kinds}. Invalid value: {operation[name]}")
