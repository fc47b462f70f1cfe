"""What one page looks at: the live car, or a recording while the live car goes on being told beside it."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from typing import Any

import orjson

from server.bus.bus import Frame, LocalBus, NotServed
from server.replay import commands
from server.replay.manager import NoReplay, ReplayClient, ReplayManager, summary

KINDS = ("state", "scan")
REPLAY_KINDS = (*KINDS, "timeline")


class ViewSource:
    """Gives a page the newest of what it looks at. `on_new(kind)` is called when a replay has something new, and
    `on_turned()` when the page looks at something else from now on."""

    def __init__(
        self,
        bus: LocalBus,
        vehicle: str,
        replays: ReplayManager,
        *,
        server: Callable[[], Mapping[str, Any]],
        on_new: Callable[[str], None],
        on_turned: Callable[[], None],
    ) -> None:
        """`server`: what a state tells of the server."""
        self._bus = bus
        self._vehicle = vehicle
        self._replays = replays
        self._server = server
        self._on_new, self._on_turned = on_new, on_turned
        self._client: ReplayClient | None = None
        self._wants_scan = False
        self._live_number = 0  # of the newest live state that was seen …
        self._live: dict[str, Any] | None = None  # … and its summary; None: the live car is not told at all

    @property
    def is_replaying(self) -> bool:
        return self._client is not None

    @property
    def ended(self) -> str | None:
        """Why the replay is over without the page's wish, as a sentence; None: it is not."""
        return self._client.failed if self._client is not None else None

    @property
    def kinds(self) -> tuple[str, ...]:
        """The kinds of frame there are to look at."""
        return KINDS if self._client is None else REPLAY_KINDS

    def number(self, kind: str) -> int:
        """Of the newest frame of a kind; 0: there is none."""
        client, live = self._client, self._bus.newest(self._vehicle, kind)
        if client is None:
            return live.number if live is not None else 0
        if kind != "state":
            return client.numbers[kind]
        return client.numbers["state"] + (live.number if live is not None else self._live_number)

    def newest(self, kind: str) -> Frame | None:
        """A replay's state is as new as the newer of what was recorded and what is live."""
        client, live = self._client, self._bus.newest(self._vehicle, kind)
        if client is None:
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

    def watch_scan(self, wanted: bool) -> None:
        """Scans are made only while somebody looks at them."""
        if wanted != self._wants_scan:
            self._wants_scan = wanted
            if self._client is not None:
                self._client.watch_scan(wanted)
            else:
                self._bus.want(self._vehicle, "scan", +1 if wanted else -1)

    async def open(self, order: commands.Open) -> None:
        """From now on a recording. What was looked at before goes on until it is there. Raises NoReplay."""
        settings: Mapping[str, Any] = {}
        with contextlib.suppress(NotServed):
            settings = await self._bus.request(self._vehicle, {"kind": "settings"})
        opening = {
            "vehicle": self._vehicle,
            "at_s": order.at_s,
            "settings": settings.get("toml", ""),
            "settings_version": settings.get("version", 0),
        }
        client = await self._replays.open(order.recording, opening, on_new=self._on_new)
        await self._turn_to(client)

    async def leave(self) -> None:
        """Back to live."""
        if self._client is not None:
            await self._turn_to(None)

    async def ask(self, order: commands.Order) -> dict[str, Any]:
        """What the replay answers to an order."""
        if self._client is None:
            return {"ok": False, "reason": "This page replays nothing."}
        try:
            return await self._client.ask(order.model_dump(exclude={"do"}) | {"kind": order.do})
        except NoReplay as why:
            return {"ok": False, "reason": str(why)}

    async def _turn_to(self, client: ReplayClient | None) -> None:
        wanted, before = self._wants_scan, self._client
        self.watch_scan(False)
        self._client = client
        self.watch_scan(wanted)
        self._on_turned()
        if before is not None:
            await asyncio.shield(self._replays.close(before))
