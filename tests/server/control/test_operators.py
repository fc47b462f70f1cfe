"""Who is in control, over real sockets: pages beside each other, programs, restarts, recordings."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path

import orjson
import pytest
import websockets

from server.access.identity import Role
from server.app.config import Config
from server.recording.read.read import open_recording
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.access.pairs import OPERATOR_KEY, cookie_of, keyed, paired_server
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.viewer import Viewer, viewer

SEEN = {"kind": "present", "visible": True, "sound": "ready", "awake": "ready", "lag_s": 0.1}


async def be_seen(one: Viewer) -> None:
    """As a page reports it once a second."""
    with contextlib.suppress(websockets.ConnectionClosed):
        while True:
            await one.send(SEEN)
            await asyncio.sleep(0.5)


@contextlib.asynccontextmanager
async def operator(base: str, name: str, page: str) -> AsyncIterator[Viewer]:
    """A page that is seen, with a name of its own."""
    async with viewer(base, name=name, page=page) as one:
        seen = asyncio.create_task(be_seen(one))
        await one.state(lambda s: any(there["page"] == page for there in s["reach"]["pages"]))
        try:
            yield one
        finally:
            seen.cancel()


def acts(one: Viewer) -> list[str]:
    return [event["act"] for event in one.events if event["change"] == "control"]


@pytest.mark.virtual_time
async def test_two_pages_one_control_and_an_old_number_is_refused(server: str) -> None:
    async with operator(server, "Ann", "page-ann") as ann, operator(server, "Ben", "page-ben") as ben:
        first = await ann.ask(kind="pause")
        assert first["ok"], first
        answer = await ben.ask(kind="resume")
        assert answer == answer | {"ok": False, "reason": "Ann is in control.", "held_by": "Ann"}
        state = await ben.state(lambda s: s["control"]["page"] == "page-ann")
        assert (state["control"]["holder"], state["control"]["fence"]) == ("Ann", first["fence"])
        assert (await ben.ask(kind="control", do="take_over"))["ok"]
        old = await ann.ask(kind="resume", fence=first["fence"])
        assert old["reason"] == "Ben is in control."
        assert (await ben.ask(kind="control", do="hand_over", to="page-ann"))["ok"]
        old = await ann.ask(kind="resume", fence=first["fence"])  # she is in control again, by another lease
        assert old["reason"] == "Control changed since this command: check, then send it again."
        assert (await ann.ask(kind="resume"))["ok"]
        await ben.until(lambda: len(acts(ben)) == 3)
        assert acts(ben) == ["taken", "taken_over", "handed_over"]
        fences = [event["fence"] for event in ben.events if event["change"] == "control"]
        assert fences == sorted(set(fences))


@pytest.mark.virtual_time
async def test_anybody_acknowledges_and_nobody_else_stops(bridge: RosBridge, server: str) -> None:
    async with operator(server, "Ann", "page-ann") as ann, operator(server, "Ben", "page-ben") as ben:
        assert (await ann.ask(kind="control", do="take"))["ok"]
        answer = await ben.ask(kind="acknowledge", alarm="speed_limit", occurrence=1)
        assert "held_by" not in answer  # refused for what it is: there is no such alarm
        refused = [
            await ben.ask(**command)
            for command in (
                {"kind": "connect", "address": bridge.address},  # type: ignore[attr-defined]
                {"kind": "disconnect"},
                {"kind": "record", "on": False},
                {"kind": "set", "values": {"speed_limit.max_mps": 4.0}},
                {"kind": "import", "toml": ""},
                {"kind": "ride", "phone": "page-ben"},
            )
        ]
        assert [one["reason"] for one in refused] == ["Ann is in control."] * 6


@pytest.mark.virtual_time
async def test_this_machine_s_own_console_is_never_refused_and_named(server: str) -> None:
    async with operator(server, "Ann", "page-ann") as ann, http_client(base_url=server) as console:
        assert (await ann.ask(kind="control", do="take"))["ok"]
        assert (await console.post("/api/pause", headers={"X-Catgraph-Fence": "1"})).status_code == 200
        await ann.until(lambda: any(event["change"] == "paused" for event in ann.events))
        assert [event["by"] for event in ann.events if event["change"] == "paused"] == ["api · python-httpx"]
        assert (await ann.state())["control"]["holder"] == "Ann"


@pytest.mark.virtual_time
async def test_the_name_that_a_page_claims_does_not_count(server: str) -> None:
    async with operator(server, "Ann", "page-ann") as ann, operator(server, "Ben", "page-ben") as ben:
        assert (await ann.ask(kind="control", do="take"))["ok"]
        answer = await ben.ask(kind="pause", by="Ann", who="local", page="page-ann", console=True)
        assert answer["reason"] == "Ann is in control."


@pytest.mark.virtual_time
async def test_nonsense_about_presence_is_answered(server: str) -> None:
    async with operator(server, "Ann", "page-ann") as ann:
        await ann.send(SEEN | {"sound": "deafening"})
        await ann.until(lambda: any(one["kind"] == "problem" and "sound" in one["reason"] for one in ann.other))
        assert (await ann.state())["reach"]["can"] == 1


@pytest.mark.virtual_time
async def test_a_page_that_is_closed_is_not_waited_for_and_one_that_breaks_off_is(server: str) -> None:
    async with operator(server, "Ann", "page-ann") as ann:
        async with operator(server, "Ben", "page-ben") as ben:
            await ann.state(lambda s: s["reach"]["of"] == 2)
            await ben.socket.close(code=1001)
            await ann.state(lambda s: s["reach"]["of"] == 1)
        async with operator(server, "Cem", "page-cem") as cem:
            await ann.state(lambda s: s["reach"]["of"] == 2)
            cem.socket.transport.abort()
            state = await ann.state(lambda s: s["reach"]["can"] == 1)
            assert (state["reach"]["of"], state["reach"]["why"]) == (2, "no contact")


@pytest.mark.virtual_time
async def test_alarms_reach_nobody_on_a_server_without_pages(bridge: RosBridge, server: str) -> None:
    async with driving(bridge), http_client(base_url=server) as program:
        async with asyncio.timeout(30):
            while True:
                found = (await program.get("/api/alarms")).json()["alarms"]
                if any(one["id"] == "reach" for one in found):
                    break
                await asyncio.sleep(0.5)
        (alarm,) = [one for one in found if one["id"] == "reach"]
        assert alarm["text"] == "The car moves at 4.2 m/s and nobody can hear alarms: no operator's phone is connected"
        log = (await program.get("/api/log.json", params={"alarm": "reach"})).json()
        assert [event["change"] for event in log] == ["raised"]


async def test_a_choice_of_phone_outlasts_connection_and_server(bridge: RosBridge, tmp_path: Path) -> None:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    async with serving(config) as base, operator(base, "Ann", "page-ann") as ann:
        assert (await ann.ask(kind="ride", phone="page-ann"))["ok"]
        assert (await ann.state(lambda s: s["phone"] is not None))["phone"]["choice"] == "operator"
        assert (await ann.ask(kind="disconnect"))["ok"]
        assert (await ann.ask(kind="connect", address=bridge.address))["ok"]  # type: ignore[attr-defined]
        state = await ann.state(lambda s: s["session"]["phase"] == "monitoring")
        assert (state["phone"]["id"], state["phones"][0]["compared"]) == ("page-ann", True)
        fence = state["control"]["fence"]
    async with serving(config) as base, operator(base, "Ann", "page-ann") as ann:
        state = await ann.state(lambda s: s["phone"] is not None)
        assert (state["phone"]["id"], state["phone"]["chosen"]) == ("page-ann", True)
        answer = await ann.ask(kind="pause")
        assert answer["fence"] > fence  # numbers go on
        assert (await ann.ask(kind="ride", phone=None))["ok"]
        assert (await ann.state(lambda s: s["phone"] is None))["phones"] == []


async def test_the_recording_holds_who_ordered_from_which_page(bridge: RosBridge, tmp_path: Path) -> None:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    async with driving(bridge), serving(config) as base, operator(base, "Ann", "page-ann") as ann:
        await ann.state(lambda s: s["recording"]["state"] == "recording")
        assert (await ann.ask(kind="control", do="take"))["ok"]
        answer = await ann.ask(kind="position", phone="page-ann", handheld=True, why="timeout")
        assert answer["ok"], answer
        state = await ann.state(lambda s: len(s["phones"]) == 1)
        assert (state["phones"][0]["label"], state["phones"][0]["why"]) == ("Ann", "timeout")
        assert (await ann.ask(kind="disconnect"))["ok"]
        await ann.state(lambda s: s["recording"]["saved"] is not None, within_s=10.0)
    (path,) = (tmp_path / "recordings").rglob("*.mcap")
    with open_recording([path]) as recording:
        took = next(row for _, row in recording.own("/catgraph/operator"))
        (position,) = [row for _, row in recording.own("/catgraph/phone")]
        log = [row["text"] for _, row in recording.own("/catgraph/alarms")]
    assert took == took | {"kind": "control", "do": "take", "by": "Ann", "who": "local", "page": "page-ann", "ok": True}
    assert position == position | {
        "phone": "page-ann",
        "why": "timeout",
        "by": "Ann",
        "who": "local",
        "page": "page-ann",
    }
    assert "Ann is in control." in log


# -- where devices are paired ------------------------------------------------------------------------------------------


async def test_a_program_is_refused_while_a_page_is_in_control_with_its_name(tmp_path: Path) -> None:
    async with paired_server(keyed(tmp_path)) as served, served.paired(Role.OPERATOR, "Pixel 7") as browser:
        program = {"Authorization": f"Bearer {OPERATOR_KEY}"}
        async with served.browser() as outside:
            assert (await outside.post("/api/pause", headers=program)).status_code == 200  # nobody is in control
            async with served.socket(await served.ticket(browser), cookie=cookie_of(browser)) as socket:
                one = Viewer(socket)
                await one.send({"kind": "hello", "have_event": None, "name": "somebody else", "page": "page-a"})
                reading, seen = asyncio.create_task(one.read()), asyncio.create_task(be_seen(one))
                await one.state(lambda s: s["reach"]["of"] == 1)
                taken = await one.ask(kind="resume")
                assert taken["ok"], taken
                refused = await outside.post("/api/pause", headers=program)
                assert (refused.status_code, refused.json()["detail"]) == (409, "Pixel 7 is in control.")
                assert refused.json()["held_by"] == "Pixel 7"  # as the list of devices has it, whatever the page claims
                by_page = await browser.post("/api/pause", headers={"X-Catgraph-Fence": str(taken["fence"])})
                assert by_page.status_code == 200
                old = await browser.post("/api/resume", headers={"X-Catgraph-Fence": str(taken["fence"] - 1)})
                assert old.status_code == 409
                seen.cancel()
                reading.cancel()


async def test_a_viewer_is_never_in_control_and_not_counted_on(tmp_path: Path) -> None:
    async with paired_server(keyed(tmp_path)) as served, served.paired(Role.VIEWER, "Visitor") as browser:
        async with served.socket(await served.ticket(browser), cookie=cookie_of(browser)) as socket:
            one = Viewer(socket)
            await one.send({"kind": "hello", "have_event": None, "page": "page-v"})
            reading, seen = asyncio.create_task(one.read()), asyncio.create_task(be_seen(one))
            for command in ({"do": "take"}, {"do": "take_over"}, {"do": "request"}):
                answer = await one.ask(kind="control", **command)
                assert not answer["ok"]
            assert (await one.state())["control"]["holder"] is None
            assert one.states[-1]["reach"]["of"] == 0
            seen.cancel()
            reading.cancel()


@pytest.mark.virtual_time
async def test_a_status_before_the_hello_counts_for_no_page(server: str) -> None:
    async with websockets.connect(f"{server.replace('http', 'ws')}/ws") as raw, viewer(server) as looks_on:
        await raw.send(orjson.dumps(SEEN).decode())
        await asyncio.sleep(1.0)
        await raw.send(orjson.dumps({"kind": "hello", "name": "Ann", "page": "page-ann"}).decode())
        await raw.send(orjson.dumps(SEEN).decode())
        state = await looks_on.state(lambda s: s["reach"]["of"])
        assert [there["page"] for there in state["reach"]["pages"]] == ["page-ann"]
        assert max(one["reach"]["of"] for one in looks_on.states) == 1
