"""What stays in sight beside an open screen is live, and what is drawn is in its place after the window changes."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned, alarm, live
from tests.page.conftest import Phone

OPEN = "name => dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen: name } }))"
# The fewest marks in any picture of 1.5 s: where their places are not known, they collapse to one.
FEWEST = """async () => {
  let fewest = Infinity;
  for (const end = performance.now() + 1500; performance.now() < end;) {
    await new Promise(requestAnimationFrame);
    fewest = Math.min(fewest, document.querySelectorAll('.trends-marks g[transform]').length);
  }
  return fewest;
}"""


def wants_scan(canned: Canned) -> list[Any]:
    return [one["scan"] for one in canned.received if one.get("kind") == "watch"]


@pytest.mark.gate
async def test_beside_a_screen_that_leaves_the_scan_in_sight_it_goes_on(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 1920, "height": 1080})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.page.locator("[data-panel=scan] [data-f=canvas]")).to_be_visible()
    await phone.drawn()
    assert wants_scan(canned)[-1:] == [True]
    await phone.page.evaluate(OPEN, "signals")
    await expect(phone.f("title")).to_have_text("Signals")
    await phone.drawn()
    await expect(phone.page.locator("[data-panel=scan] [data-f=canvas]")).to_be_visible()
    assert wants_scan(canned)[-1:] == [True]
    for width, height in ((1440, 900), (412, 915)):  # the screen covers it there: it would be sent for nobody
        await phone.page.set_viewport_size({"width": width, "height": height})
        async with asyncio.timeout(20):
            while wants_scan(canned)[-1:] != [False]:
                await asyncio.sleep(0.05)


@pytest.mark.gate
async def test_the_marks_above_the_trends_stay_at_their_lines_in_another_theme(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    marks = page.locator(".trends-marks g[transform]")
    await expect(marks.nth(1)).to_be_visible()
    await phone.drawn()
    before = await marks.count()
    assert before > 1
    for n in range(3):
        fewest = asyncio.create_task(page.evaluate(FEWEST))
        await page.emulate_media(color_scheme="light" if n % 2 == 0 else "dark", reduced_motion="reduce")
        assert await fewest == before, n


@pytest.mark.gate
async def test_a_warning_that_returned_looks_ended_in_its_notice(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    notice = phone.page.locator("[data-f=warning]")
    canned.state = live() | {"alarms": [alarm("GPS drift", "GPS drift", text="6.3 m of 2.0 m")]}
    await expect(notice.locator("b")).to_have_text("GPS drift")
    await expect(notice).to_have_css("border-style", "solid")
    canned.state["alarms"][0] |= {"state": "RTN_UNACKED", "active": False, "needs_ack": True}
    await expect(notice.locator("b")).to_have_text("GPS drift: ended")
    await expect(notice).to_have_css("border-style", "dashed")
    await expect(notice.locator(".side")).to_have_css("background-color", "rgba(0, 0, 0, 0)")
