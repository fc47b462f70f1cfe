"""The car a server was started for stays known after Stop: by name, with one request, for pages and for programs."""

from __future__ import annotations

import asyncio
from typing import Any

import httpx
import pytest

from server.app.config import Config
from server.rosbridge_server.server import RosBridge
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.conftest import serving

pytestmark = pytest.mark.virtual_time


async def phase(client: httpx.AsyncClient, wanted: str, vehicle: str = "ocelot") -> dict[str, Any]:
    """The session of a state, once it is in this phase."""
    async with asyncio.timeout(20):
        while True:
            session = (await client.get("/api/state", params={"vehicle": vehicle})).json()["session"]
            if session["phase"] == wanted:
                return dict(session)
            await asyncio.sleep(0.02)


@pytest.mark.world(n=19)
async def test_after_stop_an_empty_address_dials_the_car_that_was_configured(bridge: RosBridge) -> None:
    address = bridge.address  # type: ignore[attr-defined]
    cars = (Vehicle(name="ocelot", address=address), Vehicle(name="lynx", address=address), Vehicle(name="none"))
    async with serving(Config(vehicles=cars)) as server, http_client(base_url=server) as client:
        for number in range(2):
            await phase(client, "monitoring")
            assert (await client.post("/api/disconnect", params={"vehicle": "ocelot"})).is_success
            stopped = await phase(client, "idle")
            assert (stopped["address"], stopped["configured"]) == (None, address)
            listed = (await client.get("/api/vehicles")).json()["vehicles"]
            assert {"name": "ocelot", "address": address, "phase": "idle"} in listed
            body = {"address": " "} if number else {}
            answer = await client.post("/api/connect", params={"vehicle": "ocelot"}, json=body)
            assert answer.is_success, answer.text
            assert (await phase(client, "monitoring"))["address"] == address
        assert (await phase(client, "monitoring", "lynx"))["configured"] == address
        refused = await client.post("/api/connect", params={"vehicle": "none"}, json={})
        assert refused.is_client_error
        assert "No address is given." in refused.text


@pytest.mark.world(n=19)
async def test_another_car_that_was_typed_does_not_replace_the_configured_one(bridge: RosBridge) -> None:
    address = bridge.address  # type: ignore[attr-defined]
    config = Config(vehicles=(Vehicle(name="ocelot", address=address),))
    async with serving(config) as server, http_client(base_url=server) as client:
        await phase(client, "monitoring")
        await client.post("/api/disconnect")
        await client.post("/api/connect", json={"address": "127.0.0.1:1"})
        await client.post("/api/disconnect")
        assert (await phase(client, "idle"))["configured"] == address
        await client.post("/api/connect", json={})
        assert (await phase(client, "monitoring"))["address"] == address
