"""One client's subscription to one topic: which messages it gets, how often and in which encoding."""

from __future__ import annotations

import asyncio
from collections import deque
from dataclasses import dataclass

from server.rosbridge_server.encoding import Encoding, Outgoing
from server.rosbridge_server.outbox import Counters, Lane, Outbox


@dataclass(frozen=True, slots=True, kw_only=True)
class Wish:
    """What one subscribe operation asked for."""

    type: str | None  # canonical; None: whatever the topic has
    throttle_s: float
    queue_length: int  # 0: no limit but the client's byte limit
    encoding: Encoding


class Subscription:
    """A client may ask for one topic several times under several ids, and gets each message once, as from rosbridge:
    with the highest rate and the shortest queue that was asked for, in CBOR when any asked for CBOR."""

    def __init__(self, spelling: str, outbox: Outbox, counters: Counters, loop: asyncio.AbstractEventLoop) -> None:
        self.spelling = spelling  # the topic's name as this client writes it
        self.wishes: dict[object, Wish] = {}
        self._is_muted = False  # the topic turned out to have another type than the one asked for
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
        """Takes the wishes into account after they, or the topic's type, changed."""
        wishes = self.wishes.values()
        self._is_muted = type is not None and all(wish.type not in (None, type) for wish in wishes)
        self._throttle_s = min((wish.throttle_s for wish in wishes), default=0.0)
        self._lane.limit = min((wish.queue_length for wish in wishes), default=0)
        self._encoding = "cbor" if any(wish.encoding == "cbor" for wish in wishes) else "json"
        if not self._throttle_s or not self._lane.limit:
            self._release_all()

    def offer(self, message: Outgoing) -> None:
        """Sends, holds or leaves out one message."""
        if self._is_muted:
            return
        if not self._throttle_s:
            self._outbox.send(self._lane, message.frame(self.spelling, self._encoding))
            return
        now = self._loop.time()
        if now >= self._next_at and not self._held:
            self._next_at = now + self._throttle_s
            self._outbox.send(self._lane, message.frame(self.spelling, self._encoding))
        elif not self._lane.limit:
            self._counters.throttled += 1
        else:
            self._held.append(message.frame(self.spelling, self._encoding))
            if len(self._held) > self._lane.limit:
                self._held.popleft()
                self._counters.throttled += 1
            if self._timer is None:
                self._timer = self._loop.call_at(self._next_at, self._release_one)

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
