"""Style sheets that come after the page: when they are fetched, and where they stand in the cascade."""

from __future__ import annotations

import re
from typing import Any

import pytest
from playwright.async_api import Route, expect

from tests.page.canned import Canned, alarm, live, slow, slowed
from tests.page.conftest import Phone

# What the page fetches two and three seconds after it began never comes.
NEVER = """() => {
  const set = window.setTimeout;
  window.setTimeout = (done, ms, ...more) => (ms === 2000 || ms === 3000 ? 0 : set(done, ms, ...more));
}"""
ORDER = """async (names) => {
  const { fetchStyle } = await import('/static/js/core/style-sheet.js');
  for (const name of names) await fetchStyle(`/static/css/${name}.css`);
  return [...document.head.querySelectorAll('link[data-place]')].map(({ href }) => href.replace(/.*[/]|[.-].*/g, ''));
}"""
WANTED: dict[str, dict[str, Any]] = {
    "alarm": {"alarms": [alarm("phone_missing", "Phone position missing")]},
    "order": {"decelerate": slowed(False)},
    "countdown": {
        "decelerate": slow(
            "armed", countdown={"trigger": "speed", "title": "Speed above limit", "text": "", "left_s": 9.0}
        )
    },
    "link": {"link": live()["link"] | {"cut": "bridge-car", "car_age_s": 3.3}},
}


@pytest.mark.gate
@pytest.mark.own_phone
@pytest.mark.parametrize("name", WANTED)
async def test_an_alarm_and_an_order_have_their_styles_at_once(phone: Phone, canned: Canned, name: str) -> None:
    await phone.page.add_init_script(f"({NEVER})()")
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await phone.drawn()
    late = phone.page.locator("link[href*='/drawers'], link[href*='/drive']")
    await expect(late).to_have_count(0)
    canned.state |= WANTED[name]
    await expect(late).to_have_count(2)


@pytest.mark.own_phone
async def test_styles_that_could_not_be_loaded_come_with_a_later_frame(phone: Phone, canned: Canned) -> None:
    failed: set[str] = set()

    async def fail_once(route: Route) -> None:
        await (route.continue_() if route.request.url in failed else route.abort())
        failed.add(route.request.url)

    await phone.page.add_init_script(f"({NEVER})()")
    await phone.page.route(re.compile(r"/(drawers|drive)\b[^/]*\.css"), fail_once)
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    canned.state |= WANTED["alarm"]
    await phone.page.wait_for_function(
        "() => ['drawers', 'drive'].every((name) => document.querySelector(`link[href*='/${name}']`)?.sheet)"
    )
    assert len(failed) == 2
    phone.complaints.clear()


@pytest.mark.gate
@pytest.mark.own_phone
async def test_the_cascade_does_not_depend_on_what_arrives_first(phone: Phone, canned: Canned) -> None:
    await phone.page.add_init_script(f"({NEVER})()")
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    names = ["people", "drive", "wall", "access", "mail", "drawers", "files"]
    found = await phone.page.evaluate(ORDER, names)
    assert [name for name in found if name in names] == [
        "drawers",
        "drive",
        "wall",
        "access",
        "files",
        "mail",
        "people",
    ]
