"""Back closes what is open, from every sheet and tab, and only then leaves the page."""

from __future__ import annotations

import pytest
from playwright.async_api import Page, expect

from tests.page.canned import Canned, alarm, live
from tests.page.canned_fleet import car
from tests.page.conftest import Phone
from tests.page.test_parts import until_sent

GUARDED = "() => history.state?.over === true"
PLAIN = "() => history.state?.over !== true"


async def opened(phone: Phone, address: str) -> Page:
    """The page at `address`, its Back ready."""
    await phone.open("about:blank")
    await phone.open(address)
    await phone.live()
    return phone.page


async def ready(page: Page) -> None:
    """Back is there: it was fetched, and knows of a tab that is not the first."""
    await page.locator("#tab-map").tap()
    await page.wait_for_function(GUARDED)
    await page.locator("#tab-home").tap()
    await page.wait_for_function(PLAIN)


async def back(page: Page) -> None:
    await page.wait_for_function(GUARDED)
    await page.go_back()


#: Whether each entry that the page adds from now on is added by a touch: Back passes over the one before it, if not.
WATCH_PUSHES = """() => {
  window.pushes = [];
  const push = history.pushState;
  history.pushState = function (...given) {
    window.pushes.push(navigator.userActivation.isActive);
    return push.apply(this, given);
  };
}"""


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
async def test_one_back_after_the_other_needs_no_entry_that_no_touch_added(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, f"{canned.address}/#home")
    await ready(page)
    await page.evaluate(WATCH_PUSHES)
    await page.locator("#tab-map").tap()
    await page.wait_for_function(GUARDED)
    await phone.f("menu").tap()
    menu = page.locator("#sheet-menu")
    await expect(menu).to_be_visible()
    await back(page)
    await expect(menu).to_be_hidden()
    await is_front(page, "map")
    await back(page)
    await is_front(page, "home")
    await page.wait_for_function(PLAIN)
    assert await page.evaluate("window.pushes") == [True]
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
    me = (await until_sent(canned, "hello"))["page"]
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


@pytest.mark.gate
async def test_from_one_screen_to_another_and_to_a_tab(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, f"{canned.address}/#home")
    await ready(page)
    menu, bar = page.locator("#sheet-menu"), page.locator("#monitor .titlebar")
    for name in ("Signals", "Alarm log"):
        await phone.f("menu").tap()
        await page.wait_for_function(GUARDED)
        await menu.get_by_text(name).tap()
        await expect(menu).to_be_hidden()
        await expect(phone.f("title")).to_contain_text(name)
    await page.go_back()  # not to the screen before
    await expect(bar).to_be_hidden()
    await page.wait_for_function(PLAIN)
    await phone.f("menu").tap()
    await menu.get_by_text("Signals").tap()
    await expect(bar).to_be_visible()
    await page.wait_for_function("() => history.state?.screen === 'signals'")
    await phone.f("menu").tap()
    await page.wait_for_function(GUARDED)
    await menu.locator("[data-screen=saved]").tap()
    await is_front(page, "files")
    await expect(bar).to_be_hidden()
    await back(page)
    await is_front(page, "home")
    await page.wait_for_function(PLAIN)
    await expect(bar).to_be_hidden()
    await page.go_back()
    await page.wait_for_url("about:blank")


@pytest.mark.gate
async def test_the_address_goes_on_with_the_car_that_is_shown(phone: Phone, canned: Canned) -> None:
    canned.vehicle = "Caracal"
    canned.cars = [car(name, 3.0, None) for name in ("Caracal", "Margay")]
    page = await opened(phone, f"{canned.address}/?vehicle=Caracal#home")
    await ready(page)
    await phone.f("who").tap()
    await page.wait_for_function(GUARDED)
    canned.vehicle = "Margay"
    await page.locator('#sheet-cars [data-car="Margay"]').tap()
    await expect(page.locator("#sheet-cars")).to_be_hidden()
    await page.wait_for_function(PLAIN)
    assert page.url.endswith("/?vehicle=Margay#home")


@pytest.mark.gate
async def test_back_answers_no_alarm(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, f"{canned.address}/#home")
    await ready(page)
    fast = alarm("speed_limit", "Speed above limit", priority="critical", place="dialog", actions=["acknowledge"])
    canned.state = live() | {"alarms": [fast]}
    sheet = page.locator("#sheet-alarm")
    await expect(sheet).to_be_visible()
    await expect(sheet).not_to_have_attribute("data-moved", "")
    await page.wait_for_function(GUARDED)
    await page.evaluate(WATCH_PUSHES)
    for _ in range(2):  # it is guarded again
        await page.wait_for_timeout(1100)  # what came a moment ago takes no answer anyway
        await back(page)
        await page.wait_for_function(GUARDED)
        await phone.drawn()
        await expect(sheet).to_be_visible()
    assert "acknowledge" not in [one["kind"] for one in canned.received]
    assert await page.evaluate("window.pushes") == []


@pytest.mark.gate
@pytest.mark.own_phone
async def test_a_board_outlives_the_sheet_over_it_and_back_closes_it_alone(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, f"{canned.address}/#home")
    await ready(page)
    await phone.show("files")
    await page.wait_for_function(GUARDED)
    await page.route("**/api/logbook?*", lambda _: None)  # still loading
    board, menu = page.locator("#monitor .logbook-board"), page.locator("#sheet-menu")
    for closes in ("Escape", "Back"):
        await page.locator('[data-f="files-logbook"]').tap()
        await expect(board).to_be_visible()
        await phone.f("menu").tap()
        await page.wait_for_function(GUARDED)
        await (page.keyboard.press(closes) if closes == "Escape" else page.go_back())
        await expect(menu).to_be_hidden()
        await page.wait_for_function("() => history.state?.logbook > 0 && history.state.over !== true")
        await expect(board).to_be_visible()
        await page.go_back()
        await expect(board).to_have_count(0)
        await is_front(page, "files")
        await page.wait_for_function(GUARDED)
