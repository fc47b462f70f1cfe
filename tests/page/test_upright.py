"""Upright phones: what a sheet, a notice or an edge leaves in sight is whole, and what a sheet is for is in sight."""

from __future__ import annotations

import pytest
from playwright.async_api import FloatRect, Page, expect

from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.screenshots import alarm, show, silent_car
from tests.page.test_tablet import RISEN

# What a sheet over Home covers in part: the gauge, its digits, and each row of the instruments.
CUT = """() => {
  const top = document.querySelector('.view > .sheet[open]').getBoundingClientRect().top;
  return [...document.querySelectorAll('[data-panel=home] :is(.gauge, .head, .near, .tape, .pedals, .pos)')]
    .filter((part) => part.checkVisibility({ visibilityProperty: true }))
    .filter((part) => {
      const box = part.getBoundingClientRect();
      return box.height > 0 && box.top < top - 1 && box.bottom > top + 1;
    }).map((part) => part.className);
}"""
# Whether the tag of a sheet lies on a key or in its body.
TAG = """() => {
  const keys = document.querySelector('.view > .sheet[open] > :is(.keys, .mark-keys):last-child');
  const tag = getComputedStyle(keys, '::before');
  const bottom = keys.getBoundingClientRect().bottom - parseFloat(tag.bottom);
  const top = bottom - parseFloat(tag.height);
  const first = Math.min(...[...keys.querySelectorAll('.key, .main')].map((key) => key.getBoundingClientRect().top));
  return [top - keys.getBoundingClientRect().top, first - bottom];
}"""
SHEETS = ("preferences", "stop", "slow-down-release", "question-sheet", "slow-down-arm", "help", "mark-sheet")


@pytest.mark.parametrize("scene", SHEETS)
async def test_a_sheet_leaves_the_gauge_whole_or_covers_it(phone: Phone, canned: Canned, scene: str) -> None:
    page = phone.page
    for width, height in ((412, 915), (360, 780), (360, 640)):
        await page.set_viewport_size({"width": width, "height": height})
        await show(canned, page, scene)
        await expect(page.locator(".view > .sheet[open] > .sheet-head")).to_be_visible()
        await page.evaluate(RISEN)
        assert await page.evaluate(CUT) == [], (width, height)
        above, under = await page.evaluate(TAG)
        assert above >= -0.5, (width, height)
        assert under >= 3.5, (width, height)
        view, sheet = [
            await page.locator(one).first.bounding_box() for one in ("#monitor > .view", ".view > .sheet[open]")
        ]
        assert view is not None
        assert sheet is not None
        room = sheet["y"] - view["y"]
        assert room <= 1 or room >= 127, "no strip in which nothing can be read"


@pytest.mark.parametrize(
    ("scene", "wanted"),
    [
        ("mark-sheet", "[data-f=mark-text]"),
        ("take-over", "[data-f=what]"),
        ("slow-down-arm", "#slow-words > .sub"),
        ("slow-down-arm", ".facts .bad"),
        ("stop", "#stop-words > .sub"),
        ("stop-warned", "#stop-title"),
        ("stop-warned", "#stop-words > .sub"),
        ("slow-down-release", "#release-words > p"),
        ("slow-down-release-warned", "[data-f=release-title]"),
        ("slow-down-release-warned", "#release-words > p"),
    ],
)
@pytest.mark.parametrize(("width", "height"), [(360, 640), (360, 740)])
async def test_what_a_sheet_is_for_is_in_sight_with_its_keys(
    phone: Phone, canned: Canned, scene: str, wanted: str, width: int, height: int
) -> None:
    page = phone.page
    await page.set_viewport_size({"width": width, "height": height})
    await show(canned, page, scene.removesuffix("-warned"))
    if scene.endswith("-warned"):
        canned.state["alarms"].append(alarm("phone_missing", "Phone position missing", text="No fix for 12 s."))
        await expect(page.locator(".snack[data-f=warning]")).to_be_visible()
    await expect(page.locator(".view > .sheet[open] > .sheet-head")).to_be_visible()
    await page.evaluate(RISEN)
    sheet = page.locator(".view > .sheet[open]")
    await sheet.evaluate("(sheet) => [sheet, sheet.querySelector('.mark-body')].forEach((one) => one?.scrollTo(0, 0))")
    seen, keys = [await sheet.locator(one).first.bounding_box() for one in (wanted, ":scope > :is(.keys, .mark-keys)")]
    assert seen is not None
    assert keys is not None
    assert seen["y"] + seen["height"] <= keys["y"] + 0.5
    head = await sheet.locator(".sheet-head").bounding_box()
    assert head is not None
    assert seen["y"] >= head["y"] + head["height"] - 0.5, "the keys leave no room for it"


@pytest.mark.parametrize("height", [915, 851, 780])
async def test_of_a_stale_car_what_stands_above_a_sheet_is_whole(phone: Phone, canned: Canned, height: int) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 412, "height": height})
    await show(canned, page, "stop")
    canned.state = silent_car(canned.state)
    await expect(page.locator("#monitor .veil h2")).to_contain_text("Stale")
    await expect(page.locator(".veil [data-f=veil-then]")).to_contain_text("4.2 m/s")
    await page.evaluate(RISEN)
    view, plate, sheet = await boxes(page, "#monitor > .view", "#monitor .veil .plate", "#sheet-stop")
    assert plate["y"] <= view["y"] + 0.5
    assert plate["y"] + plate["height"] <= sheet["y"] + 0.5


async def test_of_a_small_gauge_under_a_question_all_labels_are_read(phone: Phone, canned: Canned) -> None:
    page = await shown(phone, canned, "question", 320, 568)
    await expect(page.locator(".questions .card")).to_be_visible()
    small = """() => [...document.querySelectorAll('#panel-home .gauge text')]
      .filter((one) => one.checkVisibility({ visibilityProperty: true }) && one.textContent.trim())
      .map((one) => [one.textContent, parseFloat(getComputedStyle(one).fontSize) * one.getScreenCTM().a])
      .filter(([, size]) => size < 12)"""
    await page.wait_for_function("() => document.querySelector('#panel-home .gauge .lim')?.textContent")
    assert await page.evaluate(small) == []
    limit, gauge, view = await boxes(page, "#panel-home .gauge .lim", "#panel-home .gauge", "#monitor > .view")
    assert limit["x"] >= gauge["x"] + gauge["width"] * 0.8, "it is beside the scale"
    assert limit["x"] + limit["width"] <= view["x"] + view["width"]


async def shown(phone: Phone, canned: Canned, scene: str, width: int, height: int) -> Page:
    """Shows a scene in the font of a phone."""
    page = phone.page
    await page.set_viewport_size({"width": width, "height": height})
    await show(canned, page, scene)
    await expect(page.locator(".ledge > .mark-key")).to_be_attached()
    font = "document.documentElement.style.setProperty('--words', 'Roboto, \"Liberation Sans\", Arial')"
    await page.evaluate(font)
    await phone.drawn()
    return page


async def boxes(page: Page, *those: str) -> list[FloatRect]:
    found = [await page.locator(one).first.bounding_box() for one in those]
    assert None not in found, found
    return [one for one in found if one is not None]


async def test_of_a_silent_car_at_a_planned_stop_it_is_read_what_is_known(phone: Phone, canned: Canned) -> None:
    page = await shown(phone, canned, "planned-stop-stale", 360, 640)
    await expect(page.locator(".snack[data-f=warning]")).to_be_visible()
    said, snack = await boxes(page, "#monitor .veil .plate > p", ".snack[data-f=warning]")
    assert said["y"] + said["height"] <= snack["y"]


async def test_an_order_that_is_not_confirmed_is_named_whole_over_whole_rows(phone: Phone, canned: Canned) -> None:
    page = await shown(phone, canned, "slow-down-not-confirmed-warned", 360, 740)
    text = page.locator("#monitor > .strip [data-f=strip-text]")
    await expect(text).to_have_text("NOT CONFIRMED – use the physical stop")
    assert await text.evaluate("(text) => text.scrollWidth - text.clientWidth") <= 0
    pedals, view = await boxes(page, "#panel-home .pedals", "#monitor > .view")
    assert pedals["y"] >= view["y"] + view["height"] - 0.5

    page = await shown(phone, canned, "slow-down-not-confirmed", 412, 915)
    title, sheet = await boxes(page, "#alarm-title", "#sheet-alarm")
    assert title["height"] <= 66, "one line"
    cut = await page.evaluate(
        """(top) => [...document.querySelectorAll('#panel-home :is(.head, .near, .tape, .check-marks)')]
          .filter((one) => one.checkVisibility({ visibilityProperty: true }))
          .filter((one) => one.getBoundingClientRect().bottom > top)
          .filter((one) => one.getBoundingClientRect().top < top)
          .map((one) => one.textContent)""",
        sheet["y"],
    )
    assert cut == []


async def test_under_a_question_the_gauge_is_whole(phone: Phone, canned: Canned) -> None:
    for height in (640, 740):
        page = await shown(phone, canned, "question", 360, height)
        await expect(page.locator(".questions .card")).to_be_visible()
        gauge, near, view = await boxes(
            page, "#panel-home .gauge", "#panel-home .near > [data-f=distance-part]", "#monitor > .view"
        )
        end = view["y"] + view["height"]
        assert gauge["y"] + gauge["height"] <= end, height
        assert near["y"] >= end - 0.5 or near["y"] + near["height"] <= end, height


@pytest.mark.parametrize(("width", "height"), [(412, 915), (213, 379)])
async def test_a_count_down_covers_the_tabs_whole_and_no_digit(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    page = await shown(phone, canned, "countdown", width, height)
    await expect(page.locator("#sheet-countdown")).to_be_visible()
    banner, strip, speed = await boxes(page, "#sheet-countdown", "#monitor > .strip", "#panel-home .gauge .speed")
    assert banner["y"] + banner["height"] >= strip["y"] - 0.5
    assert banner["y"] + banner["height"] <= speed["y"]


async def test_what_acts_on_the_drive_comes_first_in_the_menu(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await show(canned, page, "menu")
    texts = await page.locator("#sheet-menu li:visible").all_inner_texts()
    assert texts[0] == "Planned stop"
    assert texts[1].startswith("On duty")
    assert texts[2] == "End the recording"
    assert texts[-2:] == ["License", "About"]


async def test_why_there_is_no_slow_down_keeps_off_its_edge(phone: Phone, canned: Canned) -> None:
    page = await shown(phone, canned, "home", 360, 740)
    room = """(slide) => {
      const range = document.createRange();
      range.selectNodeContents(slide.querySelector('.tx'));
      return slide.getBoundingClientRect().right - range.getBoundingClientRect().right;
    }"""
    assert await page.locator("#monitor > .rail > .slide").evaluate(room) >= 11.5


@pytest.mark.parametrize(("width", "height"), [(360, 740), (412, 915)])
async def test_a_threshold_that_is_typed_has_its_slider_and_the_labels_in_sight(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    page = await shown(phone, canned, "check-change", width, height)
    await expect(page.locator(".check-rows .v:focus")).to_be_visible()
    labels, body = await boxes(page, ".check-rows .range .text", ".check-body")
    assert labels["y"] + labels["height"] <= body["y"] + body["height"]
