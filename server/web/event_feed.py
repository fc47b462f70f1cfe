"""The events that a page has not got yet, read without holding up its other frames."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

from server.bus.bus import NotServed, PageBus
from server.bus.log_runs import Resumed

AGAIN_S = 1.0
LEAST_A_BATCH = 100  # events in one message
FIRST_BATCH = 10  # some 1 kB, compressed: half a second at 16 kbit/s
MOST_A_BATCH = 400  # some 120 kB
QUICK_S = 0.1  # a page that has a batch within this gets a larger one next


class EventFeed:
    """Of one page and vehicle. `on_read` is called when events that were not in memory have been read.

    A page that has missed many gets them in batches that grow while it receives them quickly, so that a slow radio
    carries small ones between its newest values, and a fast one catches up soon. The first one, and each while the
    page's radio is thin, is smaller: a longer message would look like a connection that fell silent.
    """

    def __init__(
        self,
        bus: PageBus,
        vehicle: str,
        now: Callable[[], float],
        on_read: Callable[[], None],
        is_thin: Callable[[], bool] = lambda: False,
    ) -> None:
        self._bus = bus
        self._vehicle = vehicle
        self._now = now
        self._is_thin = is_thin
        self._batch = self._limit = FIRST_BATCH  # the next one, and what was read at most
        self._sent_s = float("-inf")
        self._is_catching_up = False  # more events wait than one message takes
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

    def sent(self, events: Sequence[object]) -> None:
        """These were sent to the page."""
        self._sent_s = self._now()
        self._is_catching_up = len(events) == self._limit
        if not self._is_catching_up:
            self._batch = LEAST_A_BATCH

    def acknowledged(self) -> bool:
        """The page has them. Returns whether it is catching up: more of them wait."""
        if not self._is_catching_up:
            return False
        self._is_catching_up = False
        is_quick = self._now() - self._sent_s <= QUICK_S
        self._batch = max(LEAST_A_BATCH, min(MOST_A_BATCH, 2 * self._batch)) if is_quick else LEAST_A_BATCH
        return True

    def after(self, n: int) -> list[dict[str, Any]]:
        """The next batch after number `n`; none yet where the disk must be read, for which `on_read` is called."""
        if self._reading is None:
            self._limit = min(self._batch, FIRST_BATCH) if self._is_thin() else self._batch
        recent = self._bus.recent_events(self._vehicle, n, self._limit)
        if recent is not None:
            return recent
        reading = self._reading
        if reading is None:
            self._reading_after = n
            self._reading = asyncio.create_task(self._bus.events_after(self._vehicle, n, self._limit))
            self._reading.add_done_callback(self._read)
            return []
        if not reading.done():
            return []
        self._reading = None
        return reading.result() if self._reading_after == n else self.after(n)

    def _read(self, reading: asyncio.Task[list[dict[str, Any]]]) -> None:
        if reading.cancelled():
            return
        if isinstance(reading.exception(), NotServed):  # they are at an agent that does not answer
            self._reading, self._batch = None, LEAST_A_BATCH
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
