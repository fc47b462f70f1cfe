"""Another car's alarm beside this car's values: what its card shows, what room it leaves, and how few presses help."""

from __future__ import annotations

import asyncio
import re
from typing import Any

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned, alarm, live, slow
from tests.page.canned_fleet import car, worst
from tests.page.conftest import Phone
from tests.page.test_alarm_list import answer, received
from tests.page.test_alarm_states import CRITICAL, ENDED, speeding
from tests.page.test_overlaps import noticed
from tests.page.test_slow_down import DIALOG, RAIL, Thumb

OTHER = "Margay-the-long-named-car"
PHONES = [(320, 640), (360, 740), (412, 915), (768, 1024)]
TABLETS = [(700, 1060), (820, 1106), (820, 1180), (800, 1280), (1000, 600), (1199, 779), (1199, 780), (1180, 820)]
SIZES = [*PHONES, *TABLETS, (1280, 800), (1440, 900), (1920, 1080)]
PRESSES = "() => { window.presses = 0; addEventListener('pointerdown', () => { window.presses += 1; }, true); }"
#: The height of the map's picture, and which of its keys lie over the car, the phone or the scale.
MAP = """() => {
  const at = (one) => one.getBoundingClientRect();
  const over = (a, b) => Math.min(a.right, b.right) > Math.max(a.left, b.left)
    && Math.min(a.bottom, b.bottom) > Math.max(a.top, b.top);
  const map = document.querySelector('#panel-map .map');
  const kept = [...map.querySelectorAll('.mapv :is(.car, .sc)')].map(at);
  const keys = [...map.querySelectorAll('button')].filter((one) => one.checkVisibility());
  const box = at(map.querySelector('.mapbox'));
  const lost = keys.filter((one) => at(one).top < at(map).top - 1 || at(one).bottom > at(map).bottom + 1);
  const hit = keys.filter((key) => kept.some((one) => over(at(key), one)));
  return { height: Math.round(box.height), kept: kept.length, keys: keys.length,
    lost: lost.map((one) => one.ariaLabel), hit: hit.map((one) => one.ariaLabel) };
}"""


def fleet(canned: Canned, **more: Any) -> None:
    """Three cars, of which this page shows the first and the last is too fast."""
    alarm = worst("Speed above limit", "12.0 m/s, limit 11.0 m/s", ago_s=9) | more
    canned.vehicle = "Ocelot"
    canned.cars = [
        car("Ocelot", 4.2, (0, 0, 0)),
        car("Serval", 3.0, (9, 0, 0)),
        car(OTHER, 12.0, (0, 9, 0), worst=alarm),
    ]


async def opened(phone: Phone, canned: Canned, width: int = 412, height: int = 915, tab: str = "home") -> None:
    await phone.page.set_viewport_size({"width": width, "height": height})
    await phone.open(f"{canned.address}/?vehicle={canned.vehicle}#{tab}")
    await phone.live()
    await phone.page.evaluate(PRESSES)


async def presses(phone: Phone) -> int:
    count: int = await phone.page.evaluate("window.presses")
    return count


@pytest.mark.gate
async def test_the_card_begins_with_the_car_and_what_was_measured(phone: Phone, canned: Canned) -> None:
    fleet(canned)
    await opened(phone, canned)
    card = phone.page.locator("[data-f=other-car]")
    await expect(card.locator("b")).to_have_text("Margay t: 12.0 m/s, limit 11.0 m/s")
    await expect(card).to_contain_text(re.compile(r"m/s.*Speed above limit, for \d.*In control: No one\."))
    await expect(card.get_by_role("button")).to_have_text(["Leave it", "Open Margay t"])
    await expect(phone.f("strip-text")).to_have_text("Margay t: Speed above limit")
    canned.cars[-1]["summary"]["worst"].pop("text")
    await expect(card.locator("b")).to_have_text("Margay t: Speed above limit")  # an older agent sends no numbers
    await phone.f("who").tap()
    await expect(phone.page.locator(f'#sheet-cars [data-car="{OTHER}"]')).to_contain_text(OTHER)  # there it is whole


async def map_is_whole(phone: Phone, canned: Canned, width: int, height: int) -> None:
    await expect(phone.page.locator("#panel-map .car-mark").first).to_be_attached(timeout=20_000)
    for is_asking in (True, False):
        if not is_asking:
            canned.cars[-1]["summary"]["worst"] = None
        await expect(phone.page.locator("[data-f=other-car]")).to_have_count(int(is_asking))
        await phone.drawn(4)
        found = await phone.page.evaluate(MAP)
        assert found["height"] >= 180, (width, height, is_asking)
        assert found["kept"] >= 2
        assert [found["keys"], found["lost"], found["hit"]] == [5, [], []], (width, height, is_asking)


@pytest.mark.parametrize(("width", "height"), SIZES)
async def test_the_map_keeps_180_px_and_its_keys_stay_off_car_and_scale(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    fleet(canned)
    await opened(phone, canned, width, height, "map" if (width, height) in PHONES else "home")
    await map_is_whole(phone, canned, width, height)


@pytest.mark.gate
async def test_a_card_takes_the_map_of_a_desk_no_height(phone: Phone, canned: Canned) -> None:
    fleet(canned)
    await opened(phone, canned, 1440, 900)
    await map_is_whole(phone, canned, 1440, 900)


@pytest.mark.gate
@pytest.mark.parametrize(("state", "most"), [("armed", 2), ("not_armed", 5)])
async def test_with_three_cars_the_right_one_is_slowed(phone: Phone, canned: Canned, state: str, most: int) -> None:
    fleet(canned)
    await opened(phone, canned)
    thumb = Thumb(phone, await phone.page.context.new_cdp_session(phone.page))
    card = phone.page.locator("[data-f=other-car]")
    await expect(card).to_be_visible()
    await phone.drawn(6)
    canned.vehicle = OTHER
    canned.state = live() | {"alarms": [speeding()], "decelerate": slow(state)}
    await card.get_by_role("button", name="Open").tap()
    await expect(phone.page.locator("#sheet-alarm")).to_be_visible()
    await expect(phone.page.locator("#sheet-alarm [data-f=legend-name]")).to_have_text("Margay t")
    where = DIALOG
    if state != "armed":
        await phone.drawn(6)
        await phone.page.locator("#sheet-alarm [data-f=acknowledge]").tap()
        answer(canned, await received(canned, 1))
        await phone.f("slow").tap()
        await phone.page.locator("#sheet-slow [data-act=arm]").tap()
        await heard_any(canned, "arm")
        canned.state["decelerate"] = slow("armed")
        where = RAIL
    await thumb.drag(0.95, where)
    order = await heard_any(canned, "slow_down")
    assert order["vehicle"] == OTHER
    assert await presses(phone) <= most


async def heard_any(canned: Canned, kind: str) -> dict[str, Any]:
    async with asyncio.timeout(20):
        while not (found := [one for one in canned.received if one["kind"] == kind]):
            await asyncio.sleep(0.05)
    return found[-1]


@pytest.mark.parametrize(("width", "height"), [pytest.param(412, 915, marks=pytest.mark.gate), (1440, 900)])
async def test_five_alarms_three_of_them_returned_are_acknowledged(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    """With four presses: a critical alarm that ended, and has a dialog of its own, takes none more."""
    canned.state["alarms"] = [
        alarm("gone", "GPS drift", place="list", **ENDED),
        alarm("obstacle", "Obstacle ahead", **(CRITICAL | ENDED)),
        alarm("late", "The link is too slow", place="list", **ENDED),
        alarm("phone_missing", "Phone position missing"),
        speeding(raised_ms=1),
    ]
    await opened(phone, canned, width, height)
    page = phone.page
    sheet = page.locator("#sheet-alarm")
    await expect(sheet).to_contain_text("Speed above limit")
    await phone.drawn(6)
    await sheet.locator("[data-f=acknowledge]").tap()
    answer(canned, await received(canned, 1))
    await expect(sheet).to_be_hidden()
    if width < 1000:
        await phone.f("strip").tap()
    ended = page.locator("[data-f=alarms-ended]:visible")
    await expect(ended).to_have_text("Acknowledge all that ended (3)")
    await phone.drawn(6)
    await ended.tap()
    answer(canned, await received(canned, 4))
    waiting = page.locator("[data-f=alarms] [data-kind=unacknowledged]:visible")
    await expect(waiting).to_have_count(1)
    await phone.drawn(6)
    await waiting.locator("[data-do=acknowledge]").tap()
    names = await received(canned, 5)
    assert sorted(names) == ["gone", "late", "obstacle", "phone_missing", "speed_limit"]
    answer(canned, names)
    await expect(phone.f("strip")).to_have_attribute("data-known", "")
    assert await presses(phone) <= 4


@pytest.mark.gate
@pytest.mark.parametrize(("width", "height"), [(412, 915), (820, 400)])
async def test_the_warning_of_this_car_is_covered_by_no_other_car_and_no_notice(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    fleet(canned)
    await opened(phone, canned, width, height)
    card = phone.page.locator("[data-f=other-car]")
    await expect(card).to_be_visible()
    canned.state["alarms"] = [alarm("phone_missing", "Phone position missing")]
    warning = phone.page.locator(".snacks > [data-f=warning]")
    await expect(warning).to_be_visible()
    await expect(card).to_be_hidden()
    await expect(phone.f("strip-text")).to_have_text("Margay t: Speed above limit")
    await noticed(phone.page, canned)
    await phone.drawn(6)
    await warning.get_by_role("button", name="Acknowledge").tap()
    answer(canned, await received(canned, 1))
    await phone.page.evaluate("document.querySelector('.snacks > .note').remove()")
    await expect(warning).to_be_hidden()
    await expect(card).to_be_visible()


async def test_no_card_stands_over_the_list_that_begins_with_the_same_row(phone: Phone, canned: Canned) -> None:
    fleet(canned)
    await opened(phone, canned, 820, 1180)
    page = phone.page
    card = page.locator("[data-f=other-car]")
    await expect(card).to_be_visible()
    await phone.f("who").tap()
    await expect(page.locator("#sheet-cars li").first).to_contain_text(OTHER)
    await expect(card).to_have_count(0)
    await page.locator("#sheet-cars [data-f=no]").tap()
    await expect(card).to_be_visible()
