"""Numbers stand on one line with their units, and nothing is named twice or cut: in alarms, signals, a low window."""

from __future__ import annotations

import re

import pytest
from playwright.async_api import expect

from tests.page import canned_fleet as fleet
from tests.page.canned import Canned, alarm, live, slow, slowed
from tests.page.conftest import Phone
from tests.page.screenshots import too_fast

DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
#: Quantities of a text that begin on one line and end on another, at each of these widths of it [px].
BROKEN = """([selector, from, to]) => {
  const element = document.querySelector(selector);
  const texts = document.createTreeWalker(element, NodeFilter.SHOW_TEXT);
  const all = [];
  while (texts.nextNode()) all.push(texts.currentNode);
  const whole = all.map((one) => one.data).join('');
  const place = (at) => {
    let [n, before] = [0, 0];
    while (at > before + all[n].data.length) before += all[n++].data.length;
    return [all[n], at - before];
  };
  const found = [...whole.matchAll(/[\\d.]+ (?:m\\/s²|m\\/s|Hz|m|s)(?![a-z])/g)].map((one) => {
    const range = document.createRange();
    range.setStart(...place(one.index));
    range.setEnd(...place(one.index + one[0].length));
    return [one[0], range];
  });
  const broken = new Set();
  for (let width = from; width <= to; width += 3) {
    element.style.cssText = `display: block; width: ${width}px`;
    for (const [text, range] of found) {
      const tops = [...range.getClientRects()].filter((box) => box.width > 1).map((box) => box.bottom);
      if (Math.max(...tops) - Math.min(...tops) > 12) broken.add(text);
    }
  }
  element.style.cssText = '';
  return { of: found.length, broken: [...broken] };
}"""

#: Lower ends of what acts and of the speed, and the upper end of the action bar [px].
BOTTOMS = """() => {
  const box = (selector) => document.querySelector(selector).getBoundingClientRect();
  const rail = '#monitor > .rail';
  return {
    keys: [`${rail} [data-f=release]`, `${rail} .slide`].map((one) => box(one).bottom),
    speed: box('.gauge .speed').bottom, rail: box(rail).top,
  };
}"""


#: How far the text of the slide ends from the right edge of its key [px].
RIGHT = """() => {
  const key = document.querySelector('#monitor > .rail .slide');
  const range = document.createRange();
  range.selectNodeContents(key.querySelector('.tx'));
  return key.getBoundingClientRect().right - range.getBoundingClientRect().right;
}"""


async def test_a_number_and_its_unit_stand_on_one_line(phone: Phone, canned: Canned) -> None:
    """In the dialog of an alarm and in its row of the list, however wide they are."""
    page = phone.page
    canned.state = too_fast(live())
    await phone.open(canned.address)
    await expect(page.locator("#sheet-alarm [data-f=text]")).to_contain_text("12.8 m/s")
    found = await page.evaluate(BROKEN, ["#sheet-alarm [data-f=text]", 120, 400])
    assert found["of"] >= 2
    assert found["broken"] == []
    text = "6.3 m from where it stopped 41 s ago at 2.5 m/s; 2.0 m are allowed, 61 of 75 Hz"
    canned.state = live() | {"alarms": [alarm("drift", "GPS drift", place="list", text=text)]}
    await phone.f("strip").tap()
    row = page.locator(".alarms li .m").first
    await expect(row).to_contain_text("2.5 m/s")
    assert await page.evaluate(BROKEN, [".alarms li .m", 120, 400]) == {"of": 5, "broken": []}


async def test_what_is_not_published_is_named_once_at_nearest_and_on_one_line_in_signals(
    phone: Phone, canned: Canned
) -> None:
    canned.state = live()
    canned.state["signals"]["distance"] |= {"freshness": "not_published", "value": None, "age_s": None, "topic": None}
    await phone.open(canned.address)
    await phone.live()
    nearest = phone.page.locator('[data-part="nearest"]')
    await expect(nearest.locator("[data-f=none]")).to_have_text("not published")
    await expect(nearest.locator("[data-f=age]")).to_have_text("–")
    await nearest.locator("[data-f=age]").tap()  # it still leads to the signal
    value = phone.page.locator(".sig .n[data-ink=not_published]").first
    await expect(value).to_have_text("not published")
    box = await value.bounding_box()
    assert box is not None
    assert box["height"] < 24


@pytest.mark.own_phone
@pytest.mark.parametrize("hand", ["right", "left"])
async def test_the_keys_of_a_slow_down_are_inside_a_low_window(phone: Phone, canned: Canned, hand: str) -> None:
    page = phone.page
    await page.add_init_script(f"localStorage.setItem('catgraph.hand', '{hand}')")
    canned.state = live() | {"decelerate": slowed()}
    await phone.open(canned.address)
    await phone.live()
    await page.set_viewport_size({"width": 412, "height": 360})
    await page.evaluate(DRAWN)
    assert max((await page.evaluate(BOTTOMS))["keys"]) <= 360  # above it stands that the sound is off
    await phone.f("sound-off").tap()
    await expect(phone.f("sound-off")).to_be_hidden()
    for confirmed in (True, False):
        canned.state = live() | {"decelerate": slowed(confirmed)}
        await expect(page.locator('.order[data-kind="crit"]')).to_have_count(0 if confirmed else 1)
        await expect(phone.f("release")).to_be_visible()
        for width, height in ((412, 360), (568, 360), (360, 320), (480, 320)):
            await page.set_viewport_size({"width": width, "height": height})
            await page.evaluate(DRAWN)
            boxes = await page.evaluate(BOTTOMS)
            assert max(boxes["keys"]) <= height, (confirmed, width)
            assert height < 360 or boxes["speed"] <= boxes["rail"] + 1, (confirmed, width)


@pytest.mark.parametrize(("sending", "state"), [(True, "not confirmed"), (False, "not sending")])
async def test_a_slow_down_that_fails_names_the_physical_stop_while_an_alarm_is_to_be_acknowledged(
    phone: Phone, canned: Canned, sending: bool, state: str
) -> None:
    page = phone.page
    canned.state = live() | {"decelerate": slowed(False, sending=sending)}
    await phone.open(canned.address)
    await phone.live()
    legend = page.locator(f'#monitor > .rail .legend > [data-state="{state}"]')
    await expect(legend).to_have_css("font-weight", "700")
    canned.state = too_fast(canned.state)
    await expect(page.locator("#sheet-alarm")).to_be_visible()
    for width, height in ((568, 320), (640, 360), (412, 360), (740, 360)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.evaluate(DRAWN)
        stops = page.get_by_text("physical stop")
        assert any([await stops.nth(n).is_visible() for n in range(await stops.count())]), (width, height)


async def test_what_is_read_beneath_the_scan_is_in_sight_on_a_low_phone(phone: Phone, canned: Canned) -> None:
    page = phone.page
    canned.state = live()
    await phone.open(canned.address)
    await phone.live()
    await page.get_by_role("tab", name="Scan").tap()
    await expect(page.locator(".scanc")).to_be_visible()
    for has_note in (False, True):
        if has_note:
            canned.state["signals"]["scan"]["note"] = "assumed to look ahead: no transforms, and no setting"
        await expect(page.locator(".scan-note")).to_be_visible(visible=has_note)
        for width, height in ((360, 640), (360, 740), (412, 915)):
            await page.set_viewport_size({"width": width, "height": height})
            await page.evaluate(DRAWN)
            ends = await page.locator("#panel-scan .three .n").last.bounding_box()
            rail = await page.locator("#monitor > .rail").bounding_box()
            assert ends is not None
            assert rail is not None
            assert ends["y"] + ends["height"] <= rail["y"], (has_note, width, height)


async def test_what_the_slide_says_breaks_at_spaces_on_a_narrow_phone(phone: Phone, canned: Canned) -> None:
    """In the font of a phone, which is narrower than the one of these tests."""
    page = phone.page
    await page.set_viewport_size({"width": 360, "height": 740})
    canned.state = live()
    await phone.open(canned.address)
    await phone.live()
    lines = "(name) => { const range = document.createRange(); range.selectNodeContents(document.querySelector(name));"
    lines += (
        " return new Set([...range.getClientRects()].filter(({ width }) => width > 1).map(({ top }) => top)).size }"
    )
    tx = "#monitor > .rail .slide .tx"
    await page.locator(tx).evaluate("(one) => { one.style.fontFamily = 'Roboto' }")
    assert await page.evaluate(lines, tx) == 3  # the title, and the reason in two lines
    assert await page.evaluate(RIGHT) >= 4, "clear of the edge of the key [px]"
    canned.state["decelerate"] = slow("armed")
    await expect(page.locator(tx)).to_contain_text("Slide to slow")
    assert await page.evaluate(lines, tx) == 2


async def test_beams_and_the_acceleration_of_the_last_minute_have_their_units(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 360, "height": 740})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    row = page.locator("[data-trend=acceleration] .row")
    await page.locator(".panel[data-panel=home]").evaluate("(one) => one.scrollTo(0, 9999)")  # drawn once in sight
    await expect(row).to_contain_text("Accel. m/s²")
    assert await row.evaluate("(one) => [...one.children].every((it) => it.scrollWidth <= it.clientWidth + 1)")
    await page.evaluate("dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen: 'signals' } }))")
    await expect(page.locator(".sigs")).to_contain_text("181beams", use_inner_text=False)


async def test_the_page_of_all_cars_names_this_operator_as_you_first(phone: Phone, canned: Canned) -> None:
    canned.cars = fleet.three()
    await phone.open(f"{canned.address}/fleet")
    await expect(phone.f("me", "#fleet")).to_have_text(re.compile("^You, ."))
