"""A page's events where they cannot be read for a while."""

from __future__ import annotations

import asyncio
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
        found.extend(feed.after(4, 100))

    feed = EventFeed(cast(PageBus, agent), "car", look)
    look()
    await until(lambda: found)
    assert (found, agent.asked) == ([{"n": 5}], 2)
    feed.close()


async def test_a_page_that_has_left_asks_no_more(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(event_feed, "AGAIN_S", 0.01)
    agent, woken = Agent(), list[int]()
    feed = EventFeed(cast(PageBus, agent), "car", lambda: woken.append(1))
    feed.after(4, 100)
    await until(lambda: agent.asked)
    await asyncio.sleep(0)
    feed.close()
    await asyncio.sleep(0.05)
    assert woken == []
