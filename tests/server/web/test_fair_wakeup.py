"""One after another, what is urgent first, and timers in between."""

from __future__ import annotations

import asyncio
import time

import pytest

from server.web.fair_wakeup import FairWakeup


async def order_of(turns: FairWakeup, events: dict[str, asyncio.Event]) -> list[str]:
    """In which order they are woken, with a mark for each turn of the loop that others have between."""
    woken: list[str] = []

    async def wait(name: str) -> None:
        await events[name].wait()
        woken.append(name)

    waiting = [asyncio.create_task(wait(name)) for name in events]
    while any(not task.done() for task in waiting):
        await asyncio.sleep(0)
    return woken


async def test_each_is_woken_once_in_the_order_in_which_it_came_and_what_is_urgent_first() -> None:
    turns, events = FairWakeup(), {name: asyncio.Event() for name in "abcd"}
    for name in "abca":
        turns.queue(events[name])
    turns.queue(events["d"], is_urgent=True)
    turns.queue(events["c"], is_urgent=True)
    turns.queue(events["c"])
    assert len(turns) == 4
    assert await order_of(turns, events) == ["d", "c", "a", "b"]
    assert len(turns) == 0


async def test_who_left_is_not_woken() -> None:
    turns, left, stays = FairWakeup(), asyncio.Event(), asyncio.Event()
    turns.queue(left)
    turns.queue(stays)
    turns.leave(left)
    turns.leave(left)
    await stays.wait()
    assert not left.is_set()


@pytest.mark.field
async def test_a_crowd_lets_a_timer_through() -> None:
    """Each of 200 works for 1 ms as it is woken: together they would hold up a timer for 200 ms."""
    turns = FairWakeup()

    async def work(event: asyncio.Event) -> None:
        await event.wait()
        ends_s = time.perf_counter() + 0.001
        while time.perf_counter() < ends_s:
            pass

    events = [asyncio.Event() for _ in range(200)]
    crowd = [asyncio.create_task(work(event)) for event in events]
    await asyncio.sleep(0)
    for event in events:
        turns.queue(event)
    await asyncio.sleep(0.005)
    assert sum(event.is_set() for event in events) < 100
    await asyncio.gather(*crowd)
