"""What an operator does from one end to the other, with a server and a car."""

from __future__ import annotations

import re
from pathlib import Path

import pytest
from playwright.async_api import Browser, expect

from tests.page.conftest import PHONE, Phone, phone_in
from tests.page.drives import steady
from tests.page.processes import replay, running, server

pytestmark = [pytest.mark.gate, pytest.mark.timeout(120)]


async def test_an_acknowledgement_reaches_a_second_phone(phone: Phone, browser: Browser, tmp_path: Path) -> None:
    """Both get the dialog; one answers, and the other sees by whom. What both have received is in the log once."""
    fast = steady(tmp_path / "fast.bag", 12.6)
    data = tmp_path / "data"
    async with running(*replay(fast)) as car, running(*server(data, car.address)) as watch:
        context = await browser.new_context(**PHONE)
        second = await phone_in(context)
        try:
            for one in (phone, second):
                await one.open(watch.address)
                await expect(one.page.locator("#sheet-alarm")).to_contain_text("Speed above limit")
                await expect(one.page.locator("#sheet-alarm")).not_to_have_attribute("data-moved", "")
            await phone.f("acknowledge", "#sheet-alarm").tap()
            for one in (phone, second):
                await expect(one.page.locator("#sheet-alarm")).to_be_hidden()
                await expect(one.page.locator(".frame")).to_have_attribute("data-mode", "critical")
                await expect(one.f("strip")).to_contain_text("Speed above limit")
            await second.f("strip").tap()
            row = second.page.locator("[data-f=alarms] li", has_text="Speed above limit")
            await expect(row).to_contain_text("acknowledged by")
            assert second.faults == []
        finally:
            await context.close()


async def test_what_is_recorded_is_ended_listed_and_replayed(phone: Phone, tmp_path: Path) -> None:
    slow = steady(tmp_path / "slow.bag", 4.2)
    data = tmp_path / "data"
    async with running(*replay(slow)) as car, running(*server(data, car.address)) as watch:
        page = phone.page
        await phone.open(f"{watch.address}/#files")
        await phone.live()
        now = page.locator("#panel-files [data-live]")
        await expect(now).to_contain_text("Recording now")
        await expect(phone.f("rec-for")).to_have_text(re.compile(r"00:(0[5-9]|[1-5]\d)"), timeout=30_000)
        await now.get_by_role("button", name="End the recording").tap()
        await phone.f("yes", "#sheet-record").tap()  # the car moves
        await expect(now).to_contain_text("Not recording", timeout=30_000)
        saved = page.locator("#panel-files [data-f=recordings] .file")
        await expect(saved).to_have_count(1, timeout=30_000)
        await expect(saved).to_have_attribute("data-state", "read", timeout=30_000)
        (file,) = (data / "recordings" / "car").glob("*.mcap")
        assert file.stat().st_size > 1000
        await saved.get_by_role("button").tap()
        await page.locator("#sheet-file").get_by_text("Open replay").tap()
        await expect(page.locator('html[data-replay="on"]')).to_have_count(1, timeout=30_000)
        await expect(page.locator(".replay-date")).to_contain_text("Recorded")
        await page.get_by_role("slider", name="Position in the recording").press("ArrowRight")  # by 3 s
        await expect(page.locator(".gauge .speed")).to_have_text("4.2", timeout=30_000)
        await page.get_by_role("button", name="Leave").tap()
        await phone.live()
        await expect(now).to_contain_text("Not recording")
