"""The pages of one server: each is offered what is new, takes the newest, and is told every event once.

Nothing is pushed but offers and events, at most one of each unanswered (docs/protocol.md says why), so a page that
stops
reading costs nothing, delays nobody, and finds nothing old when it comes back.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import re
import secrets
from collections import Counter
from collections.abc import Callable, Mapping
from typing import Any

import orjson
from starlette.websockets import WebSocket, WebSocketDisconnect

from server.access.identity import LOCAL, Who
from server.bus.bus import LocalBus, NotServed
from server.control import display_name
from server.protocol import commands
from server.protocol.rate_limit import MAX_DEPTH, SLOW_DOWN, Allowance, Limits, nests_deeper
from server.replay import commands as orders
from server.replay.manager import NoReplay, ReplayManager
from server.replay.view_source import ViewSource
from server.web.event_feed import EventFeed
from server.web.fair_wakeup import Turns

log = logging.getLogger("catgraph.hub")

EVENTS_A_BATCH = 100
HELLO_WITHIN_S = 1.0  # until then no event is sent: the page's hello tells which it has
MAX_PAGES = 500
MAX_COMPLAINTS = 200  # a page that sends nothing sensible is let go
LONGEST_SLOW_DOWN = 400  # letters of an order to slow the car
MAX_REPLIES = 200  # and so is one that asks and never reads
# Where the phone is, the live monitor must know whatever its page shows; and a page that is asked for control answers.
FROM_A_REPLAY = ("position", "control", "veto")
GOING_AWAY = 1001  # a browser closes so when its page is closed, and not when its phone falls asleep (RFC 6455, 7.4.1)
FAREWELL = {"kind": "present", "visible": False, "sound": "asks", "awake": "asks", "leaves": True}
TOO_MANY = "Too many orders at once from this page: wait a second."
NOT_A_VIEWERS = "This device is paired as a viewer: it looks, and changes nothing."
NOT_FROM_A_REPLAY = "This page replays a recording: nothing is ordered from it. Go back to live first."


class Page:
    """One page's connection, from its acceptance to its end."""

    def __init__(
        self,
        socket: WebSocket,
        bus: LocalBus,
        vehicle: str,
        *,
        hello: Mapping[str, Any],
        who: Who,
        replays: ReplayManager,
        server: Callable[[], Mapping[str, Any]],
        limits: Limits,
        now: Callable[[], float],
        turns: Turns,
        replay: orders.Open | None = None,
    ):
        """`turns`: of all pages, for what is new to all of them. `replay`: the recording with which the page begins."""
        self._socket = socket
        self._bus = bus
        self._vehicle = vehicle
        self._hello = hello
        self._who = who
        self._wake = asyncio.Event()
        self._view = ViewSource(bus, vehicle, replays, server=server, on_new=self._on_replay, on_turned=self._turned)
        self._begins_with = replay
        self._opening: asyncio.Task[None] | None = None
        self._sent = dict.fromkeys(self._view.kinds, 0)  # number of the newest frame of a kind this page got
        self._watches_scan = False
        self._seq = 0
        self._offered = False  # an offer stands unanswered
        self._take = False  # the page asked for the newest
        self._replies: list[dict[str, Any]] = []
        self._event = bus.last_event(vehicle)  # the last number sent
        self._feed = EventFeed(bus, vehicle, on_read=lambda: self._something_new("events"))
        self._events_due = False
        self._events_unanswered = False
        self._said_hello = False
        self._is_counted = False
        self._name = display_name.NAMELESS  # what the page calls itself: who gave its orders, in the log
        self._page = secrets.token_hex(8)  # by which it knows itself, and keeps control over a reload
        self._complaints = 0
        self._is_leaving = False
        self._now = now
        self._since_s = now()
        self._turns = turns
        self._messages = Allowance(limits.messages, now())
        self._orders = Allowance(limits.commands, now())
        self._slow_downs = Allowance(limits.slow_down, now())
        self.skipped = 0  # frames that were replaced by newer ones before this page could take them

    async def serve(self) -> None:
        """Runs until the page leaves."""
        unwatch = self._bus.watch(self._vehicle, self._something_new)
        writer = asyncio.create_task(self._write(), name="page writer")
        reader = asyncio.create_task(self._read(), name="page reader")
        writer.add_done_callback(lambda task: self._writer_ended(task, reader))
        try:
            await reader
        except (WebSocketDisconnect, RuntimeError):
            pass  # it left, perhaps while something was being sent
        except asyncio.CancelledError:
            if not writer.done():
                raise  # the server ends; else the writer failed, and the page shall connect again
            with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
                await self._socket.close(code=1011, reason="the server failed to send")
        finally:
            self._is_leaving = True
            reader.cancel()
            unwatch()
            self._feed.close()
            self._turns.leave(self._wake)
            if self._opening is not None:
                self._opening.cancel()
                await asyncio.gather(self._opening, return_exceptions=True)
            writer.cancel()
            with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError, OSError):
                await writer
            self._watch_scan(False)
            await self._view.leave()

    def _writer_ended(self, writer: asyncio.Task[None], reader: asyncio.Task[None]) -> None:
        """A page that gets nothing more is no page: it is closed, so that it connects again."""
        if self._is_leaving:
            return
        if writer.cancelled() or writer.exception() is not None:
            error = None if writer.cancelled() else writer.exception()
            log.error("the writer of a page ended: %s", error or "it was cancelled", exc_info=error)
            reader.cancel()

    # -- from the bus ------------------------------------------------------------------------------------------------

    def _something_new(self, kind: str) -> None:
        if kind == "events":
            self._events_due = True
            self._turns.queue(self._wake, is_urgent=True)
        elif kind == "scan" and self._view.is_replaying:
            return
        elif self._offered or (kind == "scan" and not self._watches_scan):
            if kind == "state":
                self.skipped += 1
        else:
            self._turns.queue(self._wake)

    def _on_replay(self, kind: str) -> None:
        if kind == "failed" or not self._offered:
            self._wake.set()

    def _turned(self) -> None:
        """Another thing is looked at: none of its frames was sent."""
        self._sent = dict.fromkeys(self._view.kinds, 0)
        self._wake.set()

    # -- from the page -----------------------------------------------------------------------------------------------

    async def _read(self) -> None:
        while self._complaints < MAX_COMPLAINTS and len(self._replies) < MAX_REPLIES:
            received = await self._socket.receive()
            if received["type"] == "websocket.disconnect":
                if received.get("code") == GOING_AWAY:
                    await self._present(FAREWELL)
                return
            text = received.get("text")
            if not self._messages.takes(self._now()) and not _may_slow_down(text):
                self._complain("Too many messages at once.")
                continue
            if text is None or len(text) > commands.MAX_COMMAND_BYTES:
                self._complain("A page's message is text of at most 16 kB.")
                continue
            try:
                message = orjson.loads(text)
            except orjson.JSONDecodeError:
                self._complain("That was not JSON.")
                continue
            if not isinstance(message, dict):
                self._complain("A message is an object with a kind.")
                continue
            if nests_deeper(message, MAX_DEPTH):
                self._complain("A message does not nest so deep.")
                continue
            await self._obey(message)
        await self._socket.close(code=1008, reason="too many messages that make no sense")

    async def _obey(self, message: dict[str, Any]) -> None:
        match message.get("kind"):
            case "take":
                self._offered = False
                self._take = True
                self._turns.queue(self._wake)
            case "have":
                self._events_unanswered = False
                self._events_due = True
                self._wake.set()
            case "watch":
                self._watch_scan(message.get("scan") is True)
            case "hello":
                await self._hear_hello(message)
            case "present":
                await self._present(message)
            case "replay":
                await self._replay(message)
            case _:
                await self._command(message)

    async def _hear_hello(self, message: Mapping[str, Any]) -> None:
        page = message.get("page")
        if isinstance(page, str) and re.fullmatch(commands.PAGE, page) and not self._said_hello:
            if self._is_counted:
                await self._present(FAREWELL)  # it told how it stands before it told who it is: that was nobody else
            self._page = page
        self._name = display_name.clean(message.get("name")) or self._name
        have = message.get("have_event")
        if type(have) is int and 0 <= have <= self._bus.last_event(self._vehicle) and not self._said_hello:
            self._event = have
            self._events_due = True
        self._said_hello = True
        self._wake.set()

    async def _command(self, message: dict[str, Any]) -> None:
        identity = self._identity(message)
        if identity is None:
            return
        if not self._who.is_operator:  # whatever it is: no command of the union needs less than an operator
            self._reply(identity, {"ok": False, "reason": NOT_A_VIEWERS})
            return
        kind = message.get("kind")
        if not isinstance(kind, str) or kind not in commands.KINDS:  # what the server asks of a session is not a page's
            self._reply(identity, {"ok": False, "reason": commands.NO_SUCH})
            return
        allowance = self._slow_downs if message.get("kind") in SLOW_DOWN else self._orders
        if not allowance.takes(self._now()):
            self._reply(identity, {"ok": False, "reason": TOO_MANY})
            return
        if self._view.is_replaying and message.get("kind") not in FROM_A_REPLAY:
            self._reply(identity, {"ok": False, "reason": NOT_FROM_A_REPLAY})
            return
        try:
            answer = await self._bus.request(self._vehicle, message | self._sender)
        except NotServed as why:
            answer = {"ok": False, "reason": f"{str(why).capitalize()}."}
        self._reply(identity, answer)

    async def _present(self, message: Mapping[str, Any]) -> None:
        """How the page stands, once a second: nobody answers it. A viewer's page is not counted on to hear alarms."""
        if not self._who.is_operator:
            return
        self._is_counted = True
        try:
            answer = await self._bus.request(self._vehicle, {**message, **self._sender})
        except NotServed:
            return
        if answer.get("ok") is not True:
            self._complain(str(answer.get("reason")))

    @property
    def _sender(self) -> dict[str, Any]:
        """Who sent what comes on this socket; it stands above whatever the page itself says of that."""
        return {
            "by": self._name if self._who is LOCAL else self._who.name,
            "who": self._who.id,
            "page": self._page,
            "replaying": self._view.is_replaying,
            "console": False,
        }

    async def _replay(self, message: Mapping[str, Any]) -> None:
        """An order to this page's own replay."""
        identity = self._identity(message)
        if identity is None:
            return
        if not self._orders.takes(self._now()):
            self._reply(identity, {"ok": False, "reason": TOO_MANY})
            return
        try:
            order = orders.read({name: value for name, value in message.items() if name not in ("id", "kind")})
        except orders.NotUnderstood as why:
            self._reply(identity, {"ok": False, "reason": str(why)})
            return
        match order:
            case orders.Open() if self._opening is not None and not self._opening.done():
                self._reply(identity, {"ok": False, "reason": "A recording is being opened already."})
            case orders.Open():  # it takes a second; meanwhile this page goes on taking what is live
                self._opening = asyncio.create_task(self._open(identity, order), name="open a replay")
            case orders.Leave():
                await self._view.leave()
                self._reply(identity, {"ok": True})
            case _:
                self._reply(identity, await self._view.ask(order))

    async def _open(self, identity: str | None, order: orders.Open) -> None:
        """`identity` None: it was asked for by the address, and only a refusal is answered."""
        try:
            await self._view.open(order)
            if identity is not None:
                self._reply(identity, {"ok": True})
        except NoReplay as why:
            if identity is not None:
                self._reply(identity, {"ok": False, "reason": str(why)})
            else:
                self._replies.append({"kind": "replay", "ended": str(why)})
                self._wake.set()

    def _identity(self, message: Mapping[str, Any]) -> str | None:
        identity = message.get("id")
        if isinstance(identity, str) and len(identity) <= 80:
            return identity
        self._complain("A command carries an id of at most 80 letters.")
        return None

    def _reply(self, identity: str, answer: Mapping[str, Any]) -> None:
        self._replies.append({**answer, "kind": "reply", "id": identity})
        self._wake.set()

    def _complain(self, reason: str) -> None:
        self._complaints += 1
        self._replies.append({"kind": "problem", "reason": reason})
        self._wake.set()

    def _watch_scan(self, wanted: bool) -> None:
        if wanted != self._watches_scan:
            self._watches_scan = wanted
            self._view.watch_scan(wanted)

    # -- to the page -------------------------------------------------------------------------------------------------

    async def _write(self) -> None:
        try:
            await self._send(self._hello)
            if self._begins_with is not None:
                self._opening = asyncio.create_task(self._open(None, self._begins_with), name="open a replay")
            with contextlib.suppress(NotServed):
                await self._bus.request(self._vehicle, {"kind": "refresh"})  # nobody may have looked for a while
            await self._send_newest("state", unasked=True)
            while True:
                await self._wake.wait()
                self._wake.clear()
                await self._write_round()
        except (WebSocketDisconnect, RuntimeError, OSError):
            return  # the reader notices the same end

    async def _write_round(self) -> None:
        if self._view.ended is not None:
            self._replies.append({"kind": "replay", "ended": self._view.ended})
            await self._view.leave()
        replies, self._replies = self._replies, []
        for reply in replies:
            await self._send(reply)
        has_begun = self._said_hello or self._now() >= self._since_s + HELLO_WITHIN_S
        if self._events_due and has_begun and not self._events_unanswered:
            await self._send_events()
        if self._take:
            self._take = False
            for kind in self._view.kinds:
                if self._is_new(kind):
                    await self._send_newest(kind)
        if not self._offered:
            await self._offer()

    async def _send_events(self) -> None:
        self._events_due = False
        events = self._feed.after(self._event, EVENTS_A_BATCH)
        if events:
            self._events_unanswered = True
            self._event = events[-1]["n"]
            await self._send({"kind": "events", "events": events, "last": self._bus.last_event(self._vehicle)})

    async def _offer(self) -> None:
        fresh = [kind for kind in self._view.kinds if self._is_new(kind)]
        if fresh:
            self._seq += 1
            self._offered = True
            await self._send({"kind": "offer", "seq": self._seq, "of": fresh})

    def _is_new(self, kind: str) -> bool:
        if kind == "scan" and not self._watches_scan:
            return False
        return self._view.number(kind) > self._sent[kind]

    async def _send_newest(self, kind: str, *, unasked: bool = False) -> None:
        frame = self._view.newest(kind)
        if frame is None or (frame.number <= self._sent[kind] and not unasked):
            return
        self._sent[kind] = frame.number
        if isinstance(frame.payload, bytes):
            await self._socket.send_bytes(frame.payload)
        else:
            await self._socket.send_text(frame.payload)

    async def _send(self, message: Mapping[str, Any]) -> None:
        await self._socket.send_text(orjson.dumps(message).decode())


def _may_slow_down(text: str | None) -> bool:
    """Whether a message beyond the allowance is read all the same: it may be an order to slow the car."""
    return text is not None and len(text) <= LONGEST_SLOW_DOWN and '"slow_down"' in text


class Hub:
    """All pages of the server."""

    def __init__(
        self,
        bus: LocalBus,
        *,
        replays: ReplayManager,
        server: Callable[[], Mapping[str, Any]],
        limits: Limits,
        now: Callable[[], float],
    ) -> None:
        """`server`: what a state tells of the server; `now` is a monotonic clock in seconds."""
        self._bus = bus
        self._limits = limits
        self._now = now
        self._replays = replays
        self._server = server
        self._pages: set[Page] = set()
        self._turns = Turns()
        self._by_device: Counter[str] = Counter()

    @property
    def pages(self) -> int:
        return len(self._pages)

    @property
    def skipped(self) -> int:
        return sum(page.skipped for page in self._pages)

    async def serve(
        self,
        socket: WebSocket,
        vehicle: str,
        hello: Mapping[str, Any],
        *,
        who: Who,
        replay: orders.Open | None = None,
    ) -> None:
        """Serves one page until it leaves; `replay`: the recording it begins with."""
        await socket.accept()
        if len(self._pages) >= MAX_PAGES or self._has_too_many(who):
            await socket.close(code=1013, reason="too many pages")
            return
        page = Page(
            socket,
            self._bus,
            vehicle,
            hello=hello,
            who=who,
            replays=self._replays,
            server=self._server,
            limits=self._limits,
            now=self._now,
            turns=self._turns,
            replay=replay,
        )
        self._pages.add(page)
        self._by_device[who.id] += 1
        try:
            await page.serve()
        finally:
            self._pages.discard(page)
            self._by_device -= Counter((who.id,))

    def _has_too_many(self, who: Who) -> bool:
        return who is not LOCAL and self._by_device[who.id] >= self._limits.pages
