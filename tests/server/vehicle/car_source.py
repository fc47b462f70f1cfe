"""A source of messages without a network: the simulated car, beside a session, in virtual time."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Iterable, Mapping
from typing import Any

from server.judge.message import Message
from server.rosbridge.address import Address
from server.rosbridge.link_listener import LinkListener, Marks
from server.rosbridge.live_source import CallFailed
from server.rosbridge.subscription import Subscription
from server.simulator.car import SimulatedCar

MARK_EVERY_S = 0.5  # as a link pings its bridge


class CarSource:
    """`open_source` of a session that watches `car`. It also offers `others`, topic → type, for `publish`."""

    frame_bytes, junk_count, unanswered, attempts = 100, 0, 0, 0
    server_software = ""
    command_problem: str | None = None
    keeps_types = True

    def __init__(self, car: SimulatedCar, others: Mapping[str, str] = {}) -> None:
        self.car = car
        self.is_open = False
        self.heard_s: float | None = None
        self._types = {one.topic: one.type for one in car.published} | dict(others)
        self._rows: dict[str, Subscription] = {}
        self._listener: LinkListener | None = None
        self._marks: Marks | None = None
        self._mark_due_s = 0.0
        self._now: Callable[[], float] = lambda: 0.0

    def __call__(
        self, address: Address, listener: LinkListener, *, now: Callable[[], float], marks: Marks | None, **more: Any
    ) -> CarSource:
        self._listener, self._now, self._marks = listener, now, marks
        return self

    @property
    def subscriptions(self) -> tuple[Subscription, ...]:
        return tuple(self._rows.values())

    def start(self) -> None:
        asyncio.get_running_loop().call_soon(self._open)

    def _open(self) -> None:
        assert self._listener is not None
        self.is_open, self.heard_s = True, self._now()
        if self._marks is not None:
            self._marks.open(self._now())
        self._listener.link_opened()

    def stop(self, *, is_flushed: bool = False) -> None:
        self.is_open = False

    def retry_now(self) -> None:
        pass

    def abort(self) -> None:
        self.is_open = False

    def subscribe(self, wanted: Subscription) -> None:
        self._rows[wanted.topic] = wanted
        if self._marks is not None:
            self._marks.subscribe(wanted.topic, wanted.queue_length, wanted.throttle_ms / 1000)

    def unsubscribe(self, topic: str) -> None:
        self._rows.pop(topic, None)

    def renew(self, topic: str) -> None:
        pass

    def again(self, topic: str) -> bool:
        return False

    def ping(self) -> None:
        self.heard_s = self._now()

    def send_now(self, operation: Mapping[str, Any]) -> None:
        if operation["op"] == "publish":
            self.car.follow(operation["msg"])

    def beside(self, listener: LinkListener) -> CarSource:
        return self

    async def call(self, service: str, arguments: Mapping[str, Any] | None = None, *, timeout_s: float = 2.0) -> Any:
        """Answers what every rosapi answers."""
        self.heard_s = self._now()
        if service == "/rosapi/topics":
            return {"topics": [*self._types], "types": [*self._types.values()]}
        if service == "/rosapi/get_time":
            return {"time": {"secs": int(self.car.now_s), "nsecs": 0}}
        raise CallFailed(f"{service} does not exist")

    def publish(self, messages: Iterable[Message]) -> None:
        """Deliver messages of the car, or of one of `others`, now."""
        now_s = self.heard_s = self._now()
        assert self._listener is not None
        if self._marks is not None and now_s >= self._mark_due_s:
            self._mark_due_s = now_s + MARK_EVERY_S
            self._marks.sent(now_s)
            self._marks.answered(now_s, now_s)
        for message in messages:
            if message.topic in self._rows:
                self._listener.message_received(message.topic, message.message, None)
