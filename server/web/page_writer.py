"""The writer of one page: offers of frames and events, at most one of each unanswered, and replies to commands.

Of states it also sends as many ahead as the page allows (see docs/protocol.md), and nothing else. So a page that stops
reading costs nothing, delays nobody, and gets nothing else that is outdated when it resumes.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from typing import cast

import orjson
from starlette.websockets import WebSocket, WebSocketDisconnect

from server.bus.bus import UNSERVED, NotServed, PageBus
from server.bus.log_runs import Resumed
from server.protocol import messages
from server.protocol.alarm_state import LogEvent
from server.protocol.messages import FrameKind, Hello
from server.protocol.slow_down_state import FORMER_PHASES
from server.replay.view_source import ViewSource
from server.web.event_feed import EventFeed
from server.web.fair_wakeup import FairWakeup
from server.web.page_offers import PageOffers

_FORMER = {present: former for former, present in FORMER_PHASES.items()}

RESTARTED = 1012  # RFC 6455: the page dials again, and is greeted anew
HELLO_WITHIN_S = 10.0  # until then no event is sent: the hello names the newest that the page has; it waits 8 s at most
BATCH_EVERY_S = 0.2  # to a page that catches up: with its other messages it sends at most 25 a second
ROUNDING_S = 1e-6  # what rounding leaves of a wait is none
MAX_REPLIES = 200  # waiting for a page that does not read


def former_state(payload: str) -> str:
    """What a page of before a change of names gets: it may be open while the server is updated.

    A state with the former name of its slow-down's phase.
    """
    found = orjson.loads(payload)
    slow_down = found.get("decelerate")
    phase = slow_down.get("state") if isinstance(slow_down, dict) else None
    if not isinstance(phase, str) or phase not in _FORMER:
        return payload
    slow_down["state"] = _FORMER[phase]
    return orjson.dumps(found).decode()


class PageWriter:
    """Of one page. `now` is a monotonic clock [s], `wall_ms` the time of day; `wakeup` is shared by all pages."""

    def __init__(
        self,
        socket: WebSocket,
        bus: PageBus,
        vehicle: str,
        view: ViewSource,
        wakeup: FairWakeup,
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
    ) -> None:
        self._socket = socket
        self._bus = bus
        self._vehicle = vehicle
        self._view = view
        self._wakeup = wakeup
        self._now = now
        self._offers = PageOffers(now, wall_ms)
        self._since_s = now()
        self._wake = asyncio.Event()
        self._sent: dict[FrameKind, int] = dict.fromkeys(view.kinds, 0)  # the newest frame of each kind
        self._watches_scan = False
        self._later: asyncio.TimerHandle | None = None  # an offer or a state is due then
        self._is_taking = False  # the page requested the newest
        self._replies: list[messages.ToPage] = []
        self._event = 0  # the last number sent; from the greeting on
        self._have: int | None = None  # the newest event that the page has, as its hello names it, and its run
        self._have_run: str | None = None
        self._is_resuming = False  # where a page of another run goes on is not known yet
        self._resumed: messages.Resumed | None = None  # to be sent with the next events
        self._is_greeted = False
        self._run = ""  # of the vehicle's session when the page was greeted
        self._feed = EventFeed(bus, vehicle, now, lambda: self.on_new("events"))
        self._are_events_due = self._are_events_unanswered = False
        self._has_begun = False  # the page's hello came
        self._is_former = False
        self._is_state_waiting = False  # a state of the live car came that was not sent yet
        self.skipped = 0  # states of the live car that were replaced by newer ones before they were sent

    # -- what is new -------------------------------------------------------------------------------------------------

    def on_new(self, kind: str) -> None:
        """Something new of the live car: a kind of frame, or "events"."""
        if kind == "events":
            self._are_events_due = True
            self._wakeup.queue(self._wake, is_urgent=True)
        elif kind == UNSERVED:
            why = self._bus.trouble(self._vehicle)
            if why is not None and not self._replies:  # a page that does not read does not get it again
                self.queue({"kind": "unserved", "why": why})
        elif kind == "scan" and (self._view.is_replaying or not self._watches_scan):
            return
        else:
            if kind == "state" and not self._view.is_replaying:
                self.skipped += self._is_state_waiting
                self._is_state_waiting = True
            if not self._offers.is_open or (kind == "state" and self._offers.may_push):
                self._wakeup.queue(self._wake)

    def on_replay(self, kind: str) -> None:
        """Something new of the page's replay."""
        if kind == "failed" or self._offers.may_push or not self._offers.is_open:
            self._wake.set()

    def on_turned(self) -> None:
        """Switch the source of the page's frames: none of them was sent yet."""
        self._sent = dict.fromkeys(self._view.kinds, 0)
        self._is_state_waiting = False
        self._wake.set()

    # -- what the page answers ---------------------------------------------------------------------------------------

    def begin(self, have_event: object, run: object = None, *, is_former: bool = False) -> None:
        """Take the page's hello: its newest event, and the run of that. Only the first hello counts.
        `is_former`: it knows the former names of phases."""
        self._is_former = self._is_former or (is_former and not self._has_begun)
        if not self._has_begun and type(have_event) is int and have_event < 1 << 53:
            self._have, self._have_run = have_event, run if isinstance(run, str) and len(run) <= 40 else None
            if self._is_greeted:
                self._go_on()
        self._has_begun = True
        self._wake.set()

    def _go_on(self) -> None:
        """Events follow those that the page has, where that can be."""
        if self._have is None or self._have < 0:
            return
        if self._have_run and self._have_run != self._run:
            self._is_resuming = True
            self._feed.resume(self._have_run, self._have, self._on_resumed)
        elif self._have <= self._bus.last_event(self._vehicle):
            self._event = self._have
            self._are_events_due = True

    def _on_resumed(self, found: Resumed) -> None:
        self._is_resuming = False
        self._event = found.after
        self._resumed = {"common": found.common, "new_after": found.new_after}
        self._are_events_due = True
        self._wake.set()

    def take(self, message: Mapping[str, object]) -> None:
        """The page takes what was offered, or has a state that was sent ahead."""
        self._is_taking = self._offers.taken(message) or self._is_taking
        self._wakeup.queue(self._wake)

    def have_events(self) -> None:
        """The page has the events that were sent."""
        if self._feed.acknowledged(self._offers.trip_s):
            asyncio.get_running_loop().call_later(BATCH_EVERY_S, self.have_events)
            return
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

    async def run(self, hello: Callable[[], Hello]) -> None:
        """Sends until the socket fails, whose end the reader notices as well.

        Where the vehicle's session is elsewhere and sent nothing yet, the page is informed, and greeted once it has.
        """
        with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
            while not self._bus.knows(self._vehicle):
                await self._wake.wait()
                self._wake.clear()
                await self._send_round()  # the list of cars, from which another one may be chosen
            self._since_s = self._now()
            self._event, self._run = self._bus.last_event(self._vehicle), self._bus.run(self._vehicle)
            self._is_greeted = True
            asyncio.get_running_loop().call_later(HELLO_WITHIN_S, self._wake.set)  # for a client that sends no hello
            self._go_on()
            await self._send(hello())
            with contextlib.suppress(NotServed):  # there may have been no viewer for a while
                await self._bus.request(self._vehicle, {"kind": "refresh"}, deadline_s=0.5)
            await self._send_newest("state", unasked=True)
            while True:
                await self._wake.wait()
                self._wake.clear()
                await self._send_round()

    def close(self) -> None:
        """Leaves what wakes it."""
        self._feed.close()
        if self._later is not None:
            self._later.cancel()
        self._wakeup.leave(self._wake)
        self.watch_scan(False)

    async def _send_round(self) -> None:
        if self._is_greeted and self._bus.run(self._vehicle) != self._run:
            await self._socket.close(code=RESTARTED, reason="the agent of the car has started again")
            return
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
        may_send = self._is_greeted and has_begun and not (self._are_events_unanswered or self._is_resuming)
        if may_send and self._are_events_due:
            await self._send_events()
        if self._is_taking:
            self._is_taking = False
            for kind in self._view.kinds:
                if self._is_new(kind) and (kind != "state" or self._offers.has_room):
                    await self._send_newest(kind)
        elif self._offers.may_push and self._is_new("state") and self._is_time(self._offers.push_wait_s()):
            await self._send_newest("state")
        if self._offers.is_echo_due:
            await self._send_offer([])  # behind the state: it measures how long the last of those under way takes
        if not self._offers.is_open:
            await self._offer()

    async def _send_events(self) -> None:
        self._are_events_due = False
        events = self._feed.after(self._event)
        if events or self._resumed:
            self._are_events_unanswered = True
            self._feed.sent(events)
            self._event = events[-1]["n"] if events else self._event
            last = self._bus.last_event(self._vehicle)
            message: messages.Events = {"kind": "events", "events": cast(list[LogEvent], events), "last": last}
            if self._resumed:
                message["resumed"], self._resumed = self._resumed, None
            await self._send(message)

    async def _offer(self) -> None:
        waits = [kind for kind in self._view.kinds if self._is_new(kind)]
        fresh = [kind for kind in waits if kind != "state" or not self._offers.may_push]
        if fresh and self._is_time(self._offers.offer_wait_s()):
            await self._send_offer(fresh)

    async def _send_offer(self, of: list[FrameKind]) -> None:
        seq, took_ms, took = self._offers.offered(is_echo=not of), self._offers.took_ms, self._offers.took
        await self._send({"kind": "offer", "seq": seq, "of": of, "took_ms": took_ms, "took": took})

    def _is_time(self, wait_s: float) -> bool:
        """Whether nothing is to be waited for; else another round follows when it is over."""
        if is_early := wait_s > ROUNDING_S:
            if self._later is not None:
                self._later.cancel()
            self._later = asyncio.get_running_loop().call_later(wait_s, self._wake.set)
        return not is_early

    def _is_new(self, kind: FrameKind) -> bool:
        is_held = kind == "scan" and not (self._watches_scan and (self._view.is_replaying or self._offers.carries_scan))
        return not is_held and self._view.number(kind) > self._sent[kind]

    async def _send_newest(self, kind: FrameKind, *, unasked: bool = False) -> None:
        number, frame = self._view.number(kind), self._view.newest(kind)
        is_new = frame is not None and (unasked or frame.number > self._sent[kind])
        self._sent[kind] = max(self._sent[kind], number)  # also of one without a payload: it is not offered again
        if frame is None or not is_new:
            return
        self._sent[kind] = frame.number
        self._offers.sent(kind)
        if kind == "state":
            self._is_state_waiting = False
        if isinstance(frame.payload, bytes):
            await self._socket.send_bytes(frame.payload)
        else:
            is_renamed = self._is_former and kind == "state"
            await self._socket.send_text(former_state(frame.payload) if is_renamed else frame.payload)

    async def _send(self, message: messages.ToPage | Hello | messages.Offer | messages.Events) -> None:
        await self._socket.send_text(orjson.dumps(message).decode())
