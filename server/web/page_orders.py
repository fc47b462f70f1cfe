"""What a page requests of its car, carried out beside what is read of the page: its answers to frames wait for none."""

from __future__ import annotations

import asyncio
import logging
import math
from collections import defaultdict
from collections.abc import Awaitable, Callable, Mapping
from functools import partial
from typing import Any

log = logging.getLogger("catgraph.web")

MOST_WAITING = 100  # orders; then the reader waits as well, and so does the page
# The lanes of what a page sends by itself: one of each at a time, more would only fill a slow radio.
REPORTS, STATUS = "reports", "status"
REPEATED = "slow_down"  # is pressed again where no answer comes
MOST_REPEATED = 3  # at once: more would only fill a slow radio
OVER_S = 1.0  # after it came one of them is carried out no more: it has half of that

Before = tuple[asyncio.Task[None], float]  # an order, and until when it is waited for, by a monotonic clock [s]


class _Turns:
    """Who has the turn of a lane, or waits for it."""

    def __init__(self) -> None:
        self._last: list[Before] = []  # at most one; those before it are over when it is
        self._repeated: list[Before] = []  # orders of `REPEATED` since then

    def waits_for(self, *, is_repeated: bool) -> list[Before]:
        repeated = [one for one in self._repeated if not one[0].done()]
        return self._last + (repeated[: 1 - MOST_REPEATED] if is_repeated else repeated)

    def add(self, task: asyncio.Task[None], now_s: float, *, is_repeated: bool) -> None:
        if is_repeated:
            self._repeated = [*(one for one in self._repeated if not one[0].done()), (task, now_s + OVER_S)]
        else:
            self._last, self._repeated = [(task, math.inf)], []


class PageOrders:
    """Of one page: its orders of a lane one after the other, as they came, and of its statuses the newest.

    A car that is lost answers nothing for seconds: an order waits for no other lane, one to slow for none to slow,
    and a release for each of those only while it may be carried out. `carry_out` is called with an order and how long
    it waited [s], `pass_on` with a status. `now` is a monotonic clock [s].
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
        self._calls: asyncio.Queue[tuple[tuple[str, str], bool, Callable[[], Awaitable[None]]]] = asyncio.Queue()
        self._turns = defaultdict[tuple[str, str], _Turns](_Turns)  # by lane and car
        self._reports: dict[str, dict[str, Any]] = {}  # by id, those that wait
        self._status: Mapping[str, Any] | None = None  # waits for its turn
        self._unfinished = 0

    @property
    def are_unfinished(self) -> bool:
        """Whether an order waits or is being carried out."""
        return self._unfinished > 0

    async def add(self, order: dict[str, Any], lane: str, car: str = "") -> None:
        """To be carried out after those of the same lane and car that came before; of both there are few.

        A report takes the place of one with its id that still waits. The time of an order counts from now, that of a
        report from its turn.
        """
        if lane == REPORTS:
            is_new = (id := str(order.get("id"))) not in self._reports
            self._reports[id] = order
            if not is_new:
                return
            call = partial(self._carry_out_report, id)
        else:
            call = partial(self._carry_out_order, order, self._now())
        self._unfinished += 1
        await self._room.acquire()
        self._calls.put_nowait(((lane, car), order.get("kind") == REPEATED, call))

    def add_status(self, status: Mapping[str, Any]) -> None:
        """To be passed on once the one before was answered, in place of one that still waits."""
        is_new = self._status is None
        self._status = status
        if is_new:
            self._calls.put_nowait(((STATUS, ""), False, self._pass_on_newest))

    async def finished(self) -> None:
        """Wait until all that came was carried out."""
        await self._calls.join()

    async def run(self) -> None:
        """Carries out what comes, without end."""
        async with asyncio.TaskGroup() as group:
            while True:
                lane, is_repeated, call = await self._calls.get()
                turns = self._turns[lane]
                work = self._in_turn(turns.waits_for(is_repeated=is_repeated), call)
                turns.add(group.create_task(work, name="order of a page"), self._now(), is_repeated=is_repeated)

    async def _in_turn(self, waits_for: list[Before], call: Callable[[], Awaitable[None]]) -> None:
        try:
            for order, until_s in waits_for:
                wait_s = None if until_s == math.inf else max(0.0, until_s - self._now())
                await asyncio.wait({order}, timeout=wait_s)
            await call()
        except Exception:  # a fault of ours: the other orders are carried out
            log.exception("an order of a page failed")
        finally:
            self._calls.task_done()

    async def _carry_out_order(self, order: dict[str, Any], came_s: float) -> None:
        try:
            await self._carry_out(order, self._now() - came_s)
        finally:
            self._end()

    async def _carry_out_report(self, id: str) -> None:
        try:
            await self._carry_out(self._reports.pop(id), 0.0)
        finally:
            self._end()

    def _end(self) -> None:
        self._unfinished -= 1
        self._room.release()

    async def _pass_on_newest(self) -> None:
        status, self._status = self._status, None
        if status is not None:
            await self._pass_on(status)
