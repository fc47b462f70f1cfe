"""The tabs: swiped, pressed, reached by keys and links, remembered; and the screens behind the menu."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from server.web.tabs import TABS as DECLARED
from tests.page.barriers import SIZES
from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.touch import stroke

TABS = [tab.name for tab in DECLARED]


async def swipe(phone: Phone, dx: int, dy: int = 0) -> None:
    """One finger across the view, as the browser gets it from a touch screen."""
    x, y = (340, 500) if dx < 0 else (70, 500)
    is_short = abs(dx) < 100 and not dy  # held for a moment: a slow machine must not take it for a flick
    await stroke(phone.page, (x, y, x + dx, y + dy), rest_s=0.4 if is_short else 0.0)


async def in_front(phone: Phone, tab: str) -> None:
    """The tab is marked, linked, and its panel fills the view."""
    await expect(phone.page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")
    await expect(phone.page.locator("[role=tab][aria-selected=true]")).to_have_count(1)
    await phone.page.wait_for_function(
        "tab => Math.abs(document.querySelector(`#panel-${tab}`).getBoundingClientRect().left) < 1", arg=tab
    )
    assert phone.page.url.endswith(f"#{tab}")


@pytest.mark.gate
async def test_ui_01_swiping_leads_through_all_five_tabs_and_back(phone: Phone, canned: Canned) -> None:
    await phone.open(canned.address)
    await phone.live()
    for tab in TABS[1:]:
        await swipe(phone, -250)
        await in_front(phone, tab)
    for tab in reversed(TABS[:-1]):
        await swipe(phone, 250)
        await in_front(phone, tab)


async def test_a_short_touch_springs_back_and_a_swipe_up_scrolls(phone: Phone, canned: Canned) -> None:
    await phone.open(canned.address)
    await phone.live()
    await swipe(phone, -60)
    await in_front(phone, "home")
    await swipe(phone, 0, -250)
    await phone.page.wait_for_function("() => document.querySelector('#panel-home').scrollTop > 50")
    await in_front(phone, "home")


@pytest.mark.gate
async def test_keys_links_and_memory(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#scan")
    await phone.live()
    await in_front(phone, "scan")
    await phone.page.locator("#tab-scan").focus()
    for key, tab in (("ArrowRight", "files"), ("End", "settings"), ("Home", "home"), ("ArrowRight", "map")):
        await phone.page.keyboard.press(key)
        await in_front(phone, tab)
        await expect(phone.page.locator(f"#tab-{tab}")).to_be_focused()
    await phone.open("about:blank")
    await phone.open(canned.address)  # without a link the last tab is remembered
    await phone.live()
    await in_front(phone, "map")
    await phone.page.evaluate("location.hash = '#files'")
    await in_front(phone, "files")


@pytest.mark.gate
async def test_ui_report_fig_3_9_the_overflow_menu(phone: Phone, canned: Canned) -> None:
    await phone.open(canned.address)
    await phone.live()
    await phone.f("menu").tap()
    menu = phone.page.locator("#sheet-menu")
    assert await menu.locator("li:has([data-screen])").all_inner_texts() == [
        "Departure check", "Alarms", "Alarm log", "Signals", "View saved data", "Preferences", "License", "About",
    ]  # fmt: skip
    await menu.get_by_text("Preferences").tap()
    await phone.page.locator("[data-theme-key=light]").tap()
    assert await phone.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    await phone.page.keyboard.press("Escape")
    await phone.f("menu").tap()
    await menu.get_by_text("Signals").tap()
    speed = phone.page.locator(".sigs .sig").first
    await expect(speed).to_contain_text("Speed")
    await phone.page.go_back()  # the phone's back key
    await expect(phone.page.locator(".tabs")).to_be_visible()
    await phone.f("menu").tap()
    await menu.get_by_text("Signals").tap()
    await speed.tap()
    more = phone.page.locator(".sig-more:not([hidden])")
    await expect(more).to_contain_text("/catvehicle/speed")
    await expect(more).to_contain_text("geometry_msgs/Twist")
    await expect(phone.page.locator(".sig", has_text="Fuel")).to_contain_text("not published")
    assert "0" not in await phone.page.locator(".sig", has_text="Fuel").inner_text()


async def test_on_every_screen_the_keys_of_the_rail_are_as_large_as_a_thumb_and_leave_a_view(
    phone: Phone, canned: Canned
) -> None:
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    for width, height in SIZES:
        if height < 412:  # lower than any phone on its side
            continue
        await phone.page.set_viewport_size({"width": width, "height": height})
        for name in ("stop", "pause", "slow"):
            box = await phone.page.locator(f".board > .rail [data-f={name}]").bounding_box()
            assert box is not None
            assert min(box["height"], box["width"]) >= 56, (width, name)
        view = await phone.page.locator("#monitor .view").bounding_box()
        assert view is not None
        assert view["height"] >= 180, width


async def test_what_is_out_of_sight_is_neither_reached_nor_laid_out(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#map")
    await phone.live()
    watch = ["home", "map", "scan"]
    for width, tab, front, seen in (
        (412, "home", "home", ["home"]),
        (412, "map", "map", ["map"]),
        (1280, None, "home", watch),  # a pane needs no tab of its own
        (1280, "settings", "settings", ["home", "settings"]),  # a drawer over map and scan
        (1280, "files", "files", ["files"]),
        (1280, "scan", "home", watch),
        (800, "scan", "scan", ["scan"]),
    ):
        await phone.page.set_viewport_size({"width": width, "height": 800})
        if tab:
            await phone.page.evaluate("tab => { location.hash = `#${tab}`; }", tab)
        await expect(phone.page.locator(f"#tab-{front}")).to_have_attribute("aria-selected", "true")
        await expect(phone.page.locator("[role=tab][aria-selected=true]")).to_have_count(1)
        reached = phone.page.locator("#monitor [data-panel]:not([inert])")
        await expect(reached).to_have_count(len(seen))
        assert await reached.evaluate_all("all => all.map((panel) => panel.dataset.panel)") == seen
        # At rest those that are reached are laid out, and no others.
        await expect(phone.page.locator("#monitor [data-panel][data-folded]")).to_have_count(len(TABS) - len(seen))
    await phone.page.set_viewport_size({"width": 1280, "height": 800})
    await phone.page.evaluate("location.hash = '#home'")
    await phone.page.locator("#tab-home").focus()
    for key, tab in (("ArrowRight", "files"), ("ArrowRight", "settings"), ("ArrowLeft", "files"), ("Home", "home")):
        await phone.page.keyboard.press(key)
        await expect(phone.page.locator(f"#tab-{tab}")).to_be_focused()
        await expect(phone.page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")
