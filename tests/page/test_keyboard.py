"""The desktop page by keyboard alone: what matters comes first, and the journey of an operator needs no pointer."""

from __future__ import annotations

import asyncio

import pytest
from playwright.async_api import Page, expect

from tests.page.canned import Canned, alarm, live, signal, slow
from tests.page.conftest import Phone

FOCUSED = "document.activeElement?.dataset.f ?? document.activeElement?.id ?? ''"
MOST_PRESSES = 10


async def desktop(phone: Phone, canned: Canned, width: int = 1440) -> Page:
    await phone.page.set_viewport_size({"width": width, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.page.locator("#monitor [data-pane=alarms] *").first).to_be_attached()
    return phone.page


async def tab_to(page: Page, matches: str, most: int = 60) -> int:
    """Presses Tab until what has the focus matches; the number of presses."""
    for presses in range(1, most + 1):
        await page.keyboard.press("Tab")
        if await page.evaluate(f"document.activeElement.matches({matches!r})"):
            return presses
    raise AssertionError(f"{matches} has no focus after {most} presses")


async def until_received(served: Canned, kind: str) -> None:
    async with asyncio.timeout(20):
        while not [one for one in served.received if one["kind"] == kind]:
            await asyncio.sleep(0.05)


@pytest.mark.gate
@pytest.mark.parametrize("width", [412, 1440])
async def test_the_tab_key_begins_at_what_matters(phone: Phone, canned: Canned, width: int) -> None:
    canned.state = live() | {"decelerate": slow("armed"), "alarms": [alarm("laser", "Laser silent", place="list")]}
    page = await desktop(phone, canned, width)
    await page.keyboard.press("Tab")
    assert await page.evaluate(FOCUSED) == "strip", "the alarm"
    to_stop = await tab_to(page, "[data-f=stop]", MOST_PRESSES)
    to_slow = await tab_to(page, "[data-f=slow]", MOST_PRESSES)
    to_tabs = await tab_to(page, "[role=tab]", MOST_PRESSES)
    assert 1 + to_stop + to_slow + to_tabs <= MOST_PRESSES


@pytest.mark.gate
async def test_a_journey_by_keyboard_alone(phone: Phone, canned: Canned) -> None:
    """Acknowledge, arm, slow, open a replay."""
    waits = alarm("laser", "Laser silent", place="list", actions=["acknowledge"])
    canned.state = live() | {"decelerate": slow("not_armed"), "alarms": [waits]}
    page = await desktop(phone, canned)
    await tab_to(page, "[data-pane=alarms] [data-do=acknowledge]")
    await page.keyboard.press("Enter")
    await until_received(canned, "acknowledge")
    canned.state = live() | {"decelerate": slow("not_armed")}
    await expect(page.locator("#monitor [data-f=strip]")).to_contain_text("No alarms")
    await page.locator("body").press("Shift+Tab")
    await tab_to(page, ".rail [data-f=slow]")
    await page.keyboard.press("Enter")
    await expect(page.locator("#sheet-slow")).to_be_visible()
    await expect(page.locator("#sheet-slow .main")).to_be_focused()
    await page.keyboard.press("Enter")
    await until_received(canned, "arm")
    canned.state = live() | {"decelerate": slow("armed")}
    await expect(page.locator("#sheet-slow")).to_be_hidden()
    slide = page.locator("#monitor > .rail [data-f=slow]")
    await expect(slide).to_have_attribute("data-kind", "armed")
    await tab_to(page, ".rail [data-f=slow]")
    await page.keyboard.down("Enter")  # held for a second
    await until_received(canned, "slow_down")
    await page.keyboard.up("Enter")
    canned.state = live()
    await page.keyboard.press("Escape")
    await page.keyboard.press("2")
    await expect(page.locator("#tab-files")).to_have_attribute("aria-selected", "true")
    await expect(page.locator("#panel-files [data-f=recordings] .file").first).to_be_visible()
    await tab_to(page, "[data-f=recordings] .file button")
    await page.keyboard.press("Enter")
    sheet = page.locator("#sheet-file")
    await expect(sheet).to_be_visible()
    for _ in range(12):
        if "Open replay" in await page.evaluate("document.activeElement.textContent"):
            break
        await page.keyboard.press("Tab")
    await page.keyboard.press("Enter")
    await until_received(canned, "replay")


#: Of what has the focus: the part of the page it is in, and its place there, row before column [px].
PLACE = """() => {
  const one = document.activeElement;
  const part = one.closest('#sheet-slow > .keys, #monitor > .rail, #monitor > .ledge');
  const { left, top, height } = one.getBoundingClientRect();
  return part && [part.id || part.className, Math.round((top + height / 2) / 16), Math.round(left)];
}"""


@pytest.mark.gate
@pytest.mark.parametrize("hand", ["right", "left"])
@pytest.mark.parametrize(("width", "height"), [(412, 780), (1440, 900)])
async def test_the_tab_key_goes_through_keys_as_they_stand(
    phone: Phone, canned: Canned, hand: str, width: int, height: int
) -> None:
    canned.state = live() | {"decelerate": slow("not_armed")}
    page = await desktop(phone, canned, width)
    await page.set_viewport_size({"width": width, "height": height})
    await page.evaluate(f"document.documentElement.dataset.hand = '{hand}'")
    await page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    await page.locator("#monitor > .rail [data-f=slow]").tap()
    await expect(page.locator("#sheet-slow .main")).to_be_visible()
    await page.locator("#sheet-slow").evaluate(
        "sheet => Promise.all(sheet.getAnimations().map((one) => one.finished)).then(() => {})"
    )
    places: dict[str, list[list[int]]] = {}
    for _ in range(60):  # from the first key of the sheet on
        place = await page.evaluate(PLACE)
        if place and place[1:] not in places.setdefault(place[0], []):
            places[place[0]].append(place[1:])
        await page.keyboard.press("Tab")
    assert len(places["keys"]) == 2
    assert len(places["rail"]) == 3
    for name, found in places.items():
        assert found == sorted(found), name


@pytest.mark.gate
@pytest.mark.parametrize(
    ("speed_mps", "freshness", "reason"),
    [
        (4.2, "fresh", "The car moves at 4.2 m/s."),
        (0.0, "stale", "not known whether the car moves"),
        (0.0, "fresh", ""),
    ],
)
async def test_ending_the_recording_asks_once_unless_the_car_stands(
    phone: Phone, canned: Canned, speed_mps: float, freshness: str, reason: str
) -> None:
    speed = signal("Speed", "Twist", {"speed_mps": speed_mps, "yaw_rate_radps": 0.0})
    canned.state["signals"]["speed"] |= {"value": speed["value"], "freshness": freshness}
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await phone.f("menu").tap()
    await phone.f("record", "#sheet-menu").tap()
    sheet = phone.page.locator("#sheet-record")
    if reason:
        await expect(sheet).to_contain_text(reason)
        await sheet.get_by_role("button", name="Keep recording").tap()
        await expect(sheet).to_have_count(0)
        assert not [one for one in canned.received if one["kind"] == "record"]
        await phone.f("menu").tap()
        await phone.f("record", "#sheet-menu").tap()
        await sheet.get_by_role("button", name="End the recording").tap()
    await until_received(canned, "record")
    (command,) = [one for one in canned.received if one["kind"] == "record"]
    assert command["on"] is False


@pytest.mark.gate
async def test_what_cannot_be_pressed_says_so_to_readers_and_looks_so(phone: Phone, canned: Canned) -> None:
    canned.state = live() | {"alarms": [alarm("laser", "Laser silent", place="list")]}
    page = await desktop(phone, canned)
    ends = page.locator("[data-pane=alarms] .turn .key")
    await expect(ends.first).to_have_attribute("aria-label", "Previous page")
    for end in await ends.all():  # one page: both ends
        await expect(end).to_have_attribute("aria-disabled", "true")
        assert await end.evaluate("(key) => getComputedStyle(key).borderTopStyle") == "dashed"
    assert await page.locator('[aria-disabled=""]').count() == 0
