"""The five tabs: swiped, pressed, reached by keys and links, remembered; and the screens behind the menu."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from axe_playwright_python.async_playwright import Axe
from playwright.async_api import expect

from tests.page.conftest import Phone
from tests.page.processes import Process, running, server, simulate

TABS = ["home", "map", "scan", "files", "settings"]


@pytest_asyncio.fixture(loop_scope="module", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    """A server that watches a simulated car."""
    data = tmp_path_factory.mktemp("data")
    async with running(*simulate()) as car, running(*server(data, car.address)) as process:
        yield process


async def swipe(phone: Phone, dx: int, dy: int = 0) -> None:
    """One finger across the view, as the browser gets it from a touch screen."""
    cdp = await phone.page.context.new_cdp_session(phone.page)
    x, y = (340, 500) if dx < 0 else (70, 500)
    await cdp.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": [{"x": x, "y": y}]})
    for step in range(1, 11):
        point = {"x": x + dx * step / 10, "y": y + dy * step / 10}
        await cdp.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [point]})
        await asyncio.sleep(0.016)
    if abs(dx) < 100 and not dy:  # held for a moment: a slow machine must not take it for a flick
        await asyncio.sleep(0.2)
        await cdp.send("Input.dispatchTouchEvent", {"type": "touchMove", "touchPoints": [{"x": x + dx + 1, "y": y}]})
        await asyncio.sleep(0.2)
    await cdp.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    await cdp.detach()


async def in_front(phone: Phone, tab: str) -> None:
    """The tab is marked, linked, and its panel fills the view."""
    await expect(phone.page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")
    await expect(phone.page.locator("[role=tab][aria-selected=true]")).to_have_count(1)
    await phone.page.wait_for_function(
        "tab => Math.abs(document.querySelector(`#panel-${tab}`).getBoundingClientRect().left) < 1", arg=tab
    )
    assert phone.page.url.endswith(f"#{tab}")


async def test_ui_01_swiping_leads_through_all_five_tabs_and_back(phone: Phone, watch: Process) -> None:
    await phone.open(watch.address)
    await phone.live()
    for tab in TABS[1:]:
        await swipe(phone, -250)
        await in_front(phone, tab)
    for tab in reversed(TABS[:-1]):
        await swipe(phone, 250)
        await in_front(phone, tab)


async def test_a_short_touch_springs_back_and_a_swipe_up_scrolls(phone: Phone, watch: Process) -> None:
    await phone.open(watch.address)
    await phone.live()
    await swipe(phone, -60)
    await asyncio.sleep(0.4)
    await in_front(phone, "home")
    await swipe(phone, 0, -250)
    await phone.page.wait_for_function("() => document.querySelector('#panel-home').scrollTop > 50")
    await in_front(phone, "home")


async def test_keys_links_and_memory(phone: Phone, watch: Process) -> None:
    await phone.open(f"{watch.address}/#scan")
    await phone.live()
    await in_front(phone, "scan")
    await phone.page.locator("#tab-scan").focus()
    for key, tab in (("ArrowRight", "files"), ("End", "settings"), ("Home", "home"), ("ArrowRight", "map")):
        await phone.page.keyboard.press(key)
        await in_front(phone, tab)
        await expect(phone.page.locator(f"#tab-{tab}")).to_be_focused()
    await phone.open("about:blank")
    await phone.open(watch.address)  # without a link the last tab is remembered
    await phone.live()
    await in_front(phone, "map")
    await phone.page.evaluate("location.hash = '#files'")
    await in_front(phone, "files")


async def test_ui_report_fig_3_9_the_overflow_menu(phone: Phone, watch: Process) -> None:
    await phone.open(watch.address)
    await phone.live()
    await phone.f("menu").tap()
    menu = phone.page.locator("#sheet-menu")
    assert await menu.locator("li:has([data-screen])").all_inner_texts() == [
        "View saved data", "Preferences", "Alarms", "Alarm log", "Signals", "License", "About",
    ]  # fmt: skip
    await menu.get_by_text("License").tap()
    await phone.page.locator(".notice summary", has_text="catgraph").tap()
    await expect(phone.page.locator(".notice[open] .license")).to_contain_text("TERMS AND CONDITIONS FOR USE")
    await phone.page.go_back()  # the phone's back key
    await expect(phone.page.locator(".tabs")).to_be_visible()
    await phone.f("menu").tap()
    await menu.get_by_text("About").tap()
    await expect(phone.page.locator("[data-f=screen] .prose")).to_contain_text("not an emergency stop")
    await phone.f("back").tap()
    await phone.f("menu").tap()
    await menu.get_by_text("Preferences").tap()
    await phone.page.locator("[data-theme-key=light]").tap()
    assert await phone.page.evaluate("getComputedStyle(document.body).backgroundColor") == "rgb(255, 255, 255)"
    await phone.page.keyboard.press("Escape")
    await phone.f("menu").tap()
    await menu.get_by_text("Signals").tap()
    speed = phone.page.locator(".sigs .sig").first
    await expect(speed).to_contain_text("Speed")
    await speed.tap()
    more = phone.page.locator(".sig-more:not([hidden])")
    await expect(more).to_contain_text("/catvehicle/vel")
    await expect(more).to_contain_text("geometry_msgs/Twist")
    await expect(phone.page.locator(".sig", has_text="Fuel")).to_contain_text("not published")
    assert "0" not in await phone.page.locator(".sig", has_text="Fuel").inner_text()


@pytest.mark.parametrize("size", [(320, 640), (360, 740), (430, 932), (915, 412), (1180, 820)])
async def test_no_width_breaks_the_page(phone: Phone, watch: Process, size: tuple[int, int]) -> None:
    """Nothing hangs over the edge, and the keys of the rail keep the size of a thumb."""
    await phone.page.set_viewport_size({"width": size[0], "height": size[1]})
    await phone.open(f"{watch.address}/#home")
    await phone.live()
    over = await phone.page.evaluate(
        """() => [...document.querySelectorAll('.top *, .tabs *, .strip, .strip *, .rail *, #panel-home *')]
          .filter((one) => one.getClientRects().length && !one.closest('svg'))
          .filter((one) => !one.matches('.unseen, .clip *, .turn, .turn *, .moves'))
          .filter((one) => one.getBoundingClientRect().right > innerWidth + 1 || one.getBoundingClientRect().left < -1)
          .map((one) => one.className + ' ' + one.textContent.trim().slice(0, 30))"""
    )
    assert over == []
    for name in ("stop", "pause", "slow"):
        box = await phone.page.locator(f".board > .rail [data-f={name}]").bounding_box()
        assert box is not None
        assert min(box["height"], box["width"]) >= 56
    view = await phone.page.locator("#monitor .view").bounding_box()
    assert view is not None
    assert view["height"] >= 180


async def test_no_barrier_that_a_machine_can_find(phone: Phone, watch: Process) -> None:
    """Contrast, names, roles, landmarks: WCAG as axe measures it."""
    await phone.open(f"{watch.address}/#home")
    await phone.live()
    for screen in ("home", "signals"):
        if screen == "signals":
            await phone.f("menu").tap()
            await phone.page.locator("#sheet-menu").get_by_text("Signals").tap()
        for theme in ("dark", "light"):
            await phone.page.emulate_media(color_scheme=theme)
            found = (await Axe().run(phone.page)).response["violations"]
            assert [(one["id"], one["nodes"][0]["html"]) for one in found] == [], f"{screen}, {theme}"


@pytest.mark.parametrize(
    ("width", "hash", "marked"),
    [(412, "home", ["home"]), (412, "settings", ["settings"]), (1280, "home", ["home", "map", "scan"])],
)
async def test_the_tabs_in_sight_are_marked_and_no_others(
    phone: Phone, watch: Process, width: int, hash: str, marked: list[str]
) -> None:
    await phone.page.set_viewport_size({"width": width, "height": 800})
    await phone.open(f"{watch.address}/#{hash}")
    await phone.live()
    tabs = phone.page.locator("#monitor [data-tab][data-shown]")
    await expect(tabs).to_have_count(len(marked))
    assert await tabs.evaluate_all("all => all.map((tab) => tab.dataset.tab)") == marked
    # What is out of sight is neither reached nor laid out.
    folded = phone.page.locator("#monitor [data-panel][data-folded]")
    await expect(folded).to_have_count(5 - len(marked))
    assert await folded.evaluate_all("all => all.every((panel) => panel.inert)")
