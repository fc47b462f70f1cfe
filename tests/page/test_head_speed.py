"""A screen that covers the gauge carries the speed in its head."""

from __future__ import annotations

import os
from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned, live
from tests.page.conftest import Phone
from tests.page.screenshots import replayed, replayed_timeline, silent_car
from tests.page.touch import DRAWN

TITLED = ("departure", "log", "trends", "signals")
OPEN = "name => dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen: name } }))"
#: What of a title bar is cut off or lies over its neighbour [px].
LOST = """bar => {
  const parts = [...bar.children].filter((part) => part.checkVisibility());
  const boxes = parts.map((part) => part.getBoundingClientRect());
  const bottom = bar.getBoundingClientRect().bottom;
  const texts = parts.filter((part) => !part.matches('.head-speed'));  // whose cover is larger on purpose
  const cut = texts.map((part) => part.scrollWidth - part.clientWidth);
  const over = boxes.map((box, n) => box.right - (boxes[n + 1]?.left ?? innerWidth));
  const low = boxes.map((box) => box.bottom - bottom - 1);
  return [...cut, ...over, ...low].filter((px) => px > 1);
}"""


@pytest.mark.parametrize("width", [412, 360, 320])
async def test_each_screen_behind_the_menu_shows_the_speed(phone: Phone, canned: Canned, width: int) -> None:
    await phone.page.set_viewport_size({"width": width, "height": 780})
    await phone.open(canned.address)
    await phone.live()
    bar = phone.page.locator("#monitor > .titlebar")
    for name in TITLED:
        await phone.page.evaluate(OPEN, name)
        await expect(bar.locator(".head-speed")).to_have_text("4.2m/s")
        await expect(bar.locator(".head-speed")).to_be_visible()
        assert await bar.evaluate(LOST) == [], name
        if folder := os.environ.get("CATGRAPH_LOOK"):
            await phone.page.screenshot(path=Path(folder) / f"head-{name}-{width}.png")


#: Whether the speed is read in the gauge or in the head, and nothing pressable lies under that head.
IN_SIGHT = """() => {
  const box = (one) => document.querySelector(one).getBoundingClientRect();
  const [gauge, screen, head] = [box('.gauge .speed'), box('.view > .screen'), box('#monitor > .titlebar')];
  const covers = (a, b) => a.left < b.right - 1 && a.right > b.left + 1 && a.top < b.bottom - 1 && a.bottom > b.top + 1;
  const speed = document.querySelector('#monitor > .titlebar .head-speed');
  const tabs = [...document.querySelectorAll('#monitor > .tabs button')]
    .filter((one) => one.checkVisibility({ visibilityProperty: true }) && covers(head, one.getBoundingClientRect()));
  const isRead = speed.checkVisibility() || !covers(screen, gauge);
  return { isRead, under: tabs.map((one) => one.textContent.trim()) };
}"""


@pytest.mark.gate
async def test_a_screen_shows_the_speed_on_a_tablet_and_a_desktop_too(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 820, "height": 1180})
    await phone.open(canned.address)
    await phone.live()
    await expect(page.locator("link[href*='drawers']")).to_be_attached()
    for name in TITLED:
        await page.evaluate(OPEN, name)
        await expect(page.locator("#monitor > .titlebar .head-speed")).to_have_text("4.2m/s")
        for width, height in ((820, 1180), (740, 1180), (1100, 800), (1000, 640), (1440, 900), (1440, 560)):
            await page.set_viewport_size({"width": width, "height": height})
            await page.evaluate(DRAWN)
            assert await page.evaluate(IN_SIGHT) == {"isRead": True, "under": []}, (name, width, height)
            assert await page.locator("#monitor > .titlebar").evaluate(LOST) == [], (name, width, height)


@pytest.mark.gate
async def test_no_speed_of_a_recording_stands_in_a_head(phone: Phone, canned: Canned) -> None:
    canned.state, canned.timeline = replayed(live()), replayed_timeline()
    await phone.page.goto(f"{canned.address}/?replay=car_0&t=246#home")
    await phone.page.wait_for_selector("#monitor:not([hidden])")
    await phone.complete()
    await phone.page.evaluate(OPEN, "log")
    await expect(phone.page.locator("#monitor > .titlebar")).to_contain_text("Alarm log of the live car")
    await expect(phone.page.locator("#monitor > .titlebar .head-speed")).to_be_hidden()


@pytest.mark.gate
async def test_the_speed_in_a_head_is_covered_once_it_is_not_renewed(phone: Phone, canned: Canned) -> None:
    await phone.open(canned.address)
    await phone.live()
    await phone.page.evaluate(OPEN, "signals")
    cover = phone.page.locator("#monitor > .titlebar .head-speed > .cover")
    await expect(cover).to_have_css("opacity", "0")
    canned.state = silent_car(live())
    await expect(cover).to_have_css("opacity", "1")


@pytest.mark.gate
async def test_the_speed_in_a_head_is_covered_with_the_values_when_the_page_hangs(phone: Phone, canned: Canned) -> None:
    """It goes by the animation of the veil, which every drawing rewinds and which needs no script."""
    await phone.open(canned.address)
    await phone.live()
    await phone.page.evaluate(OPEN, "signals")
    cover = phone.page.locator("#monitor > .titlebar .head-speed > .cover")
    await expect(cover).to_be_visible()
    course = """element => {
      const veil = document.querySelector('#monitor > .view > .veil');
      const styles = [element, veil].map((one) => getComputedStyle(one));
      return styles.map(({ animationName, animationDuration }) => [animationName, animationDuration].join());
    }"""
    mine, veils = await cover.evaluate(course)
    assert mine == veils
    assert mine in ("cover-even,2s", "cover-odd,2s")
