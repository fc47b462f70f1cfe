"""Text can be read in every state and theme, on every tab: text with a contrast of 4.5:1, what is measured of 7:1."""

from __future__ import annotations

import itertools
import re
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Page, expect

from tests.page.canned import Canned, Json, alarm, check, live
from tests.page.conftest import Phone
from tests.page.screenshots import silent_car
from tests.page.test_alarm_states import ACKED, ENDED, opened, speeding

CONTRAST = Path(__file__).with_name("contrast.js").read_text(encoding="utf-8").split("\n", 1)[1].rstrip().rstrip(";")
TEXT, DIGITS = 4.5, 7.0
THEMES = ("dark", "light")


def aged(freshness: str, speed_mps: float) -> Json:
    """A car of which every value is so fresh."""
    state = live()
    age_s = {"fresh": 0.04, "ageing": 0.4, "stale": 3.4}[freshness]
    for one in state["signals"].values():
        if one["value"] is not None:
            one |= {"freshness": freshness, "age_s": age_s}
    state["signals"]["speed"]["value"]["speed_mps"] = speed_mps
    return state


def with_alarm(*alarms: Json) -> Json:
    state = aged("fresh", 12.0)
    state["checks"][0] |= {"verdict": "fault", "brief": "FAULT 12.0 m/s"}
    return state | {"alarms": list(alarms)}


def paused() -> Json:
    state = live()
    state["session"] |= {"paused": True, "paused_for_s": 42.1}
    return state


#: Each state of the car, and what of the page shows that it is drawn.
STATES: dict[str, tuple[Callable[[], Json], str]] = {
    "fresh": (lambda: aged("fresh", 4.2), '.gauge[data-speed="fresh"]'),
    "ageing": (lambda: aged("ageing", 12.0), '.gauge[data-speed="ageing"]'),
    "stale": (lambda: aged("stale", 4.2), '.gauge[data-speed="stale"]'),
    "silent": (lambda: silent_car(live()), '.view[data-veil="values"]'),
    "paused": (paused, '.frame[data-mode="paused"]'),
    "warned": (lambda: with_alarm(alarm("gps", "GPS drift 6.3 m", text="6.3 m of 2.0 m")), '.strip[data-kind="warn"]'),
    "critical": (lambda: with_alarm(speeding()), "#sheet-alarm[open]:not([data-ended])"),
    "ended": (lambda: with_alarm(speeding(**ENDED)), "#sheet-alarm[open][data-ended]"),
    "acknowledged": (lambda: with_alarm(speeding(**ACKED)), ".strip[data-known]"),
}
Opening = Callable[[Page], Awaitable[None]]


def by_hash(tab: str) -> Opening:
    async def go(page: Page) -> None:
        await page.evaluate("tab => { location.hash = tab; }", tab)
        await expect(page.locator(f"#panel-{tab}")).not_to_have_attribute("inert", re.compile(""))

    return go


def by_event(screen: str, of: str | None, shows: str) -> Opening:
    async def go(page: Page) -> None:
        detail = {"screen": screen, "of": of}
        await page.evaluate("detail => dispatchEvent(new CustomEvent('catgraph-open', { detail }))", detail)
        await expect(page.locator(shows).first).to_be_visible()

    return go


#: Each place, and how it is opened.
PLACES: dict[str, Opening] = {
    "map": by_hash("map"),
    "scan": by_hash("scan"),
    "files": by_hash("files"),
    "settings": by_hash("settings"),
    "trends": by_event("trends", None, ".trends-pane .v"),
    "check": by_event("check", "Speed", ".check-view"),
    "alarms": by_event("alarms", None, ".alarm-list"),
}


async def all_is_read(phone: Phone, canned: Canned, place: str, states: tuple[str, ...]) -> None:
    """In each of these states, in both themes; `place` is open throughout."""
    canned.checks["Speed"] = check("Speed", "Speed", verdict="fault", text="12.0 m/s, limit 11.0 m/s")
    page = await opened(phone, canned)
    await PLACES[place](page)
    wrong: dict[str, Any] = {}
    for state, theme in itertools.product(states, THEMES):
        make, shows = STATES[state]
        canned.state = make()
        await page.emulate_media(color_scheme="dark" if theme == "dark" else "light", reduced_motion="reduce")
        await page.wait_for_selector(shows, state="attached")
        await phone.drawn(2)
        found = await page.evaluate(CONTRAST)
        assert len(found) > 15, (state, theme)
        if bad := [one for one in found if one["ratio"] < TEXT]:
            wrong[f"{state}, {theme}"] = bad
    assert wrong == {}


@pytest.mark.gate
@pytest.mark.parametrize("place", ["map", "files", "settings"])
async def test_text_is_readable_on_the_other_tabs(phone: Phone, canned: Canned, place: str) -> None:
    await all_is_read(phone, canned, place, ("ageing", "critical"))


@pytest.mark.timeout(300)
@pytest.mark.parametrize("place", PLACES)
async def test_text_is_readable_everywhere_in_every_state(phone: Phone, canned: Canned, place: str) -> None:
    await all_is_read(phone, canned, place, tuple(STATES))


@pytest.mark.gate
async def test_digits_are_readable_in_every_state_and_theme(phone: Phone, canned: Canned) -> None:
    """Of Home, whatever is fresh, over its limit or announced."""
    page = await opened(phone, canned)
    gauge = page.locator(".gauge")
    alarms = itertools.cycle(
        [[], [speeding()], [speeding(**ENDED)], [speeding(**ACKED)], [alarm("gps", "GPS drift 6.3 m")]]
    )
    seen: set[str] = set()
    for theme in THEMES:
        await page.emulate_media(color_scheme="dark" if theme == "dark" else "light", reduced_motion="reduce")
        for freshness, speed_mps in itertools.product(("fresh", "ageing", "stale"), (4.2, 12.0)):
            canned.state = aged(freshness, speed_mps) | {"alarms": next(alarms)}
            await expect(gauge).to_have_attribute("data-speed", freshness)
            await expect(gauge.locator(".speed")).to_have_text(f"{speed_mps}")
            is_over = speed_mps > 11 and freshness != "stale"
            await expect(page.locator(".gauge[data-over]")).to_have_count(int(is_over))
            await phone.drawn(2)
            found = [
                one for one in await page.evaluate(CONTRAST) if re.search(r"\d", one["text"]) and one["part"] != "rail"
            ]
            assert len(found) > 10
            assert [one for one in found if one["ratio"] < DIGITS] == [], (theme, freshness, speed_mps)
            seen |= {one["ink"] for one in found}
            if freshness == "ageing":  # what takes the place of the ink
                await expect(gauge.locator(".note")).to_have_text("0.4 s old")
                line = await gauge.locator(".speed").evaluate("one => getComputedStyle(one).textDecorationStyle")
                assert line == "dotted"
    assert {"fresh", "ageing", "stale"} <= seen
