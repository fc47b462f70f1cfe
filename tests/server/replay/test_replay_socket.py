"""A page's replay over a real socket: opened, controlled, left; live data continues; refusals carry a reason."""

from __future__ import annotations

import asyncio
import contextlib
import math
import signal
from pathlib import Path
from typing import Any

import psutil
import pytest
import websockets

from server.replay import manager
from server.rosbridge_server.server import RosBridge
from tests.http import http_client
from tests.server.cars import driving
from tests.server.replay.conftest import STREET
from tests.server.viewer import Viewer, viewer


async def order(one: Viewer, do: str, **fields: Any) -> dict[str, Any]:
    identity = f"order {do} {len(one.other)}"
    await one.send({"kind": "replay", "do": do, "id": identity, **fields})
    answer: dict[str, Any] = await one.until(
        lambda: next((reply for reply in one.other if reply.get("id") == identity), None)
    )
    return answer


def replays() -> list[psutil.Process]:
    """The processes of replays that run now."""
    found = []
    for process in psutil.Process().children():
        with contextlib.suppress(psutil.Error):  # it ends as we look
            if "server.replay.process" in process.cmdline():
                found.append(process)
    return found


async def at(one: Viewer, at_s: float) -> dict[str, Any]:
    return await one.state(
        lambda s: s.get("replay") is not None and s["replay"]["at_s"] == at_s and not s["replay"]["is_seeking"],
    )


@pytest.mark.field
async def test_a_recording_is_opened_led_and_left_while_live_goes_on(bridge: RosBridge, base: str) -> None:
    async with driving(bridge, speed=lambda n: 4.2), viewer(base) as other, viewer(base) as one:
        live = await one.state(lambda s: s["session"]["phase"] == "monitoring")
        assert "replay" not in live
        assert (await order(one, "open", recording=STREET, at_s=25.0))["ok"]
        frame = await at(one, 25.0)
        assert frame["signals"]["speed"]["value"]["speed_mps"] == 12.5
        assert "speed_limit" in {alarm["id"] for alarm in frame["alarms"] if alarm["active"]}
        assert frame["replay"]["alarms_from"] == "judged"
        assert frame["live"]["phase"] == "monitoring"
        assert (await other.state())["signals"]["speed"]["value"]["speed_mps"] == 4.2
        assert (await order(one, "seek", at_s=10.0))["ok"]
        assert (await at(one, 10.0))["signals"]["speed"]["value"]["speed_mps"] == pytest.approx(8.0 + math.sin(10 / 9))
        assert (await order(one, "rate", rate=4.0))["ok"]
        assert (await order(one, "play"))["ok"]
        await one.state(lambda s: s["replay"]["at_s"] > 12.0)
        assert (await order(one, "pause"))["ok"]
        assert (await order(one, "leave"))["ok"]
        again = await one.state(lambda s: "replay" not in s)
        assert again["signals"]["speed"]["value"]["speed_mps"] == 4.2


@pytest.mark.field
async def test_two_pages_look_at_different_moments(bridge: RosBridge, base: str) -> None:
    async with driving(bridge), viewer(base) as one, viewer(base) as two:
        for page, at_s in ((one, 5.0), (two, 40.0)):
            assert (await order(page, "open", recording=STREET, at_s=at_s))["ok"]
        assert (await at(one, 5.0))["replay"]["token"] != (await at(two, 40.0))["replay"]["token"]
        await order(one, "seek", at_s=33.0)
        await at(one, 33.0)
        await at(two, 40.0)


@pytest.mark.field
async def test_the_time_line_the_track_and_the_minute_come_of_the_recording(bridge: RosBridge, base: str) -> None:
    async with driving(bridge), viewer(base) as one:
        await order(one, "open", recording="car_20260921T142640Z", at_s=15.0)
        frame = await at(one, 15.0)
        assert frame["replay"]["alarms_from"] == "recording"
        line = await one.until(lambda: next((m for m in one.other if m["kind"] == "timeline" and m["is_done"]), None))
        assert len(line["speed_mps"]) > 30
        token = frame["replay"]["token"]
        async with http_client() as client:
            points = (await client.get(f"{base}/api/track/points", params={"replay": token})).json()
            minute = (await client.get(f"{base}/api/trends", params={"replay": token})).json()
            drive = (await client.get(f"{base}/api/trends/drive", params={"replay": token})).json()
            gone = await client.get(f"{base}/api/trends", params={"replay": "0000"})
        assert points["number"] == frame["session"]["track"]["number"]
        assert len(points["points"]) > 5
        assert minute["now"] == 75.0
        assert drive["start_ms"] == frame["replay"]["start_ms"]
        assert drive["known_s"] == drive["length_s"] == frame["replay"]["length_s"]
        assert sum(low is not None for low in drive["signals"]["speed"]["lowest"]) > 30
        assert gone.status_code == 404
        assert gone.json()["detail"] == "This replay is over."


async def test_nothing_is_ordered_from_a_replay_but_a_position_is_told(bridge: RosBridge, base: str) -> None:
    async with driving(bridge), viewer(base) as one:
        await one.state(lambda s: s["session"]["phase"] == "monitoring")
        await order(one, "open", recording=STREET)
        await at(one, 0.0)
        for command in (
            {"kind": "pause"},
            {"kind": "acknowledge", "alarm": "speed_limit", "occurrence": 1},
            {"kind": "set", "values": {}},
            {"kind": "disconnect"},
        ):
            answer = await one.ask(**command)
            assert answer["ok"] is False
            assert "shows a replay" in answer["reason"]
        assert (await one.ask(kind="position", phone="9c0f2b7d", handheld=True, why="denied"))["ok"]
        await order(one, "leave")
        assert (await one.ask(kind="pause"))["ok"]


@pytest.mark.field
async def test_a_live_alarm_reaches_the_page_that_replays(bridge: RosBridge, base: str) -> None:
    speed = [4.2]
    async with driving(bridge, speed=lambda n: speed[0]), viewer(base, have_event=0) as one:
        await order(one, "open", recording=STREET, at_s=5.0)
        await at(one, 5.0)
        speed[0] = 13.0
        event = await one.until(lambda: next((e for e in one.events if e["alarm"] == "speed_limit"), None))
        frame = await one.state(lambda s: "speed_limit" in {a["id"] for a in s["live"]["alarms"]})
        assert event["change"] == "raised"
        assert frame["replay"]["at_s"] == 5.0
        assert frame["signals"]["speed"]["value"]["speed_mps"] < 10.0


@pytest.mark.field
async def test_scans_are_those_of_the_recording(bridge: RosBridge, base: str) -> None:
    async with driving(bridge, scans=True), viewer(base) as one:
        await order(one, "open", recording=STREET, at_s=5.0)
        await at(one, 5.0)
        await one.send({"kind": "watch", "scan": True})
        await one.until(lambda: len(one.scans) >= 3)
        assert len({scan[4:8] for scan in one.scans}) == 1, "it stands at one moment: the same scan, sent repeatedly"
        assert int.from_bytes(one.scans[0][2:4], "little") == 181
        await order(one, "play")
        await one.until(lambda: len({scan[4:8] for scan in one.scans}) > 3)


async def test_what_is_no_recording_is_refused_in_words(bridge: RosBridge, base: str) -> None:
    async with viewer(base) as one:
        for recording in ("nobody", "../../etc/passwd", "..", "/etc/passwd", "street\x00", "a" * 119, "é"):
            answer = await order(one, "open", recording=recording)
            assert answer["ok"] is False
            assert answer["reason"].startswith("There is no recording named")
            await one.state()


ODD: tuple[dict[str, Any], ...] = (
    {"do": "seek"},
    {"do": "seek", "at_s": None},
    {"do": "seek", "at_s": "5"},
    {"do": "seek", "at_s": 1e12},
    {"do": "rate", "rate": 3.0},
    {"do": "rate", "rate": -1.0},
    {"do": "alarm", "direction": 2},
    {"do": "destroy"},
    {},
)


async def test_orders_that_make_no_sense_are_refused_in_words(bridge: RosBridge, base: str) -> None:
    async with viewer(base) as one:
        await order(one, "open", recording=STREET, at_s=3.0)
        for n, fields in enumerate(ODD):
            await one.send({"kind": "replay", "id": f"odd {n}", **fields})
            answer = await one.until(lambda n=n: next((r for r in one.other if r.get("id") == f"odd {n}"), None))
            assert answer["ok"] is False, fields
            assert answer["reason"].endswith("."), fields
            await at(one, 3.0)


@pytest.mark.parametrize(
    ("query", "at_s"), [("t=12", 12.0), ("t=inf", 59.95), pytest.param("t=nan", 0.0, marks=pytest.mark.field)]
)
async def test_a_socket_may_begin_with_a_recording(bridge: RosBridge, base: str, query: str, at_s: float) -> None:
    url = base.replace("http://", "ws://") + f"/ws?replay={STREET}&{query}"
    async with websockets.connect(url, max_size=2**24) as socket:
        one = Viewer(socket)
        reading = asyncio.create_task(one.read())
        await one.send({"kind": "hello", "have_event": None})
        await at(one, at_s)
        first = next(n for n, state in enumerate(one.states) if "replay" in state)
        assert all("replay" in state for state in one.states[first:])
        reading.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await reading


async def test_a_socket_that_begins_with_no_recording_is_told_and_goes_on_live(bridge: RosBridge, base: str) -> None:
    url = base.replace("http://", "ws://") + "/ws?replay=nobody"
    async with websockets.connect(url, max_size=2**24) as socket:
        one = Viewer(socket)
        reading = asyncio.create_task(one.read())
        await one.send({"kind": "hello", "have_event": None})
        message = await one.until(lambda: next((m for m in one.other if m["kind"] == "replay"), None))
        assert message["ended"] == "There is no recording named nobody."
        await one.state(lambda s: "replay" not in s)
        reading.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await reading


@pytest.mark.field
async def test_so_many_replays_and_no_more(bridge: RosBridge, base: str, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(manager, "MOST_REPLAYS", 2)
    async with contextlib.AsyncExitStack() as stack:
        pages = [await stack.enter_async_context(viewer(base)) for _ in range(3)]
        assert [(await order(page, "open", recording=STREET))["ok"] for page in pages] == [True, True, False]
        refusal = await order(pages[2], "open", recording=STREET)
        assert refusal["reason"] == "2 replays are open already: close one first."
        assert (await order(pages[0], "leave"))["ok"]
        assert (await order(pages[2], "open", recording=STREET))["ok"]


async def test_a_file_that_is_deleted_meanwhile_is_replayed_to_its_end(
    bridge: RosBridge, base: str, data: Path
) -> None:
    async with viewer(base) as one:
        await order(one, "open", recording=STREET)
        (data / "recordings" / "car" / "street.bag").unlink()
        await order(one, "seek", at_s=50.0)
        assert (await at(one, 50.0))["signals"]["speed"]["freshness"] == "fresh"


async def test_a_file_without_its_end_is_replayed_and_said_to_be_so(bridge: RosBridge, base: str, data: Path) -> None:
    whole = data / "recordings" / "car" / "car_20260921T142640Z.mcap"
    whole.write_bytes(whole.read_bytes()[: whole.stat().st_size // 2])
    async with viewer(base) as one:
        assert (await order(one, "open", recording="car_20260921T142640Z"))["ok"]
        line = await one.until(lambda: next((m for m in one.other if m["kind"] == "timeline" and m["is_done"]), None))
        assert any("never closed" in note for note in line["notes"])


async def test_a_file_that_is_none_is_refused_without_its_place_on_the_disk(
    bridge: RosBridge, base: str, data: Path
) -> None:
    (data / "recordings" / "car" / "car_20260921T142640Z.mcap").write_bytes(b"no recording at all")
    async with viewer(base) as one:
        answer = await order(one, "open", recording="car_20260921T142640Z")
        assert answer["ok"] is False
        assert "car_20260921T142640Z" in answer["reason"]
        assert str(data) not in answer["reason"]
        await one.state()


async def test_a_process_that_dies_ends_the_replay_in_words_and_live_goes_on(bridge: RosBridge, base: str) -> None:
    async with viewer(base) as one:
        await order(one, "open", recording=STREET)
        await at(one, 0.0)
        [process] = replays()
        process.send_signal(signal.SIGKILL)
        message = await one.until(lambda: next((m for m in one.other if m["kind"] == "replay"), None))
        assert message["ended"].startswith("The replay failed")
        await one.state(lambda s: "replay" not in s)


async def test_a_page_that_leaves_takes_its_process_along(bridge: RosBridge, base: str) -> None:
    async with viewer(base) as one:
        await order(one, "open", recording=STREET)
    async with asyncio.timeout(5):
        while replays():
            await asyncio.sleep(0.05)
