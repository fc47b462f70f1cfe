"""States that are sent ahead of a page's takes: to a page that allows them, spaced, no more than that under way."""

from __future__ import annotations

import asyncio
import hashlib
import json
import time
import zlib
from collections.abc import AsyncIterator, Mapping, Sequence
from contextlib import asynccontextmanager
from itertools import pairwise
from typing import Any, cast

import orjson
import pytest
from starlette.websockets import WebSocket

from server.bus.bus import ALL
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.protocol.messages import Hello
from server.protocol.state import ServerState
from server.replay.manager import ReplayManager
from server.replay.view_source import ViewSource
from server.web.fair_wakeup import FairWakeup
from server.web.page_offers import AHEAD_EVERY_S, MOST_AHEAD, THIN_SCAN_EVERY_S, PageOffers
from server.web.page_writer import PageWriter

pytestmark = pytest.mark.virtual_time


STATE, SMALL = 800, 120


def event(n: int) -> dict[str, Any]:
    """Of 50 bytes, compressed beside others."""
    digits = hashlib.sha256(str(n).encode()).hexdigest()
    return {
        "alarm": f"signal_slow.{digits[:8]}", "occurrence": n, "change": "raised", "priority": "warning",
        "title": f"{digits[:8]} slower than expected", "text": f"{digits[8:56]} messages a second, at least 8 expected",
        "at_ms": 1_790_000_000_000 + int(digits[56:62], 16), "cause": None, "by": None, "reason": None,
    }  # fmt: skip


class SlowPage:
    """Answers what it gets after a round trip, while it answers."""

    def __init__(self, ahead: int) -> None:
        self.ahead = ahead
        self.answers = True
        self.round_trip_s = 0.4
        self.byte_s = 0.0  # what the radio carries: a state has STATE bytes on it, anything else SMALL
        self.more: Sequence[str] = ()  # what comes besides states
        self.most_under_way = 0  # from its first take on
        self.events_s: list[float] = []  # how long each took
        self.longest_s = 0.0  # that one message was on the air
        self.scans = 0
        self.most_event = 0
        self.states: list[tuple[float, int]] = []  # when each came, and its number
        self.offers: list[dict[str, Any]] = []
        self.writer: PageWriter | None = None
        self._takes = self._sent = self._got = 0
        self._free_s = 0.0

    async def send_text(self, text: str) -> None:
        message = json.loads(text)
        kind = message["kind"]
        now_s = time.monotonic()
        if kind == "state":
            self.states.append((now_s, message["number"]))
            self._sent += 1
            if self._takes:
                self.most_under_way = max(self.most_under_way, self._sent - self._got)
        elif kind == "offer":
            self.offers.append({**message, "at_s": now_s})
        size = {"state": STATE, "events": len(zlib.compress(text.encode()))}.get(kind, SMALL)
        self.longest_s = max(self.longest_s, self.byte_s * size)
        self._free_s = max(self._free_s, now_s) + self.byte_s * size
        if kind == "state" and self.ahead:
            self._take_later(0)
        elif kind == "offer" and message["of"]:
            self._take_later(message["seq"])
        elif kind == "events":
            self.most_event = message["events"][-1]["n"]
            self.events_s.append(self._free_s - now_s)
            asyncio.get_running_loop().call_later(self._free_s - now_s + self.round_trip_s, self._have)

    async def send_bytes(self, _: bytes) -> None:
        self.scans += 1

    def _have(self) -> None:
        assert self.writer is not None
        self.writer.have_events()

    def _take_later(self, seq: int) -> None:
        if self.answers:
            wait_s = self._free_s - time.monotonic() + self.round_trip_s
            asyncio.get_running_loop().call_later(wait_s, self.take, seq, self._sent)

    def take(self, seq: int, got: int) -> None:
        assert self.writer is not None
        self._takes += 1
        self._got = max(self._got, got)
        ahead = {"ahead": self.ahead, "got": self._got} if self.ahead else {}
        self.writer.take({"kind": "take", "seq": seq, "n": self._takes, **ahead})


@asynccontextmanager
async def watching(page: SlowPage, missed: int = 0) -> AsyncIterator[LocalBus]:
    """A car whose state is made twenty times a second; `missed`: events that the page has not got."""

    async def car(_: Mapping[str, Any]) -> Mapping[str, Any]:
        return {"ok": True}

    bus = LocalBus(Journal(None), now=time.monotonic)
    bus.serve("car", car)
    bus.append("car", [event(n) for n in range(missed)])

    async def drive() -> None:
        number = 0
        while True:
            number += 1
            bus.put("car", "state", orjson.dumps({"kind": "state", "number": number}).decode())
            if "scan" in page.more:
                bus.put("car", "scan", b"beams")
            if "event" in page.more and number % 40 == 0:
                bus.append("car", [{"change": "mark", "alarm": None, "at_ms": 0}])
            if "cars" in page.more:
                bus.put(ALL, "cars", orjson.dumps({"kind": "cars", "number": number}).decode())
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
    writer.watch_scan("scan" in page.more)
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
async def test_a_page_that_stops_answering_gets_as_many_as_it_announced_and_one_offer(ahead: int) -> None:
    page = SlowPage(ahead)
    async with watching(page):
        await asyncio.sleep(5.0)
        assert page.most_under_way <= min(ahead, MOST_AHEAD)
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


async def test_before_its_first_take_a_page_gets_the_states_that_uncover_its_values_and_no_more() -> None:
    page = SlowPage(MOST_AHEAD)
    page.answers = False
    async with watching(page):
        await asyncio.sleep(60.0)
    assert len(page.states) == 3
    assert page.states[-1][0] - page.states[0][0] < 0.15


@pytest.mark.parametrize("more", [(), ("scan", "cars")])
async def test_a_take_is_answered_with_its_number_twice_a_second_whatever_is_offered(more: Sequence[str]) -> None:
    page = SlowPage(6)
    page.more = more
    async with watching(page):
        await asyncio.sleep(2.0)
        page.offers.clear()
        await asyncio.sleep(10.0)
    echoes = [offer for offer in page.offers if not offer["of"]]
    assert 15 <= len(echoes) <= 21
    numbers = [offer["took"] for offer in echoes]
    assert numbers == sorted(set(numbers))
    assert numbers[0] > 0


@pytest.mark.parametrize("ahead", [1, 3])
async def test_over_16_kbit_s_no_more_states_are_under_way_than_the_page_allows_and_events_wait_for_these(
    ahead: int,
) -> None:
    page = SlowPage(ahead)
    page.byte_s, page.more = 8 / 16_000, ("event",)
    async with watching(page):
        await asyncio.sleep(60.0)
    assert page.most_under_way == ahead
    assert len(page.states) >= 60
    assert len(page.events_s) >= 25
    assert max(page.events_s) <= (ahead * STATE + 4 * SMALL) * page.byte_s


@pytest.mark.parametrize("ahead", [2, 3])
async def test_over_16_kbit_s_200_missed_events_come_in_short_messages_and_scans_seldom_where_less_is_allowed(
    ahead: int,
) -> None:
    page = SlowPage(ahead)
    page.byte_s, page.more = 8 / 16_000, ("scan",)
    async with watching(page, missed=200):
        await asyncio.sleep(40.0)
        assert page.most_event == 200
        came_s = [at_s for at_s, _ in page.states]
        assert max(b - a for a, b in pairwise(came_s)) <= 2.0
        assert page.longest_s < 1.0, "after that, the page dials another connection"
        most = 40.0 / THIN_SCAN_EVERY_S + 1
        assert 8 <= page.scans <= most if ahead == 2 else page.scans > most


@pytest.mark.parametrize("kbit_s", [24, 32, 50])
@pytest.mark.parametrize("round_trip_s", [0.1, 0.4])
async def test_over_a_little_more_200_missed_events_come_in_messages_of_less_than_a_second(
    kbit_s: int, round_trip_s: float
) -> None:
    page = SlowPage(4)
    page.byte_s, page.round_trip_s = 8 / (1000 * kbit_s), round_trip_s
    async with watching(page, missed=200):
        await asyncio.sleep(30.0)
    assert page.most_event == 200
    assert page.longest_s < 1.0, "after that, the page dials another connection"


@pytest.mark.parametrize("round_trip_s", [0.7, 1.5])
async def test_a_long_round_trip_does_not_keep_messages_of_missed_events_short(round_trip_s: float) -> None:
    page = SlowPage(12)
    page.byte_s, page.round_trip_s = 8 / 500_000, round_trip_s
    async with watching(page, missed=200):
        await asyncio.sleep(5 * (round_trip_s + 0.5))
        assert page.most_event == 200, "10, 20, 40, 80 and 50"


async def test_the_round_trip_is_the_least_from_a_state_to_the_take_that_names_it() -> None:
    offers = PageOffers(time.monotonic, lambda: 5)
    assert offers.trip_s == 0.0
    for _ in range(3):
        offers.sent("state")
        await asyncio.sleep(0.1)
    offers.taken({"n": 1, "ahead": 12, "got": 2})
    assert offers.trip_s == pytest.approx(0.2)
    await asyncio.sleep(0.3)
    offers.taken({"n": 2, "ahead": 12, "got": 3})
    assert offers.trip_s == pytest.approx(0.2)
    offers.sent("state")
    await asyncio.sleep(0.05)
    offers.taken({"n": 3, "ahead": 12, "got": 4})
    offers.taken({"n": 4, "ahead": 12, "got": 4})
    assert offers.trip_s == pytest.approx(0.05)


def offers_of(now_s: float = 0.0) -> PageOffers:
    return PageOffers(lambda: now_s, lambda: 5)


def test_an_answer_that_comes_twice_or_names_more_than_was_sent_allows_no_more() -> None:
    offers = offers_of()
    for number in range(1, 4):
        offers.taken({"seq": 0, "n": number, "ahead": 2, "got": 10**9})
        assert offers.may_push
    for _ in range(2):
        offers.sent("state")
    assert not offers.may_push
    for number in range(4, 9):
        offers.taken({"seq": 0, "n": number, "ahead": 2, "got": 0})
        assert not offers.may_push
    offers.taken({"seq": 0, "n": 9, "ahead": 2, "got": 1})
    assert offers.may_push


@pytest.mark.parametrize("ahead", [{}, {"ahead": 6, "got": 0}])
def test_only_a_take_of_the_open_offer_closes_it(ahead: dict[str, int]) -> None:
    offers = offers_of()
    seq = offers.offered(is_echo=False)
    echo = offers.offered(is_echo=True)
    for other in (0, echo, seq + 7, None):
        assert not offers.taken({"seq": other, "n": 1, **ahead})
        assert offers.is_open
    assert offers.taken({"seq": seq, "n": 2, **ahead})
    assert not offers.is_open
    assert not offers.taken({"seq": seq, "n": 3, **ahead})


@pytest.mark.parametrize("ahead", [0, 6])
async def test_states_that_were_replaced_before_they_were_sent_are_counted(ahead: int) -> None:
    page = SlowPage(ahead)
    async with watching(page):
        await asyncio.sleep(10.0)
        assert page.writer is not None
        last = page.states[-1][1]
        assert last - len(page.states) - 1 <= page.writer.skipped <= last - len(page.states) + 8


@pytest.mark.parametrize("nonsense", [None, -1, True, "6", 2.5, []])
def test_a_number_that_is_none_allows_nothing_ahead(nonsense: object) -> None:
    offers = offers_of()
    assert offers.taken({"seq": 0, "n": nonsense, "ahead": nonsense, "got": nonsense}), (
        "it takes what was offered, as a page of before does"
    )
    assert (offers.may_push, offers.took, offers.took_ms) == (False, 0, 5)
