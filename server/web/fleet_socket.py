"""The connection of a page of all cars, from its acceptance to its end, its writer, its commands; see docs/protocol.md.

The writer offers frames, at most one of them unanswered, and sends replies and what happened to items.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from typing import Any

import orjson
from starlette.websockets import WebSocket, WebSocketDisconnect

from server.access.identity import Principal
from server.access.people import NOBODY, People
from server.bus.bus import ALL, PageBus
from server.control import display_name
from server.protocol import commands, messages
from server.protocol.messages import Hello
from server.protocol.rate_limit import Limits
from server.web import page_inbox
from server.web.cars_board import FLEET, CarsBoard
from server.web.fair_wakeup import FairWakeup
from server.web.fleet_log import FleetLog
from server.web.page_commands import NO_HELLO, NOT_A_VIEWERS, TOO_MANY, CommandsOfPage, lane_of, passed_on
from server.web.page_inbox import PageInbox
from server.web.page_sender import PageSender
from server.web.page_writer import MAX_REPLIES

NOT_FROM_HERE = "Open the car's own page for this."
UNNAMED = "Name the car that is meant."
PAGE_ONLY = {"announces", "id", "kind"}  # of a status: not for the cars


class FleetCommands(CommandsOfPage):
    """Has each command of one page carried out by the session of the car that it names."""

    async def add(self, message: dict[str, Any]) -> None:
        """Have a command carried out after those to the same car before it in its lane."""
        vehicle = message.get("vehicle")
        car = vehicle if isinstance(vehicle, str) and vehicle in self._bus.vehicles else ""
        await self._orders.add(message, lane_of(message.get("kind")), car)

    async def carry_out(self, message: dict[str, Any], waited_s: float = 0.0) -> None:
        """Have the session of the car carry out a command that came `waited_s` ago, and reply."""
        id = self._id_of(message)
        if id is None:
            return
        vehicle = message.get("vehicle")
        reason = self._refusal(message.get("kind"), vehicle)
        if reason is not None or not isinstance(vehicle, str):
            self._send(messages.refusal(id, reason or UNNAMED))
            return
        order = message | self._sender.as_json()
        self._send(messages.reply(id, await passed_on(self._bus, vehicle, order, fleet=True, waited_s=waited_s)))

    def _refusal(self, kind: object, vehicle: object) -> str | None:
        """Why a command does not reach a session; None: it does."""
        if not self._sender.is_operator:
            return NOT_A_VIEWERS
        if not self._sender.has_begun:
            return NO_HELLO
        command = commands.BY_KIND.get(kind) if isinstance(kind, str) else None
        if command is None:
            return commands.NO_SUCH
        if not self._allowed.takes(self._now()):
            return TOO_MANY
        if not command.from_fleet:
            return NOT_FROM_HERE
        if not isinstance(vehicle, str) or not vehicle:
            return UNNAMED
        if vehicle not in self._bus.vehicles:
            return f"No car is named {display_name.clean(vehicle)}."
        return None

    async def pass_on(self, status: Mapping[str, Any]) -> None:
        """Pass on the page's status to every car."""
        command = commands.read(status)
        to_car = command.model_dump(exclude=PAGE_ONLY)
        self._announcements.forward(to_car, self._sender.as_json(), () if to_car["leaves"] else self._bus.vehicles)


class FleetWriter:
    """The writer of one page of all cars: offers of frames, at most one unanswered, replies, and what happened.

    Of one page; `wakeup` is shared by all pages, `wall_ms` is the time of day.
    """

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


class FleetPage:
    """The socket of one page, and the parts that serve it."""

    def __init__(
        self,
        socket: WebSocket,
        bus: PageBus,
        *,
        hello: Callable[[], Hello],
        principal: Principal,
        limits: Limits,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        wakeup: FairWakeup,
        cars: CarsBoard,
        events: FleetLog,
        people: People = NOBODY,
    ):
        """`wakeup`, `cars`, `events`: of all pages."""
        self._socket = socket
        self._hello = hello
        self._cars = cars
        self._people = people
        self._events = events
        self._writer = FleetWriter(socket, bus, events, wakeup, wall_ms=wall_ms)
        self.on_hello: Callable[[], None] = lambda: None  # called with the hello of the page
        self._inbox = PageInbox(limits, now=now, send=self._writer.queue)
        self._commands = FleetCommands(
            bus,
            principal,
            limits,
            now=now,
            send=self._writer.queue,
            complain=self._inbox.complain,
            people=people,
        )

    @property
    def skipped(self) -> int:
        """Frames that were replaced by newer ones before this page took them."""
        return self._writer.skipped

    @property
    def sender(self) -> PageSender:
        return self._commands.sender

    @property
    def quiet_s(self) -> float:
        """How long the page has sent nothing; 0 while a command of it is carried out."""
        return 0.0 if self._commands.are_unfinished else self._inbox.quiet_s

    async def serve(self) -> None:
        """Runs until the page leaves."""
        leave_cars = self._cars.watch_fleet(self._writer.on_new)
        leave_events = self._events.watch(self._writer.on_events)
        leave_people = self._people.watch(self._commands.send_duty)

        async def leave() -> None:
            leave_cars()
            leave_events()
            leave_people()
            await self._commands.close()

        read = self._inbox.serve(
            self._socket,
            self._handle,
            is_full=lambda: self._writer.is_full,
            finished=self._commands.finished,
            on_leave=self._commands.leave,
        )
        try:
            await page_inbox.run_tasks(
                self._socket,
                read=read,
                write=self._writer.run(self._hello),
                work=self._commands.run(),
                leave=leave,
            )
        finally:
            self._writer.close()

    async def _handle(self, message: dict[str, Any]) -> None:
        match message.get("kind"):
            case "take":
                self._writer.take()
            case "hello":
                self._commands.begin(message)
                self.on_hello()
            case "present":
                self._commands.present(message)
            case _:
                await self._commands.add(message)
