"""A server with two small recordings, whose car is a bridge of the test."""

from __future__ import annotations

import asyncio
import hashlib
import math
import os
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest

from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.page import drives
from tests.server.conftest import serving
from tests.server.recording import made

STREET = f"street-{hashlib.sha256(b'car/street.bag').hexdigest()[:10]}"  # as the catalog calls what was copied there


@pytest.fixture(scope="module")
def street(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A minute: too fast from 20 s to 30 s."""

    def speed(t: float) -> Any:
        return drives.twist(12.5 if 20 <= t < 30 else 8.0 + math.sin(t / 9))

    return drives.write(
        tmp_path_factory.mktemp("street") / "street.bag", {"speed": speed, "scan": drives.street}, seconds=60.0
    )


@pytest.fixture
def data(tmp_path: Path, street: Path) -> Path:
    folder = tmp_path / "recordings" / "car"
    folder.mkdir(parents=True)
    os.link(street, folder / "street.bag")
    made.record(folder / "car_20260921T142640Z.mcap", alarms=[(5.0, "critical"), (12.0, "warning")])
    return tmp_path


@pytest.fixture
async def base(bridge: RosBridge, data: Path) -> AsyncIterator[str]:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=data)  # type: ignore[attr-defined]
    async with serving(config) as address:
        async with http_client() as client, asyncio.timeout(20):
            while len((await client.get(f"{address}/api/recordings")).json()["recordings"]) < 2:
                await asyncio.sleep(0.1)
        yield address
