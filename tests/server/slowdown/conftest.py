"""A simulated car with a server that watches it, in the test's own loop; every command is seen at the car's bridge."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from functools import partial
from pathlib import Path
from typing import Any

import httpx

from server.app.app import create_app
from server.app.config import Config
from server.simulator.service import CarService
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.conftest import serving_app

PATIENCE_S = 20.0
SPEEDS_BEFORE = 20  # that the server has received before an order; the car reports 20 a second
ASK_S = 0.1  # interval of requests to the server
LOOK_S = 0.02  # interval of reading the car itself, which costs nothing
EventReader = Callable[..., Awaitable[list[dict[str, Any]]]]  # newest first


class Field:
    """One car, one server, one client of its API."""

    def __init__(self, service: CarService, client: httpx.AsyncClient, log: EventReader | None = None) -> None:
        """`log`: of a server in this process; None: the events are those that its API has released."""
        self.service = service
        self.client = client
        self._log = log
        self.published: list[tuple[float, str, dict[str, Any]]] = []  # what any client published, and when it arrived
        self.driven: list[float] = []  # how fast the car was then
        service.bridge.on_publish.append(self._note_published)

    def _note_published(self, topic: str, kind: str, message: dict[str, Any]) -> None:
        self.published.append((time.monotonic(), topic, message))
        self.driven.append(self.speed_mps)

    @property
    def speed_mps(self) -> float:
        return self.service.car.motion.speed_mps

    @property
    def speeds(self) -> list[tuple[float, float]]:
        """The ordered speeds and when they arrived."""
        return [
            (at_s, message["linear"]["x"]) for at_s, topic, message in self.published if topic == "/catvehicle/cmd_vel"
        ]

    async def state(self) -> dict[str, Any]:
        found: dict[str, Any] = (await self.client.get("/api/state")).json()
        return found

    async def slow(self) -> dict[str, Any]:
        found: dict[str, Any] = (await self.state())["decelerate"]
        return found

    async def post(self, what: str, **body: Any) -> httpx.Response:
        return await self.client.post(f"/api/slow-down/{what}", json=body or None)

    async def set(self, values: Mapping[str, float]) -> None:
        """Changes settings by their full names."""
        assert (await self.client.patch("/api/settings", json={"values": values})).is_success

    async def until(self, true: Callable[[Mapping[str, Any]], Any], seconds: float = PATIENCE_S) -> dict[str, Any]:
        """The first state of which it is true."""
        ends_s = time.monotonic() + seconds
        while True:
            state = await self.state()
            if true(state):
                return state
            assert time.monotonic() < ends_s, state["decelerate"]
            await asyncio.sleep(ASK_S)

    async def until_car(self, true: Callable[[], Any], seconds: float = PATIENCE_S) -> None:
        """Waits for what the car does, without asking the server."""
        ends_s = time.monotonic() + seconds
        while not true():
            assert time.monotonic() < ends_s, self.speed_mps
            await asyncio.sleep(LOOK_S)

    async def armed(self, speed_mps: float = 4.0) -> None:
        """Drives, and slow-down is armed."""
        await self.until(lambda state: state["decelerate"]["state"] == "not_armed")
        await self.until(lambda state: state["decelerate"]["rivals"] is not None)
        await self.until_car(lambda: self.speed_mps >= speed_mps)
        # An order is proven against the motion before it, which must be known for half a second.
        await self.until(lambda state: state["signals"]["speed"]["count"] >= SPEEDS_BEFORE)
        assert (await self.post("arm")).status_code == 200

    async def events(self, change: str = "slow_down") -> list[dict[str, Any]]:
        """Oldest first. A state may be a moment ahead of what the API releases of the log: what the disk has."""
        if self._log is not None:
            return (await self._log(change=change, limit=1000))[::-1]
        found = (await self.client.get("/api/events", params={"limit": 1000})).json()["events"]
        return [event for event in found if event["change"] == change]

    async def steps(self) -> list[str]:
        return [event["step"] for event in await self.events()]


@contextlib.asynccontextmanager
async def simulated(**how: Any) -> AsyncIterator[tuple[CarService, str]]:
    """A car that drives, and the address of its bridge; `how`: of the CarService."""
    service = CarService(**{"clock": time.time} | how)
    port = await service.start()
    try:
        yield service, f"ws://127.0.0.1:{port}"
    finally:
        await service.stop()


@contextlib.asynccontextmanager
async def watching(
    service: CarService, address: str, data: Path | None = None, *, name: str = "car"
) -> AsyncIterator[Field]:
    """A server that watches it."""
    config = Config(vehicles=(Vehicle(name=name, address=address),), data=data)
    app = create_app(config, now=time.monotonic)
    async with serving_app(app, config) as base, http_client(base_url=base, timeout=10.0) as client:
        yield Field(service, client, partial(app.state.services.bus.find_events, name))


@contextlib.asynccontextmanager
async def field(**how: Any) -> AsyncIterator[Field]:
    """Both."""
    async with simulated(**how) as (service, address), watching(service, address) as car:
        yield car
