"""All pages of one server."""

from __future__ import annotations

import asyncio
from collections import Counter
from collections.abc import Callable

from starlette.websockets import WebSocket

from server.access.identity import LOCAL, Principal
from server.access.people import NOBODY, People
from server.bus.bus import PageBus
from server.protocol import page_messages
from server.protocol.cars_state import OffOnPurpose
from server.protocol.messages import Hello
from server.protocol.rate_limit import Limits
from server.protocol.state import ServerState
from server.replay.manager import ReplayManager
from server.web.cars_board import CarsBoard
from server.web.fair_wakeup import FairWakeup
from server.web.fleet_log import FleetLog
from server.web.fleet_socket import FleetPage
from server.web.page_socket import Page

MAX_PAGES = 500
QUIET_S = 2.0  # a page that is served sends more often


class Hub:
    """Serves each page, and limits how many there are."""

    def __init__(
        self,
        bus: PageBus,
        *,
        replays: ReplayManager,
        server: Callable[[], ServerState],
        limits: Limits,
        off: Callable[[str], OffOnPurpose | None] = lambda _: None,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        people: People = NOBODY,
    ) -> None:
        """`server`: the server's part of a state; `off`: who declared a silent car off; `now` is a monotonic clock [s],
        `wall_ms` the time of day."""
        self._bus = bus
        self._limits = limits
        self._now = now
        self._wall_ms = wall_ms
        self._replays = replays
        self._server = server
        self._pages: dict[Page | FleetPage, asyncio.Task[None]] = {}  # the oldest first
        self._replaced: set[asyncio.Task[None]] = set()
        self._wakeup = FairWakeup()
        self._cars = CarsBoard(bus, off=off, now=now, wall_ms=wall_ms)
        self._fleet_log = FleetLog(bus)
        self._by_device: Counter[str] = Counter()
        self._people = people

    @property
    def pages(self) -> int:
        """How many pages are connected."""
        return len(self._pages)

    @property
    def skipped(self) -> int:
        """Frames that were replaced by newer ones before a page took them, of all pages that are connected."""
        return sum(page.skipped for page in self._pages)

    async def serve(
        self,
        socket: WebSocket,
        vehicle: str,
        hello: Callable[[], Hello],
        *,
        principal: Principal,
        replay: page_messages.OpenReplay | None = None,
    ) -> None:
        """Serves one page until it leaves; `replay`: the recording it begins with."""
        if await self._accept(socket, principal):
            page = Page(
                socket,
                self._bus,
                vehicle,
                hello=hello,
                principal=principal,
                replays=self._replays,
                server=self._server,
                limits=self._limits,
                now=self._now,
                wall_ms=self._wall_ms,
                wakeup=self._wakeup,
                cars=self._cars,
                replay=replay,
                people=self._people,
            )
            await self._serve(page, principal)

    async def serve_fleet(self, socket: WebSocket, hello: Callable[[], Hello], *, principal: Principal) -> None:
        """Serves one page of all cars until it leaves."""
        if await self._accept(socket, principal):
            page = FleetPage(
                socket,
                self._bus,
                hello=hello,
                principal=principal,
                limits=self._limits,
                now=self._now,
                wall_ms=self._wall_ms,
                wakeup=self._wakeup,
                cars=self._cars,
                events=self._fleet_log,
                people=self._people,
            )
            await self._serve(page, principal)

    async def _accept(self, socket: WebSocket, principal: Principal) -> bool:
        await socket.accept()
        if len(self._pages) >= MAX_PAGES or self._has_too_many(principal):
            await socket.close(code=1013, reason="too many pages")
            return False
        return True

    async def _serve(self, page: Page | FleetPage, principal: Principal) -> None:
        task = asyncio.current_task()
        assert task is not None
        self._pages[page] = task
        self._by_device[principal.id] += 1
        page.on_hello = lambda: self._end_former(page)
        try:
            await page.serve()
        except asyncio.CancelledError:
            if task not in self._replaced:
                raise
            task.uncancel()
        finally:
            del self._pages[page]
            self._replaced.discard(task)
            self._by_device -= Counter((principal.id,))

    def _end_former(self, page: Page | FleetPage) -> None:
        """End connections that the page has given up and that have not noticed it: they count for its device.

        A tab that was duplicated has the same id, and is served. One that carries out a command, or ends already, is
        not interrupted.
        """
        for other, task in self._pages.items():
            if other is page:
                return
            if other.sender.is_same(page.sender) and other.quiet_s > QUIET_S:
                self._replaced.add(task)
                task.cancel()

    def _has_too_many(self, principal: Principal) -> bool:
        return principal is not LOCAL and self._by_device[principal.id] >= self._limits.pages
