"""One client's subscription at a real bridge: several ids, one stream of frames in the strongest requested form."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from server.judge.message import RosVersion
from server.rosbridge_server.real.outgoing import RealOutgoing
from server.rosbridge_server.real.shape import Lost


@dataclass(frozen=True, slots=True, kw_only=True)
class Asked:
    """The request of one subscribe operation."""

    throttle_s: float
    queue_length: int
    compression: str


class RealSubscription:
    """`send` takes an object to be written as JSON, or the bytes of a binary frame."""

    def __init__(self, spelling: str, version: RosVersion, send: Callable[[Any], None]) -> None:
        self.asked: dict[object, Asked] = {}
        self._spelling = spelling
        self._version = version
        self._send = send
        self._throttle_s = 0.0
        self._queue_length = 0
        self._compression = "none"
        self._last_at = -1e9
        self._queue: deque[RealOutgoing] = deque()
        self._timer: asyncio.TimerHandle | None = None

    def settle(self) -> None:
        """Apply the requests: the highest rate, the shortest queue, the strongest compression."""
        if not self.asked:
            return
        asked = self.asked.values()
        self._throttle_s = min(one.throttle_s for one in asked)
        self._queue_length = min(one.queue_length for one in asked)
        compressions = {one.compression for one in asked}
        strongest = (name for name in ("cbor-raw", "cbor", "png") if name in compressions)
        self._compression = next(strongest, "none")

    def on_message(self, message: RealOutgoing) -> None:
        """Sends, queues or leaves out a message. Raises Lost."""
        now = asyncio.get_running_loop().time()
        if self._throttle_s <= 0:
            self._write(message)
        elif self._queue_length <= 0:
            if now >= self._last_at + self._throttle_s:
                self._last_at = now
                self._write(message)
        else:
            self._queue.append(message)
            while len(self._queue) > self._queue_length:
                self._queue.popleft()
            if self._timer is None:
                self._release()

    def close(self) -> None:
        if self._timer is not None:
            self._timer.cancel()
            self._timer = None
        self._queue.clear()

    def _release(self) -> None:
        self._timer = None
        loop = asyncio.get_running_loop()
        due = self._last_at + self._throttle_s
        if loop.time() < due:
            self._timer = loop.call_at(due, self._release)
            return
        if self._queue:
            message = self._queue.popleft()
            self._last_at = loop.time()
            try:
                self._write(message)
            except Lost:
                pass
            if self._queue:
                self._timer = loop.call_at(self._last_at + self._throttle_s, self._release)

    def _write(self, message: RealOutgoing) -> None:
        if self._compression == "cbor-raw":
            self._send(message.raw_frame(self._spelling))
        elif self._compression == "cbor":
            self._send(message.cbor_frame(self._spelling))
        elif self._compression == "png":
            if self._version == 2:
                raise Lost("sequence item 0: expected str instance, bytes found")
            self._send({"op": "png", "data": message.png_text(self._spelling)})
        else:
            self._send({"op": "publish", "topic": self._spelling, "msg": message.json_values()})
