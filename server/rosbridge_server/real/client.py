"""One client of a bridge that behaves as the real one: no status, no mercy."""

from __future__ import annotations

import asyncio
import json
import logging
from collections.abc import Callable
from typing import Any, Protocol

from websockets.exceptions import ConnectionClosed

from server.rosbridge_server.connection import Connection
from server.rosbridge_server.encoding import binary_frame, text_frame
from server.rosbridge_server.interface import ServiceHost, TopicHost
from server.rosbridge_server.outbox import Counters, Lane, Outbox
from server.rosbridge_server.provider import Providers
from server.rosbridge_server.real import client_topics
from server.rosbridge_server.real import text as writing
from server.rosbridge_server.real.calls import Failure, NoAnswer, call
from server.rosbridge_server.real.client_topics import ClientTopics
from server.rosbridge_server.real.fragments import RealFragments
from server.rosbridge_server.real.operation_fields import CALL, check
from server.rosbridge_server.real.options import is_open
from server.rosbridge_server.real.shape import Lost

BACKLOG_BYTES = 64_000_000
DEFAULT_BYTES = 10_000_000  # ROS 2: the longest incoming frame, and the longest outgoing one in one piece
_log = logging.getLogger("catgraph.bridge.real")


class Host(client_topics.Host, TopicHost, ServiceHost, Protocol):
    """What serves a client."""

    counters: Counters
    fragments: RealFragments


class RealClient:
    """Lives as long as its connection."""

    def __init__(self, bridge: Host, connection: Connection) -> None:
        self._bridge = bridge
        self._connection = connection
        self._outbox = Outbox(connection, bridge.counters, limit_bytes=BACKLOG_BYTES)
        self._lane = Lane(0)
        self._fragment_size: int | None = bridge.real.max_message_bytes or (
            DEFAULT_BYTES if bridge.ros_version == 2 else None
        )
        self._topics = ClientTopics(bridge, self.send)
        self._providers = Providers(bridge.services, self.send)
        self._calls: set[asyncio.Task[None]] = set()
        self._blocking: asyncio.Task[None] | None = None  # ROS 2: the call that all else waits for
        self._waiting: list[str] = []  # frames that came meanwhile
        self._operations: dict[str, Callable[[dict[str, Any], Any], object]] = {
            "subscribe": self._topics.subscribe,
            "unsubscribe": self._topics.unsubscribe,
            "advertise": self._topics.advertise,
            "unadvertise": self._topics.unadvertise,
            "publish": self._topics.publish,
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
        """Serve the client until it disconnects."""
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
        """Execute a frame; False if it is too long."""
        limit = self._bridge.real.max_message_bytes or DEFAULT_BYTES
        if self._bridge.ros_version == 2 and len(raw if isinstance(raw, bytes) else raw.encode()) > limit:
            return False
        if isinstance(raw, bytes):
            try:
                raw = raw.decode()
            except UnicodeDecodeError:
                return True
        if self._bridge.ros_version == 1 and self._bridge.real.authenticate and self._refuses(raw):
            return True
        self.incoming(raw)
        return True

    def incoming(self, text: str) -> None:
        """Execute the operation of the text. Any other text is passed over; the real bridge may stop at it."""
        if self._blocking is not None:
            self._waiting.append(text)
            return
        try:
            operation = json.loads(text)
        except (ValueError, RecursionError):
            return
        if isinstance(operation, dict):
            self._do(operation)

    def send(self, message: Any) -> None:
        """Sends an object as JSON, in fragments where it is long, or the bytes of a binary frame."""
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
        id = message.get("id")
        for piece in writing.fragments(text, self._fragment_size, 0 if id is None else id):
            self._write(writing.dumps(piece, self._bridge.ros_version))

    def leave(self) -> None:
        """The client is gone. Its publishers stay a while."""
        self._connection.on_ready = self._connection.on_lost = None
        self._outbox.close()
        for task in self._calls:
            task.cancel()
        self._topics.close()  # what it offers stays and never answers, as do the calls that wait

    def _write(self, text: str) -> None:
        self._outbox.send(self._lane, text_frame(text.encode("utf-8", "surrogatepass")))

    def _do(self, operation: dict[str, Any]) -> None:
        op = operation.get("op")
        handler = self._operations.get(op) if isinstance(op, str) else None
        if handler is None:
            return
        size = operation.get("fragment_size")
        if type(size) is int and size > 0:
            self._fragment_size = size
        try:
            handler(operation, operation.get("id"))
        except Exception as why:  # the real bridge only logs it
            _log.debug("%s: %s", op, why)

    def _refuses(self, raw: str) -> bool:
        """A bridge with authenticate:=true closes on any JSON that is no auth; auth itself is no operation here."""
        try:
            is_auth = json.loads(raw)["op"] == "auth"
        except (ValueError, TypeError, KeyError, RecursionError):
            return False
        if not is_auth:
            self._connection.close_without_code()
        return not is_auth

    def _call(self, operation: dict[str, Any], id: Any) -> None:
        check(operation, CALL)
        service = operation["service"]
        globs = self._bridge.real.services_glob
        if globs and not is_open(service, (*globs, "/rosapi/*")):
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
