"""A page's events where they cannot be read for a while."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Sequence
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
        self.requests = 0

    def recent_events(self, vehicle: str, n: int, limit: int = 100) -> None:
        return None

    async def events_after(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]]:
        self.requests += 1
        if self.requests == 1:
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
    assert (found, agent.requests) == ([{"n": 5}], 2)
    feed.close()


async def test_a_page_that_has_left_asks_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_feed, "AGAIN_S", 0.01)
    agent, woken = Agent(), list[int]()
    feed = EventFeed(cast(PageBus, agent), "car", time.monotonic, lambda: woken.append(1))
    feed.after(4)
    await until(lambda: agent.requests)
    await asyncio.sleep(0)
    feed.close()
    await asyncio.sleep(0.05)
    assert woken == []


class Long:
    """A bus with a million events, all in memory."""

    def recent_events(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]]:
        return [{"n": n + 1 + i} for i in range(limit)]


def feed_of(bus: object) -> EventFeed:
    return EventFeed(cast(PageBus, bus), "car", time.monotonic, lambda: None)


async def sizes_of(delays_s: Sequence[float], trip_s: float = 0.0) -> list[int]:
    """Of the batches that a page gets which has each one so late; the last one is not sent yet."""
    feed, sizes, n = feed_of(Long()), list[int](), 0
    for delay_s in delays_s:
        events = feed.after(n)
        n = events[-1]["n"]
        sizes.append(len(events))
        feed.sent(events)
        await asyncio.sleep(delay_s)
        assert feed.acknowledged(trip_s)
        assert not feed.acknowledged(trip_s), "of one batch once"
    return [*sizes, len(feed.after(n))]


async def test_batches_grow_while_a_page_has_them_quickly_and_a_slow_one_gets_what_takes_half_a_second() -> None:
    delays_s = (0.0, 0.05, 0.25, 0.5, 0.5, 0.4, 0.1, 0.1, 1.0, 1.0, 3.0)
    assert await sizes_of(delays_s) == [10, 20, 40, 80, 160, 160, 200, 400, 400, 400, 200, 100]


async def test_one_late_answer_is_a_loss_and_two_are_a_radio_that_carries_little() -> None:
    assert await sizes_of((0.1, 2.0, 0.1, 1.4, 0.1)) == [10, 20, 20, 40, 40, 80], "after a late one, none is longer"
    assert await sizes_of((0.1, 0.1, 0.1, 2.0, 2.0)) == [10, 20, 40, 80, 80, 20]


async def test_what_counts_is_the_time_beyond_the_round_trip() -> None:
    assert await sizes_of((1.3, 1.4, 1.2, 1.3), trip_s=1.2) == [10, 20, 40, 80, 160]
    assert await sizes_of((1.3, 1.4, 1.2, 1.3), trip_s=0.2) == [10, 10, 10, 10, 10]


async def test_no_batch_is_smaller_than_the_first_one() -> None:
    assert await sizes_of((5.0, 5.0, 5.0)) == [10, 10, 10, 10]


async def test_the_next_gap_begins_as_the_last_one_ended_unless_two_answers_were_slow_meanwhile() -> None:
    feed = feed_of(Long())
    for _ in range(3):
        feed.sent(feed.after(0))
        assert feed.acknowledged(0.0)
    for took_s, size in ((0.1, 80), (2.0, 80), (1.0, 40)):
        assert len(feed.after(100)) == 80
        feed.sent([{"n": 101}])  # all that there was
        await asyncio.sleep(took_s)
        assert not feed.acknowledged(0.0)
        assert len(feed.after(101)) == size
