"""What the recipes add, live: a replayed drive, the server of the copy, and its page in Chromium."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import async_playwright, expect

from tests.chromium import FLAGS
from tests.http import http_client
from tests.page.conftest import PHONE
from tests.page.processes import Process, replay, running, server
from tests.recipes.project_copy import ProjectCopy

pytestmark = [pytest.mark.browser, pytest.mark.field, pytest.mark.asyncio(loop_scope="module")]


@pytest_asyncio.fixture(loop_scope="module", scope="module")
async def watch(extended: ProjectCopy, drive: Path, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    """A server of the copy that watches the drive."""
    data, folder = tmp_path_factory.mktemp("data"), extended.root
    async with running(*replay(drive, "--loop"), folder=folder) as car:
        async with running(*server(data, car.address), folder=folder) as process:
            yield process


async def state_of(process: Process, is_reached: Any) -> Any:
    """The state, once it is as awaited."""
    async with http_client(base_url=process.address) as client:
        for _ in range(400):
            state = (await client.get("/api/state")).json()
            if is_reached(state):
                return state
            await asyncio.sleep(0.05)
    raise AssertionError(f"not reached: {state['signals'].get('oil')}, {[one['id'] for one in state['alarms']]}")


async def test_the_signal_and_the_alarm_are_in_the_state(watch: Process) -> None:
    state = await state_of(
        watch,
        lambda state: (
            "steering_limit" in {one["id"] for one in state["alarms"]}
            and any(isinstance(step, float) for step in state["trends"]["lowest"]["oil"])
        ),
    )
    oil = state["signals"]["oil"]
    assert (oil["label"], oil["unit"], oil["topic"]) == ("Oil", "°C", "/oil_temperature")
    assert 80.0 <= oil["lowest"] <= oil["value"]["value"] <= oil["highest"] <= 100.0
    assert "steering_limit.max_percent" in state["limits"]


async def test_the_tab_shows_what_it_is_for_and_home_the_signal(watch: Process, chromium: str) -> None:
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(executable_path=chromium, args=list(FLAGS))
        page = await (await browser.new_context(**PHONE)).new_page()
        complaints: list[str] = []
        page.on("pageerror", lambda error: complaints.append(str(error)))
        await page.goto(f"{watch.address}/#trip")
        await expect(page.locator("#tab-trip")).to_have_attribute("aria-selected", "true", timeout=15_000)
        await expect(page.locator("#panel-trip [data-f=trip-m]")).to_have_text(
            re.compile(r"^[1-9]\d*$"), timeout=15_000
        )
        await page.locator("#tab-home").tap()
        await page.locator("#panel-home [data-trend=brake]").scroll_into_view_if_needed()
        await expect(page.locator("[data-trend=oil] .row")).to_have_text(re.compile(r"^Oil °C(8|9)\d\.\d$"))
        await page.locator("#tab-trip").focus()
        await page.keyboard.press("End")
        await expect(page.locator("#tab-settings")).to_have_attribute("aria-selected", "true")
        assert complaints == []
        await browser.close()
