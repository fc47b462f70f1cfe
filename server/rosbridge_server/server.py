"""A rosbridge server (protocol v2) in front of a recording or a simulated car."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

from server.judge.message import Json, RosVersion
from server.judge.ros_names import canonical_name, canonical_type
from server.rosbridge_server.client import Client
from server.rosbridge_server.connection import Connection, WriteTogether
from server.rosbridge_server.encoding import Outgoing
from server.rosbridge_server.graph import SOURCE, Graph, Handler, Service, ServiceFailed, Services, Topic
from server.rosbridge_server.listener import CannotListen, Listener
from server.rosbridge_server.outbox import Counters
from server.rosbridge_server.rosapi import add_rosapi
from server.rosbridge_server.types import MessageTypes

__all__ = ["CannotListen", "RosBridge", "ServiceFailed"]

ROSOUT = "/rosout"
_LOG_TYPES = {1: "rosgraph_msgs/Log", 2: "rcl_interfaces/Log"}


class RosBridge:
    """Behaves as the rosbridge of `ros_version`; `now` is the ROS time of rosapi [s since 1970].

    It answers as rosbridge_suite does. What that only writes to its log is sent as a `status`, and what it cannot
    encode is sent.

    Everything but start, stop, kill and revive is synchronous and belongs on the loop on which the bridge was started.
    """

    def __init__(
        self,
        *,
        ros_version: RosVersion = 1,
        now: Callable[[], float] = time.time,
        node: str = "/car",
        max_clients: int = 256,
        max_message_bytes: int = 10_000_000,
        fragment_size: int | None = None,
    ) -> None:
        self.ros_version: RosVersion = ros_version
        self.now = now
        self.node = node  # name under which rosapi shows what we publish ourselves
        self.max_message_bytes = max_message_bytes
        if fragment_size is None and ros_version == 2:  # as rosbridge does where nothing else is set
            fragment_size = max_message_bytes
        self.fragment_size = fragment_size  # characters of text in one frame
        self.counters = Counters()
        self.graph = Graph()
        self.services = Services()
        self.types = MessageTypes(ros_version)
        self.on_publish: list[Callable[[str, str, Json], None]] = []  # (topic, type, message) of what clients publish
        self.on_subscribe: list[Callable[[str], None]] = []  # (topic) each time a client subscribes
        self.parameters: dict[str, object] = {}
        self._types_seen: dict[str, str] = {}  # ROS 1's master remembers the type of every topic there ever was
        self._listener = Listener(self._serve_client, max_clients=max_clients, max_message_bytes=max_message_bytes)
        self._clients: set[Client] = set()
        self._address: tuple[str, int] | None = None
        self.add_rosapi()

    @property
    def sent(self) -> int:
        """Messages handed to clients' sockets; one message to three clients counts three."""
        return self.counters.sent

    @property
    def dropped(self) -> int:
        """Messages lost because a client did not keep up, or went while they waited."""
        return self.counters.dropped

    @property
    def bytes_sent(self) -> int:
        return self.counters.bytes_sent

    @property
    def clients(self) -> int:
        """Clients connected now."""
        return self._listener.clients

    async def start(self, host: str = "127.0.0.1", port: int = 0) -> int:
        """Start to listen and return the port, a free one for 0. Raises CannotListen with one sentence for a person."""
        self.types.load()
        port = await self._listener.open(host, port)
        self._address = (host, port)
        return port

    async def stop(self) -> None:
        """Close every client's connection and stop listening."""
        self._address = None
        await self._listener.close(abruptly=False)

    async def kill(self) -> None:
        """Drops every connection as a killed process would, and refuses new ones until `revive()`."""
        await self._listener.close(abruptly=True)

    async def revive(self) -> None:
        """Start to listen again on the same port. Raises CannotListen."""
        if self._address is None:
            raise RuntimeError("the bridge was not started")
        await self._listener.open(*self._address)

    def freeze(self) -> None:
        """Keeps every connection but answers nothing, not even pings, as a stopped process would."""
        self._listener.freeze()

    def thaw(self) -> None:
        """Resume after a freeze: read and send what was waiting."""
        self._listener.thaw()

    def message_type(self, name: str) -> str:
        """A message type's name as this ROS version spells it. Raises BadName."""
        return canonical_type(name, self.ros_version)

    def advertise(self, topic: str, type: str, definition: str | None = None, *, latch: bool = False) -> None:
        """Advertise a topic. `latch`: newcomers get the last message at once. Raises BadName.

        `definition` is the type's .msg text with all it contains; standard types need none.
        """
        type = self.message_type(type)
        found = self.graph.find_or_make(topic, type)
        found.type, found.latches = type, latch
        if definition:
            self.types.learn(type, definition)
        found.publishers.add(SOURCE)
        self.note_type(found.name, type)
        for subscription, client in list(found.subscribers.items()):
            client.type_became(found, subscription)

    def advertise_rosout(self) -> None:
        """Makes /rosout exist where the source has none: every node has it, and players tell ROS 2 by its type."""
        if self.graph.find(ROSOUT) is None:
            self.advertise(ROSOUT, _LOG_TYPES[self.ros_version])

    def unadvertise(self, topic: str) -> None:
        """Remove the source of a topic; its subscribers stay subscribed."""
        found = self.graph.find(topic)
        if found is not None:
            found.publishers.discard(SOURCE)
            self.graph.tidy(found)

    def publish(self, topic: str, message: Json | Outgoing) -> None:
        """Send a message to all subscribers, without ever waiting. The message must not change afterwards.

        Raises LookupError where the topic was not advertised, Unencodable where it cannot be sent.
        """
        found, type = self._published_here(topic)
        found.distribute(message if isinstance(message, Outgoing) else Outgoing(self, type, message))

    def prepare(self, topic: str, message: Json) -> Outgoing:
        """Encode a message for the current subscribers; it is to be published soon. Raises LookupError."""
        found, type = self._published_here(topic)
        outgoing = Outgoing(self, type, message)
        for subscription in found.subscribers:
            subscription.prepare(outgoing)
        return outgoing

    def _published_here(self, topic: str) -> tuple[Topic, str]:
        found = self.graph.find(topic)
        if found is None or SOURCE not in found.publishers:
            raise LookupError(f"{topic} was not advertised")
        assert found.type is not None
        return found, found.type

    @property
    def writing_together(self) -> WriteTogether:
        """For a block that does not wait: what it publishes is written to each client with one system call."""
        return self._listener.together

    def add_service(
        self,
        name: str,
        type: str,
        handler: Handler,
        arguments: tuple[str, ...] = (),
        *,
        request: str | None = None,
        response: str | None = None,
        node: str | None = None,
    ) -> None:
        """Offer a service. `handler(args)` returns the values, now or as an awaitable; what it raises is passed on.

        `arguments` are their names in order, for the callers that send a list; `request` and `response` the .msg text
        of both.
        """
        self.services.add(
            Service(
                name=canonical_name(name),
                type=canonical_type(type, self.ros_version, "srv"),
                handler=handler,
                arguments=arguments,
                request=request,
                response=response,
                node=self.node if node is None else node,
            )
        )

    def end_node(self, node: str) -> None:
        """A node ends and takes its services with it."""
        for service in self.services.all():
            if service.node == node:
                self.services.remove(service.name)

    def add_rosapi(self) -> None:
        """Offers the services of rosapi, at the beginning and again after its end."""
        add_rosapi(self)

    def note_type(self, topic: str, type: str | None) -> None:
        """Remembers the type of a topic."""
        if type is not None:
            self._types_seen[topic] = type

    def advertised_types(self) -> set[str]:
        """The types of what the source publishes: they are known to it, even where no definition came with them."""
        return {topic.type for topic in self.graph.topics() if topic.type and SOURCE in topic.publishers}

    def types_seen(self) -> dict[str, str]:
        """Every topic there ever was, with its newest type."""
        return dict(self._types_seen)

    def subscribed(self, topic: str) -> None:
        """Called by a client when it has subscribed."""
        for callback in self.on_subscribe:
            callback(topic)

    async def drain(self, within_s: float) -> bool:
        """Waits until every client has been sent all that waits for it; False when that took too long."""
        deadline = time.monotonic() + within_s
        while not all(client.is_drained for client in self._clients):
            if time.monotonic() > deadline:
                return False
            await asyncio.sleep(0.01)
        return True

    async def _serve_client(self, connection: Connection) -> None:
        client = Client(self, connection)
        self._clients.add(client)
        try:
            await client.run()
        finally:
            self._clients.discard(client)
