"""A page's events where they cannot be read for a while."""

from __future__ import annotations

import asyncio
import time
from typing import Any, cast

import pytest

from server.bus.bus import NotServed, PageBus
from server.web import event_feed
from server.web.event_feed import EventFeed
from tests.server.bus.buses import until

pytestmark = pytest.mark.virtual_time


class Agent:
    """A bus whose events are elsewhere; the first question is not answered."""

    def __init__(self) -> None:
        self.asked = 0

    def recent_events(self, vehicle: str, n: int, limit: int = 100) -> None:
        return None

    async def events_after(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]]:
        self.asked += 1
        if self.asked == 1:
            raise NotServed("nothing from car for 3 s")
        return [{"n": n + 1}]


async def test_what_an_agent_did_not_answer_is_asked_again(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_feed, "AGAIN_S", 0.01)
    agent, found = Agent(), list[dict[str, Any]]()

    def look() -> None:
        found.extend(feed.after(4))

    feed = EventFeed(cast(PageBus, agent), "car", time.monotonic, look)
    look()
    await until(lambda: found)
    assert (found, agent.asked) == ([{"n": 5}], 2)
    feed.close()


async def test_a_page_that_has_left_asks_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_feed, "AGAIN_S", 0.01)
    agent, woken = Agent(), list[int]()
    feed = EventFeed(cast(PageBus, agent), "car", time.monotonic, lambda: woken.append(1))
    feed.after(4)
    await until(lambda: agent.asked)
    await asyncio.sleep(0)
    feed.close()
    await asyncio.sleep(0.05)
    assert woken == []


class Long:
    """A bus with a million events, all in memory."""

    def recent_events(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]]:
        return [{"n": n + 1 + i} for i in range(limit)]


async def test_batches_grow_while_a_page_has_them_quickly_and_a_slow_one_gets_small_ones() -> None:
    feed, sizes, n = EventFeed(cast(PageBus, Long()), "car", time.monotonic, lambda: None), list[int](), 0
    for delay_s in (0.0, 0.05, 0.09, 0.05, 0.2, 0.05, 3.0):
        events = feed.after(n)
        n = events[-1]["n"]
        sizes.append(len(events))
        feed.sent(events)
        await asyncio.sleep(delay_s)
        assert feed.acknowledged()
        assert not feed.acknowledged(), "of one batch once"
    sizes.append(len(feed.after(n)))
    assert sizes == [10, 100, 200, 400, 400, 100, 200, 100]


async def test_the_next_gap_begins_with_a_small_batch_again() -> None:
    feed = EventFeed(cast(PageBus, Long()), "car", time.monotonic, lambda: None)
    for _ in range(2):
        feed.sent(feed.after(0))
        assert feed.acknowledged()
    assert len(feed.after(100)) == 200
    feed.sent([{"n": 101}])  # all that there was
    assert not feed.acknowledged()
    assert len(feed.after(101)) == 100


async def test_over_a_thin_radio_each_batch_stays_small() -> None:
    thin = [True]
    feed = EventFeed(cast(PageBus, Long()), "car", time.monotonic, lambda: None, lambda: thin[0])
    sizes = list[int]()
    for _ in range(4):
        events = feed.after(0)
        sizes.append(len(events))
        feed.sent(events)
        assert feed.acknowledged()
        thin[0] = len(sizes) < 3
    assert sizes == [10, 10, 10, 400]
