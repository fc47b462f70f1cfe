"""A page that read the log in another run of the server goes on where both logs are the same."""

from __future__ import annotations

import shutil
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


async def boot_of(one: Viewer) -> str:
    hello = await one.until(lambda: next((message for message in one.other if message["kind"] == "hello"), None))
    return str(hello["boot"])


async def change(one: Viewer, most_mps: float) -> dict[str, Any]:
    """Its event in the log, once the page has it."""
    assert (await one.ask(kind="set", values={"speed_limit.max_mps": most_mps}))["ok"]
    found: dict[str, Any] = await one.until(
        lambda: next((e for e in one.events if e["change"] == "settings" and str(most_mps) in e["text"]), None)
    )
    return found


async def test_a_restored_folder_gives_no_number_of_a_run_again(bridge: RosBridge, tmp_path: Path) -> None:
    address, data, backup = bridge.address, tmp_path / "data", tmp_path / "backup"  # type: ignore[attr-defined]
    config = Config(vehicles=(Vehicle(name="car", address=address),), data=data)
    async with driving(bridge):
        async with serving(config) as server, viewer(server, have_event=0) as one:
            first, kept = await boot_of(one), await change(one, 21.5)
        shutil.copytree(data, backup)
        async with serving(config) as server, viewer(server, have_event=kept["n"], boot=first) as one:
            second, lost = await boot_of(one), await change(one, 22.5)
            assert one.resumed is not None
            assert one.resumed["common"] == one.resumed["new_after"] == kept["n"]
            assert [event["n"] for event in one.events] == list(range(kept["n"] + 1, lost["n"] + 1))
        shutil.rmtree(data)
        shutil.copytree(backup, data)
        async with serving(config) as server:
            async with viewer(server, have_event=lost["n"], boot=second) as one:
                later = await change(one, 23.5)
                assert await boot_of(one) not in (first, second)
                assert one.resumed is not None
                assert one.resumed["common"] == 0, "the folder does not know the second run"
                assert kept["n"] <= one.resumed["new_after"] < later["n"]
                assert [event["n"] for event in one.events] == list(range(1, later["n"] + 1))
                assert lost not in one.events
            async with viewer(server, have_event=kept["n"], boot=first) as one:
                await one.until(lambda: later in one.events)
                assert one.events[0]["n"] == kept["n"] + 1
            async with http_client(base_url=server) as client:
                query = {"after": lost["n"], "run": second}
                answer = (await client.get("/api/events", params=query)).json()
                assert answer["resumed"]["common"] == 0
                assert answer["events"][0]["n"] == 1
                same = (await client.get("/api/events", params={"after": 1, "run": answer["run"]})).json()
                assert same["events"][0]["n"] == 2
                assert "resumed" not in same
