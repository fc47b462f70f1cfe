"""What a page requests of its car, carried out beside what is read of the page: its answers to frames wait for none."""

from __future__ import annotations

import asyncio
from collections import defaultdict
from collections.abc import Awaitable, Callable, Mapping
from typing import Any

MOST_WAITING = 100  # orders; then the reader waits as well, and so does the page

CarryOut = Callable[[dict[str, Any], float], Awaitable[None]]


class PageOrders:
    """Of one page: its orders of a lane one after the other, as they came, and beside them the newest of its statuses.

    A car that is lost answers neither for seconds: an order waits for no other lane, and for no answer to a status.
    `now` is a monotonic clock [s].
    """

    def __init__(self, now: Callable[[], float]) -> None:
        self._now = now
        self._room = asyncio.Semaphore(MOST_WAITING)
        self._orders: asyncio.Queue[tuple[dict[str, Any], str, float]] = asyncio.Queue()
        self._turns: defaultdict[str, asyncio.Lock] = defaultdict(
            asyncio.Lock
        )  # by lane; those who wait have it in turn
        self._statuses: asyncio.Queue[Mapping[str, Any]] = asyncio.Queue(1)
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
        self._orders.put_nowait((order, lane, came_s))

    def add_status(self, status: Mapping[str, Any]) -> None:
        """To be passed on once the one before was answered, in place of one that still waits."""
        if self._statuses.full():
            self._statuses.get_nowait()
            self._statuses.task_done()
        self._statuses.put_nowait(status)

    async def finished(self) -> None:
        """Wait until all that came was carried out."""
        await self._orders.join()
        await self._statuses.join()

    async def run(self, carry_out: CarryOut, pass_on: Callable[[Mapping[str, Any]], Awaitable[None]]) -> None:
        """Calls `carry_out` with each order and how long it waited [s], and `pass_on` with statuses, without end."""
        async with asyncio.TaskGroup() as group:
            group.create_task(self._pass_on_all(pass_on), name="statuses of a page")
            while True:
                order, lane, came_s = await self._orders.get()
                group.create_task(self._carry_out(carry_out, order, lane, came_s), name="order of a page")

    async def _carry_out(self, carry_out: CarryOut, order: dict[str, Any], lane: str, came_s: float) -> None:
        async with self._turns[lane]:
            await carry_out(order, self._now() - came_s)
        self._unfinished -= 1
        self._room.release()
        self._orders.task_done()

    async def _pass_on_all(self, pass_on: Callable[[Mapping[str, Any]], Awaitable[None]]) -> None:
        while True:
            await pass_on(await self._statuses.get())
            self._statuses.task_done()
