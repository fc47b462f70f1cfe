"""The events that a page has not got yet, read without holding up its other frames."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from typing import Any

from server.bus.bus import NotServed, PageBus
from server.bus.log_runs import Resumed

AGAIN_S = 1.0
FIRST_BATCH = 10  # events in one message: some 1 kB, compressed, half a second at 16 kbit/s
MOST_A_BATCH = 400  # some 120 kB
BATCH_S = 0.5  # a batch may take so long beyond the round trip: an alarm waits behind it
NEVER_S = float("inf")


class EventFeed:
    """Of one page and vehicle. `on_read` is called when events that were not in memory have been read.

    A page that has missed many gets them in batches of what its radio was measured to carry in `BATCH_S`. So one that
    carries little gets small ones between its newest values, and every other page catches up soon, however long its
    round trip is. A message that takes more than a second would look like a connection that fell silent.
    """

    def __init__(
        self,
        bus: PageBus,
        vehicle: str,
        now: Callable[[], float],
        on_read: Callable[[], None],
    ) -> None:
        self._bus = bus
        self._vehicle = vehicle
        self._now = now
        self._batch = self._limit = FIRST_BATCH  # the next one, and what was read at most
        self._late_s = NEVER_S  # of the batch before
        self._sent_s = NEVER_S  # when the batch was sent that is not acknowledged yet
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

    def acknowledged(self, trip_s: float) -> bool:
        """The page has them; a round trip takes it `trip_s` at least. Returns whether it is catching up: more of them
        wait."""
        if self._sent_s == NEVER_S:
            return False
        late_s = max(0.0, self._now() - self._sent_s - trip_s)
        # A loss makes one batch late, a radio that carries little all of them; it is twice as many at most, and no more
        # after a late one: of a radio that has become slow, the next one is late as well, and an alarm waits behind it.
        factor = BATCH_S / max(min(late_s, self._late_s), BATCH_S / 2)
        if late_s > BATCH_S:
            factor = min(factor, 1.0)
        is_catching_up = self._is_catching_up
        self._late_s, self._sent_s, self._is_catching_up = late_s, NEVER_S, False
        if is_catching_up or factor < 1:
            self._batch = min(MOST_A_BATCH, max(FIRST_BATCH, round(self._batch * factor)))
        return is_catching_up

    def after(self, n: int) -> list[dict[str, Any]]:
        """The next batch after number `n`; none yet where the disk must be read, for which `on_read` is called."""
        if self._reading is None:
            self._limit = self._batch
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
