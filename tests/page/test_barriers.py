"""Nobody is kept out: every tab, screen, sheet and dialog in both themes as axe measures it, at every size."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.page.barriers import fits_all, no_barrier
from tests.page.canned import Canned, check
from tests.page.conftest import Phone
from tests.page.screenshots import show, silent_car, too_fast

STATES = {
    "home": ("home-lower", "chart", "home-fault", "home-warning", "paused"),
    "silence": ("home-stale", "server-silent", "link-lost", "no-messages"),
    "planned-stop": tuple(f"planned-stop{state}" for state in ("", "-critical", "-returned", "-stale", "-no-data")),
    "slow-down": ("slow-down-arm", "slow-down-release", "slow-down-in-dialog", "countdown"),
    "map": ("map-tiles", "map-stale", "map-none"),
    "files": ("files", "files-menu", "mail", "outbox", "replay"),
    "settings": ("settings", "topic", "preferences"),
    "alarms": ("alarms", "check", "check-unknown"),
    "sources": ("question", "question-sheet", "signal"),
    "work": ("files-search", "marks-wait", "handover"),
    "menu": ("menu", "stop", "scan", "signals", "alarm-log"),
    "connect": ("connect", "connect-saved", "connect-failed"),
}


@pytest.mark.parametrize("states", STATES)
async def test_nothing_keeps_anybody_out(phone: Phone, canned: Canned, states: str) -> None:
    """A small phone, a large one, both ways, a tablet, and a desktop at once and twice its size."""
    for name in STATES[states]:
        await show(canned, phone.page, name)
        await no_barrier(phone.page, name)
        await fits_all(phone.page, name)


@pytest.mark.gate
@pytest.mark.parametrize("size", [(412, 915), (820, 1180), (1024, 768), (1440, 900), (1920, 1080)], ids=str)
async def test_a_screen_reader_says_what_a_check_found(phone: Phone, canned: Canned, size: tuple[int, int]) -> None:
    """A tile shows it by its mark alone where it has one line."""
    await phone.page.set_viewport_size({"width": size[0], "height": size[1]})
    await show(canned, phone.page, "home")
    tile = next(one for one in canned.state["checks"] if one["label"] == "Laser")
    tile |= {"verdict": "fault", "brief": "FAULT 12 Hz"}
    await expect(phone.page.get_by_role("button", name="Laser FAULT 12 Hz")).to_be_visible()


SCREENS = (
    "home", "chart", "map-tiles", "scan", "files", "files-menu", "mail", "outbox", "settings", "topic", "preferences",
    "alarms", "check", "check-unknown", "menu", "signals", "alarm-log",
)  # fmt: skip
AS = {"live": lambda state: state, "stale": silent_car, "critical": too_fast}
SHOWS = {  # what tells that the page shows it
    "live": ":root:not([data-replay]) #monitor",
    "stale": '.view[data-veil="values"]',
    "critical": "#sheet-alarm[open]",
}


@pytest.mark.soak
@pytest.mark.parametrize("state", AS)
@pytest.mark.parametrize("size", [(412, 915), (1440, 900)], ids=str)
async def test_no_screen_in_any_state_keeps_anybody_out(
    phone: Phone, canned: Canned, state: str, size: tuple[int, int]
) -> None:
    """Every screen, theme and state: what is open stays open while the car falls silent or speeds."""
    broken = []
    for screen in SCREENS:
        await phone.page.set_viewport_size({"width": 412, "height": 915})  # its keys are where the scene presses them
        await show(canned, phone.page, screen)
        canned.state = AS[state](canned.state)
        await phone.page.set_viewport_size({"width": size[0], "height": size[1]})
        await phone.page.wait_for_selector(SHOWS[state], state="attached", timeout=5000)
        await phone.page.wait_for_timeout(700)
        try:
            await no_barrier(phone.page, f"{screen}, {state}")
        except AssertionError as found:
            broken.append(str(found).splitlines()[0])
    assert broken == []


MENU = "#monitor [data-f=menu]"
REPLAYED = {  # what is pressed one after the other
    "home": (),
    "map": ("#tab-map",),
    "scan": ("#tab-scan",),
    "files": ("#tab-files",),
    "settings": ("#tab-settings",),
    "alarms": ("[data-f=strip]",),
    "check": ("[data-f=tiles] li button",),
    "chart": ("[data-trend=speed]",),
    "menu": (MENU,),
    "signals": (MENU, "[data-screen=signals]"),
    "log": (MENU, "[data-screen=log]"),
    "preferences": (MENU, "[data-screen=preferences]"),
}


@pytest.mark.soak
@pytest.mark.parametrize("size", [(412, 915), (1440, 900)], ids=str)
async def test_no_screen_of_a_replay_keeps_anybody_out(phone: Phone, canned: Canned, size: tuple[int, int]) -> None:
    broken = []
    page = phone.page
    for screen, keys in REPLAYED.items():
        await page.set_viewport_size({"width": 412, "height": 915})
        await show(canned, page, "replay")
        await page.wait_for_selector(":root[data-replay]")
        canned.checks["Speed"] = check("Speed", "Speed", verdict="fault", text="12.1 m/s, limit 11.0 m/s")
        for key in keys:
            await page.locator(key).first.evaluate("key => key.click()")
            await page.wait_for_timeout(300)
        await page.set_viewport_size({"width": size[0], "height": size[1]})
        await page.wait_for_timeout(700)
        try:
            await no_barrier(page, f"{screen} of a replay")
        except AssertionError as found:
            broken.append(str(found).splitlines()[0])
    assert broken == []
