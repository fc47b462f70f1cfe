"""What the page reads over HTTP is of the types of the protocol."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import pytest_asyncio

from server.app.config import Config
from server.protocol.answers import (
    DeviceList,
    DriveTrendsAnswer,
    ExportJob,
    Recording,
    RecordingList,
    SettingsAnswer,
    SignalsAnswer,
    TrackPoints,
)
from server.protocol.state import LiveState, Trends
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.frames import check_shape
from tests.server.conftest import serving
from tests.server.recording.made import record

DRIVE = "car_20260921T141320Z"
ANSWERS: dict[str, Any] = {
    "/api/state": LiveState,
    "/api/trends": Trends,
    "/api/trends/drive": DriveTrendsAnswer,
    "/api/track/points": TrackPoints,
    "/api/settings": SettingsAnswer,
    "/api/signals": SignalsAnswer,
    "/api/devices": DeviceList,
    "/api/recordings": RecordingList,
    f"/api/recordings/{DRIVE}": Recording,
}


@pytest_asyncio.fixture
async def client(bridge: RosBridge, tmp_path: Path) -> AsyncIterator[httpx.AsyncClient]:
    """A server with a car and one recording, which has been read."""
    record(tmp_path / "recordings" / "car" / f"{DRIVE}.mcap", alarms=[(2.0, "critical")])
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=tmp_path)  # type: ignore[attr-defined]
    async with serving(config) as base, httpx.AsyncClient(base_url=base, timeout=60) as client:
        async with asyncio.timeout(60):
            while not [
                row for row in (await client.get("/api/recordings")).json()["recordings"] if row["state"] == "read"
            ]:
                await asyncio.sleep(0.05)
        yield client


async def test_each_answer_is_of_its_type(client: httpx.AsyncClient) -> None:
    for path, shape in ANSWERS.items():
        answer = await client.get(path)
        assert answer.status_code == 200, path
        check_shape(answer.content, shape)
    job = await client.post(f"/api/recordings/{DRIVE}/exports", json={"format": "csv"})
    check_shape(job.content, ExportJob)
    check_shape((await client.get(f"/api/exports/{job.json()['job']}")).content, ExportJob)
