"""The page in a browser whose language is German: every number that is read has a comma."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned, alarm, live
from tests.page.conftest import Phone

POINTED = r"""() => {
  const walker = document.createTreeWalker(document.querySelector('#monitor'), NodeFilter.SHOW_TEXT);
  const found = [];
  for (let node = walker.nextNode(); node; node = walker.nextNode()) {
    const text = node.data.trim(), at = node.parentElement;
    if (/(?<![\d.])\d+\.\d+(?![\d.])/.test(text) && at.checkVisibility()) found.push(text);
  }
  const typed = [...document.querySelectorAll('#monitor input:not([type=range])')]
    .filter((one) => one.checkVisibility() && /\d\.\d/.test(one.value));
  return [...found, ...typed.map(({ value }) => value)];
}"""
GERMAN = {"locale": "de-DE"}


def driving() -> dict[str, object]:
    quantity = {"label": "Speed", "value": 12.6, "unit": "m/s"}
    fast = alarm(
        "speed_limit", "Speed above limit", priority="critical", place="list", state="ACKED",
        text="12.6 m/s, limit 11.0 m/s", trip_text="12.6 m/s, limit 11.0 m/s",
        measured=quantity, limit=quantity | {"label": "Limit", "value": 11.0},
    )  # fmt: skip
    return live() | {"alarms": [fast]}


@pytest.mark.gate
@pytest.mark.parametrize("phone", [GERMAN], indirect=True)
@pytest.mark.parametrize("width", [412, 1440])
async def test_no_number_that_is_shown_has_a_point(phone: Phone, canned: Canned, width: int) -> None:
    canned.state = driving()
    await phone.page.set_viewport_size({"width": width, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.page.locator("#panel-home")).to_contain_text("12,4")
    for tab in ("home", "map", "scan", "settings"):
        if await phone.page.locator(f"#tab-{tab}").is_visible():  # else it is a pane
            await phone.page.locator(f"#tab-{tab}").click()
        await expect(phone.page.locator(f"#panel-{tab}")).to_be_visible()
        await phone.drawn()
        assert await phone.page.evaluate(POINTED) == [], tab


@pytest.mark.gate
@pytest.mark.parametrize("phone", [GERMAN], indirect=True)
async def test_a_sentence_of_the_server_has_a_comma(phone: Phone, canned: Canned) -> None:
    canned.state = driving()
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await phone.f("strip").tap()
    row = phone.page.locator("[data-f=alarms] li", has_text="Speed above limit")
    await expect(row).to_contain_text("12,6")
    await expect(row).not_to_contain_text("12.6")
