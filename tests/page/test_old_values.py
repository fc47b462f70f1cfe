"""What is old is not shown as if it were of now: the phone's comparison, the strip, the chain, the grid of all cars."""

from __future__ import annotations

from typing import Any

from playwright.async_api import expect

from tests.page import canned_fleet as fleet
from tests.page.canned import Canned
from tests.page.conftest import Phone

# The gauge and the strip at each picture, until the page covers its values.
WATCH = """() => {
  window.seen = [];
  const look = () => {
    const at = (one) => document.querySelector(one);
    const isStale = at('.gauge').dataset.speed === 'stale';
    if (!at('.veil').dataset.on) window.seen.push([isStale, at('.strip use').getAttribute('href')]);
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


async def test_no_tick_stands_in_the_strip_while_a_value_is_stale(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await phone.page.evaluate(WATCH)
    await phone.page.wait_for_function("() => window.seen.some(([isStale, mark]) => !isStale && mark === '#i-ok')")
    canned.silent = True
    await expect(phone.f("veil")).to_have_attribute("data-on", "all")
    seen: list[list[Any]] = await phone.page.evaluate("window.seen")
    stale = [mark for is_stale, mark in seen if is_stale]
    assert stale, "stale values are shown before they are covered"
    assert "#i-ok" not in stale


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
