"""In every sheet the key that acts is in sight without scrolling; a tag shows that more lies beneath."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Any

import pytest
from playwright.async_api import Page, expect

from tests.page.canned import Canned, alarm, live
from tests.page.conftest import Phone
from tests.page.screenshots import SCENES, show

SIZES = [(360, 640), (360, 740), (412, 915), (740, 360)]
#: What acts in a sheet, by the scene that opens it.
ACTING = {
    "slow-down-arm": "#sheet-slow [data-act=arm]",
    "slow-down-release": "#sheet-release [data-f=yes]",
    "stop": "#sheet-stop [data-f=yes]",
    "home-fault": "#sheet-alarm [data-f=acknowledge]",
    "link-lost": "#sheet-lost [data-f=retry]",
    "no-messages": "#sheet-mute [data-f=retry]",
    "connect-failed": "#sheet-failed [data-f=retry]",
    "menu": "#sheet-menu [data-f=no]",
    "preferences": "#sheet-preferences [data-f=no]",
    "mail": "#sheet-mail [data-f=mail-send]",
    "outbox": "#sheet-outbox [data-f=no]",
    "files-menu": "#sheet-file [data-f=file-actions] button",
    "mark-sheet": "#sheet-mark [data-f=mark-keep]",
    "marks": "#sheet-marks [data-f=no]",
    "take-over": "#sheet-take-over [data-f=keep]",
    "sign-on": "#sheet-duty .sign",
    "left": "#sheet-left .sign",
    "handover": "#sheet-handover .sign",
    "topic": "#sheet-topic li button",
    "question-sheet": "#sheet-question li button",
    "cars": "#sheet-cars li button",
    "control": "#sheet-control .main",
    "planned-stop-sheet": "#sheet-planned-stop [data-reason]",
    "this-device": "#sheet-this-phone [data-f=arm]",
    "shelve": "#sheet-shelve [data-minutes]",
    "record": "#sheet-record .main",
    "signals-of-chart": ".trends-pick .key",
}
Opening = Callable[[Canned, Page], Awaitable[None]]


async def click(page: Page, selector: str) -> None:
    await page.wait_for_selector(selector, state="attached")
    await page.evaluate("(selector) => document.querySelector(selector).click()", selector)


async def control(server: Canned, page: Page) -> None:
    server.state = live() | {"control": {"holder": "Ann-Kathrin (Pixel 7)", "page": "other", "fence": 3}}
    await click(page, "#monitor [data-f=who]")
    await click(page, "#sheet-cars [data-f=cars-control]")


def of_menu(name: str) -> Opening:
    async def opened(server: Canned, page: Page) -> None:
        server.state = live()
        await click(page, f"#sheet-menu [data-f={name}]")

    return opened


async def shelve(server: Canned, page: Page) -> None:
    server.state = live() | {"alarms": [alarm("drift", "GPS drift", state="ACKED", place="list")]}
    await click(page, "[data-f=strip]")
    await click(page, "ul[data-f=alarms] [data-do=shelve]")


async def signals_of_chart(server: Canned, page: Page) -> None:
    await SCENES["chart"](server, page)
    await click(page, ".trends-tools .key[aria-haspopup]")


OPENED: dict[str, Opening] = {
    "control": control,
    "planned-stop-sheet": of_menu("planned-stop"),
    "this-device": of_menu("this-phone"),
    "record": of_menu("record"),
    "shelve": shelve,
    "signals-of-chart": signals_of_chart,
}
#: How many of 25 points of an element are beyond the window, cut by what it lies in, or under something else.
UNSEEN = """(selector) => {
  const one = document.querySelector(selector);
  const { left, top, width, height } = one.getBoundingClientRect();
  const at = (x, y) => document.elementFromPoint(left + (x / 10) * width, top + (y / 10) * height);
  const points = [1, 3, 5, 7, 9].flatMap((x) => [1, 3, 5, 7, 9].map((y) => at(x, y)));
  return height < 32 ? 'low' : points.filter((point) => !one.contains(point)).length;
}"""
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
#: Once the open sheet has risen.
STANDS = """() => Promise.all([...document.querySelectorAll('dialog[open]')]
  .flatMap((sheet) => sheet.getAnimations()).map((one) => one.finished)).then(() => {})"""
#: Whether the tag over the keys shows that more lies beneath.
MORE = """() => {
  const foot = document.querySelector('dialog[open] > .keys:last-child');
  return getComputedStyle(foot, '::before').visibility;
}"""
#: Where the rows of a list act: in a low window the first lies beneath, and the tag shows it.
LISTS = ("files-menu", "topic", "question-sheet")


async def unseen(phone: Phone, canned: Canned, name: str) -> dict[str, Any]:
    """At which sizes how much of the key that acts is out of sight."""
    page = phone.page
    await page.set_viewport_size({"width": SIZES[0][0], "height": SIZES[0][1]})
    await show(canned, page, "home" if name in OPENED else name)
    if name in OPENED:
        await OPENED[name](canned, page)
    await expect(page.locator(ACTING[name]).first).to_be_visible()
    found = {}
    for width, height in SIZES:
        await page.set_viewport_size({"width": width, "height": height})
        await page.evaluate(DRAWN)
        await page.evaluate(STANDS)
        await expect(page.locator("[data-moved]")).to_have_count(0)  # what has just come takes no press
        if name in LISTS and height < 400 and await page.evaluate(MORE) == "visible":
            continue
        if out := await page.evaluate(UNSEEN, ACTING[name]):
            found[f"{width} × {height}"] = out
    return found


@pytest.mark.gate
async def test_the_key_that_arms_is_in_sight_without_scrolling(phone: Phone, canned: Canned) -> None:
    assert await unseen(phone, canned, "slow-down-arm") == {}


@pytest.mark.parametrize("name", list(ACTING)[1:])
async def test_the_key_that_acts_is_in_sight_without_scrolling(phone: Phone, canned: Canned, name: str) -> None:
    assert await unseen(phone, canned, name) == {}


@pytest.mark.gate
async def test_a_tag_shows_that_more_lies_beneath_until_the_end_is_in_sight(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 360, "height": 640})
    await show(canned, page, "slow-down-arm")
    await page.wait_for_function(f"() => ({MORE})() === 'visible'")
    await page.evaluate("document.querySelector('#sheet-slow').scrollTo(0, 9999)")
    await page.wait_for_function(f"() => ({MORE})() === 'hidden'")
    await page.set_viewport_size({"width": 412, "height": 1180})  # all of it is in sight
    await page.wait_for_function(f"() => ({MORE})() === 'hidden'")
