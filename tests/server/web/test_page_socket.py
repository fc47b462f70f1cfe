"""Pages: newest only, events exactly once, nobody delays anybody, nonsense harms nobody."""

from __future__ import annotations

import asyncio
import itertools
import json
import time

import pytest
import websockets
from websockets.protocol import State

from server.rosbridge_server.server import RosBridge
from server.web import page_writer
from tests.http import http_client
from tests.server import scan_frames
from tests.server.cars import driving
from tests.server.viewer import Viewer, viewer


@pytest.mark.virtual_time
@pytest.mark.parametrize("gap_s", [3.0, 30.0])
async def test_a_viewer_that_stops_reading_finds_nothing_old(bridge: RosBridge, server: str, gap_s: float) -> None:
    """The pipe may hold an offer, and at most one batch of events, but no state."""
    async with driving(bridge, speed=lambda n: n / 100), websockets.connect(server.replace("http", "ws") + "/ws") as ws:
        one = Viewer(ws)
        while len(one.states) < 20:
            await one.hear(await ws.recv())
        ws.transport.pause_reading()
        await asyncio.sleep(gap_s + 0.05)  # between two states
        ws.transport.resume_reading()
        resumed_s, seen = time.time(), len(one.states)
        while len(one.states) == seen:
            await one.hear(await ws.recv())
        age_s = resumed_s - one.states[-1]["server"]["time_ms"] / 1000
        assert age_s < 0.06
        assert one.got_s[-1] - resumed_s < 0.11


@pytest.mark.virtual_time
@pytest.mark.parametrize(
    ("hello", "is_former"),
    [({"page": "p1"}, True), ({"page": "p1", "build": ""}, False), ({"page": "p1", "build": "b2"}, False), ({}, False)],
)
async def test_only_a_page_that_names_no_build_gets_former_names(
    bridge: RosBridge, server: str, hello: dict[str, str], is_former: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    renamed: list[str] = []

    def rename(payload: str) -> str:
        renamed.append(payload)
        return payload

    monkeypatch.setattr(page_writer, "former_state", rename)
    async with driving(bridge), websockets.connect(server.replace("http", "ws") + "/ws") as socket:
        one = Viewer(socket)
        await one.send({"kind": "hello", "have_event": 0} | hello)
        async with asyncio.timeout(10.0):
            while len(one.states) < 5:
                await one.hear(await socket.recv())
    assert bool(renamed) == is_former


@pytest.mark.virtual_time
async def test_one_offer_stands_unanswered_at_a_time(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), viewer(server) as one:
        await one.state()
        one.takes = False
        await asyncio.sleep(0.3)
        offers = len(one.offers)
        await asyncio.sleep(0.7)
        assert len(one.offers) == offers
        one.takes = True
        await one.send({"kind": "take", "seq": one.offers[-1]["seq"]})
        await one.state()


@pytest.mark.virtual_time
async def test_a_stalled_page_delays_nobody(bridge: RosBridge, server: str) -> None:
    async with driving(bridge, scans=True), viewer(server) as live:
        stalled = [await websockets.connect(server.replace("http", "ws") + "/ws") for _ in range(3)]
        for socket in stalled:
            await socket.send('{"kind":"watch","scan":true}')
            socket.transport.pause_reading()
        await live.state()
        start = len(live.got_s)
        await asyncio.sleep(2.0)
        times = live.got_s[start:]
        assert len(times) >= 19
        assert max(b - a for a, b in itertools.pairwise(times)) < 0.2
        for socket in stalled:
            socket.transport.abort()


@pytest.mark.virtual_time
async def test_events_come_exactly_once_over_a_reconnection(bridge: RosBridge, server: str) -> None:
    async with driving(bridge):
        async with viewer(server, have_event=0) as one:
            await one.until(lambda: any(event["change"] == "connected" for event in one.events))
            assert (await one.ask(kind="pause"))["ok"]
            await one.until(lambda: any(event["change"] == "paused" for event in one.events))
            seen = [event["n"] for event in one.events]
        async with http_client() as client:
            (await client.post(f"{server}/api/resume")).raise_for_status()
        async with viewer(server, have_event=seen[-1]) as two:
            await two.until(lambda: two.events)
            later = [event["n"] for event in two.events]
        assert seen + later == list(range(1, later[-1] + 1))
        assert two.events[0]["change"] == "resumed"


@pytest.mark.virtual_time
async def test_scans_go_only_to_pages_that_watch_them(bridge: RosBridge, server: str) -> None:
    async with driving(bridge, scans=True), viewer(server) as one, viewer(server) as other:
        await one.send({"kind": "watch", "scan": True})
        await one.until(lambda: len(one.scans) > 5)
        assert scan_frames.read(one.scans[-1]).codes.size == 181
        await one.send({"kind": "watch", "scan": False})
        await asyncio.sleep(0.3)
        count = len(one.scans)
        await asyncio.sleep(0.5)
        assert len(one.scans) == count
        assert other.scans == []


NONSENSE = [
    "",
    "null",
    "[]",
    "42",
    '"take"',
    "{",
    '{"kind":"take"',
    "{}",
    '{"kind":17,"id":"x"}',
    '{"kind":"fly","id":"x"}',
    '{"kind":"acknowledge","id":"x"}',
    '{"kind":"acknowledge","id":"x","alarm":[],"occurrence":"1"}',
    '{"kind":"acknowledge","id":"x","alarm":"nothing","occurrence":99999999999999999999}',
    '{"kind":"shelve","id":"x","alarm":"speed_limit","occurrence":1,"minutes":1e9}',
    '{"kind":"connect","id":"x","address":7}',
    '{"kind":"pause","id":["x"]}',
    '{"kind":"hello","have_event":-5}',
    '{"kind":"hello","have_event":"many"}',
    '{"kind":"have","event":[]}',
    '{"kind":"take","seq":"no"}',
    '{"kind":"watch","scan":"yes"}',
    "[" * 5000,
    '{"kind":"' + "x" * 17000 + '"}',
]


@pytest.mark.virtual_time
@pytest.mark.parametrize("text", NONSENSE, ids=range(len(NONSENSE)))
async def test_nonsense_from_a_page_is_answered_and_harms_nothing(server: str, text: str) -> None:
    async with viewer(server) as one:
        await one.state()
        await one.socket.send(text)
        await one.state()
        for answer in one.other:
            if answer["kind"] in ("reply", "problem"):
                assert answer.get("ok") is not True
                assert 5 < len(answer["reason"]) < 300


@pytest.mark.virtual_time
async def test_a_page_that_only_talks_nonsense_is_let_go(server: str) -> None:
    async with websockets.connect(server.replace("http", "ws") + "/ws") as socket:
        with pytest.raises(websockets.ConnectionClosed):
            await _talk_nonsense(socket)


async def _talk_nonsense(socket: websockets.ClientConnection) -> None:
    for _ in range(2000):
        await socket.send("nonsense")
        await asyncio.sleep(0)
    while True:
        await asyncio.wait_for(socket.recv(), 5)


@pytest.mark.virtual_time
async def test_an_unknown_vehicle_is_refused(server: str) -> None:
    with pytest.raises(websockets.InvalidStatus):
        await websockets.connect(server.replace("http", "ws") + "/ws?vehicle=nobody")


@pytest.mark.virtual_time
async def test_binary_from_a_page_is_refused(server: str) -> None:
    async with viewer(server) as one:
        await one.socket.send(b"\x00\x01")
        await one.until(lambda: any(answer["kind"] == "problem" for answer in one.other))


@pytest.mark.virtual_time
async def test_hello_says_what_the_protocol_promises(server: str) -> None:
    async with websockets.connect(server.replace("http", "ws") + "/ws") as socket:
        hello = json.loads(await socket.recv())
        assert hello["kind"] == "hello"
        assert set(hello) >= {"version", "boot", "vehicle", "vehicles", "time_ms", "last_event", "veil_after_s"}
        assert json.loads(await socket.recv())["kind"] == "state"


@pytest.mark.virtual_time
@pytest.mark.parametrize("fleet", [False, True])
async def test_a_page_that_connects_again_ends_its_connection_that_is_quiet_and_no_other(
    bridge: RosBridge, server: str, fleet: bool
) -> None:
    async with (
        driving(bridge),
        viewer(server, page="page-ann", fleet=fleet) as dead,
        viewer(server, page="page-ann", fleet=fleet) as tab,
        viewer(server, page="page-ben", fleet=fleet) as quiet,
    ):
        for one in (dead, tab, quiet):
            await one.until(lambda one=one: one.offers)
        dead.takes = quiet.takes = False
        await asyncio.sleep(4.0)
        assert dead.socket.state is State.OPEN
        async with viewer(server, page="page-ann", fleet=fleet) as again, asyncio.timeout(10.0):
            await dead.socket.wait_closed()
            for one in (again, tab):
                count = len(one.offers)
                await one.until(lambda one=one, count=count: len(one.offers) > count + 5)
        assert (tab.socket.state, quiet.socket.state) == (State.OPEN, State.OPEN)
