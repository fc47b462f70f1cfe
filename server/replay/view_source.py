"""The source of a page's view: the live car, or a recording with a summary of the live car."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from typing import Any

import orjson

from server.bus.bus import ALL, Frame, NotServed, PageBus
from server.protocol.messages import FrameKind
from server.protocol.page_messages import OpenBeside, OpenReplay, ReplayOrder
from server.protocol.state import LiveSummary, ServerState
from server.replay.manager import NoReplay, ReplayClient, ReplayManager, summary

KINDS: tuple[FrameKind, ...] = ("state", "scan", "cars")
REPLAY_KINDS: tuple[FrameKind, ...] = (*KINDS, "timeline")
BESIDE_KINDS: tuple[FrameKind, ...] = (*REPLAY_KINDS, "beside")
NO_REPLAY = "This page shows no replay."


class ViewSource:
    """Provides the newest frames of the page's source. `on_new(kind)` is called for new frames of a replay,
    `on_turned()` when the source changes."""

    def __init__(
        self,
        bus: PageBus,
        vehicle: str,
        replays: ReplayManager,
        *,
        server: Callable[[], ServerState],
        on_new: Callable[[str], None],
        on_turned: Callable[[], None],
    ) -> None:
        """`server`: the server's part of a state."""
        self._bus = bus
        self._vehicle = vehicle
        self._replays = replays
        self._server = server
        self._on_new, self._on_turned = on_new, on_turned
        self._client: ReplayClient | None = None
        self._beside: ReplayClient | None = None  # a second recording; only while there is a first
        self._wants_scan = False
        self._live_number = 0  # of the newest live state that was seen …
        self._live: LiveSummary | None = None  # … and its summary; None: no summary of the live car

    @property
    def is_replaying(self) -> bool:
        return self._client is not None

    @property
    def ended(self) -> str | None:
        """Why the replay ended without a request of the page, as a sentence; None: it did not."""
        return self._client.failed if self._client is not None else None

    @property
    def beside_ended(self) -> str | None:
        """Why the second recording ended without a request of the page, as a sentence; None: it did not."""
        return self._beside.failed if self._beside is not None else None

    @property
    def kinds(self) -> tuple[FrameKind, ...]:
        """The kinds of frames of the source."""
        if self._client is None:
            return KINDS
        return REPLAY_KINDS if self._beside is None else BESIDE_KINDS

    def number(self, kind: str) -> int:
        """Of the newest frame of a kind; 0: there is none."""
        if kind == "beside":
            return self._beside.numbers["state"] if self._beside is not None else 0
        client, live = self._client, self._live_frame(kind)
        if client is None or kind == "cars":
            return live.number if live is not None else 0
        if kind == "scan" and not client.scan:  # before the first one, also after a seek back to there
            return 0
        if kind != "state":
            return client.numbers[kind]
        return client.numbers["state"] + (live.number if live is not None else self._live_number)

    def newest(self, kind: str) -> Frame | None:
        """A replay's state is as new as the newer of what was recorded and what is live."""
        if kind == "beside":
            return self._newest_beside()
        client, live = self._client, self._live_frame(kind)
        if client is None or kind == "cars":
            return live
        if kind != "state":
            payload = client.scan if kind == "scan" else client.timeline.decode()
            return Frame(number=client.numbers[kind], payload=payload, put_s=0.0) if payload else None
        if live is None:
            self._live = None
        elif live.number != self._live_number or self._live is None:
            self._live_number, self._live = live.number, summary(orjson.loads(live.payload))
        return Frame(
            number=client.numbers["state"] + self._live_number,
            payload=client.compose(self._server(), self._live),
            put_s=0.0,
        )

    def _newest_beside(self) -> Frame | None:
        beside = self._beside
        if beside is None:
            return None
        return Frame(number=beside.numbers["state"], payload=beside.compose_beside(), put_s=0.0)

    def _live_frame(self, kind: str) -> Frame | None:
        """The cars of the server are live also while a recording is shown."""
        return self._bus.newest(ALL if kind == "cars" else self._vehicle, kind)

    def watch_scan(self, wanted: bool) -> None:
        """Scans are built only while they are viewed."""
        if wanted != self._wants_scan:
            self._wants_scan = wanted
            if self._client is not None:
                self._client.watch_scan(wanted)
            else:
                self._bus.want(self._vehicle, "scan", +1 if wanted else -1)

    async def open(self, order: OpenReplay) -> None:
        """Switch to a recording; the former source continues until it is open. Raises NoReplay."""
        await self._turn_to(await self._opened(order, self._client))

    async def open_beside(self, order: OpenBeside) -> None:
        """Show a second recording beside the first; one that was there before is closed. Raises NoReplay."""
        first = self._client
        if first is None:
            raise NoReplay(NO_REPLAY)
        if order.recording == first.recording:
            raise NoReplay("This recording is shown already: choose another one.")
        client = await self._opened(order, self._beside)
        if self._client is not first:
            await self._replays.close(client)
            raise NoReplay("The replay was left meanwhile.")
        before, self._beside = self._beside, client
        for one in (first, client):
            one.pass_gaps(False)
        self._on_turned()
        await self._close(before)

    async def close_beside(self) -> None:
        """The first recording alone."""
        before, self._beside = self._beside, None
        if self._client is not None:
            self._client.pass_gaps(True)
        self._on_turned()
        await self._close(before)

    async def leave(self) -> None:
        """Back to live."""
        if self._client is not None:
            await self._turn_to(None)

    async def _opened(self, order: OpenReplay | OpenBeside, instead: ReplayClient | None) -> ReplayClient:
        settings: Mapping[str, Any] = {}
        with contextlib.suppress(NotServed):
            settings = await self._bus.request(self._vehicle, {"kind": "settings"})
        opening = {
            "vehicle": self._vehicle,
            "at_s": order.at_s,
            "settings": settings.get("toml", ""),
            "settings_version": settings.get("version", 0),
            "topics": order.topics if isinstance(order, OpenReplay) else {},
            "units": order.units if isinstance(order, OpenReplay) else {},
        }
        return await self._replays.open(order.recording, opening, on_new=self._on_new, instead=instead)

    async def ask(self, order: ReplayOrder) -> Mapping[str, Any]:
        """What the replay answers to an order, or the recording beside it."""
        is_beside = getattr(order, "beside", False)
        client = self._beside if is_beside else self._client
        if client is None:
            return {"ok": False, "reason": "No recording is shown beside this one." if is_beside else NO_REPLAY}
        try:
            return await client.ask(order.model_dump(exclude={"do", "kind", "id", "beside"}) | {"kind": order.do})
        except NoReplay as why:
            return {"ok": False, "reason": str(why)}

    async def _turn_to(self, client: ReplayClient | None) -> None:
        wanted, before, beside = self._wants_scan, self._client, self._beside
        self.watch_scan(False)
        self._client, self._beside = client, None
        self.watch_scan(wanted)
        self._on_turned()
        await self._close(beside)
        await self._close(before)

    async def _close(self, client: ReplayClient | None) -> None:
        if client is not None:
            await asyncio.shield(self._replays.close(client))
