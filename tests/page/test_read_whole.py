"""Texts and numbers that an operator must read whole: names of checks, waiting alarms, what is measured, defaults."""

from __future__ import annotations

import re

import pytest
from playwright.async_api import expect

from monitor.catalog import CHECKS
from tests.page.canned import Canned, Json, alarm, idle, live
from tests.page.conftest import Phone
from tests.page.screenshots import several, silent_car

NAMES = list(dict.fromkeys(check.tile_label for check in sorted(CHECKS, key=lambda one: one.order)))
SIZES = [(820, 1180), (740, 1180), (1180, 1000), (1440, 900)]
EACH = [(width, height) for width in range(700, 1500, 33) for height in (600, 720, 768, 820, 1000, 1180, 1300)]
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
#: Names that are cut, or lie over the frame of their tile.
CUT = """() => [...document.querySelectorAll('#monitor .checks b')].filter((one) => {
  if (!one.checkVisibility()) return false;
  const range = document.createRange();
  range.selectNodeContents(one);
  const [at, tile] = [range.getBoundingClientRect(), one.closest('li').getBoundingClientRect()];
  return one.scrollWidth > one.clientWidth || at.right > tile.right - 1 || at.bottom > tile.bottom + 0.5;
}).map((one) => one.textContent)"""
#: Whether anything of the first lies over the second.
OVER = """(both) => ((all) => all[0].some((a) => all[1].some((b) => {
  const range = document.createRange();
  range.selectNodeContents(b);
  const [p, q] = [a.getBoundingClientRect(), range.getBoundingClientRect()];
  return p.width > 0 && q.width > 0 && p.left < q.right && q.left < p.right && p.top < q.bottom && q.top < p.bottom;
})))(both.map((one) => [...document.querySelectorAll(one)]))"""
#: Defaults under the slider, or over an end of their range.
COVERED = """() => [...document.querySelectorAll('#panel-settings .range')].filter((one) => {
  if (!one.checkVisibility()) return false;
  const label = one.querySelector('.text').getBoundingClientRect();
  const range = document.createRange();
  range.selectNodeContents(one.querySelector('.text'));
  const { left, right, top, bottom } = range.getBoundingClientRect();
  const ends = [...one.querySelectorAll('.low, .high')]
    .filter((end) => end.checkVisibility({ visibilityProperty: true }));
  const isOverEnd = ends.map((end) => end.getBoundingClientRect())
    .some((end) => left < end.right && end.left < right && top < end.bottom && end.top < bottom);
  return label.top < one.querySelector('input').getBoundingClientRect().bottom || isOverEnd;
}).map((one) => one.textContent)"""
#: Whether an element shows less than all of its text.
LESS = "(one) => one.scrollWidth > one.clientWidth + 1 || one.scrollHeight > one.clientHeight + 1"


async def names_are_whole(phone: Phone, canned: Canned, sizes: list[tuple[int, int]], font: str = "") -> None:
    """Bold, as those of what is not checked: so they are widest."""
    canned.state = live()
    canned.state["checks"] = [
        {"id": name, "label": name, "verdict": "unknown", "text": "", "brief": "not checked", "checks": [name]}
        for name in NAMES
    ]
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    if font:
        await phone.page.evaluate("(font) => document.documentElement.style.setProperty('--words', font)", font)
    await expect(phone.page.locator("#monitor .checks b")).to_have_count(len(NAMES))
    found = {}
    for width, height in sizes:
        await phone.page.set_viewport_size({"width": width, "height": height})
        await phone.page.evaluate(DRAWN)
        if cut := await phone.page.evaluate(CUT):
            found[f"{width} × {height}"] = cut
    assert found == {}


@pytest.mark.gate
async def test_each_name_of_a_check_is_read_whole(phone: Phone, canned: Canned) -> None:
    await names_are_whole(phone, canned, SIZES)


async def test_each_is_in_each_window(phone: Phone, canned: Canned) -> None:
    await names_are_whole(phone, canned, EACH, 'Roboto, "Liberation Sans", Arial')  # DejaVu is a quarter wider


#: Text under the name of a check whose letters reach out of their line at its foot, where they are cut.
CUT_LOW = """() => [...document.querySelectorAll('#monitor .checks li button > span')].filter((one) => {
  const range = document.createRange();
  range.selectNodeContents(one);
  return one.checkVisibility() && range.getBoundingClientRect().bottom > one.getBoundingClientRect().bottom + 0.5;
}).map((one) => one.textContent)"""


@pytest.mark.gate
async def test_tiles_of_three_lines_are_read_whole_on_the_widest_screen(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1920, "height": 1080})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(page.locator("#monitor .checks li.unk span").first).to_have_text("not checked\nmoving")
    await expect(page.locator("#monitor .checks li.unk span").first).to_be_visible()
    assert await page.evaluate(CUT_LOW) == []


def fast() -> Json:
    return alarm(
        "speed_limit", "Speed above limit", priority="critical", place="dialog", sound="high", actions=["acknowledge"],
        measured={"label": "Speed", "value": 12.6, "unit": "m/s"},
        limit={"label": "Limit", "value": 11.0, "unit": "m/s"},
    )  # fmt: skip


@pytest.mark.gate
async def test_no_key_lies_over_the_limit_of_a_critical_alarm(phone: Phone, canned: Canned) -> None:
    canned.state = live() | {"alarms": [fast()]}
    await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await expect(phone.page.locator(".alarms-pane #sheet-alarm .versus")).to_be_visible()
    for width, height in ((1440, 900), (1200, 700), (1000, 768), (1100, 900), (820, 1180)):
        await phone.page.set_viewport_size({"width": width, "height": height})
        await phone.page.evaluate(DRAWN)
        assert not await phone.page.evaluate(OVER, ["#sheet-alarm .key", "#sheet-alarm .versus > div"]), (width, height)


#: What of the measured value and its limit reaches out of the sheet, or of the window.
BESIDE = """() => {
  const sheet = document.querySelector('#sheet-alarm').getBoundingClientRect();
  return [...document.querySelectorAll('#sheet-alarm .versus > div:not(.cover)')].filter((one) => {
    const range = document.createRange();
    range.selectNodeContents(one);
    const { left, right } = range.getBoundingClientRect();
    return right > Math.min(sheet.right, innerWidth) - 6 || left < sheet.left;
  }).map((one) => one.textContent);
}"""


@pytest.mark.gate
async def test_the_limit_of_a_critical_alarm_is_read_whole_beside_a_low_gauge(phone: Phone, canned: Canned) -> None:
    canned.state = live() | {"alarms": [fast()]}
    await phone.page.set_viewport_size({"width": 412, "height": 360})
    await phone.open(f"{canned.address}/#home")
    await expect(phone.page.locator("#sheet-alarm .versus")).to_be_visible()
    for width, height in ((412, 360), (480, 360), (568, 320), (640, 360), (690, 360)):
        await phone.page.set_viewport_size({"width": width, "height": height})
        await phone.page.evaluate(DRAWN)
        assert await phone.page.evaluate(BESIDE) == [], (width, height)


#: Of the list under a docked alarm: how far its foot lies over the end of its pane, and the height of its rows [px].
LIST = """() => {
  const [pane, sheet, rows, foot] = ['', ' > .slot > .sheet', ' .alarm-list > .alarms', ' .alarms-foot']
    .map((one) => document.querySelector(`.alarms-pane${one}`).getBoundingClientRect());
  return { over: Math.max(foot.bottom, sheet.bottom) - pane.bottom, rows: rows.height };
}"""


@pytest.mark.gate
async def test_a_critical_alarm_leaves_the_list_a_row_and_its_foot(phone: Phone, canned: Canned) -> None:
    page = phone.page
    canned.state = several()
    canned.state["alarms"][0]["place"] = "dialog"
    await page.set_viewport_size({"width": 1200, "height": 700})
    await phone.open(f"{canned.address}/#home")
    await expect(page.locator(".alarms-pane #sheet-alarm .versus")).to_be_visible()
    await expect(page.locator("link[href*='drawers']")).to_be_attached()
    await expect(page.locator(".alarms-pane .alarms > li").first).to_be_attached()
    for width, height in ((1200, 700), (1200, 610), (1000, 640), (1180, 768), (1366, 768), (1440, 900)):
        await page.set_viewport_size({"width": width, "height": height})
        await phone.drawn()
        found = await page.evaluate(LIST)
        assert found["over"] <= 1, (width, height, found)
        assert found["rows"] >= 63, (width, height, found)


@pytest.mark.gate
async def test_a_waiting_alarm_is_read_whole_in_its_row(phone: Phone, canned: Canned) -> None:
    page = phone.page
    canned.state = live()
    canned.state["alarms"] = [
        alarm("moving", "The car moves with nobody in control", place="list", text="6.5 m/s, nobody acted for 4 s")
    ]
    await page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#home")
    row = page.locator("#monitor .alarms-pane .alarms > li")
    for part in (".t", ".m", ".s"):
        await expect(row.locator(part)).to_be_visible()
        assert not await row.locator(part).evaluate(LESS), part


@pytest.mark.gate
async def test_all_rows_of_the_trends_have_the_same_letters(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#home")
    heads = page.locator("#monitor .trends-pane")
    await expect(heads).to_have_count(4)
    for part in (".lab", ".v"):
        sizes = await heads.locator(part).evaluate_all("(all) => all.map((one) => getComputedStyle(one).fontSize)")
        assert len(set(sizes)) == 1, (part, sizes)


#: Values of the trends that reach out of their place.
OUTSIDE = """() => [...document.querySelectorAll('.trends-pane .trends-value')].filter((one) => {
  const range = document.createRange();
  range.selectNodeContents(one);
  const [at, head] = [range.getBoundingClientRect(), one.closest('.trends-head').getBoundingClientRect()];
  return at.right > head.right + 0.5 || at.bottom > head.bottom + 0.5;
}).map((one) => one.textContent)"""


@pytest.mark.gate
async def test_no_value_of_the_trends_is_cut_on_a_narrow_phone(phone: Phone, canned: Canned) -> None:
    """With the lowest and the highest at the cursor, they are longest."""
    page = phone.page
    await page.set_viewport_size({"width": 360, "height": 740})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await page.evaluate("dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen: 'trends' } }))")
    await expect(page.locator(".trends-strip .line")).to_have_attribute("d", re.compile("M.*M"))
    over = await page.locator(".trends-panes .u-over").first.bounding_box()
    assert over is not None
    await page.touchscreen.tap(over["x"] + 0.6 * over["width"], over["y"] + 20)
    await expect(page.locator(".trends-pane[data-then]")).to_have_count(4)
    await expect(page.locator(".trends-pane .v").first).to_contain_text(" to ")
    for width, height in ((360, 740), (360, 640), (320, 640), (375, 667), (412, 915)):
        await page.set_viewport_size({"width": width, "height": height})
        await phone.drawn()
        assert await page.evaluate(OUTSIDE) == [], (width, height)


@pytest.mark.gate
async def test_the_default_of_a_limit_stands_clear_of_its_thumb_and_its_ends(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#settings")
    await expect(phone.page.locator("#panel-settings .range").first).to_be_visible()
    for width in (320, 412, 820):
        await phone.page.set_viewport_size({"width": width, "height": 900})
        assert await phone.page.evaluate(COVERED) == [], width


@pytest.mark.gate
async def test_no_line_crosses_the_gauge_of_a_phone_on_its_side(phone: Phone, canned: Canned) -> None:
    """The place of a fresh mark has a frame once there is one."""
    await phone.page.set_viewport_size({"width": 740, "height": 360})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    slot = phone.page.locator("#monitor > .ledge > .fresh-slot")
    await expect(slot).to_be_attached()
    assert await slot.evaluate("(one) => one.offsetHeight") == 0


@pytest.mark.gate
async def test_the_gauge_of_a_phone_on_its_side_stays_whole_at_the_end_of_home(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 740, "height": 360})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(page.locator("link[href*='drawers']")).to_be_attached()
    await page.wait_for_function("() => document.querySelector('link[href*=\"drawers\"]').sheet")
    home = page.locator("[data-panel=home]")
    assert await home.evaluate("one => { one.scrollTo(0, 9999); return one.scrollTop; }") > 100
    await page.evaluate(DRAWN)
    cut = """() => {
      const box = (one) => document.querySelector(one).getBoundingClientRect();
      const [view, gauge] = ['#monitor > .view', '.gauge'].map(box);
      return Math.max(view.top - gauge.top, gauge.bottom - view.bottom);
    }"""
    assert await page.evaluate(cut) <= 0


#: How far the plate over stale values reaches out of its place, at the top and at the foot [px].
PLATE = """() => {
  const box = (one) => document.querySelector(`#monitor ${one}`).getBoundingClientRect();
  const [veil, plate] = ['.veil', '.veil .plate'].map(box);
  return [veil.top - plate.top, plate.bottom - veil.bottom];
}"""


@pytest.mark.gate
async def test_stale_is_read_whole_on_a_small_phone(phone: Phone, canned: Canned) -> None:
    """Under the line of the sound its title is, and the rest scrolls."""
    page = phone.page
    canned.state = silent_car(live())
    await page.set_viewport_size({"width": 320, "height": 640})
    await phone.open(f"{canned.address}/#home")
    await expect(phone.f("veil")).to_have_attribute("data-on", "values")
    await expect(phone.f("sound-off")).to_be_visible()
    assert (await page.evaluate(PLATE))[0] <= 0
    await phone.f("sound-off").tap()
    await expect(phone.f("sound-off")).to_be_hidden()
    for width, height in ((320, 640), (360, 640), (360, 740), (320, 568)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.evaluate(DRAWN)
        top, foot = await page.evaluate(PLATE)
        assert top <= 0, (width, height)
        assert foot <= 1 or height < 600, (width, height)


#: How far the texts of the pedals and of the steering stand from each other [px].
APART = """() => {
  const boxes = [...document.querySelectorAll('.pedals .v')].map((one) => {
    const range = document.createRange();
    range.selectNodeContents(one);
    return range.getBoundingClientRect();
  });
  return boxes.slice(1).map(({ left }, i) => left - boxes[i].right);
}"""


@pytest.mark.gate
async def test_texts_of_pedals_without_a_value_stand_apart(phone: Phone, canned: Canned) -> None:
    canned.state = idle("monitoring")
    await phone.open(f"{canned.address}/#home")
    await expect(phone.page.locator(".pedals .v").first).to_have_text("not published")
    await phone.page.evaluate("document.documentElement.style.setProperty('--words', 'Roboto, \"Liberation Sans\"')")
    for width, height in ((320, 640), (360, 740), (412, 915), (820, 1180), (1440, 900), (1920, 1080)):
        await phone.page.set_viewport_size({"width": width, "height": height})
        await phone.page.evaluate(DRAWN)
        assert min(await phone.page.evaluate(APART)) > 7, width


async def test_without_a_scan_no_key_lies_over_the_reason(phone: Phone, canned: Canned) -> None:
    canned.state = idle("monitoring")
    await phone.page.set_viewport_size({"width": 820, "height": 1180})
    await phone.open(f"{canned.address}/#home")
    await expect(phone.page.locator("#panel-scan .scan-none")).to_contain_text("not published")
    await expect(phone.page.locator("#panel-scan .zoom")).to_be_hidden()
    canned.state = live()
    await expect(phone.page.locator("#panel-scan .zoom")).to_be_visible()


#: Keys and fields that reach out of the window, or that show less than all of their text.
SHORT = """(panel) => [...document.querySelectorAll(`#panel-${panel} :is(button, input, select, a)`)].filter((one) => {
  if (!one.checkVisibility() || one.matches('.unseen, [type=range]')) return false;
  const at = one.getBoundingClientRect();
  if (at.right > innerWidth + 1 || at.left < -1) return true;
  if (!one.matches('[type=search]')) return false;
  const pen = document.createElement('canvas').getContext('2d');
  pen.font = getComputedStyle(one).font;
  return pen.measureText(one.placeholder).width > one.clientWidth;
}).map((one) => one.placeholder ?? one.textContent.trim())"""


@pytest.mark.gate
async def test_search_and_keys_are_read_whole_at_150_percent(phone: Phone, canned: Canned) -> None:
    """A phone of 360 px has 240 then."""
    await phone.page.set_viewport_size({"width": 240, "height": 493})
    for panel, part in (("settings", ".find input"), ("files", ".files-find input")):
        await phone.open("about:blank")
        await phone.open(f"{canned.address}/#{panel}")
        await expect(phone.page.locator(f"#panel-{panel} {part}")).to_be_visible()
        assert await phone.page.evaluate(SHORT, panel) == [], panel
