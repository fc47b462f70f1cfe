"""What is old is not shown as if it were of now: the phone's comparison, the strip, the chain, the grid of all cars."""

from __future__ import annotations

import itertools
import re
from typing import Any

import pytest
from playwright.async_api import expect

from tests.page import canned_fleet as fleet
from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.screenshots import cars_bar, link_lost, map_tiles

# The gauge and the strip at each picture, until the page covers its values.
WATCH = """() => {
  window.seen = [];
  const look = () => {
    const at = (one) => document.querySelector(one);
    const isStale = at('.gauge').dataset.speed === 'stale';
    const isOk = document.querySelector('[data-f=tiles] .ok, [data-f=marks] .ok')
      || !at('[data-f=count]').textContent.startsWith('0 OK');
    const mark = at('.strip use').getAttribute('href');
    if (!at('.veil').dataset.on) window.seen.push([isStale, mark, Boolean(isOk)]);
    requestAnimationFrame(look);
  };
  look();
}"""
# The chains right after the page was away: as drawn before anything can come.
AWAKE = """() => {
  document.dispatchEvent(new Event('freeze'));
  const count = (what) => document.querySelectorAll(what).length;
  return {
    state: document.querySelector('#monitor [data-f=link-state]').textContent,
    small: [count('.top .chain .node:not(.q)'), count('.top .chain .node.q'), count('.top .chain .wire')],
    large: [count('.veil .node:not(.q)'), count('.veil .node.q'), count('.veil .wire:not(.q)')],
    label: document.querySelector('.veil .bigchain').getAttribute('aria-label'),
  };
}"""


async def test_home_shows_a_comparison_with_the_phone_for_5_s_as_the_map_does(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    apart = phone.f("phone-apart")
    await expect(apart).to_have_text("10.4")
    canned.state["phone"]["compared_age_s"] = 5.1
    await expect(apart).to_have_text("–")
    await expect(phone.f("phone-apart-unit")).to_be_empty()
    canned.state["phone"]["compared_age_s"] = 0.8
    await expect(apart).to_have_text("10.4")
    canned.state["phone"]["compared_age_s"] = None
    await expect(apart).to_have_text("–")


async def test_no_tick_stands_in_strip_or_checks_while_a_value_is_stale(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await phone.page.evaluate(WATCH)
    await phone.page.wait_for_function(
        "() => window.seen.some(([isStale, mark, isOk]) => !isStale && mark === '#i-ok' && isOk)"
    )
    canned.silent = True
    await expect(phone.f("veil")).to_have_attribute("data-on", "all")
    seen: list[list[Any]] = await phone.page.evaluate("window.seen")
    stale = [(mark, is_ok) for is_stale, mark, is_ok in seen if is_stale]
    assert stale, "stale values are shown before they are covered"
    assert [one for one in stale if one[0] == "#i-ok" or one[1]] == []


# What is drawn of a value that ages, by its opacity, and the words of its stopping distance.
ALL = """(opacity, line, weight) => {
  const style = (one) => getComputedStyle(document.querySelector(one));
  const drawn = ['.ptr', '.clip:not(.left, .right) .val', '.clip.right .val', '.obj', '.stopz', '[data-f=brake-fill]'];
  const ages = [...document.querySelectorAll('[data-f=pane-signals] li > :last-child')];
  return style('#panel-home [data-f=stops]').textDecorationStyle === line
    && drawn.every((one) => style(`#panel-home ${one}`).opacity === opacity)
    && ages.length > 0 && ages.every((one) => getComputedStyle(one).fontWeight === weight);
}"""


async def test_all_that_is_drawn_of_a_source_that_ages_loses_ink(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 1920, "height": 1080})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.page.locator("[data-f=pane-signals] li[data-ink=fresh]").first).to_be_visible()
    await phone.page.wait_for_function(f"() => ({ALL})('1', 'solid', '400')")
    for one in canned.state["signals"].values():
        if one["age_s"] is not None:
            one |= {"freshness": "ageing", "age_s": 0.4}
    await phone.page.wait_for_function(f"() => ({ALL})('0.6', 'dotted', '700')")


async def test_in_signals_an_old_age_has_its_word_and_covers_nothing(phone: Phone, canned: Canned) -> None:
    canned.state["signals"]["diagnostics"] |= {"freshness": "stale", "age_s": 7.35, "rate_hz": 0.0}
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await phone.page.evaluate("dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen: 'signals' } }))")
    row = phone.page.locator(".sigs .sig", has_text="Diagnostics")
    await expect(row.locator("[data-age=stale]")).to_have_text(re.compile(r"^STALE \d+\.\d$"))
    first = "() => document.elementFromPoint(99, document.querySelector('.sigs').getBoundingClientRect().top + 9)"
    assert await phone.page.evaluate(f"({first})().closest('.sig').textContent.startsWith('Diagnostics')")
    sizes = await row.locator(".n").evaluate_all("(all) => all.map((one) => getComputedStyle(one).fontSize)")
    assert set(sizes) == {"18px"}, "the age is as large as the other values"
    sizes = [
        await phone.page.locator(one).first.evaluate("(one) => parseFloat(getComputedStyle(one).fontSize)")
        for one in (".sigs [data-age=stale]", ".sigs .sig small")
    ]
    assert sizes[0] > sizes[1]
    await expect(row.locator("> :nth-child(3)")).to_be_empty()


@pytest.mark.parametrize("width", [412, 820])
async def test_what_was_last_known_is_read_once_over_a_lost_connection(
    phone: Phone, canned: Canned, width: int
) -> None:
    """On a phone in the sheet, whose sentence is there at every height; on a tablet on the plate too."""
    await phone.page.set_viewport_size({"width": width, "height": 915})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await link_lost(canned, phone.page)
    await expect(phone.page.locator("#sheet-lost")).to_have_attribute("open", "")
    then = phone.f("veil-then")
    await expect(phone.page.locator("#sheet-lost")).to_contain_text("4.2 m/s, object at 12.4 m")
    await expect(then).to_contain_text("4.2 m/s, object at 12.4 m")
    await expect(then).to_be_visible(visible=width == 820)
    last, sheet = [await one.bounding_box() for one in (phone.f("veil-rec"), phone.page.locator("#sheet-lost"))]
    assert last is not None
    assert sheet is not None
    assert last["y"] + last["height"] < sheet["y"]


async def test_a_page_that_was_away_knows_of_itself_alone(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    canned.silent = True
    found = await phone.page.evaluate(AWAKE)
    assert found == {"state": "Waking", "small": [1, 3, 0], "large": [1, 3, 0], "label": "This page was away."}


async def test_in_the_grid_a_lost_connection_that_is_acknowledged_is_no_new_one(phone: Phone, canned: Canned) -> None:
    canned.cars = fleet.hundred(2)
    canned.cars[34]["summary"]["worst"]["state"] = "ACKED"  # C35
    await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/fleet")
    edge = "(name) => getComputedStyle(document.querySelector(`.wall a[aria-label^='${name},']`)).borderTopStyle"
    await expect(phone.page.locator(".wall a[data-kind=lost]")).to_have_count(2)
    assert [await phone.page.evaluate(edge, name) for name in ("C34", "C35")] == ["dashed", "solid"]


async def test_the_strip_gives_the_age_of_the_alarm_of_another_car(phone: Phone, canned: Canned) -> None:
    await cars_bar(canned, phone.page)
    await expect(phone.f("strip-text")).to_have_text("Caracal: GPS drift")
    await expect(phone.f("strip-end")).to_have_text(re.compile(r"^\d+(\.\d)? s$"))
    canned.cars[1]["summary"]["worst"]["raised_ms"] -= 720_000
    await expect(phone.f("strip-end")).to_have_text(re.compile(r"^1\d:\d\d$"))


async def test_a_log_without_entries_and_a_list_without_people_say_so(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 1920, "height": 1080})
    canned.state["reach"] = None
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.f("pane-log")).to_have_text("No entries received.")
    await expect(phone.f("pane-people")).to_have_text("No list received")


async def test_the_list_of_keys_begins_at_its_close(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.f("head-alarms")).to_have_text("none active")
    await phone.page.keyboard.press("?")
    await expect(phone.page.locator("#sheet-keys [data-f=no]")).to_be_focused()


async def test_the_picture_of_a_map_with_tiles_has_them_on_a_wide_screen(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await map_tiles(canned, phone.page)
    await expect(phone.f("by", "#panel-map")).to_have_text("Plan: test track")


async def test_a_tablet_shows_the_time_on_the_page_of_all_cars(phone: Phone, canned: Canned) -> None:
    canned.cars = fleet.three()
    await phone.page.set_viewport_size({"width": 820, "height": 1180})
    await phone.open(f"{canned.address}/fleet")
    await expect(phone.page.locator("#fleet tbody tr").first).to_be_attached()
    for width in (820, 768):
        await phone.page.set_viewport_size({"width": width, "height": 1180})
        await expect(phone.page.locator("#fleet .time")).to_be_visible()
        boxes = [await phone.page.locator(f"#fleet {one}").bounding_box() for one in (".count", ".ways", ".time")]
        edges = sorted((box["x"], box["x"] + box["width"]) for box in boxes if box)
        assert all(a[1] <= b[0] for a, b in itertools.pairwise(edges)), edges
        assert edges[-1][1] <= width
