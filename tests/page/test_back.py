"""Back closes what is open, from every sheet and tab, and only then leaves the page."""

from __future__ import annotations

import pytest
from playwright.async_api import Page, expect

from tests.page.canned import Canned
from tests.page.conftest import Phone

GUARDED = "() => history.state?.over === true"
PLAIN = "() => history.state?.over !== true"


async def opened(phone: Phone, address: str) -> Page:
    """The page at `address`, its Back ready."""
    await phone.open("about:blank")
    await phone.open(address)
    await phone.live()
    await expect(phone.page.locator("#monitor [data-pane=alarms] *").first).to_be_attached()  # fetched with it
    return phone.page


async def back(page: Page) -> None:
    await page.wait_for_function(GUARDED)
    await page.go_back()


async def is_front(page: Page, tab: str) -> None:
    await expect(page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")


@pytest.mark.gate
async def test_back_closes_a_sheet_then_leads_home_and_only_then_leaves(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, f"{canned.address}/#home")
    await page.locator("#tab-map").tap()
    await is_front(page, "map")
    menu = page.locator("#sheet-menu")
    await page.wait_for_function(GUARDED)
    for _ in range(2):  # again and again: no entry is left over
        await phone.f("menu").tap()
        await expect(menu).to_be_visible()
        await back(page)
        await expect(menu).to_be_hidden()
        await is_front(page, "map")
    await phone.f("menu").tap()
    await page.keyboard.press("Escape")  # closed in another way: one Back fewer
    await expect(menu).to_be_hidden()
    await back(page)
    await is_front(page, "home")
    await page.wait_for_function(PLAIN)
    await page.go_back()
    await page.wait_for_url("about:blank")


@pytest.mark.gate
async def test_back_from_a_screen_and_from_a_sheet_over_it(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, f"{canned.address}/#home")
    menu, bar = page.locator("#sheet-menu"), page.locator("#monitor .titlebar")
    await phone.f("menu").tap()
    await menu.get_by_text("Signals").tap()
    await expect(bar).to_be_visible()
    await page.go_back()
    await expect(bar).to_be_hidden()
    await page.wait_for_function(PLAIN)
    await phone.f("menu").tap()
    await menu.get_by_text("Preferences").tap()
    preferences = page.locator("#sheet-preferences")
    await expect(preferences).to_be_visible()
    await back(page)
    await expect(preferences).to_be_hidden()
    await expect(menu).to_be_hidden()
    await page.wait_for_function(PLAIN)
    await page.go_back()
    await page.wait_for_url("about:blank")


@pytest.mark.gate
@pytest.mark.parametrize("way", ["a tab", "a press beside it"])
async def test_a_hand_over_that_was_left_by_hand_opens_no_more_by_itself(
    phone: Phone, canned: Canned, way: str
) -> None:
    page = await opened(phone, f"{canned.address}/#home")
    me = next(one["page"] for one in reversed(canned.heard) if one["kind"] == "hello")
    line = {
        "key": "limit", "kind": "limit", "title": "Speed limit: 2 m/s", "text": "", "priority": None, "since_ms": None,
        "until_ms": None, "read": False,
    }  # fmt: skip
    offer = {"by": "Ann", "by_page": "other", "name": "Ben", "page": me, "since_ms": 1, "version": "1"}
    canned.state["control"] = {"holder": "Ann", "handover": offer | {"lines": [line], "left": 1}}
    sheet = page.locator("#sheet-handover")
    await expect(sheet).to_be_visible()
    if way == "a tab":
        await page.locator("#tab-map").tap()
    else:
        await page.evaluate("document.querySelector('#panel-home').click()")
    await expect(sheet).to_have_count(0)
    await page.wait_for_timeout(1200)  # so long it would not open again at once
    await phone.drawn(4)
    await expect(sheet).to_have_count(0)
