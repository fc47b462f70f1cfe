"""One client's subscription to one topic: which messages it gets, how often and in which encoding."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass

from server.rosbridge_server.encoding import Encoding, Outgoing
from server.rosbridge_server.outbox import Counters, Lane, Outbox
from server.rosbridge_server.shape import Lost

STRONGEST: tuple[Encoding, ...] = ("cbor-raw", "cbor", "png", "json")


@dataclass(frozen=True, slots=True, kw_only=True)
class SubscriptionRequest:
    """The request of one subscribe operation."""

    type: str | None  # canonical; None: whatever the topic has
    throttle_s: float
    queue_length: int  # 0: no limit but the client's byte limit
    encoding: Encoding


class Subscription:
    """A client can subscribe to a topic several times under several ids, and gets each message once, as from rosbridge:
    with the highest requested rate and the shortest queue, in the first of STRONGEST that any request is for."""

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
