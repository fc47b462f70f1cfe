"""What a bridge may refuse, a few at a time: some close a connection for which too many refusals wait."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

AT_ONCE = 4  # rosbridge-server-rs closes a connection with 16 that wait to be sent
PAUSE_S = 0.02


class Paced:
    """`send(topic, is_renewed)` is called on the running loop, for each topic once, in the order in which they were
    put."""

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
