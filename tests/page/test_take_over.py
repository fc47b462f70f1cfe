"""Who drives, on the ledge; a take-over and a braking of the simulated safety driver, described by an operator."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
from playwright.async_api import Browser, expect
from playwright.async_api import TimeoutError as PlaywrightTimeout

from tests.http import http_client
from tests.page.barriers import fits_all, no_barrier
from tests.page.canned import Canned
from tests.page.conftest import PHONE, Phone, phone_in
from tests.page.processes import Process, running, server, simulate
from tests.page.work_scenes import take_over

HOSTILE = "<img src=x onerror=alert(1)> the car did not see the box"
SLOW = "[limits.link_late]\nlate_s = 10.0\ncritical_s = 20.0\n"  # this machine is shared: that is not tested here


class Watch:
    """A phone at a server that watches one simulated car, and the server as a program sees it."""

    def __init__(self, phone: Phone, client: httpx.AsyncClient, car: Process) -> None:
        self.phone = phone
        self.client = client
        self.car = car

    async def mode(self) -> dict[str, Any]:
        found: dict[str, Any] = (await self.client.get("/api/state")).json()["mode"]
        return found

    async def events(self, change: str) -> list[dict[str, Any]]:
        found = (await self.client.get("/api/events", params={"limit": 1000})).json()["events"]
        return [event for event in found if event["change"] == change]

    async def until_open(self, count: int) -> dict[str, Any]:
        async with asyncio.timeout(30):
            while len((found := await self.mode())["open"]) != count:
                await asyncio.sleep(0.2)
        return found


@contextlib.asynccontextmanager
async def watching(browser: Browser, data: Path, **context_options: Any) -> AsyncIterator[Watch]:
    (data / "settings").mkdir(exist_ok=True)
    (data / "settings" / "car.toml").write_text(SLOW)
    async with contextlib.AsyncExitStack() as stack:
        car = await stack.enter_async_context(running(*simulate()))
        watch = await stack.enter_async_context(running(*server(data, car.address)))
        client = await stack.enter_async_context(http_client(base_url=watch.address))
        context = await browser.new_context(**{**PHONE, **context_options})
        stack.push_async_callback(context.close)
        phone = await phone_in(context)
        await phone.open(watch.address)
        await phone.live()
        yield Watch(phone, client, car)


async def opened(phone: Phone) -> None:
    """The form; an alarm of a busy machine may have closed it, and then it is opened again."""
    if not await phone.page.locator("#sheet-take-over").count():
        await phone.acknowledge_all()
        await phone.f("mode-key").tap()
        await expect(phone.page.locator("#sheet-take-over")).to_contain_text("1 to describe")


async def do(phone: Phone, act: Callable[[], Awaitable[None]]) -> None:
    """One thing in the form, tried once more where an alarm closed it meanwhile."""
    await opened(phone)
    try:
        await act()
    except PlaywrightTimeout:
        await opened(phone)
        await act()


@pytest.mark.parametrize(("width", "height"), [(360, 740), (820, 1180)])
async def test_the_reasons_are_in_sight_at_once(phone: Phone, canned: Canned, width: int, height: int) -> None:
    """One tap is enough: nothing need be scrolled before it."""
    page = phone.page
    await page.set_viewport_size({"width": width, "height": height})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await take_over(canned, page)
    body = await page.locator("#sheet-take-over .mark-body").bounding_box()
    keys = page.locator("#sheet-take-over [data-category]")
    assert body is not None
    assert await keys.count() == 6
    for key in await keys.all():
        box = await key.bounding_box()
        assert box is not None
        assert box["y"] + box["height"] <= body["y"] + body["height"]


async def test_why_it_was_refused_is_in_sight_above_the_keys(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 360, "height": 740})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await take_over(canned, page)
    canned.refuses["describe_intervention"] = "No room for descriptions on this disk."
    sheet = page.locator("#sheet-take-over")
    await sheet.locator('[data-category="object_late"]').tap()
    await sheet.locator('[data-f="keep"]').tap()
    why = sheet.get_by_text("No room for descriptions on this disk.")
    await expect(why).to_be_in_viewport(ratio=1)
    box, keys = await why.bounding_box(), await sheet.locator(".mark-keys").bounding_box()
    assert box is not None
    assert keys is not None
    assert box["y"] + box["height"] <= keys["y"] + 1
    assert keys["y"] + keys["height"] <= 740


@pytest.mark.slow
async def test_a_take_over_is_seen_and_described_with_one_tap(browser: Browser, tmp_path: Path) -> None:
    """The key appears by itself and the form never does; a draft outlives "Later"; hostile text stays text."""
    async with watching(browser, tmp_path) as watch:
        phone, page = watch.phone, watch.phone.page
        label, key, sheet = phone.f("mode-label"), phone.f("mode-key"), page.locator("#sheet-take-over")
        await expect(label).to_contain_text("Autonomous")
        await expect(key).to_be_hidden()
        await watch.car.type("manual-takeover 60")
        await watch.until_open(1)
        await expect(key).to_contain_text("Describe take-over")
        await expect(key).to_have_attribute("data-mode", "manual")
        await expect(sheet).to_have_count(0)
        await no_barrier(page, "the ledge")
        await opened(phone)
        await expect(sheet.locator('[data-f="fact-at"]')).to_contain_text("m/s")
        await no_barrier(page, "the form of a take-over", "#sheet-take-over, .ledge")
        await fits_all(page, "the form of a take-over", "#sheet-take-over")
        await do(phone, lambda: sheet.locator('[data-f="what"]').fill(HOSTILE, timeout=5000))
        await do(phone, lambda: sheet.locator('[data-by="driver"]').tap(timeout=5000))
        await do(phone, lambda: sheet.locator('[data-f="later"]').tap(timeout=5000))
        await expect(sheet).to_have_count(0)
        await opened(phone)
        await expect(sheet.locator('[data-f="what"]')).to_have_value(HOSTILE)
        await do(phone, lambda: sheet.locator('[data-category="object_late"]').tap(timeout=5000))
        await do(phone, lambda: sheet.locator('[data-f="keep"]').tap(timeout=5000))
        await expect(sheet).to_have_count(0)
        await expect(label).to_contain_text("Manual")
        await expect(key).to_be_hidden()
        (event,) = await watch.events("intervention_described")
        (intervention,) = await watch.events("intervention")
        assert event["intervention"] == intervention["intervention"]
        assert (event["what"], event["category"]) == (HOSTILE, "object_late")
        assert event["initiated_by"] == "driver"
