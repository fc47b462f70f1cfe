"""On a phone on its side what acts, and what is read first, is whole in sight at once."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.screenshots import COMPLETE, show

SIZES = [(740, 360), (640, 360), (568, 320), (915, 412)]
ALL = (99, 99, 99, 99)
#: By the scene: how many of which elements are whole in sight at each of these sizes, at least.
WHOLE: dict[str, dict[str, tuple[int, int, int, int]]] = {
    "home-stale": {"[data-f=veil-then]": (1, 1, 0, 1), "[data-f=veil-rec]": (1, 0, 0, 1)},
    "alarms": {
        "ul.alarms > li:not([hidden])": ALL,
        "ul.alarms > li:not([hidden]) .key": ALL,
        ".alarm-list .alarms-foot .key": ALL,
        ".alarm-list [data-f=close]": ALL,
    },
    "alarms-ended": {
        "ul.alarms > li:not([hidden])": ALL,
        "ul.alarms > li:not([hidden]) .key": ALL,
        ".alarm-list .alarms-foot .key": ALL,
    },
    "check": {
        ".check-view .check-message": ALL,
        ".check-view [data-f=check-figures]": ALL,
        ".check-view .alarms-foot .turn .key": ALL,
        ".check-view .check-alarm .key": ALL,
        ".check-view [data-f=close]": ALL,
    },
    "link-lost": {"#sheet-lost .bd p": ALL, "#sheet-lost :is(.main, .key)": ALL},
    "files": {"#panel-files .file": (2, 1, 1, 3), "#panel-files .files-find .field": ALL},
    "files-menu": {"#sheet-file [data-f=file-actions] > li": (4, 4, 2, 4), "#sheet-file .bd .bad": (1, 1, 0, 1)},
    "outbox": {"#sheet-outbox [data-mail]:first-child .key": ALL},
    "cars": {"#sheet-cars [data-car]": (3, 2, 1, 3)},
    "menu": {"#sheet-menu .menu-list button": (8, 6, 6, 8), "#sheet-menu .keys .key": ALL},
    "handover": {
        "#sheet-handover .from-to": (1, 0, 0, 1),
        "#sheet-handover .read-back > li": (2, 2, 1, 2),
        "#sheet-handover .tick[data-next]": (1, 1, 0, 1),
        "#sheet-handover .duty-keys .key": ALL,
        "#sheet-handover .sign > *": (2, 2, 0, 2),
        "#sheet-handover [data-f=no]": ALL,
        "#sheet-handover .head-speed .v": ALL,
    },
    "sign-on": {
        "#sheet-duty .people-rows > li": (2, 2, 1, 2),
        "#sheet-duty .roles button": ALL,
        "#sheet-duty .sign": ALL,
        "#sheet-duty [data-f=no]": ALL,
    },
    "left": {"#sheet-left .read-back > li": (2, 2, 1, 2), "#sheet-left .main": ALL, "#sheet-left [data-f=no]": ALL},
    "mark-sheet": {
        "#sheet-mark .chip-rows .key": (6, 6, 0, 6),
        "#sheet-mark textarea": (1, 1, 0, 1),
        "#sheet-mark .mark-keys .key": ALL,
        "#sheet-mark .mark-head .btn": ALL,
    },
    "slow-down-arm": {
        "#sheet-slow [data-f=guard]": ALL,
        "#sheet-slow .facts .bad": (1, 1, 0, 1),
        "#sheet-slow .keys > button": ALL,
        "#sheet-slow h2": ALL,
    },
    "slow-down-release": {"#sheet-release p:not(.head-speed)": ALL, "#sheet-release .keys > *": ALL},
    "question-sheet": {"#sheet-question .menu-list li": ALL, "#sheet-question .keys .key": ALL},
    "planned-stop-stale": {"[data-f=planned-stop-line] :is(.key, b, .small)": ALL, ".snack .key.solid": ALL},
    "departure": {".dep-list > li": (3, 2, 1, 3), ".departure .sign": ALL},
    "topic": {".pick-sheet .menu-list li": (3, 2, 1, 3), ".pick-sheet .keys .key": ALL},
    "help": {"#sheet-keys .key-list dd": (4, 3, 2, 5), "#sheet-keys .keys .key": ALL},
    "question": {"[data-f=stops]": (1, 0, 0, 1)},
    "slow-down-sliding": {"[data-f=stops]": (1, 0, 0, 1)},
    "planned-stop-returned": {"[data-f=stops]": (1, 0, 0, 1)},
    "settings": {".range .high": (1, 0, 0, 1)},
    "scan": {"#panel-scan .three": ALL, "#panel-scan .zoom": (1, 0, 0, 1)},
}
#: How many elements there are, how many of them are whole in sight, and whose text is cut.
SEEN = """(selector) => {
  const all = [...document.querySelectorAll(selector)].filter((one) => one.checkVisibility());
  const isIn = (one, x, y) => {
    const { left, right, top, bottom } = one.getBoundingClientRect();
    return left <= x && x <= right && top <= y && y <= bottom;
  };
  const isSeen = (one, x, y) => {
    const hit = document.elementFromPoint(x, y);
    return hit && (one.contains(hit) || !isIn(hit, x, y));  // the hand reaches farther than the eye
  };
  const isWhole = (one) => {
    const { left, top, width, height } = one.getBoundingClientRect();
    const points = [[50, 50], [50, 3], [50, 97], [3, 50], [97, 50]];  // corners are round
    return points.every(([x, y]) => isSeen(one, left + (x / 100) * width, top + (y / 100) * height));
  };
  const isCut = (one) => one.scrollWidth > one.clientWidth + 1 || one.scrollHeight > one.clientHeight + 1;
  const cut = all.filter((one) => one.matches('.key, .main, p') && isCut(one)).map((one) => one.textContent);
  return { all: all.length, whole: all.filter(isWhole).length, cut };
}"""
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


@pytest.mark.parametrize("scene", list(WHOLE))
async def test_what_acts_and_what_is_read_first_is_whole_in_sight(phone: Phone, canned: Canned, scene: str) -> None:
    page = phone.page
    found: dict[str, Any] = {}
    for n, (width, height) in enumerate(SIZES):
        await page.set_viewport_size({"width": width, "height": height})
        await show(canned, page, scene)
        await page.wait_for_function(COMPLETE)
        await page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
        await page.evaluate(DRAWN)
        for selector, least in WHOLE[scene].items():
            await expect(page.locator(selector).first).to_be_visible()
            seen = await page.evaluate(SEEN, selector)
            if seen["whole"] < min(least[n], seen["all"]) or seen["cut"]:
                found[f"{selector} at {width} × {height}"] = seen
    assert found == {}
