"""The log's file is held, damaged or gone: judging goes on, events reach the pages, and the operator is informed."""

from __future__ import annotations

import sqlite3
from pathlib import Path
from typing import Any

import pytest

from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.cars import driving
from tests.server.conftest import serving
from tests.server.viewer import Viewer, viewer

pytestmark = pytest.mark.virtual_time


def config_of(bridge: RosBridge, data: Path) -> Config:
    return Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=data)  # type: ignore[attr-defined]


def stands(state: dict[str, Any], name: str) -> bool:
    return any(alarm["id"] == name and alarm["active"] for alarm in state["alarms"])


async def raised(one: Viewer, name: str) -> None:
    await one.until(
        lambda: any(event["alarm"] == name and event["change"] == "raised" for event in one.events), within_s=8
    )


@pytest.mark.field
async def test_a_file_that_another_program_holds_stops_no_alarm_and_is_reported(
    bridge: RosBridge, tmp_path: Path
) -> None:
    config = config_of(bridge, tmp_path)
    speeds = {"now": 2.0}
    async with driving(bridge, speed=lambda n: speeds["now"]):
        async with serving(config) as server, viewer(server) as one, http_client(base_url=server) as client:
            await one.state(lambda s: s["signals"]["speed"]["freshness"] == "fresh")
            other = sqlite3.connect(tmp_path / "events.sqlite", isolation_level=None)
            other.execute("BEGIN IMMEDIATE")
            speeds["now"] = 12.6
            await raised(one, "speed_limit")
            state = await one.state(lambda s: stands(s, "log_not_kept"), within_s=8)
            assert state["log_trouble"].startswith("The alarm log is not stored: another program holds the file.")
            assert 'catgraph_alarm_log_kept{vehicle="car"} 0' in (await client.get("/metrics")).text
            found = next(alarm for alarm in state["alarms"] if alarm["id"] == "speed_limit")
            assert (await one.ask(kind="acknowledge", alarm="speed_limit", occurrence=found["occurrence"]))["ok"]
            page = (await client.get("/api/log", params={"alarm": "speed_limit"})).json()
            assert [event["change"] for event in page["events"]] == ["acknowledged", "raised"]
            other.execute("ROLLBACK")
            other.close()
            await one.state(lambda s: s["log_trouble"] is None)
        async with serving(config) as server, viewer(server) as one:
            state = await one.state(lambda s: stands(s, "speed_limit"))
            found = next(alarm for alarm in state["alarms"] if alarm["id"] == "speed_limit")
            assert found["state"] == "ACKED"


@pytest.mark.parametrize("body", [b"this is no database at all" * 400, b"SQLite format 3\x00" + bytes(9000), b""])
async def test_a_damaged_log_stops_no_start(bridge: RosBridge, tmp_path: Path, body: bytes) -> None:
    (tmp_path / "events.sqlite").write_bytes(body)
    async with (
        driving(bridge, speed=lambda n: 12.6),
        serving(config_of(bridge, tmp_path)) as server,
        viewer(server, have_event=0) as one,
    ):
        await raised(one, "speed_limit")
        assert one.states[-1]["log_trouble"] is None
        if body:
            assert one.events[0]["text"].startswith("The alarm log was damaged: it is set aside as events.damaged")
        else:
            assert one.events[0]["change"] == "started"


async def test_a_data_folder_that_takes_no_log_stops_no_start(bridge: RosBridge, tmp_path: Path) -> None:
    (tmp_path / "events.sqlite").mkdir()  # where the file should be: for a superuser too it cannot be opened
    async with (
        driving(bridge, speed=lambda n: 12.6),
        serving(config_of(bridge, tmp_path)) as server,
        viewer(server, have_event=0) as one,
    ):
        await raised(one, "speed_limit")
        state = await one.state(lambda s: stands(s, "log_not_kept"), within_s=8)
        assert state["log_trouble"].startswith("The alarm log is not stored: the file cannot be opened.")
