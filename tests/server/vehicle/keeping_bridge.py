"""A bridge without a network that keeps latched samples and gives them to each new subscription, in virtual time."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.recording.folder import RecordingsFolder
from server.rosbridge import connection_errors
from server.rosbridge.address import Address
from server.rosbridge.link_listener import LinkListener, Marks
from server.rosbridge.live_source import CallFailed
from server.rosbridge.raw_frame import RawFrame, raw_frame
from server.rosbridge.subscription import Subscription
from server.vehicle.session import Session
from server.vehicle.undelivered import CLIENT_COUNT, OWN_CLIENTS
from server.vehicle.vehicle import Vehicle
from tests.virtual_time import real_time

ADDRESS = "ws://127.0.0.1:9090"
GIVEN_AFTER_S = 0.05  # a bridge reads a subscription and gives what it kept
PING_EVERY_S = 0.5
NODE, CAR = "/rosbridge_websocket", "/car"


@dataclass(frozen=True, slots=True)
class Topic:
    """What a car publishes."""

    type: str
    is_latched: bool = False


class KeepingBridge:
    """`open_source` of a session. Its time is the loop's; `clients` are others that are connected to it."""

    frame_bytes, junk_count, unanswered, attempts = 100, 0, 0, 0
    server_software = ""
    command_problem: str | None = None
    keeps_types = True

    def __init__(self, topics: Mapping[str, Topic], *, clients: int = 0, has_rosapi: bool = True) -> None:
        self.topics = dict(topics)
        self.clients = clients
        self.stuck: set[str] = set()  # topics of which each subscription is given one message, as on ROS 2
        self.is_open = False
        self.ahead_s = 0.0  # by which the car's clock is ahead
        self.trip_s = 0.0  # what the link needs there and back
        self.connects_s = 0.0  # what the bridge needs to find the publishers of a topic whose last subscription ended
        self.heard_s: float | None = None
        self.subscribed: list[tuple[float, str]] = []  # when each subscription was sent
        self._has_rosapi = has_rosapi
        self._kept: dict[str, Mapping[str, Any]] = {}
        self._rows: dict[str, Subscription] = {}
        self._given: set[str] = set()  # topics that gave a message to the newest subscription
        self._listener: LinkListener | None = None
        self._marks: Marks | None = None
        self._take_unparsed: Callable[[RawFrame], bool] = lambda _: False

    def __call__(
        self,
        address: Address,
        listener: LinkListener,
        *,
        now: Callable[[], float],
        take_unparsed: Callable[[RawFrame], bool],
        marks: Marks | None,
    ) -> KeepingBridge:
        self._listener, self._marks, self._take_unparsed = listener, marks, take_unparsed
        return self

    # -- of the test -------------------------------------------------------------------------------------------------

    def publish(self, topic: str, message: Mapping[str, Any]) -> None:
        """A message of the car now."""
        if self.topics[topic].is_latched:
            self._kept[topic] = message
        if topic in self._rows and not (topic in self.stuck and topic in self._given):
            self._deliver(topic, message)

    def close(self) -> None:
        """The link is lost."""
        self.is_open = False
        assert self._listener is not None
        self._listener.link_closed(connection_errors.CAR_SILENT)

    def open(self) -> None:
        """The link opens, for the first time or again."""
        assert self._listener is not None
        now_s = time.monotonic()
        self.is_open, self.heard_s = True, now_s
        if self._marks is not None:
            self._marks.open(now_s)
        for row in self._rows.values():
            self._begin(row)
        self._listener.link_opened()

    async def answer_pings(self) -> None:
        """Answers a ping twice a second until it is cancelled, and publishes the number of clients."""
        while True:
            if self.is_open and self._marks is not None:
                self.heard_s = time.monotonic()
                self._marks.sent(self.heard_s - self.trip_s)
                self._marks.answered(self.heard_s - self.trip_s, self.heard_s)
            if CLIENT_COUNT in self.topics:
                self.publish(CLIENT_COUNT, {"data": OWN_CLIENTS + self.clients})
            await asyncio.sleep(PING_EVERY_S)

    # -- of the session ----------------------------------------------------------------------------------------------

    @property
    def subscriptions(self) -> tuple[Subscription, ...]:
        return tuple(self._rows.values())

    def start(self) -> None:
        asyncio.get_running_loop().call_soon(self.open)

    def stop(self, *, is_flushed: bool = False) -> None:
        self.is_open = False

    def retry_now(self) -> None:
        pass

    def abort(self) -> None:
        self.is_open = False

    def subscribe(self, wanted: Subscription) -> None:
        if self._rows.get(wanted.topic) != wanted:
            self._rows[wanted.topic] = wanted
            if self.is_open:
                self._begin(wanted)

    def unsubscribe(self, topic: str) -> None:
        self._rows.pop(topic, None)

    def renew(self, topic: str) -> None:
        row = self._rows.pop(topic) if self.connects_s else self._rows[topic]
        self._begin(row)
        if self.connects_s:
            asyncio.get_running_loop().call_later(self.connects_s, self._rows.__setitem__, topic, row)

    def again(self, topic: str) -> bool:
        self._begin(self._rows[topic])
        return True

    def ping(self) -> None:
        pass

    def send_now(self, operation: Mapping[str, Any]) -> None:
        pass

    def beside(self, listener: LinkListener) -> KeepingBridge:
        return self

    async def call(self, service: str, arguments: Mapping[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """What rosapi answers."""
        topic = (arguments or {}).get("topic")
        if service == "/rosapi/topics" and self._has_rosapi:
            return {"topics": [*self.topics], "types": [one.type for one in self.topics.values()]}
        if service == "/rosapi/get_time" and self._has_rosapi:
            now_ns = time.time_ns() + round(self.ahead_s * 1e9)
            return {"time": {"secs": now_ns // 10**9, "nsecs": now_ns % 10**9}}
        if service == "/rosapi/publishers":
            return {"publishers": [NODE if topic == CLIENT_COUNT else CAR] if topic in self.topics else []}
        if service == "/rosapi/subscribers":
            return {"subscribers": [NODE] if topic in self._rows else []}
        raise CallFailed(f"Service {service} does not exist")

    def _begin(self, row: Subscription) -> None:
        self.subscribed.append((time.monotonic(), row.topic))
        self._given.discard(row.topic)
        if self._marks is not None:
            self._marks.subscribe(row.topic, row.queue_length, row.throttle_ms / 1000)
        asyncio.get_running_loop().call_later(GIVEN_AFTER_S + self.trip_s, self._give, row.topic)

    def _give(self, topic: str) -> None:
        if topic in self._kept and topic in self._rows:
            self._deliver(topic, self._kept[topic])

    def _deliver(self, topic: str, message: Mapping[str, Any]) -> None:
        if not self.is_open or self._listener is None:
            return
        self._given.add(topic)
        payload = json.dumps({"op": "publish", "topic": topic, "msg": message}).encode()
        frame = raw_frame(payload, False)
        assert frame is not None
        self.frame_bytes = len(payload)
        if not self._take_unparsed(frame):
            self._listener.message_received(topic, frame.message(), None)


@asynccontextmanager
async def monitored(
    bridge: KeepingBridge, folder: Path | None = None, *, ahead_s: Callable[[], float] = lambda: 0.0
) -> AsyncIterator[Session]:
    """A session that monitors the car behind `bridge`, with every part that a server gives it; recorded in `folder`.
    `ahead_s`: by which the server's clock is ahead."""
    bus = LocalBus(Journal(None), now=time.monotonic)
    session = Session(
        Vehicle(name="car", address=ADDRESS),
        bus,
        now=time.monotonic,
        wall_ms=lambda: time.time_ns() // 1_000_000 + round(ahead_s() * 1000),
        server=dict,  # type: ignore[arg-type]
        recordings=None if folder is None else RecordingsFolder(folder),
        open_source=bridge,
    )
    await session.start()
    pinging = asyncio.create_task(bridge.answer_pings())
    try:
        yield session
    finally:
        pinging.cancel()
        async with real_time():  # the recorder's thread ends in its own time
            session.disconnect(by="test")
            await session.stop()
