"""Two recordings beside each other on a desktop: chosen, aligned, moved by one time line, left by one key."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page, expect

from tests.http import http_client
from tests.page import drives
from tests.page.barriers import no_barrier
from tests.page.conftest import phone_in
from tests.page.processes import running, server, simulate

UNDER_WHAT_ASKS = """async () => {
  const height = (name) => Number(getComputedStyle(document.querySelector(name)).zIndex);
  const { areAlarmsInSight } = await import('/static/js/shell/layout.js');
  return [height('.compare') < height('#monitor .veil'), areAlarmsInSight()];
}"""
WAITS_MS = 40_000  # each recording is read by a process of lowest priority


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def address(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[str]:
    """A server with two drives: car stands until 2 s and lasts 20 s, Ocelot stands until 5 s and lasts 14 s."""
    data = tmp_path_factory.mktemp("data")
    _write(data / "recordings" / "car" / "first.bag", 8.0, 2.0, 20.0)
    _write(data / "recordings" / "Ocelot" / "second.bag", 5.0, 5.0, 14.0)
    async with running(*simulate()) as car, running(*server(data, car.address)) as process:
        async with http_client() as client, asyncio.timeout(60):
            while True:
                listing = (await client.get(f"{process.address}/api/recordings")).json()
                if sum(row["state"] == "read" for row in listing["recordings"]) >= 2:
                    break
                await asyncio.sleep(0.2)
        yield process.address


def _write(path: Path, speed_mps: float, from_s: float, seconds: float) -> None:
    def speed(t: float) -> Any:
        return drives.twist(speed_mps + 0.1 * (t % 1.0) if t >= from_s else 0.0)

    path.parent.mkdir(parents=True)
    drives.write(path, {"speed": speed}, seconds=seconds)


async def row_of(page: Page, address: str, name: str) -> str:
    """Selector of a recording among the files, and of nothing else."""
    async with http_client() as client:
        rows = (await client.get(f"{address}/api/recordings")).json()["recordings"]
    return next(row["id"] for row in rows if row["id"].startswith(name))


async def test_a_second_recording_is_shown_beside_the_replay(browser: Browser, address: str) -> None:
    phone = await phone_in(await browser.new_context(viewport={"width": 1440, "height": 900}))
    page = phone.page
    first, second = await row_of(page, address, "first"), await row_of(page, address, "second")
    state, cards = page.locator(".cmp-state"), page.locator(".cmp-card")
    await phone.open(f"{address}/?replay={first}&t=8#home")
    await page.wait_for_selector('html[data-replay="on"]', state="attached", timeout=WAITS_MS)

    await page.get_by_role("button", name="Compare", exact=True).click()
    await page.locator(f'.file[data-id="{first}"] button').first.click()
    await expect(page.locator(".file-sheet[open]")).to_contain_text("Shown in the replay now")
    await page.locator(f'.file[data-id="{second}"] button').first.click()
    await page.get_by_role("button", name="Compare with the replay").click()

    await expect(cards).to_have_count(2, timeout=WAITS_MS)
    await expect(state).to_have_text("B begins with A", timeout=WAITS_MS)
    await expect(cards.nth(1)).to_contain_text("Another car than A")
    await expect(page.locator(".cmp-figures")).to_contain_text(
        re.compile(r"Speed A8\.\d.*B 5\.\d m/s"), timeout=WAITS_MS
    )
    await expect(page.locator(".pager")).to_be_hidden()
    await expect(page.locator(".replay-band")).to_contain_text("Live")
    assert await page.evaluate(UNDER_WHAT_ASKS) == [True, False], (
        "the veil covers it, and a dialog finds its place above"
    )
    assert not await page.get_by_role("button", name=re.compile("Acknowledge|Slow|Pause the")).count()

    await page.get_by_role("button", name="First motion").click()  # the server has it in quarters of a second
    await expect(state).to_have_text(re.compile(r"B begins (2\.75|3\.0|3\.25) s before A"), timeout=WAITS_MS)
    await page.get_by_role("button", name="Same start").click()
    await page.locator(".cmp-bar h2").focus()
    await page.keyboard.press("}")
    await page.keyboard.press("]")
    await expect(state).to_have_text("B begins 1.1 s after A")
    await page.keyboard.press("{")
    await page.keyboard.press("[")
    await expect(state).to_have_text("B begins with A")
    await page.keyboard.press("}")
    await page.keyboard.press("]")
    await expect(state).to_have_text("B begins 1.1 s after A")

    await page.keyboard.press("End")
    await expect(cards.nth(1).locator(".missing")).to_have_text(re.compile(r"Ended 0:0[45]\.\d earlier"))
    await page.keyboard.press("Home")
    await expect(cards.nth(1).locator(".missing")).to_have_text("Not begun: it begins 0:01.1 later")
    await page.keyboard.press("Space")
    for card in (cards.nth(0), cards.nth(1)):  # both go on, B from its own beginning
        await expect(card.locator(".cmp-when .n")).to_have_text(re.compile(r":\d\d$"), timeout=WAITS_MS)
    await expect(page.locator(".cmp-line .clock b")).to_have_text(re.compile(r"0:(0[3-9]|1\d)"), timeout=WAITS_MS)
    await page.keyboard.press("Space")
    await expect(page.locator(".cmp-line").get_by_role("button", name="Play", exact=True)).to_be_visible()
    await no_barrier(page, "comparison", ".compare")

    await page.keyboard.press("Escape")
    await expect(page.locator(".compare")).to_have_count(0)
    await expect(page.locator(".scrub .time-line")).to_be_visible()
    await expect(page.locator(".pager")).to_be_visible()
    await page.set_viewport_size({"width": 1100, "height": 800})
    await expect(page.get_by_role("button", name="Compare", exact=True)).to_be_hidden()
    await page.get_by_role("tab", name="Files").click()
    await page.locator(f'.file[data-id="{second}"] button').first.click()
    await expect(page.locator(".file-sheet[open]")).to_contain_text("compared on a screen from 1200 × 700 px")
    await page.context.close()
