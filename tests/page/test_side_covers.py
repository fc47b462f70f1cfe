"""On a phone on its side nothing is cut by a dialog, a tag or a neighbour, and what acts or says most is in sight."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.screenshots import COMPLETE, show
from tests.page.test_on_its_side import DRAWN, SEEN

SIZES = [(740, 360), (640, 360), (844, 390), (480, 320)]
#: What of the nearest object is not whole between the lines under the strip and the open dialog.
NEAREST = """() => {
  const bounds = (name) => document.querySelector(name).getBoundingClientRect();
  const [top, bottom] = [bounds('#monitor > .view').top, bounds('dialog[open]').top];
  const near = document.querySelector('#panel-home [data-part=nearest]');
  const parts = ['distance', 'gap', 'stops', 'age'].map((name) => near.querySelector(`[data-f=${name}]`));
  return parts.filter((one) => {
    const box = one.getBoundingClientRect();
    const isCut = !one.matches('button') && one.scrollWidth > one.clientWidth + 1;
    const isShown = one.checkVisibility({ visibilityProperty: true });
    const isOut = box.top < top - 1 || box.bottom > bottom || box.right > innerWidth;
    return isCut || isOut || !isShown || near.offsetHeight < 38;
  }).map((one) => one.dataset.f);
}"""
#: What the open dialog covers in part.
CUT = """() => {
  const sheet = document.querySelector('dialog[open]').getBoundingClientRect();
  const hasText = (one) => [...one.childNodes].some((node) => node.nodeType === 3 && node.data.trim());
  const texts = [...document.querySelectorAll('main:not([hidden]) *')].filter((one) => one.checkVisibility()
    && !one.closest('dialog, svg') && (one.matches('button, input') || hasText(one)));
  return texts.filter((one) => {  // without what is scrolled out
    const { left, right, bottom, width, height, ...box } = one.getBoundingClientRect().toJSON();
    const top = Math.max(box.top, one.closest('.view')?.getBoundingClientRect().top ?? 0);
    const isOut = right <= sheet.left || left >= sheet.right || bottom <= sheet.top || top >= sheet.bottom;
    const isIn = left >= sheet.left && right <= sheet.right && top >= sheet.top;
    return width > 1 && height > 1 && !isOut && !isIn;
  }).map((one) => one.outerHTML.slice(0, 80));
}"""
#: What has just come takes a press.
PRESSED = "() => !document.querySelector('dialog[open] [data-moved], dialog[open][data-moved]')"
#: How far the keys at the foot are from the frame [px], the least.
GAP = """() => Math.min(...[...document.querySelectorAll('.rail :is(.key, .slide)')]
  .filter((one) => one.checkVisibility({ visibilityProperty: true }))
  .map((one) => innerHeight - 6 - one.getBoundingClientRect().bottom))"""
#: What the tag over the keys of a sheet covers, or that it is not whole in the sheet.
TAG = """() => {
  const sheet = document.querySelector('dialog[open]');
  const keys = sheet.querySelector(':scope > .keys');
  const style = getComputedStyle(keys, '::before');
  const base = (getComputedStyle(keys).position === 'static' ? sheet : keys).getBoundingClientRect();
  const [left, top] = [base.left + parseFloat(style.left), base.top + parseFloat(style.top)];
  const [right, bottom] = [left + parseFloat(style.width), top + parseFloat(style.height)];
  const whole = sheet.getBoundingClientRect();
  const isIn = left >= whole.left && right <= whole.right && top >= whole.top && bottom <= whole.bottom;
  if (style.content === 'none' || !isIn) return ['not whole'];
  return [...sheet.querySelectorAll('button, a')].filter((one) => {
    const box = one.getBoundingClientRect();
    const isUnder = left < box.right - 1 && right > box.left + 1 && top < box.bottom - 1 && bottom > box.top + 1;
    return one.checkVisibility() && box.top < whole.bottom && isUnder;
  }).map((one) => one.textContent);
}"""
#: Keeps what stands on each canvas: its numbers and where.
KEEP = """(() => {
  window.written = new Map();
  const pen = CanvasRenderingContext2D.prototype;
  const { fillText, clearRect } = pen;
  pen.clearRect = function (...box) {
    window.written.set(this.canvas, []);
    clearRect.apply(this, box);
  };
  pen.fillText = function (text, x, y, ...more) {
    window.written.get(this.canvas)?.push({ text: String(text), x, y });
    fillText.call(this, text, x, y, ...more);
  };
})()"""
#: The numbers of a plot that stand over each other.
PRINTED = """() => [...document.querySelectorAll('.trends-plot canvas')].flatMap((canvas) => {
  const words = (window.written.get(canvas) ?? []).filter(({ text }) => text.trim() && !text.includes(':'));
  const isOver = (a, b) => Math.abs(a.x - b.x) < 2 && Math.abs(a.y - b.y) / devicePixelRatio < 13;
  return words.flatMap((a, i) => words.slice(i + 1).filter((b) => isOver(a, b)).map((b) => `${a.text} ${b.text}`));
})"""
#: How far the first key of the rail is from the left edge, and its last part from the right one [px].
EDGES = """() => {
  const [pair, slide] = ['.pair', '.slide'].map((name) => document.querySelector(`#monitor > .rail > ${name}`));
  return [pair.getBoundingClientRect().left, innerWidth - slide.getBoundingClientRect().right];
}"""
#: How far under the lower edge of the notice the pedals begin [px].
UNDER = """() => document.querySelector('#panel-home [data-part=pedals]').getBoundingClientRect().top
  - document.querySelector('.snack:not([hidden])').getBoundingClientRect().bottom"""
#: Where the keys of the rail begin and end, and where its slide begins.
RAIL = """() => {
  const [pair, slide] = ['.pair', '.slide'].map((name) => document.querySelector(`#monitor > .rail > ${name}`));
  return [pair.getBoundingClientRect().left, pair.getBoundingClientRect().right, slide.getBoundingClientRect().left];
}"""
#: What of the bar and of the first two items of a fleet is cut.
SHORT = """() => {
  const lines = (one) => {
    const range = document.createRange();
    range.selectNodeContents(one);
    return new Set([...range.getClientRects()].map(({ top }) => Math.round(top))).size;
  };
  return [...document.querySelectorAll('.me .op > span, .item:nth-child(-n+2) :is(h3, .t, .h, .x), .item .ks .key')]
    .filter((one) => one.scrollWidth > one.clientWidth + 1 || (one.matches('.key') && lines(one) > 1))
    .map((one) => one.textContent);
}"""


async def opened(phone: Phone, canned: Canned, scene: str, size: tuple[int, int]) -> None:
    await phone.page.emulate_media(reduced_motion="reduce")
    await phone.page.set_viewport_size({"width": size[0], "height": size[1]})
    await show(canned, phone.page, scene)
    await phone.page.wait_for_function(COMPLETE)
    await phone.page.evaluate(DRAWN)


async def test_what_a_lost_fleet_means_and_what_can_be_done_is_in_sight(phone: Phone, canned: Canned) -> None:
    found: dict[str, Any] = {}
    for size in SIZES:
        await opened(phone, canned, "fleet-lost", size)
        for selector in (".lost [data-f=lost-what]", ".lost [data-f=lost-words]", ".lost .pair .key"):
            seen = await phone.page.evaluate(SEEN, selector)
            if not seen["all"] or seen["whole"] < seen["all"] or seen["cut"]:
                found[f"{selector} {size}"] = seen
    assert found == {}


@pytest.mark.parametrize("scene", ["no-messages", "planned-stop-no-data", "connect-recent", "connect-failed"])
async def test_a_dialog_covers_whole_parts(phone: Phone, canned: Canned, scene: str) -> None:
    found: dict[str, Any] = {}
    for size in SIZES:
        await opened(phone, canned, scene, size)
        await phone.page.wait_for_selector("dialog[open]")
        await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
        cut = await phone.page.evaluate(CUT)
        await phone.page.wait_for_function(PRESSED)
        keys = await phone.page.evaluate(SEEN, "dialog[open] :is(p, .key, .main)")
        if cut or keys["whole"] < keys["all"] or keys["cut"]:
            found[str(size)] = cut, keys
    assert found == {}


@pytest.mark.parametrize("scene", ["home-fault", "slow-down-not-confirmed", "check"])
async def test_no_key_at_the_foot_touches_the_frame(phone: Phone, canned: Canned, scene: str) -> None:
    for size in SIZES:
        await opened(phone, canned, scene, size)
        assert await phone.page.evaluate(GAP) >= 3.9, size


@pytest.mark.parametrize("scene", ["home-fault", "slow-down-in-dialog", "planned-stop-critical"])
async def test_the_nearest_object_is_above_a_critical_alarm(phone: Phone, canned: Canned, scene: str) -> None:
    found: dict[str, Any] = {}
    for size in ((740, 360), (915, 412), (667, 375), (640, 360)):
        if scene == "planned-stop-critical" and size[0] < 700:
            continue  # the line of the planned stop has its room
        await opened(phone, canned, scene, size)
        await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
        await phone.page.evaluate(DRAWN)
        missing, gap = await phone.page.evaluate(NEAREST), await phone.page.evaluate(GAP)
        if missing or gap < 3.9:
            found[str(size)] = missing, gap
    assert found == {}


async def test_what_a_critical_alarm_would_cut_of_the_nearest_object_is_not_shown(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "planned-stop-critical", (700, 320))
    await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    await phone.page.evaluate(DRAWN)
    assert await phone.page.evaluate("document.querySelector('#panel-home [data-part=nearest]').offsetHeight") == 0


async def test_nothing_is_left_of_the_divider_above_a_critical_alarm(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "home-fault", (740, 360))
    assert (
        await phone.page.evaluate("getComputedStyle(document.querySelector('.gbox')).borderRightColor")
        == "rgba(0, 0, 0, 0)"
    )


async def test_a_warning_says_what_was_measured_and_can_be_shelved(phone: Phone, canned: Canned) -> None:
    for size in ((740, 360), (844, 390)):
        await opened(phone, canned, "home-warning", size)
        await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
        keys = await phone.page.evaluate(SEEN, "[data-f=warning] .key")
        assert (keys["all"], keys["whole"], keys["cut"]) == (2, 2, []), size
        await expect(phone.page.locator("[data-f=warning] .tx > span")).to_be_visible()


async def test_a_planned_stop_keeps_its_key_and_who_ordered_it_beside_a_warning(phone: Phone, canned: Canned) -> None:
    for size in ((740, 360), (844, 390)):
        await opened(phone, canned, "planned-stop-returned", size)
        for selector in (".planned-stop .key", ".planned-stop .sub"):
            seen = await phone.page.evaluate(SEEN, selector)
            assert seen["whole"] == max(1, seen["all"]), (selector, size)


async def test_what_this_device_lacks_is_in_sight_before_it_connects(phone: Phone, canned: Canned) -> None:
    await phone.page.context.clear_permissions()
    await opened(phone, canned, "connect", (740, 360))
    await expect(phone.page.locator("#connect .arm [data-f=position-cost]")).to_contain_text("Refused")
    seen = await phone.page.evaluate(
        SEEN, "#connect .arm li:nth-child(2), #connect .arm li:nth-child(3), #connect .field"
    )
    assert seen["whole"] == 3


async def test_two_cars_that_need_a_person_are_whole_and_who_is_here_is_not_cut(phone: Phone, canned: Canned) -> None:
    for size in ((740, 360), (844, 390)):
        await opened(phone, canned, "fleet-three", size)
        seen = await phone.page.evaluate(SEEN, "#fleet .item .key")
        assert seen["whole"] >= 4, size
        assert await phone.page.evaluate(SHORT) == [], size


async def test_the_three_keys_of_an_item_that_is_yours_are_read_whole(phone: Phone, canned: Canned) -> None:
    for size in ((740, 360), (915, 412)):
        await opened(phone, canned, "fleet-asked", size)
        await expect(phone.page.locator("#fleet .item .key", has_text="Unassign")).to_be_attached()
        assert await phone.page.evaluate(SHORT) == [], size


async def test_on_the_lowest_window_all_keys_of_an_alarm_are_in_sight_beside_its_sentence(
    phone: Phone, canned: Canned
) -> None:
    await opened(phone, canned, "check", (480, 270))
    keys = await phone.page.evaluate(SEEN, ".check-alarm .key")
    assert (keys["all"], keys["whole"], keys["cut"]) == (3, 3, [])
    said = await phone.page.evaluate(SEEN, ".check-message .say")
    assert (said["whole"], said["cut"]) == (1, [])


async def test_a_planned_stop_leaves_the_distance_above_a_notice_whole(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "planned-stop-returned", (700, 320))
    near, snack = [
        await phone.page.locator(one).bounding_box()
        for one in ("#panel-home [data-f=distance]", ".snack[data-f=warning]")
    ]
    assert near is not None
    assert snack is not None
    assert near["y"] + near["height"] <= snack["y"]


@pytest.mark.parametrize(
    ("scene", "size"),
    [("files-menu", (740, 360)), ("preferences", (740, 360)), ("outbox", (740, 360)), ("slow-down-arm", (480, 320))],
)
async def test_the_tag_that_there_is_more_covers_no_key(
    phone: Phone, canned: Canned, scene: str, size: tuple[int, int]
) -> None:
    await opened(phone, canned, scene, size)
    await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    await phone.page.evaluate(DRAWN)
    assert await phone.page.evaluate(TAG) == []


@pytest.mark.own_phone
async def test_no_number_of_a_plot_is_printed_over_another(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.add_init_script(KEEP)
    await page.set_viewport_size({"width": 412, "height": 915})
    await show(canned, page, "chart")
    for width, height in SIZES:
        await page.set_viewport_size({"width": width, "height": height})
        await page.wait_for_timeout(600)
        assert await page.evaluate("() => Math.max(...[...window.written.values()].map((one) => one.length))") > 0
        assert await page.evaluate(PRINTED) == [], (width, height)


async def test_a_notice_leaves_no_part_of_the_pedals(phone: Phone, canned: Canned) -> None:
    for size in ((740, 360), (915, 412), (700, 320)):
        for scene in ("home-warning", "planned-stop-returned"):
            await opened(phone, canned, scene, size)
            await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
            await phone.page.evaluate(DRAWN)
            assert await phone.page.evaluate(UNDER) >= 1, (scene, size)


async def test_a_page_has_no_hole_where_the_mark_key_is_on_others(phone: Phone, canned: Canned) -> None:
    for size in ((740, 360), (640, 360)):
        await opened(phone, canned, "map", size)
        _, _, slide = await phone.page.evaluate(RAIL)
        for scene in ("check-unknown", "files", "settings"):
            await opened(phone, canned, scene, size)
            await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
            await expect(phone.page.locator("#monitor > .ledge")).to_be_hidden()
            left, right, here = await phone.page.evaluate(RAIL)
            assert (left, right, here) == (16, slide - 12, slide), (scene, size)


async def test_no_rule_stands_just_above_that_of_the_rail(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "check-unknown", (740, 360))
    await expect(phone.page.locator(".check-body > .three")).to_be_visible()
    await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    above = await phone.page.evaluate(
        "() => document.querySelector('#monitor > .rail').getBoundingClientRect().top"
        " - document.querySelector('.check-body > .three').getBoundingClientRect().bottom"
    )
    assert above < 0 or above > 24


async def test_the_field_that_is_changed_is_in_sight(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "check-change", (740, 360))
    await expect(phone.page.locator(".check-rows input:focus")).to_be_visible()
    await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    seen = await phone.page.evaluate(SEEN, ".check-rows input:focus")
    assert seen["whole"] == 1


async def test_the_rail_of_a_page_begins_at_the_margin(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned, "settings", (740, 360))
    edges = await phone.page.evaluate(EDGES)
    assert edges == [16, 16]
