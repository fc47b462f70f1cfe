"""The subscriptions of a link as its bridge gets them: at once, or a few at a time where it may refuse them.

Some bridges close a connection for which too many refusals wait.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from server.rosbridge.link_listener import Marks
from server.rosbridge.subscription import Subscription, operation_of

AT_ONCE = 4  # rosbridge-server-rs closes a connection with 16 that wait to be sent
PAUSE_S = 0.02


class Paced:
    """What a bridge may refuse, a few at a time.

    `send(topic, is_renewed)` is called on the running loop, for each topic once, in the order in which they were
    put.
    """

    def __init__(self, send: Callable[[str, bool], None]) -> None:
        self._send = send
        self._waiting: dict[str, bool] = {}  # topic → whether its subscription is renewed
        self._next: asyncio.Handle | None = None
        self._left = AT_ONCE  # may be sent until then

    def put(self, topic: str, *, is_renewed: bool = False) -> None:
        """A renewal that waits stays one."""
        self._waiting[topic] = is_renewed or self._waiting.get(topic, False)
        self._send_some()

    def take_back(self, topic: str) -> None:
        """It is not to be sent any more, if it still waits."""
        self._waiting.pop(topic, None)

    def clear(self) -> None:
        """The connection ended, or another one begins."""
        self._waiting.clear()
        if self._next is not None:
            self._next.cancel()
        self._next, self._left = None, AT_ONCE

    def _go_on(self) -> None:
        self._next, self._left = None, AT_ONCE
        self._send_some()

    def _send_some(self) -> None:
        while self._waiting and self._left:
            topic, self._left = next(iter(self._waiting)), self._left - 1
            if self._next is None:
                self._next = asyncio.get_running_loop().call_later(PAUSE_S, self._go_on)
            self._send(topic, self._waiting.pop(topic))


class SentRows:
    """The table of one link. A bridge refuses a topic without a type that has no publisher: those are paced."""

    def __init__(
        self, send: Callable[[dict[str, Any]], None], is_open: Callable[[], bool], marks: Marks | None
    ) -> None:
        self._send = send
        self._is_open = is_open
        self._marks = marks
        self._paced = Paced(self._send_paced)
        self._known: set[str] = set()  # topics that were requested from this connection's bridge
        self.table: dict[str, Subscription] = {}

    def opened(self) -> None:
        self.closed()
        for row in self.table.values():
            self._begin(row)

    def closed(self) -> None:
        self._paced.clear()
        self._known.clear()

    def subscribe(self, wanted: Subscription) -> None:
        previous = self.table.get(wanted.topic)
        self.table[wanted.topic] = wanted
        if self._is_open():
            if previous is not None and not previous.is_like(wanted):
                self._end(previous)
            self._begin(wanted)  # under the same id: its throttle and queue replace the old ones

    def unsubscribe(self, topic: str) -> None:
        row = self.table.pop(topic, None)
        if row is not None and self._is_open():
            self._end(row)

    def renew(self, topic: str) -> None:
        row = self.table.get(topic)
        if row is None or not self._is_open():
            return
        if row.type is None:
            self._paced.put(topic, is_renewed=True)
        else:
            self._operate("unsubscribe", row)
            self._operate("subscribe", row)

    def again(self, topic: str) -> bool:
        """Subscribe once more under the same id: what a publisher keeps is given, and no message is missed."""
        row = self.table.get(topic)
        if row is not None and self._is_open():
            self._begin(row)
        return True

    def _begin(self, row: Subscription) -> None:
        if row.type is None:
            self._paced.put(row.topic)
        else:
            self._operate("subscribe", row)

    def _end(self, row: Subscription) -> None:
        self._paced.take_back(row.topic)
        if row.topic in self._known:
            self._operate("unsubscribe", row)

    def _send_paced(self, topic: str, is_renewed: bool) -> None:
        row = self.table.get(topic)
        if row is None or not self._is_open():
            return
        if is_renewed and topic in self._known:
            self._operate("unsubscribe", row)
        self._operate("subscribe", row)

    def _operate(self, operation: str, row: Subscription) -> None:
        if operation == "unsubscribe":
            self._known.discard(row.topic)
        else:
            self._known.add(row.topic)
            if self._marks is not None:
                self._marks.subscribe(row.topic, row.queue_length, row.throttle_ms / 1000)
        self._send(operation_of(operation, row))
