"""A real session with the simulated car and its safety driver: logged, shown, described, kept over a restart."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.app.config import Config
from server.recording.catalog import annotations as annotation_store
from server.recording.folder import FINISHED
from server.simulator.service import CarService
from server.vehicle.vehicle import Vehicle
from tests.server.conftest import serving

PLAN = ("manual-takeover@6+4", "driver-brakes@13.5+2", "mode-flaps@18.5+3")
ENDS_S = 25.0  # of the drive
LOADED_S = 3.0  # this machine is shared; test_safety_driver.py holds ± 0.2 s where time is virtual


class Server:
    """The API of one server."""

    def __init__(self, client: httpx.AsyncClient) -> None:
        self.client = client

    async def mode(self) -> dict[str, Any]:
        found: dict[str, Any] = (await self.client.get("/api/state")).json()["mode"]
        return found

    async def events(self, change: str) -> list[dict[str, Any]]:
        found = (await self.client.get("/api/events", params={"limit": 1000})).json()["events"]
        return [event for event in found if event["change"] == change]

    async def until(self, true: Callable[[dict[str, Any]], bool], seconds: float = 30.0) -> dict[str, Any]:
        ends_s = time.monotonic() + seconds
        while not true(mode := await self.mode()):
            assert time.monotonic() < ends_s, mode
            await asyncio.sleep(0.05)
        return mode

    async def describe(self, intervention: str, **body: Any) -> httpx.Response:
        return await self.client.post(f"/api/interventions/{intervention}/describe", json=body)


@contextlib.asynccontextmanager
async def served(config: Config) -> AsyncIterator[Server]:
    async with serving(config) as base, httpx.AsyncClient(base_url=base, timeout=20.0) as client:
        yield Server(client)


@pytest.mark.field
@pytest.mark.slow
async def test_a_drive_with_each_scenario_and_a_restart(tmp_path: Path) -> None:
    service = CarService(scenarios=PLAN, seed=1)
    port = await service.start()
    config = Config(vehicles=(Vehicle(name="car", address=f"ws://127.0.0.1:{port}"),), data=tmp_path)
    try:
        async with served(config) as one:
            manual = await one.until(lambda mode: mode["mode"] == "manual")
            assert manual["source"] == "/catvehicle/control_mode"
            last = await one.until(lambda mode: service.car.elapsed_s > ENDS_S and mode["mode"] == "autonomous")
            assert [row["kind_of"] for row in last["open"]] == ["to_manual", "brake"]
            truth = service.state()["truth"]["interventions"]
            logged = await one.events("intervention")
            assert [event["kind_of"] for event in logged] == [row["kind_of"] for row in truth]
            for event, row in zip(logged, truth, strict=True):
                assert abs(event["moment_ms"] - row["at_ms"]) <= 1000 * LOADED_S
                assert event["initiated_by"] in ("driver", "unknown")  # a busy machine sees brake and mode at once
                assert len(event["before"]) <= 21
            modes = [(event["before"], event["mode"]) for event in await one.events("mode")]
            assert modes == [  # a short change is logged both ways
                ("unknown", "autonomous"), ("autonomous", "manual"), ("manual", "autonomous"),
                ("autonomous", "unknown"), ("unknown", "autonomous"),
            ]  # fmt: skip
            first, second = (row["id"] for row in last["open"])
            await describes(one, first)
            totals = (await one.client.get("/api/driving")).json()
            assert totals["interventions"] == 2
            assert totals["modes"]["manual"]["m"] > 3.0
        async with served(config) as again:
            assert [row["id"] for row in (await again.mode())["open"]] == [second]
            kept = (await again.client.get(f"/api/interventions/{first}")).json()
            assert (kept["what"], kept["category"], kept["initiated_by"]) == ("A box.", "object_late", "operator")
            assert (
                await again.describe(first, what="A box.", category="object_late", initiated_by="operator")
            ).is_success
            assert len(await again.events("intervention_described")) == 1
            assert (await again.describe(second, category="planned")).is_success
            assert (await again.mode())["open"] == []
            await kept_beside(tmp_path / "recordings" / "car", {second: "planned"})
    finally:
        await service.stop()


async def kept_beside(folder: Path, wanted: dict[str, str]) -> None:
    """The descriptions given after the recording was complete, and none that it holds itself."""
    found: dict[str, str | None] = {}
    ends_s = time.monotonic() + 20.0
    while found != wanted:
        assert time.monotonic() < ends_s, found
        await asyncio.sleep(0.1)
        found = {
            row["intervention"]: row["category"]
            for path in folder.iterdir()
            if path.name.endswith(FINISHED)
            for row in annotation_store.read(path).described
        }


async def describes(one: Server, first: str) -> None:
    """Once is once, whatever is repeated; what is wrong is refused with a sentence and changes nothing."""
    for _ in range(2):
        assert (await one.describe(first, what="A box.", category="object_late", initiated_by="operator")).is_success
    (described,) = await one.events("intervention_described")
    assert (described["intervention"], described["what"], described["category"]) == (first, "A box.", "object_late")
    for body, code in (({}, 409), ({"what": "x" * 2001}, 422), ({"category": ""}, 422), ({"initiated_by": "me"}, 422)):
        refused = await one.describe(first, **body)
        assert refused.status_code == code, refused.text
    assert (await one.describe("i-0", category="planned")).status_code == 409
    assert (await one.client.get("/api/interventions/i-0")).status_code == 409
    found = (await one.client.get(f"/api/interventions/{first}")).json()
    times = [sample["at_s"] for sample in found["samples"]]
    assert times == sorted(times)
    assert -10.5 <= times[0] < -3.0
    assert 5.5 <= times[-1] <= 6.6
    assert len(times) <= 70
