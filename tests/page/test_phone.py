"""The phone's own position, from the browser's geolocation to the tile and the alarm."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import expect

from tests.http import http_client
from tests.page.conftest import Phone
from tests.page.processes import Process, running, server, simulate

M_NORTH = 1 / 110_890.0


class Ride:
    """Lays a phone into the car: its browser gets the car's own position twice a second, `north_m` aside."""

    def __init__(self, phone: Phone, address: str) -> None:
        self._phone, self._address = phone, address
        self.north_m = 0.0
        self.state: dict[str, Any] = {}

    async def run(self) -> None:
        async with http_client() as client:
            while True:
                self.state = (await client.get(f"{self._address}/api/state")).json()
                value = self.state["signals"]["position"]["value"]
                if value is not None and value["lat_deg"] is not None:
                    place = {"latitude": value["lat_deg"] + self.north_m * M_NORTH, "longitude": value["lon_deg"]}
                    await self._phone.page.context.set_geolocation({**place, "accuracy": 6.0})
                await asyncio.sleep(0.5)

    async def until(self, fits: Any, within_s: float = 30.0) -> dict[str, Any]:
        """The first state that fits, as the server tells it."""
        async with asyncio.timeout(within_s):
            while not (self.state and fits(self.state)):
                await asyncio.sleep(0.1)
        return self.state


@contextlib.asynccontextmanager
async def riding(phone: Phone, watch: Process) -> AsyncIterator[Ride]:
    ride = Ride(phone, watch.address)
    task = asyncio.create_task(ride.run())
    try:
        yield ride
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


async def connect(phone: Phone, watch: Process, car: Process) -> None:
    await phone.open(watch.address)
    await phone.page.fill("#address", car.shown)
    await phone.f("go", "#connect").tap()
    await phone.live()


def tile(phone: Phone, label: str) -> Any:
    return phone.page.locator(".checks li", has_text=label)


def uses_it(state: dict[str, Any]) -> bool:
    return state["phone"] is not None and state["phone"]["used"] and state["phone"]["apart_m"] is not None


@pytest.mark.own_phone
@pytest.mark.timeout(90)
async def test_a_phone_in_the_car_agrees_and_one_500_m_away_is_told(phone: Phone, tmp_path: Path) -> None:
    await phone.page.context.grant_permissions(["geolocation"])
    async with running(*simulate()) as car, running(*server(tmp_path)) as watch, riding(phone, watch) as ride:
        await connect(phone, watch, car)
        state = await ride.until(uses_it)
        assert state["phone"]["handheld"] is True
        assert state["phone"]["accuracy_m"] == 6.0
        assert state["phone"]["apart_m"] < 15.0
        assert state["phone"]["age_s"] < 3.0
        await expect(tile(phone, "Phone–car")).to_contain_text("OK")
        await expect(tile(phone, "Tracks")).to_contain_text("waiting")

        ride.north_m = 500.0
        sheet = phone.page.locator("#sheet-alarm")
        await expect(sheet).to_be_visible(timeout=15_000)
        await expect(phone.f("title", "#sheet-alarm")).to_have_text("Phone and car disagree")
        await expect(sheet).to_contain_text("If the phone is in the car, do not trust the car's position.")
        await phone.f("acknowledge", "#sheet-alarm").tap()
        await expect(tile(phone, "Phone–car")).to_contain_text("FAULT")


@pytest.mark.gate
@pytest.mark.own_phone
@pytest.mark.timeout(90)
async def test_case_07_a_permission_taken_away_is_told_with_its_name_and_given_back_is_enough(
    phone: Phone, tmp_path: Path
) -> None:
    context = phone.page.context
    await context.grant_permissions(["geolocation"])
    async with (
        running(*simulate()) as car,
        running(*server(tmp_path)) as watch,
        riding(phone, watch) as ride,
    ):
        await connect(phone, watch, car)
        await ride.until(uses_it)
        await context.clear_permissions()
        await ride.until(lambda s: s["phone"]["why"] == "denied")
        await expect(tile(phone, "Phone–car")).to_contain_text("denied")
        await expect(phone.f("strip")).to_contain_text("Phone position missing", timeout=30_000)
        await expect(tile(phone, "Phone–car")).to_contain_text("permission")
        state = await ride.until(lambda s: any(one["id"] == "phone_missing" for one in s["alarms"]))
        (alarm,) = [one for one in state["alarms"] if one["id"] == "phone_missing"]
        assert alarm["text"].startswith("Location permission denied on the phone")
        await context.grant_permissions(["geolocation"])
        await ride.until(uses_it)
        await expect(tile(phone, "Phone–car")).to_contain_text("OK")


@pytest.mark.own_phone
async def test_a_reload_is_the_same_phone_and_needs_no_tap(phone: Phone, tmp_path: Path) -> None:
    await phone.page.context.grant_permissions(["geolocation"])
    async with running(*simulate()) as car, running(*server(tmp_path)) as watch, riding(phone, watch) as ride:
        await connect(phone, watch, car)
        name = (await ride.until(uses_it))["phone"]["id"]
        await phone.page.reload()
        await phone.live()
        reloaded_ms = await phone.page.evaluate("Date.now()")
        state = await ride.until(lambda s: uses_it(s) and s["phone"]["at_ms"] > reloaded_ms)
        assert (state["phone"]["id"], state["phone"]["count"]) == (name, 1)


@pytest.mark.own_phone
async def test_without_a_tap_and_a_permission_nothing_is_asked_and_nothing_sent(phone: Phone, tmp_path: Path) -> None:
    async with running(*simulate()) as car, running(*server(tmp_path, car.address)) as watch:
        await phone.page.add_init_script(
            "window.requests = 0; const geo = navigator.geolocation;"
            "for (const name of ['watchPosition', 'getCurrentPosition']) {"
            "  const ask = geo[name].bind(geo); geo[name] = (...a) => { window.requests += 1; return ask(...a); }; }"
        )
        await phone.open(watch.address)
        await phone.live()
        await asyncio.sleep(2.0)
        assert await phone.page.evaluate("window.requests") == 0
        state = await phone.page.evaluate("fetch('/api/state').then((answer) => answer.json())")
        assert state["phone"] is None
        await expect(tile(phone, "Phone–car")).to_contain_text("no phone")
        await phone.f("sound-off").tap()  # arms what the connect screen arms: this phone refuses
        await expect(tile(phone, "Phone–car")).to_contain_text("denied")
