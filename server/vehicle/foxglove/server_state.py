"""What is known of the server of one connection: what it offers, what is subscribed to, and its answers."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Callable, Collection, Iterable, Mapping
from typing import Any, Protocol

from server.rosbridge.live_source import CallFailed, LinkDown
from server.rosbridge.subscription import Subscription
from server.vehicle.foxglove import protocol
from server.vehicle.foxglove.commands import Commands
from server.vehicle.foxglove.protocol import Channel, GraphUpdate, ServerInfo

UNKNOWN_NODE = "unknown node"  # who publishes what is offered, where the server lists no nodes
MAX_OFFERED = 5000
GRAPH = "connectionGraph"
FIRST_CHANNELS_S = 0.5  # after it has named itself, a server names what it offers


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


class CallSource(Protocol):
    @property
    def is_open(self) -> bool: ...
    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any: ...


class Answers:
    """Answers the questions of a session from what the server has listed.

    A `QuestionChannel` that is open as long as the source is: nothing is sent for a question.
    """

    unanswered = 0

    def __init__(self, source: CallSource) -> None:
        self._source = source

    @property
    def is_open(self) -> bool:
        return self._source.is_open

    def start(self) -> None:
        """There is nothing to dial."""

    def stop(self) -> None:
        """There is nothing to end."""

    def ping(self) -> None:
        """Nothing was sent that an answer could be behind."""

    async def call(self, service: str, arguments: dict[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        return await self._source.call(service, arguments, timeout_s=timeout_s)


class Subscribed:
    """What is wanted of a server, topic by topic, and under which numbers it is subscribed to.

    Over all openings; the table is kept. `send(frame)` sends now; `sent(topic, number)` is called before each.
    """

    def __init__(self, send: Callable[[bytes], None], sent: Callable[[str, int], None]) -> None:
        self._send = send
        self._sent = sent
        self._ids = itertools.count(1)  # never one again: what comes late belongs to its own subscription
        self.table: dict[str, Subscription] = {}
        self.channels: dict[int, Channel] = {}  # number of the subscription → its channel

    def closed(self) -> None:
        self.channels.clear()

    def begin(self, topic: str, channels: Collection[Channel]) -> list[int]:
        """Subscribes to these channels of a topic, as far as that is not done, and to no other one of it. The numbers
        that are free now."""
        ended = self._end(number for number, one in self.channels.items() if one.topic == topic and one not in channels)
        known = set(self.channels.values())
        new = {next(self._ids): channel for channel in channels if channel not in known}
        self.channels.update(new)
        for number in new:
            self._sent(topic, number)
        if new:
            self._send(protocol.subscribe((number, channel.id) for number, channel in new.items()))
        return ended

    def end(self, topic: str) -> list[int]:
        """The numbers that are free of their topic now."""
        return self.begin(topic, ())

    def _end(self, numbers: Iterable[int]) -> list[int]:
        ended = list(numbers)
        for number in ended:
            del self.channels[number]
        if ended:
            self._send(protocol.unsubscribe(ended))
        return ended

    def gone(self, channel: Channel) -> list[int]:
        """A channel is not offered any more, and with it its subscriptions ended: their numbers."""
        ended = [number for number, one in self.channels.items() if one.id == channel.id]
        for number in ended:
            del self.channels[number]
        return ended


class ServerState:
    """To be used on one event loop."""

    def __init__(self) -> None:
        self.offered = Offered()
        self.commands: Commands | None = None
        self._is_known = asyncio.Event()
        self._timer: asyncio.TimerHandle | None = None

    def introduced(self, info: ServerInfo) -> bool:
        """A server named itself, for the first time or with another session: what it offers stays. Return whether its
        nodes are to be requested."""
        if self.commands is None:
            self.commands = Commands(info)
            self._timer = asyncio.get_running_loop().call_later(FIRST_CHANNELS_S, self._is_known.set)
        self.commands.info = info
        before, self.offered.has_graph = self.offered.has_graph, GRAPH in info.capabilities
        return self.offered.has_graph and not before

    def advertised(self) -> None:
        """Channels were offered."""
        if self.commands is not None:
            self._is_known.set()

    def end(self) -> None:
        """The connection ended."""
        if self._timer is not None:
            self._timer.cancel()

    @property
    def command_problem(self) -> str | None:
        """Why no command can be sent; None: it can, or it is not known yet."""
        return None if self.commands is None else self.commands.problem(self.offered.encodings())

    def command(self, operation: dict[str, Any]) -> tuple[bytes, bool]:
        """The frame of a command, and whether it is binary. Raises LinkDown, NotAllowed."""
        if self.commands is None:
            raise LinkDown("not sent: the Foxglove server has not listed its capabilities yet")
        frame = self.commands.frames(operation, self.offered.encodings())
        match operation["op"]:
            case "advertise":
                self.offered.announced(operation["topic"])
            case "unadvertise":
                self.offered.withdrawn(operation["topic"])
        return frame

    async def answer(self, service: str, arguments: Mapping[str, Any], timeout_s: float) -> dict[str, Any]:
        """As rosapi answers. Raises CallFailed."""
        try:
            async with asyncio.timeout(timeout_s):
                await self._is_known.wait()
        except TimeoutError:
            raise CallFailed("the Foxglove server has not listed its channels") from None
        return self.offered.answer(service, arguments)
