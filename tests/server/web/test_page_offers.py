"""States that are sent ahead of a page's takes: only to a page that allows them, spaced, never more than that."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from itertools import pairwise
from typing import Any, cast

import orjson
import pytest
from starlette.websockets import WebSocket

from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.protocol.messages import Hello
from server.protocol.state import ServerState
from server.replay.manager import ReplayManager
from server.replay.view_source import ViewSource
from server.web.fair_wakeup import FairWakeup
from server.web.page_offers import AHEAD_EVERY_S, MOST_AHEAD, PageOffers
from server.web.page_writer import PageWriter

pytestmark = pytest.mark.virtual_time


class SlowPage:
    """Answers what it gets after a round trip, while it answers."""

    def __init__(self, ahead: int) -> None:
        self.ahead = ahead
        self.answers = True
        self.round_trip_s = 0.4
        self.states: list[tuple[float, int]] = []  # when each came, and its number
        self.offers: list[dict[str, Any]] = []
        self.writer: PageWriter | None = None
        self._takes = 0

    async def send_text(self, text: str) -> None:
        message = json.loads(text)
        if message["kind"] == "state":
            self.states.append((time.monotonic(), message["number"]))
            if self.ahead:
                self._take_later(0)
        elif message["kind"] == "offer":
            self.offers.append(message)
            if message["of"]:
                self._take_later(message["seq"])

    def _take_later(self, seq: int) -> None:
        if self.answers:
            asyncio.get_running_loop().call_later(self.round_trip_s, self._take, seq)

    def _take(self, seq: int) -> None:
        assert self.writer is not None
        self._takes += 1
        ahead = {"ahead": self.ahead} if self.ahead else {}
        self.writer.take({"kind": "take", "seq": seq, "n": self._takes, **ahead})


@asynccontextmanager
async def watching(page: SlowPage) -> AsyncIterator[LocalBus]:
    """A car whose state is made twenty times a second."""

    async def car(_: Mapping[str, Any]) -> Mapping[str, Any]:
        return {"ok": True}

    bus = LocalBus(Journal(None), now=time.monotonic)
    bus.serve("car", car)

    async def drive() -> None:
        number = 0
        while True:
            number += 1
            bus.put("car", "state", orjson.dumps({"kind": "state", "number": number}).decode())
            await asyncio.sleep(0.05)

    view = ViewSource(
        bus,
        "car",
        ReplayManager(lambda _: None, now=time.monotonic),
        server=lambda: cast(ServerState, {}),
        on_new=lambda _: None,
        on_turned=lambda: None,
    )
    wall_ms = lambda: round(time.time() * 1000)  # noqa: E731
    writer = PageWriter(cast(WebSocket, page), bus, "car", view, FairWakeup(), now=time.monotonic, wall_ms=wall_ms)
    page.writer = writer
    unwatch = bus.watch("car", writer.on_new)
    tasks = [asyncio.create_task(drive())]
    await asyncio.sleep(0)
    tasks.append(asyncio.create_task(writer.run(lambda: cast(Hello, {"kind": "hello"}))))
    writer.begin(0)
    yield bus
    unwatch()
    writer.close()
    for task in tasks:
        task.cancel()
    await asyncio.gather(*tasks, return_exceptions=True)


async def states_of(page: SlowPage, lasts_s: float) -> float:
    """How many states a second came, after the first two seconds."""
    await asyncio.sleep(2.0)
    before = len(page.states)
    await asyncio.sleep(lasts_s)
    return (len(page.states) - before) / lasts_s


async def test_over_a_slow_radio_a_page_that_allows_states_ahead_gets_more_than_one_a_round_trip() -> None:
    one_by_one, ahead = SlowPage(0), SlowPage(6)
    async with watching(one_by_one):
        assert 2.0 <= await states_of(one_by_one, 10.0) <= 1 / one_by_one.round_trip_s
    async with watching(ahead):
        assert await states_of(ahead, 10.0) >= 5.0


async def test_each_state_is_newer_than_the_one_before_and_no_two_come_close_together() -> None:
    page = SlowPage(MOST_AHEAD)
    page.round_trip_s = 0.05
    async with watching(page):
        await asyncio.sleep(10.0)
    numbers = [number for _, number in page.states]
    assert len(numbers) > 50
    assert numbers == sorted(set(numbers))
    pushed = page.states[2:]
    assert min(b[0] - a[0] for a, b in pairwise(pushed)) >= AHEAD_EVERY_S - 0.001


@pytest.mark.parametrize("ahead", [1, 6, 10**9])
async def test_a_page_that_stops_answering_gets_as_many_as_it_said_and_one_offer(ahead: int) -> None:
    page = SlowPage(ahead)
    async with watching(page):
        await asyncio.sleep(5.0)
        page.answers = False
        await asyncio.sleep(page.round_trip_s)  # what it had answered before arrives
        states, offers = len(page.states), len(page.offers)
        await asyncio.sleep(60.0)
        assert len(page.states) - states <= min(ahead, MOST_AHEAD)
        assert sum(bool(offer["of"]) for offer in page.offers[offers:]) <= 1
        page.answers = True
        assert page.writer is not None
        page.writer.take({"seq": next(offer["seq"] for offer in reversed(page.offers) if offer["of"])})
        await asyncio.sleep(0.01)
        assert page.states[-1][1] >= 1200, "then it gets the newest"


async def test_a_take_is_answered_with_its_number_twice_a_second_though_nothing_is_offered() -> None:
    page = SlowPage(6)
    async with watching(page):
        await asyncio.sleep(2.0)
        page.offers.clear()
        await asyncio.sleep(10.0)
    echoes = [offer for offer in page.offers if not offer["of"]]
    assert 15 <= len(echoes) <= 21
    numbers = [offer["took"] for offer in echoes]
    assert numbers == sorted(set(numbers))
    assert numbers[0] > 0


@pytest.mark.parametrize("nonsense", [None, -1, True, "6", 2.5, []])
def test_a_number_that_is_none_allows_nothing_ahead(nonsense: object) -> None:
    offers = PageOffers(lambda: 0.0, lambda: 5)
    assert offers.taken(0, nonsense, nonsense), "it takes what was offered, as a page of before does"
    assert (offers.may_push, offers.took, offers.took_ms) == (False, 0, 5)
