"""A drive over HTTP that is recorded while it is marked."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Awaitable, Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import httpx
from fastapi import FastAPI

from server.app.app import create_app
from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from server.web.services import Services
from tests.server.cars import driving
from tests.server.conftest import serving_app

WEBM = {"content-type": "audio/webm;codecs=opus"}
JPEG = {"content-type": "image/jpeg"}


def now_ms() -> int:
    return time.time_ns() // 1_000_000


@dataclass(frozen=True, kw_only=True)
class Marked:
    """A server with a car that drives."""

    client: httpx.AsyncClient
    app: FastAPI
    data: Path

    @property
    def services(self) -> Services:
        found: Services = self.app.state.services
        return found

    async def get(self, path: str, **query: Any) -> Any:
        answer = await self.client.get(path, params=query)
        assert answer.status_code == 200, answer.text
        return answer.json()

    async def mark(self, mark: str, **fields: Any) -> None:
        answer = await self.client.post("/api/mark", json={"mark": mark, **fields})
        assert answer.status_code == 200, answer.text

    async def send(self, mark: str, kind: str, content: bytes, headers: dict[str, str]) -> None:
        answer = await self.client.post(f"/api/marks/{mark}/{kind}", content=content, headers=headers)
        assert answer.status_code == 200, answer.text

    async def until(self, is_so: Callable[[], Awaitable[Any]], within_s: float = 15.0) -> Any:
        """What `is_so` answers, once that is something."""
        async with asyncio.timeout(within_s):
            while not (found := await is_so()):
                await asyncio.sleep(0.05)
        return found

    async def recorded(self) -> None:
        """Waits until the drive is being recorded."""

        async def is_recording() -> bool:
            return any((self.data / "recordings").rglob("*.writing"))

        await self.until(is_recording)

    async def ended(self) -> str:
        """Ends monitoring; the id of the recording, once it is listed and read."""
        await self.client.post("/api/disconnect", json={})

        async def row() -> Any:
            rows = (await self.get("/api/recordings"))["recordings"]
            return next((one for one in rows if one["state"] == "read"), None)

        found = await self.until(row, 60.0)
        await self.settled()
        return str(found["id"])

    async def settled(self) -> None:
        assert self.services.marks is not None
        await self.services.marks.settled()

    def path(self, id: str) -> Path:
        return self.data / "recordings" / "car" / f"{id}.mcap"


@contextlib.asynccontextmanager
async def marked_drive(bridge: RosBridge, data: Path) -> AsyncIterator[Marked]:
    config = Config(vehicles=(Vehicle(name="car", address=bridge.address),), data=data)  # type: ignore[attr-defined]
    app = create_app(config)
    async with (
        driving(bridge),
        serving_app(app, config) as base,
        httpx.AsyncClient(base_url=base, timeout=30.0) as client,
    ):
        drive = Marked(client=client, app=app, data=data)
        await drive.recorded()
        yield drive
