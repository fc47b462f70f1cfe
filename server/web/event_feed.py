"""The events that a page has not got yet, read without holding up its other frames."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Any

from server.bus.bus import NotServed, PageBus
from server.bus.log_runs import Resumed

AGAIN_S = 1.0


class EventFeed:
    """Of one page and vehicle. `on_read` is called when events that were not in memory have been read."""

    def __init__(self, bus: PageBus, vehicle: str, on_read: Callable[[], None]) -> None:
        self._bus = bus
        self._vehicle = vehicle
        self._on_read = on_read
        self._reading: asyncio.Task[list[dict[str, Any]]] | None = None
        self._reading_after = 0
        self._again: asyncio.TimerHandle | None = None
        self._resuming: asyncio.Task[None] | None = None

    def resume(self, run: str, n: int, then: Callable[[Resumed], None]) -> None:
        """Calls `then` with where a page goes on that has read up to `n` in another run."""
        self._resuming = asyncio.create_task(self._resume(run, n, then))

    async def _resume(self, run: str, n: int, then: Callable[[Resumed], None]) -> None:
        while True:
            try:
                found = await self._bus.resume(self._vehicle, run, n)
            except NotServed:  # the agent does not answer
                await asyncio.sleep(AGAIN_S)
            else:
                return then(found)

    def after(self, n: int, limit: int) -> list[dict[str, Any]]:
        """The events after number `n`; none yet where the disk must be read, for which `on_read` is called."""
        recent = self._bus.recent_events(self._vehicle, n, limit)
        if recent is not None:
            return recent
        reading = self._reading
        if reading is None:
            self._reading_after = n
            self._reading = asyncio.create_task(self._bus.events_after(self._vehicle, n, limit))
            self._reading.add_done_callback(self._read)
            return []
        if not reading.done():
            return []
        self._reading = None
        return reading.result() if self._reading_after == n else self.after(n, limit)

    def _read(self, reading: asyncio.Task[list[dict[str, Any]]]) -> None:
        if reading.cancelled():
            return
        if isinstance(reading.exception(), NotServed):  # they are at an agent that does not answer
            self._reading = None
            self._again = asyncio.get_running_loop().call_later(AGAIN_S, self._on_read)
        else:
            self._on_read()

    def close(self) -> None:
        """Ends a reading that is under way."""
        for task in (self._reading, self._resuming):
            if task is not None:
                task.cancel()
        if self._again is not None:
            self._again.cancel()
