"""How much one page is offered: at most so many frames a second, and none that cannot be sent."""

from __future__ import annotations

import asyncio
import json
import time
from collections import Counter
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any, cast

import orjson
import pytest
from starlette.websockets import WebSocket

from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.protocol.messages import Hello
from server.protocol.page_messages import OpenReplay
from server.protocol.state import ServerState
from server.replay.manager import ReplayClient, ReplayManager
from server.replay.view_source import ViewSource
from server.web.fair_wakeup import FairWakeup
from server.web.page_writer import PageWriter

pytestmark = pytest.mark.virtual_time

A_SECOND = 20  # takes of a page, of the 25 messages that it may send
RUNAWAY = 2000
LIVE = {
    "session": {"phase": "monitoring", "name": "car", "paused": False},
    "link": {"cut": None, "problem": None},
    "recording": {}, "control": {}, "reach": {}, "decelerate": {}, "alarms": [], "server": {},
}  # fmt: skip


class Tape(ReplayClient):
    """A replay whose output the test plays."""

    async def open(self, *_: Any) -> None:
        self._source = cast(Any, type("Source", (), {"vehicle": "car", "title": ""}))
        self.play("state", "position")

    async def close(self) -> None:
        pass

    def watch_scan(self, is_wanted: bool) -> None:
        pass

    def play(self, *kinds: str, payload: bytes = b'{"kind":"state"}') -> None:
        for kind in kinds:
            self._take(kind, payload if kind in ("state", "scan") else b'{"notes":[]}')


class Tapes(ReplayManager):
    tape: Tape

    def _made(self, recording: str, _opening: Mapping[str, Any], on_new: Any) -> ReplayClient:
        self.tape = Tape(recording, now=self._now, on_new=on_new)
        return self.tape


class OnePage:
    """Takes whatever it is offered, at once."""

    def __init__(self, limit: int = RUNAWAY) -> None:
        self._limit = limit
        self.more: dict[str, int] = {}  # of its takes
        self.takes_s: list[float] = []
        self.received: Counter[str] = Counter()
        self.events: list[int] = []  # their numbers
        self.writer: PageWriter | None = None

    async def send_text(self, text: str) -> None:
        message = json.loads(text)
        self.received[message.get("kind", "")] += 1
        if message.get("kind") == "offer" and self.writer is not None:
            if len(self.takes_s) >= self._limit:
                raise RuntimeError("the page is flooded")
            self.takes_s.append(time.monotonic())
            self.writer.take({"seq": message["seq"], **self.more})
        if message.get("kind") == "events" and self.writer is not None:
            self.events += [event["n"] for event in message["events"]]
            self.writer.have_events()

    async def send_bytes(self, _: bytes) -> None:
        self.received["scan"] += 1

    @property
    def most_in_a_second(self) -> int:
        return max((sum(a <= b < a + 1.0 for b in self.takes_s) for a in self.takes_s), default=0)


@asynccontextmanager
async def watching(*, replays: bool) -> AsyncIterator[tuple[OnePage, LocalBus, Tapes, ViewSource]]:
    async def car(_: Mapping[str, Any]) -> Mapping[str, Any]:
        return {"ok": True}

    bus, tapes = LocalBus(Journal(None), now=time.monotonic), Tapes(lambda _: None, now=time.monotonic)
    bus.serve("car", car)
    bus.put("car", "state", orjson.dumps(LIVE).decode())
    page = OnePage()
    view = ViewSource(
        bus,
        "car",
        tapes,
        server=lambda: cast(ServerState, {}),
        on_new=lambda kind: writer.on_replay(kind),
        on_turned=lambda: writer.on_turned(),
    )
    writer = PageWriter(cast(WebSocket, page), bus, "car", view, FairWakeup(), now=time.monotonic, wall_ms=lambda: 0)
    page.writer = writer
    unwatch = bus.watch("car", writer.on_new)
    writer.watch_scan(True)
    running = asyncio.create_task(writer.run(lambda: cast(Hello, {"kind": "hello"})))
    writer.begin(0)
    if replays:
        await view.open(OpenReplay(kind="replay", do="open", recording="street"))
    yield page, bus, tapes, view
    unwatch()
    writer.close()
    running.cancel()
    await asyncio.gather(running, return_exceptions=True)


@pytest.mark.parametrize("kinds", [("state", "position"), ("scan",), ("state", "position", "scan"), ("timeline",)])
async def test_however_fast_a_replay_runs_a_page_takes_at_most_so_many_frames_a_second(kinds: tuple[str, ...]) -> None:
    async with watching(replays=True) as (page, bus, tapes, view):
        for n in range(300):
            tapes.tape.play(*kinds, payload=orjson.dumps({"kind": "state", "n": n}))
            bus.put("car", "state", orjson.dumps(LIVE).decode())
            await asyncio.sleep(0.01)
        assert 50 <= len(page.takes_s) < 65
        assert page.most_in_a_second <= A_SECOND
        await asyncio.sleep(0.2)
        before = len(page.takes_s)
        await asyncio.sleep(1.0)
        assert len(page.takes_s) == before, "all is taken: nothing more is offered"
        assert view.number(kinds[-1] if kinds[-1] != "position" else "state") > 0


async def test_however_often_a_live_car_is_told_of_a_page_takes_at_most_so_many_frames_a_second() -> None:
    async with watching(replays=False) as (page, bus, _tapes, _view):
        for _ in range(300):
            for kind, payload in (("state", orjson.dumps(LIVE).decode()), ("scan", b"beams")):
                bus.put("car", kind, payload)
                await asyncio.sleep(0.005)
        assert page.received["scan"] >= 50
        assert page.most_in_a_second <= A_SECOND


async def test_over_a_radio_that_carries_little_scans_of_a_replay_come_as_they_are_played() -> None:
    async with watching(replays=True) as (page, _bus, tapes, _view):
        page.more = {"n": 1, "ahead": 1, "got": 0}
        for _ in range(20):
            tapes.tape.play("scan", payload=b"beams")
            await asyncio.sleep(0.5)
        assert page.received["scan"] == 20


async def test_back_before_the_first_scan_nothing_is_offered_that_cannot_be_sent() -> None:
    """A scan was played, and not taken yet, when the replay was led back to where there is none."""
    async with watching(replays=True) as (page, _bus, tapes, view):
        await asyncio.sleep(0.2)
        tapes.tape.play("scan", payload=b"beams")
        tapes.tape.play("scan", payload=b"")
        taken = len(page.takes_s)
        await asyncio.sleep(1.0)
        assert len(page.takes_s) == taken
        view.watch_scan(True)
        await view.open(OpenReplay(kind="replay", do="open", recording="street"))  # judged anew: all is new to the page
        tapes.tape.play("scan", payload=b"beams")
        await asyncio.sleep(0.2)
        assert page.received["scan"] == 1


@pytest.mark.parametrize("kind", ["state", "scan", "cars", "timeline"])
async def test_a_frame_that_has_no_payload_is_offered_once_whatever_it_is(
    kind: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with watching(replays=True) as (page, _bus, tapes, view):
        await asyncio.sleep(0.2)
        taken, number, newest = len(page.takes_s), view.number, view.newest
        monkeypatch.setattr(view, "number", lambda one: 10**6 if one == kind else number(one))
        monkeypatch.setattr(view, "newest", lambda one: None if one == kind else newest(one))
        for _ in range(10):
            tapes.tape.play("state", "position")
            await asyncio.sleep(0.1)
        assert len(page.takes_s) - taken <= 11


async def test_a_page_that_catches_up_with_many_events_answers_slowly_and_gets_them_all() -> None:
    async with watching(replays=False) as (page, bus, _tapes, _view):
        bus.append("car", [{"change": "mark", "alarm": None, "at_ms": 0}] * 20_000)
        before_s = time.monotonic()
        while len(page.events) < 20_000:
            await asyncio.sleep(0.01)
        took_s = time.monotonic() - before_s
        assert page.events == list(range(1, 20_001))
        assert 0.2 * (page.received["events"] - 1) <= took_s + 0.001, "at most 5 answers a second"
        assert took_s <= 12
