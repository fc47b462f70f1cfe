"""The connection of a page of all cars, from its acceptance to its end; see docs/protocol.md."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from starlette.websockets import WebSocket

from server.access.identity import Principal
from server.access.people import NOBODY, People
from server.bus.bus import PageBus
from server.protocol.messages import Hello
from server.protocol.rate_limit import Limits
from server.web import page_tasks
from server.web.cars_board import CarsBoard
from server.web.fair_wakeup import FairWakeup
from server.web.fleet_commands import FleetCommands
from server.web.fleet_log import FleetLog
from server.web.fleet_writer import FleetWriter
from server.web.page_inbox import PageInbox
from server.web.page_socket import GOING_AWAY


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

        try:
            await page_tasks.run(self._socket, read=self._read(), write=self._writer.run(self._hello), leave=leave)
        finally:
            self._writer.close()

    async def _read(self) -> None:
        while not self._inbox.is_hopeless and not self._writer.is_full:
            received = await self._socket.receive()
            if received["type"] == "websocket.disconnect":
                if received.get("code") == GOING_AWAY:
                    await self._commands.leave()
                return
            message = self._inbox.read(received.get("text"))
            if message is not None:
                await self._obey(message)
        await self._socket.close(code=1008, reason="too many invalid messages")

    async def _obey(self, message: dict[str, Any]) -> None:
        match message.get("kind"):
            case "take":
                self._writer.take()
            case "hello":
                await self._commands.begin(message)
            case "present":
                await self._commands.present(message)
            case _:
                await self._commands.command(message)
