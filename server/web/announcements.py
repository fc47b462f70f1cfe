"""What a page that announces the alarms of other cars reports to their sessions."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Collection, Mapping
from typing import Any

from server.bus.bus import NotServed, PageBus

LEAVES = {"kind": "present", "visible": False, "sound": "asks", "awake": "asks", "leaves": True}
FORWARD_WITHIN_S = 1.0  # to another car whose alarms this page announces
AT_ONCE = 8  # cars; between them others on the loop have their turn


class Announcements:
    """Of one page."""

    def __init__(self, bus: PageBus) -> None:
        self._bus = bus
        self._announced: set[str] = set()  # cars whose alarms it announces
        self._forwarding: asyncio.Task[None] | None = None

    def forward(self, status: Mapping[str, Any], sender: Mapping[str, Any], cars: Collection[str]) -> None:
        """Pass a page's status on to the cars whose alarms it announces, and once to those that it did.

        Meanwhile the page is served: another car may be lost.
        """
        if self._forwarding is not None and not self._forwarding.done():
            return  # the page states it every second
        now = set(cars)
        before, self._announced = self._announced, now
        statuses = {
            vehicle: {**status, "kind": "announces", "leaves": vehicle not in now, **sender} for vehicle in now | before
        }
        if statuses:
            self._forwarding = asyncio.create_task(self._forward_all(statuses), name="announce")

    async def _forward_all(self, statuses: Mapping[str, Mapping[str, Any]]) -> None:
        async def forward_to(vehicle: str, status: Mapping[str, Any]) -> None:
            with contextlib.suppress(NotServed):
                await self._bus.request(vehicle, status, deadline_s=FORWARD_WITHIN_S)

        async with asyncio.TaskGroup() as group:
            for number, (vehicle, status) in enumerate(statuses.items(), 1):
                group.create_task(forward_to(vehicle, status))
                if number % AT_ONCE == 0:
                    await asyncio.sleep(0)

    async def forwarded(self) -> None:
        """Wait until it was passed on."""
        if self._forwarding is not None:
            await asyncio.gather(self._forwarding, return_exceptions=True)

    async def close(self) -> None:
        """End what is being passed on."""
        if self._forwarding is not None:
            self._forwarding.cancel()
            await self.forwarded()
