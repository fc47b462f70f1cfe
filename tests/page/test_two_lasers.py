"""A car with two lasers and no transforms: the question is answered in two taps, and the pallet ahead alarms."""

from __future__ import annotations

import re
import shutil
from pathlib import Path

import httpx
import pytest
from playwright.async_api import Page, expect

from tests.page.conftest import Phone
from tests.page.processes import replay, running, server
from tests.reports.cases import made

pytestmark = [pytest.mark.gate, pytest.mark.timeout(150)]
FRONT = "/front_2d_lidar/scan"
OPENS_MS = 40_000


def pallet_ahead() -> Path:
    """The car drives up to a pallet from 5 s on, and stands before it from 23 s on."""
    return made("case_03_back_laser_first.py") / "03-back-laser-first" / "object-ahead"


async def choose_front(page: Page) -> None:
    """Two presses."""
    await expect(page.locator(".questions .card")).to_contain_text(
        "Two lasers: which one faces forward?", timeout=OPENS_MS
    )
    await expect(page.locator(".questions .card")).not_to_have_attribute("data-moved", "")
    await page.locator("[data-f=question-open]").click()
    option = page.locator(f'#sheet-question [data-value="{FRONT}"]')
    await expect(option.get_by_role("img")).to_be_visible()  # what this laser sees
    await expect(page.locator("#sheet-question")).not_to_have_attribute("data-moved", "")
    await option.click()
    await expect(page.locator("#sheet-question[open]")).to_have_count(0)


async def test_on_the_phone_of_the_operator(phone: Phone, tmp_path: Path) -> None:
    page = phone.page
    bag = replay(pallet_ahead(), "--start", "12")
    async with running(*bag) as car, running(*server(tmp_path / "data", car.address)) as watch:
        await phone.open(watch.address)
        await phone.live()
        obstacle = page.locator("#panel-home .checks li", has_text="Obstacle")
        await expect(obstacle).to_contain_text(re.compile("not set|no data|UNKNOWN", re.IGNORECASE))
        await choose_front(page)
        await expect(page.locator("#sheet-alarm")).to_contain_text("Obstacle ahead", timeout=OPENS_MS)
        await expect(page.locator(".questions .card")).to_be_hidden()


async def test_in_a_recording_on_a_desktop(phone: Phone, tmp_path: Path) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1440, "height": 900})
    data = tmp_path / "data"
    shutil.copytree(pallet_ahead(), data / "recordings" / "car" / "object-ahead")
    async with running(*server(data)) as watch, httpx.AsyncClient(base_url=watch.address, timeout=60) as client:
        (one,) = (await client.get("/api/recordings")).json()["recordings"]
        await phone.open(f"{watch.address}/?replay={one['id']}&t=26")
        await page.wait_for_selector('html[data-replay="on"]', state="attached", timeout=OPENS_MS)
        await choose_front(page)
        await expect(page.locator(".replay-line")).to_contain_text("Obstacle ahead", timeout=OPENS_MS)
        settings = (await client.get("/api/settings")).json()
        assert settings["topics"] == {}  # of the live car nothing was chosen
