"""What a page requests of its car, carried out beside what is read of the page: its answers to frames wait for none."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from typing import Any

MOST_WAITING = 100  # orders; then the reader waits as well, and so does the page
REPORTS = "reports"  # the lane of what a page sends by itself: more at once would only fill a slow radio


class PageOrders:
    """Of one page: its orders of a lane one after the other, as they came, and of its statuses the newest.

    A car that is lost answers nothing for seconds: an order waits for no other lane. `carry_out` is called with an
    order and how long it waited [s], `pass_on` with a status. `now` is a monotonic clock [s].
    """

    def __init__(
        self,
        now: Callable[[], float],
        carry_out: Callable[[dict[str, Any], float], Awaitable[None]],
        pass_on: Callable[[Mapping[str, Any]], Awaitable[None]],
    ) -> None:
        self._now = now
        self._carry_out = carry_out
        self._pass_on = pass_on
        self._room = asyncio.Semaphore(MOST_WAITING)
        self._calls: asyncio.Queue[tuple[str, Callable[[], Awaitable[None]]]] = asyncio.Queue()
        self._turns: defaultdict[str, asyncio.Lock] = defaultdict(
            asyncio.Lock
        )  # by lane; those who wait have it in turn
        self._status: Mapping[str, Any] | None = None  # waits for its turn
        self._unfinished = 0

    @property
    def are_unfinished(self) -> bool:
        """Whether an order waits or is being carried out."""
        return self._unfinished > 0

    async def add(self, order: dict[str, Any], lane: str) -> None:
        """To be carried out after those of the same lane that came before; of lanes there are few."""
        self._unfinished += 1
        came_s = self._now()
        await self._room.acquire()
        self._calls.put_nowait((lane, partial(self._carry_out_one, order, came_s)))

    def add_status(self, status: Mapping[str, Any]) -> None:
        """To be passed on as a report, in place of one that still waits."""
        is_new = self._status is None
        self._status = status
        if is_new:
            self._calls.put_nowait((REPORTS, self._pass_on_newest))

    async def finished(self) -> None:
        """Wait until all that came was carried out."""
        await self._calls.join()

    async def run(self) -> None:
        """Carries out what comes, without end."""
        async with asyncio.TaskGroup() as group:
            while True:
                lane, call = await self._calls.get()
                group.create_task(self._in_turn(lane, call), name="order of a page")

    async def _in_turn(self, lane: str, call: Callable[[], Awaitable[None]]) -> None:
        async with self._turns[lane]:
            await call()
        self._calls.task_done()

    async def _carry_out_one(self, order: dict[str, Any], came_s: float) -> None:
        await self._carry_out(order, self._now() - came_s)
        self._unfinished -= 1
        self._room.release()

    async def _pass_on_newest(self) -> None:
        status, self._status = self._status, None
        if status is not None:
            await self._pass_on(status)
