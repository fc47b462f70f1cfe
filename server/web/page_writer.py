"""The writer of one page: offers of frames and events, at most one of each unanswered, and replies to commands.

Nothing else is pushed (see docs/protocol.md), so a page that stops reading costs nothing, delays nobody, and gets
nothing outdated when it resumes.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import cast

import orjson
from starlette.websockets import WebSocket, WebSocketDisconnect

from server.bus.bus import NotServed, PageBus
from server.protocol import messages
from server.protocol.alarm_state import LogEvent
from server.protocol.messages import FrameKind, Hello
from server.replay.view_source import ViewSource
from server.web.event_feed import EventFeed
from server.web.fair_wakeup import FairWakeup

EVENTS_A_BATCH = 100
HELLO_WITHIN_S = 1.0  # until then no event is sent: the page's hello names the newest that it has
MAX_REPLIES = 200  # waiting for a page that does not read


class PageWriter:
    """Of one page. `now` is a monotonic clock in seconds; `wakeup` is shared by all pages."""

    def __init__(
        self,
        socket: WebSocket,
        bus: PageBus,
        vehicle: str,
        view: ViewSource,
        wakeup: FairWakeup,
        *,
        now: Callable[[], float],
    ) -> None:
        self._socket = socket
        self._bus = bus
        self._vehicle = vehicle
        self._view = view
        self._wakeup = wakeup
        self._now = now
        self._since_s = now()
        self._wake = asyncio.Event()
        self._sent: dict[FrameKind, int] = dict.fromkeys(view.kinds, 0)  # the newest frame of each kind
        self._watches_scan = False
        self._seq = 0
        self._is_offered = False  # an offer is unanswered
        self._is_taking = False  # the page requested the newest
        self._replies: list[messages.ToPage] = []
        self._event = bus.last_event(vehicle)  # the last number sent
        self._feed = EventFeed(bus, vehicle, on_read=lambda: self.on_new("events"))
        self._are_events_due = False
        self._are_events_unanswered = False
        self._has_begun = False  # the page said hello
        self.skipped = 0  # frames that were replaced by newer ones before the page took them

    # -- what is new -------------------------------------------------------------------------------------------------

    def on_new(self, kind: str) -> None:
        """Something new of the live car: a kind of frame, or "events"."""
        if kind == "events":
            self._are_events_due = True
            self._wakeup.queue(self._wake, is_urgent=True)
        elif kind == "scan" and self._view.is_replaying:
            return
        elif self._is_offered or (kind == "scan" and not self._watches_scan):
            if kind == "state":
                self.skipped += 1
        else:
            self._wakeup.queue(self._wake)

    def on_replay(self, kind: str) -> None:
        """Something new of the page's replay."""
        if kind == "failed" or not self._is_offered:
            self._wake.set()

    def on_turned(self) -> None:
        """Switch the source of the page's frames: none of them was sent yet."""
        self._sent = dict.fromkeys(self._view.kinds, 0)
        self._wake.set()

    # -- what the page answers ---------------------------------------------------------------------------------------

    def begin(self, have_event: object) -> None:
        """The page said hello, and which event is the newest that it has; only the first hello counts."""
        if not self._has_begun and type(have_event) is int and 0 <= have_event <= self._bus.last_event(self._vehicle):
            self._event = have_event
            self._are_events_due = True
        self._has_begun = True
        self._wake.set()

    def take(self) -> None:
        """The page takes what was offered."""
        self._is_offered = False
        self._is_taking = True
        self._wakeup.queue(self._wake)

    def have_events(self) -> None:
        """The page has the events that were sent."""
        self._are_events_unanswered = False
        self._are_events_due = True
        self._wake.set()

    def watch_scan(self, wanted: bool) -> None:
        """Scans are sent only to a page that shows them."""
        if wanted != self._watches_scan:
            self._watches_scan = wanted
            self._view.watch_scan(wanted)

    def queue(self, message: messages.ToPage) -> None:
        """To be sent before any frame."""
        self._replies.append(message)
        self._wake.set()

    @property
    def is_full(self) -> bool:
        """Whether the page sends requests without reading replies."""
        return len(self._replies) >= MAX_REPLIES

    # -- the loop ----------------------------------------------------------------------------------------------------

    async def run(self, hello: Hello) -> None:
        """Sends until the socket fails, whose end the reader notices as well."""
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
            await self._send(hello)
            with contextlib.suppress(NotServed):
                await self._bus.request(self._vehicle, {"kind": "refresh"})  # there may have been no viewer for a while
            await self._send_newest("state", unasked=True)
            while True:
                await self._wake.wait()
                self._wake.clear()
                await self._send_round()

    def close(self) -> None:
        """Leaves what wakes it."""
        self._feed.close()
        self._wakeup.leave(self._wake)
        self.watch_scan(False)

    async def _send_round(self) -> None:
        if self._view.ended is not None:
            self._replies.append(messages.replay_ended(self._view.ended))
            await self._view.leave()
        if self._view.beside_ended is not None:
            self._replies.append(messages.beside_ended(self._view.beside_ended))
            await self._view.close_beside()
        waiting, self._replies = self._replies, []
        for message in waiting:
            await self._send(message)
        has_begun = self._has_begun or self._now() >= self._since_s + HELLO_WITHIN_S
        if self._are_events_due and has_begun and not self._are_events_unanswered:
            await self._send_events()
        if self._is_taking:
            self._is_taking = False
            for kind in self._view.kinds:
                if self._is_new(kind):
                    await self._send_newest(kind)
        if not self._is_offered:
            await self._offer()

    async def _send_events(self) -> None:
        self._are_events_due = False
        events = self._feed.after(self._event, EVENTS_A_BATCH)
        if events:
            self._are_events_unanswered = True
            self._event = events[-1]["n"]
            last = self._bus.last_event(self._vehicle)
            await self._send({"kind": "events", "events": cast(list[LogEvent], events), "last": last})

    async def _offer(self) -> None:
        fresh = [kind for kind in self._view.kinds if self._is_new(kind)]
        if fresh:
            self._seq += 1
            self._is_offered = True
            await self._send({"kind": "offer", "seq": self._seq, "of": fresh})

    def _is_new(self, kind: FrameKind) -> bool:
        if kind == "scan" and not self._watches_scan:
            return False
        return self._view.number(kind) > self._sent[kind]

    async def _send_newest(self, kind: FrameKind, *, unasked: bool = False) -> None:
        frame = self._view.newest(kind)
        if frame is None or (frame.number <= self._sent[kind] and not unasked):
            return
        self._sent[kind] = frame.number
        if isinstance(frame.payload, bytes):
            await self._socket.send_bytes(frame.payload)
        else:
            await self._socket.send_text(frame.payload)

    async def _send(self, message: messages.ToPage | Hello | messages.Offer | messages.Events) -> None:
        await self._socket.send_text(orjson.dumps(message).decode())
