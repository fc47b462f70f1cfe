"""Narrow phones and wide screens: nothing of bar, strip, steps or slide is cut off, no slice of a third tab is left."""

from __future__ import annotations

from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from playwright.async_api import expect

from tests.page.canned import Canned, Json, live, slowed
from tests.page.conftest import Phone

# What is wider or higher than its own room.
CUT = """(names) => names.filter((name) => [...document.querySelectorAll(name)].some((one) => one.offsetParent
  && (one.scrollWidth > one.clientWidth + 1 || one.scrollHeight > one.clientHeight + 1)))"""
# Of neighbours in a row, those whose edges cross.
CROSSING = """(name) => { const edges = [...document.querySelectorAll(name)].map((one) => {
  const range = document.createRange(); range.selectNodeContents(one); return range.getBoundingClientRect(); });
  return edges.slice(1).filter((one, n) => one.left < edges[n].right - 0.5).length; }"""
OUTSIDE = """(name) => [...document.querySelectorAll(name)].filter((one) => {
  const range = document.createRange(); range.selectNodeContents(one);
  return range.getBoundingClientRect().right > innerWidth; }).length"""


@pytest_asyncio.fixture(loop_scope="module")
async def canned() -> AsyncIterator[Canned]:
    served = Canned()
    async with served.running():
        yield served


def standing(stands: str) -> Json:
    state = live() | {"decelerate": slowed(None, stands=stands, ordered_mps=0.0)}
    state["signals"]["speed"]["value"] = {"speed_mps": 0.0}
    return state


@pytest.mark.parametrize("width", [412, 360, 320])
async def test_the_bar_shows_the_age_the_recording_and_who_is_in_control_side_by_side(
    phone: Phone, canned: Canned, width: int
) -> None:
    await phone.page.set_viewport_size({"width": width, "height": 800})
    for holder in ("You", None, "Pixel 7 · ab12"):
        canned.state = live() | {"control": {"holder": holder}}
        await phone.open(canned.address)
        await phone.live()
        if width > 345:  # narrower, the name is there for a screen reader only
            assert await phone.page.evaluate(CROSSING, "#monitor .top > *") == 0, (width, holder)
        shown = await phone.page.evaluate(
            "[...document.querySelector('#monitor .top .who').children].filter((one) => one.clientWidth > 4 || "
            "one.getBoundingClientRect().width > 4).length"
        )
        assert shown > 0, (width, holder)


@pytest.mark.world(n=11)
@pytest.mark.parametrize("width", [412, 360])
@pytest.mark.parametrize("stands", ["before", "unproven"])
async def test_an_order_on_a_standing_car_is_shown_whole_and_in_the_colour_of_an_order(
    phone: Phone, canned: Canned, width: int, stands: str
) -> None:
    await phone.page.set_viewport_size({"width": width, "height": 800})
    canned.state = standing(stands)
    await phone.open(canned.address)
    await phone.live()
    await expect(phone.f("legend-car")).to_have_text("slow-down: standing")
    order, legend = [
        await phone.page.evaluate("(name) => getComputedStyle(document.querySelector(name)).color", name)
        for name in (".order li[data-mark=ok] .i", '#monitor [data-f="legend-car"]')
    ]
    assert order == legend
    assert await phone.page.evaluate(OUTSIDE, ".order li b, .order li .lab, .order p") == 0
    assert await phone.page.evaluate(CUT, [".board > .rail .slide .tx", '[data-f="strip-text"]']) == []


async def test_that_an_order_is_not_confirmed_is_read_whole_on_the_slide(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 360, "height": 640})
    canned.state = live() | {"decelerate": slowed(False)}
    await phone.open(canned.address)
    await phone.live()
    slide = phone.page.locator(".board > .rail .slide")
    await expect(slide).to_have_text("Not confirmed physical stop!", use_inner_text=True)
    assert await phone.page.evaluate(CUT, [".board > .rail .slide .tx"]) == []


async def test_files_and_settings_fill_a_wide_screen_without_a_slice_of_the_scan(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(canned.address)
    await phone.live()
    for tab in ("files", "settings"):
        await phone.page.locator(f"[data-tab={tab}]").click()
        await expect(phone.page.locator("[data-panel=files]")).to_be_in_viewport(ratio=0.9)
        await expect(phone.page.locator("[data-panel=settings]")).to_be_in_viewport(ratio=0.9)
        await expect(phone.page.locator("[data-panel=scan]")).not_to_be_in_viewport(ratio=0.02)
