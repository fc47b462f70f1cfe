"""kill -9 and a new start on the same data: active alarms are active again, entries are kept, numbers continue."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.page.processes import Process
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.viewer import Viewer, viewer

FAST = {"speed_limit.max_mps": 4.0}


def alarm_of(state: dict[str, Any], name: str) -> dict[str, Any] | None:
    return next((alarm for alarm in state["alarms"] if alarm["id"] == name), None)


async def alarm(one: Viewer, name: str, stands: str, within_s: float = 20.0) -> dict[str, Any]:
    """The alarm, once it stands as named."""
    state = await one.state(lambda s: (alarm_of(s, name) or {}).get("state") == stands, within_s)
    found = alarm_of(state, name)
    assert found is not None
    return found


@contextlib.asynccontextmanager
async def server_of(data: Path, *vehicle: str) -> AsyncIterator[Process]:
    process = Process("serve", "--port", "0", "--data", str(data), *(f"--vehicle={one}" for one in vehicle))
    await process.start()
    try:
        yield process
    finally:
        await process.kill()


async def events(base: str, **filters: Any) -> list[dict[str, Any]]:
    async with http_client(base_url=base) as client:
        return list((await client.get("/api/log.json", params=filters)).json())


def occurrences(log: list[dict[str, Any]], name: str) -> list[int]:
    return [e["occurrence"] for e in log if e["alarm"] == name and e["change"] in ("raised", "recaused")]


async def test_alarms_survive_kill_9_as_they_stood(bridge: RosBridge, tmp_path: Path) -> None:
    """Unacknowledged, acknowledged by name, shelved; three kills; the end of each story after the last."""
    address = bridge.address  # type: ignore[attr-defined]
    speeds = {"now": 6.0}
    async with driving(bridge, speed=lambda n: speeds["now"]):
        async with server_of(tmp_path, address) as server, viewer(server.address, name="Pixel 7 · a3f2") as one:
            assert (await one.ask(kind="set", values=FAST))["ok"]
            first = await alarm(one, "speed_limit", "UNACKED")
            await server.kill()

        async with server_of(tmp_path, address) as server, viewer(server.address, name="Pixel 7 · a3f2") as one:
            again = await alarm(one, "speed_limit", "UNACKED")
            assert again["occurrence"] == first["occurrence"]
            assert again["trip_text"] == first["trip_text"]
            assert abs(again["raised_ms"] - first["raised_ms"]) < 500
            assert (await one.ask(kind="acknowledge", alarm="speed_limit", occurrence=again["occurrence"]))["ok"]
            await server.kill()  # at once: what was answered is kept

        async with server_of(tmp_path, address) as server, viewer(server.address) as one:
            acked = await alarm(one, "speed_limit", "ACKED")
            assert acked["acknowledged_by"] == "Pixel 7 · a3f2"
            await asyncio.sleep(1.5)  # the cause is still there: known, and not announced again
            assert alarm_of(one.states[-1], "speed_limit")["state"] == "ACKED"  # type: ignore[index]
            log = await events(server.address, alarm="speed_limit")
            assert [e["change"] for e in log] == ["raised", "acknowledged"]
            speeds["now"] = 2.0
            await one.state(lambda s: alarm_of(s, "speed_limit") is None)
            speeds["now"] = 6.0
            later = await alarm(one, "speed_limit", "UNACKED")
            assert later["occurrence"] == first["occurrence"] + 1
            log = await events(server.address)
            assert [e["n"] for e in log] == list(range(1, len(log) + 1))
            assert [e["change"] for e in log].count("started") == 3
            assert sum("nothing was monitored meanwhile" in e["text"] for e in log) == 2


@pytest.mark.field
async def test_a_returned_alarm_and_a_shelf_survive_kill_9(bridge: RosBridge, tmp_path: Path) -> None:
    address = bridge.address  # type: ignore[attr-defined]
    async with server_of(tmp_path, address) as server, viewer(server.address, name="Ann") as one:
        async with driving(bridge):
            await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        silent = await alarm(one, "car_silent", "UNACKED")
        async with driving(bridge):
            await alarm(one, "car_silent", "RTN_UNACKED")
            await server.kill()
    async with driving(bridge), server_of(tmp_path, address) as server, viewer(server.address, name="Ann") as one:
        returned = await alarm(one, "car_silent", "RTN_UNACKED")
        assert returned["occurrence"] == silent["occurrence"]
        await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
        await asyncio.sleep(1.0)
        assert alarm_of(one.states[-1], "car_silent") is not None
        assert (await one.ask(kind="acknowledge", alarm="car_silent", occurrence=returned["occurrence"]))["ok"]
        await one.state(lambda s: alarm_of(s, "car_silent") is None)


@pytest.mark.virtual_time
async def test_a_pause_outlasts_a_restart_and_is_reported(bridge: RosBridge, tmp_path: Path) -> None:
    address = bridge.address  # type: ignore[attr-defined]
    config = Config(vehicles=(Vehicle(name="car", address=address),), data=tmp_path)
    async with driving(bridge):
        async with serving(config) as server, viewer(server, name="Ann") as one:
            await one.state(lambda s: s["session"]["phase"] == "monitoring")
            assert (await one.ask(kind="pause"))["ok"]
            await one.state(lambda s: s["session"]["paused_by"] == "Ann")
        async with serving(config) as server, viewer(server, have_event=0) as one:
            state = await one.state(lambda s: s["session"]["phase"] == "monitoring")
            assert state["session"]["paused"]
            assert state["session"]["paused_by"] == "Ann"
            text = "restarted and monitoring is still paused"
            await one.until(lambda: any(text in event["text"] for event in one.events))
            assert (await one.ask(kind="resume"))["ok"]
        async with serving(config) as server, viewer(server) as one:
            state = await one.state(lambda s: s["session"]["phase"] == "monitoring")
            assert not state["session"]["paused"]


@pytest.mark.virtual_time
async def test_a_planned_stop_outlasts_a_restart_and_motion_ends_it(bridge: RosBridge, tmp_path: Path) -> None:
    address, speeds = bridge.address, {"now": 0.0}  # type: ignore[attr-defined]
    config = Config(vehicles=(Vehicle(name="car", address=address),), data=tmp_path)
    async with driving(bridge, speed=lambda _: speeds["now"]):
        async with serving(config) as server, viewer(server, name="Ann") as one:
            await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
            assert (await one.ask(kind="planned_stop", reason="charging"))["ok"]
            began = (await one.state(lambda s: s["session"]["planned_stop"]))["session"]["planned_stop"]
        async with serving(config) as server, viewer(server, have_event=0) as one:
            state = await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
            again = state["session"]["planned_stop"]
            assert (again["reason"], again["by"], again["is_speed_known"]) == ("charging", "Ann", True)
            assert abs(again["since_ms"] - began["since_ms"]) <= 2
            text = "the planned stop continues: charging or refuelling"
            await one.until(lambda: any(text in event["text"] for event in one.events))
            speeds["now"] = 1.0
            await one.state(lambda s: s["session"]["planned_stop"] is None)
        async with serving(config) as server, viewer(server) as one:
            state = await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
            assert state["session"]["planned_stop"] is None


@pytest.mark.virtual_time
@pytest.mark.parametrize("same", [True, False])
async def test_alarms_of_a_car_typed_by_hand_wait_for_that_car(bridge: RosBridge, tmp_path: Path, same: bool) -> None:
    """Started without an address the server dials nobody; of another car's alarms nothing is shown, and they end."""
    address = bridge.address  # type: ignore[attr-defined]
    other = RosBridge(ros_version=1)
    other_address = f"ws://127.0.0.1:{await other.start()}"
    other.advertise("/catvehicle/vel", "geometry_msgs/Twist")
    config = Config(data=tmp_path)
    async with driving(bridge, speed=lambda n: 6.0), driving(other, speed=lambda n: 1.0):
        async with serving(config) as server, viewer(server) as one:
            assert (await one.ask(kind="set", values=FAST))["ok"]
            assert (await one.ask(kind="connect", address=address))["ok"]
            first = await alarm(one, "speed_limit", "UNACKED")
        async with serving(config) as server, viewer(server, have_event=0) as one:
            state = await one.state()
            assert state["session"]["phase"] == "idle"
            assert state["session"]["held"] == {"address": address, "alarms": 1, "paused": False}
            assert state["alarms"] == []
            assert (await one.ask(kind="connect", address=address if same else other_address))["ok"]
            if same:
                assert (await alarm(one, "speed_limit", "UNACKED"))["occurrence"] == first["occurrence"]
            else:
                state = await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
                assert alarm_of(state, "speed_limit") is None
            log = await events(server, alarm="speed_limit")
            assert [e["change"] for e in log] == (["raised"] if same else ["raised", "cleared"])
            assert state["session"]["held"] is not None if same else state["session"]["held"] is None
    await other.stop()


@pytest.mark.virtual_time
async def test_an_end_by_the_operator_leaves_nothing_to_come_back(bridge: RosBridge, tmp_path: Path) -> None:
    address = bridge.address  # type: ignore[attr-defined]
    config = Config(vehicles=(Vehicle(name="car", address=address),), data=tmp_path)
    async with driving(bridge, speed=lambda n: 6.0):
        async with serving(config) as server, viewer(server) as one:
            assert (await one.ask(kind="set", values=FAST))["ok"]
            await alarm(one, "speed_limit", "UNACKED")
            assert (await one.ask(kind="disconnect"))["ok"]
        async with serving(config) as server, viewer(server) as one:
            second = await alarm(one, "speed_limit", "UNACKED")
            assert second["occurrence"] == 2
            log = await events(server)
            assert occurrences(log, "speed_limit") == [1, 2]
            assert not any(e["change"] == "restarted" for e in log)
