"""Words and numbers that an operator must read whole: names of checks, waiting alarms, what is measured, defaults."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from monitor.catalog import CHECKS
from tests.page.canned import Canned, Json, alarm, live
from tests.page.conftest import Phone

NAMES = list(dict.fromkeys(check.tile_label for check in sorted(CHECKS, key=lambda one: one.order)))
SIZES = [(820, 1180), (740, 1180), (1180, 1000)]
EACH = [(width, height) for width in range(700, 1200, 33) for height in (600, 720, 768, 820, 1000, 1180, 1300)]
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
  const word = one.querySelector('.word').getBoundingClientRect();
  const range = document.createRange();
  range.selectNodeContents(one.querySelector('.word'));
  const { left, right, top, bottom } = range.getBoundingClientRect();
  const ends = [...one.querySelectorAll('.low, .high')]
    .filter((end) => end.checkVisibility({ visibilityProperty: true }));
  const isOverEnd = ends.map((end) => end.getBoundingClientRect())
    .some((end) => left < end.right && end.left < right && top < end.bottom && end.top < bottom);
  return word.top < one.querySelector('input').getBoundingClientRect().bottom || isOverEnd;
}).map((one) => one.textContent)"""
#: Whether an element shows less than all of its words.
LESS = "(one) => one.scrollWidth > one.clientWidth + 1 || one.scrollHeight > one.clientHeight + 1"


async def names_are_whole(phone: Phone, canned: Canned, sizes: list[tuple[int, int]], words: str = "") -> None:
    """Bold, as those of what is not checked: so they are widest."""
    canned.state = live()
    canned.state["checks"] = [
        {"id": name, "label": name, "verdict": "unknown", "text": "", "brief": "not checked", "checks": [name]}
        for name in NAMES
    ]
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    if words:
        await phone.page.evaluate("(words) => document.documentElement.style.setProperty('--words', words)", words)
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
