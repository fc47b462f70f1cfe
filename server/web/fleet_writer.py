"""The writer of one page of all cars: offers of frames, at most one unanswered, replies, and what happened to items."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable

import orjson
from starlette.websockets import WebSocket, WebSocketDisconnect

from server.bus.bus import ALL, PageBus
from server.protocol import messages
from server.protocol.messages import Hello
from server.web.cars_board import FLEET
from server.web.fair_wakeup import FairWakeup
from server.web.fleet_log import FleetLog
from server.web.page_writer import MAX_REPLIES


class FleetWriter:
    """Of one page; `wakeup` is shared by all pages, `wall_ms` is the time of day."""

    def __init__(
        self,
        socket: WebSocket,
        bus: PageBus,
        events: FleetLog,
        wakeup: FairWakeup,
        *,
        wall_ms: Callable[[], int],
    ) -> None:
        self._socket = socket
        self._wall_ms = wall_ms
        self._took_ms = wall_ms()
        self._bus = bus
        self._events = events
        self._wakeup = wakeup
        self._wake = asyncio.Event()
        self._replies: list[messages.ToPage] = []
        self._sent = 0  # the newest frame
        self._seq = 0
        self._is_offered = False  # an offer is unanswered
        self._is_taking = False  # the page requested the newest
        self._event: int | None = None  # the number of the newest event that was sent; None: none yet
        self.skipped = 0  # frames that were replaced by newer ones before this page took them

    def on_new(self, _: str) -> None:
        """A new frame."""
        if self._is_offered:
            self.skipped += 1
        else:
            self._wakeup.queue(self._wake)

    def on_events(self) -> None:
        self._wakeup.queue(self._wake, is_urgent=True)

    def take(self) -> None:
        """The page takes what was offered."""
        self._took_ms = self._wall_ms()
        self._is_offered = False
        self._is_taking = True
        self._wakeup.queue(self._wake)

    def queue(self, message: messages.ToPage) -> None:
        """To be sent before any frame."""
        self._replies.append(message)
        self._wake.set()

    @property
    def is_full(self) -> bool:
        """Whether the page sends requests without reading replies."""
        return len(self._replies) >= MAX_REPLIES

    async def run(self, hello: Callable[[], Hello]) -> None:
        """Sends until the socket fails, whose end the reader notices as well."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
            await self._send(hello())
            while True:
                await self._send_round()
                await self._wake.wait()
                self._wake.clear()

    def close(self) -> None:
        self._wakeup.leave(self._wake)

    async def _send_round(self) -> None:
        waiting, self._replies = self._replies, []
        for message in waiting:
            await self._send(message)
        await self._send_events()
        frame = self._bus.newest(ALL, FLEET)
        if self._is_taking:
            self._is_taking = False
            if frame is not None and frame.number > self._sent:
                self._sent = frame.number
                await self._socket.send_text(str(frame.payload))
        elif not self._is_offered and frame is not None and frame.number > self._sent:
            self._seq += 1
            self._is_offered = True
            await self._send({"kind": "offer", "seq": self._seq, "of": ["cars"], "took_ms": self._took_ms})

    async def _send_events(self) -> None:
        number, events = self._events.after(self._events.begins_after if self._event is None else self._event)
        if events or self._event is not None:
            self._event = number
        for event in events:
            await self._send(event)

    async def _send(self, message: messages.ToPage | Hello | messages.Offer | messages.FleetEvent) -> None:
        await self._socket.send_text(orjson.dumps(message).decode())
