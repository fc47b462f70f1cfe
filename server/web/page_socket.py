"""One page's connection, from its acceptance to its end: reads what the page sends, and has its parts act on it."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from starlette.websockets import WebSocket

from server.access.identity import Principal
from server.access.people import NOBODY, People
from server.bus.bus import PageBus
from server.protocol import page_messages
from server.protocol.messages import Hello
from server.protocol.rate_limit import Limits
from server.protocol.state import ServerState
from server.replay.manager import ReplayManager
from server.replay.view_source import ViewSource
from server.web import page_inbox
from server.web.cars_board import CarsBoard
from server.web.fair_wakeup import FairWakeup
from server.web.page_commands import PageCommands
from server.web.page_inbox import PageInbox
from server.web.page_sender import PageSender
from server.web.page_writer import PageWriter


class Page:
    """The socket of one page, and the parts that serve it."""

    def __init__(
        self,
        socket: WebSocket,
        bus: PageBus,
        vehicle: str,
        *,
        hello: Callable[[], Hello],
        principal: Principal,
        replays: ReplayManager,
        server: Callable[[], ServerState],
        limits: Limits,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        wakeup: FairWakeup,
        cars: CarsBoard,
        replay: page_messages.OpenReplay | None = None,
        people: People = NOBODY,
    ):
        """`wakeup`: of all pages, for what is new to all. `replay`: the recording with which the page begins."""
        self._socket = socket
        self._bus = bus
        self._vehicle = vehicle
        self._hello = hello
        self._replay = replay
        self._cars = cars
        self._people = people
        self._view = view = ViewSource(
            bus,
            vehicle,
            replays,
            server=server,
            on_new=lambda kind: self._writer.on_replay(kind),
            on_turned=lambda: self._writer.on_turned(),
        )
        self._writer = PageWriter(socket, bus, vehicle, view, wakeup, now=now, wall_ms=wall_ms)
        self.on_hello: Callable[[], None] = lambda: None  # called with the hello of the page
        self._inbox = PageInbox(limits, now=now, send=self._writer.queue)
        self._commands = PageCommands(
            bus,
            vehicle,
            view,
            principal,
            limits,
            now=now,
            wall_ms=wall_ms,
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
        unwatch = self._bus.watch(self._vehicle, self._writer.on_new)
        leave_cars = self._cars.watch(self._writer.on_new)
        leave_people = self._people.watch(self._commands.send_duty)
        if self._replay is not None:
            self._commands.open_replay(self._replay)

        async def leave() -> None:
            unwatch()
            leave_cars()
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
            await self._view.leave()

    async def _handle(self, message: dict[str, Any]) -> None:
        match message.get("kind"):
            case "take":
                self._writer.take(message)
            case "have":
                self._writer.have_events()
            case "watch":
                self._writer.watch_scan(message.get("scan") is True)
            case "hello":
                self._commands.begin(message)
                self.on_hello()
                is_former = "page" in message and "build" not in message  # a page of before the builds were named
                self._writer.begin(message.get("have_event"), message.get("boot"), is_former=is_former)
            case "present":
                self._commands.present(message)
            case _:
                await self._commands.add(message)
