"""Where snackbars stand: whatever the size of the screen, what must be read or pressed at once is not under one."""

from __future__ import annotations

import asyncio
from typing import Any

import pytest
from playwright.async_api import Page, expect

from tests.page.canned import Canned, alarm, live, slow, slowed
from tests.page.conftest import Phone

SIZES = [(320, 640), (360, 640), (412, 915), (640, 360), (915, 412), (800, 600), (1180, 820), (1280, 800), (1440, 900)]
LISTED = 1000  # from this width on the list of alarms is in sight, and a warning needs no snackbar
LONG = "The newest fix of the phone (Ann-Kathrin, of 3 phones) is 12 s old and comes too late over the radio. " * 3
# Which of these overlap a snackbar that is seen, by how many square pixels. A panel out of sight does not count.
COVERED = """() => {
  const seen = (one) => one.getClientRects().length > 0;
  const snacks = [...document.querySelectorAll('.snack')].filter(seen).map((one) => one.getBoundingClientRect());
  const over = (a, b) => Math.max(0, Math.min(a.right, b.right) - Math.max(a.left, b.left))
    * Math.max(0, Math.min(a.bottom, b.bottom) - Math.max(a.top, b.top));
  const kept = {speed: '.gauge .speed', strip: '#monitor > .strip', slide: '#monitor > .rail .slide',
    stop: '#monitor > .rail [data-f=stop]', steps: '#monitor > .under'};
  const found = {snacks: snacks.length};
  for (const [name, selector] of Object.entries(kept)) {
    const box = document.querySelector(selector)?.getBoundingClientRect();
    found[name] = box ? snacks.reduce((sum, one) => sum + over(one, box), 0) : 0;
  }
  const [speed, view] = ['.gauge .speed', '#monitor > .view']
    .map((one) => document.querySelector(one).getBoundingClientRect());
  found.isSpeedThere = speed.height > 12 && speed.top >= view.top && speed.bottom <= view.bottom;
  return found;
}"""


def warned(**more: Any) -> dict[str, Any]:
    return live() | {"alarms": [alarm("phone_missing", "Phone position missing", text=LONG)]} | more


async def opened(phone: Phone, canned: Canned) -> Page:
    await phone.open(f"{canned.address}/#home")
    await expect(phone.page.locator("[data-f=warning]")).to_be_visible()
    await phone.page.evaluate("document.fonts.ready")
    return phone.page


async def nothing_covered(page: Page, *, snacks: int, is_low: bool = False) -> None:
    """`is_low`: on a phone on its side the steps of a slow-down leave the gauge no height, warning or not."""
    await expect(page.locator(".snack:not([hidden])")).to_have_count(snacks)
    await page.evaluate("new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))")
    found = await page.evaluate(COVERED)
    if is_low:
        found |= {"steps": 0, "isSpeedThere": True}
    assert found == {
        "snacks": snacks, "speed": 0, "strip": 0, "slide": 0, "stop": 0, "steps": 0, "isSpeedThere": True,
    }  # fmt: skip


@pytest.mark.world(n=18)
async def test_a_warning_covers_neither_speed_nor_strip_nor_slide(phone: Phone, canned: Canned) -> None:
    for name, decelerate in (("armed", slow("armed")), ("slowing", slowed(True))):
        canned.state = warned(decelerate=decelerate)
        await phone.page.set_viewport_size({"width": 320, "height": 640})
        page = await opened(phone, canned)
        for width, height in SIZES:
            await page.set_viewport_size({"width": width, "height": height})
            await nothing_covered(page, snacks=int(width < LISTED), is_low=name == "slowing" and height < 400)


@pytest.mark.world(n=18)
async def test_nor_do_a_warning_and_a_notice_together(phone: Phone, canned: Canned) -> None:
    canned.state = warned(decelerate=slow("armed"))
    page = await opened(phone, canned)
    canned.refuses["acknowledge"] = "Ben is in control."
    for width, height in ((360, 640), (412, 915), (800, 600)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.locator("[data-f=warning]").get_by_role("button", name="Acknowledge").tap()
        await nothing_covered(page, snacks=2)


@pytest.mark.world(n=18)
async def test_a_warning_costs_a_wide_screen_nothing(phone: Phone, canned: Canned) -> None:
    canned.state = warned()
    page = await opened(phone, canned)
    await page.set_viewport_size({"width": 1440, "height": 900})
    await page.locator("#tab-home").tap()  # now it may sound
    listed = page.locator("#monitor [data-pane=alarms] [data-kind=unacknowledged]")
    await expect(listed).to_contain_text("Phone position missing")
    await expect(page.locator("[data-f=warning]")).to_be_hidden()
    box = page.locator("#monitor .mapbox")
    await expect(box).to_be_visible()
    await expect(page.locator("#monitor .banner:visible")).to_have_count(0)  # that no sound is allowed yet
    under = (await box.bounding_box() or {})["height"]
    await page.locator("#tab-files").tap()  # it hides the list
    await expect(page.locator("[data-f=warning]")).to_be_visible()
    await page.locator("#tab-home").tap()
    canned.state = live()
    await expect(listed).to_have_count(0)
    async with asyncio.timeout(8):
        while (await box.bounding_box() or {}).get("height") != under:  # it is laid out once the tab is there
            await asyncio.sleep(0.05)


@pytest.mark.parametrize(("width", "height"), [(820, 1180), (1180, 820), (1440, 900)])
async def test_a_snackbar_stands_beside_a_dialog_on_files(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    critical = alarm("speed", "Speed above limit", priority="critical", place="dialog", needs_ack=True, sound="high")
    canned.state = live() | {"alarms": [alarm("phone_missing", "Phone position missing"), critical]}
    await phone.page.set_viewport_size({"width": width, "height": height})
    await phone.open(f"{canned.address}/#files")
    snack, dialog = phone.page.locator("[data-f=warning]"), phone.page.locator("dialog.crit[open]")
    await expect(snack).to_be_visible()
    await expect(dialog).to_be_visible()
    await phone.page.wait_for_timeout(600)  # the sheet slides in
    left, right = await snack.bounding_box(), await dialog.bounding_box()
    assert left is not None
    assert right is not None
    assert left["x"] + left["width"] <= right["x"]
    assert left["width"] >= 300
