"""How the page begins: with the first values, then with all that answers a finger; and what it shows when it cannot."""

from __future__ import annotations

import asyncio
import json
import re
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from playwright.async_api import expect

from tests.http import http_client
from tests.page.conftest import LIVE, Phone
from tests.page.processes import Process, running, server, simulate

# Notes what stands there once the first drawing is done, in the task in which it was.
FIRST = """() => new MutationObserver((_, observer) => {
  if (document.body?.dataset.screen !== 'monitor') return;
  observer.disconnect();
  const seen = (selector) => document.querySelector(selector)?.textContent?.trim() ?? '';
  window.first = {
    speed: seen('.gauge .speed'), link: seen('#monitor [data-f=link-state]'),
    strip: seen('#monitor [data-f="strip-text"]'),
    plate: document.querySelector('.plate').hidden, checks: document.querySelectorAll('[data-part=checks] li').length,
  };
}).observe(document, {attributeFilter: ['data-screen'], subtree: true})"""


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    async with running(*simulate()) as car, running(*server(tmp_path_factory.mktemp("data"), car.address)) as process:
        yield process


@pytest.mark.own_phone
async def test_the_first_picture_of_the_car_is_whole_and_what_lies_under_the_fold_comes_after(
    phone: Phone, watch: Process
) -> None:
    await phone.page.add_init_script(f"({FIRST})()")
    await phone.open(watch.address)
    await phone.live()
    await expect(phone.page.locator("[data-part=checks] li").first).to_be_attached()
    first = await phone.page.evaluate("window.first")
    assert LIVE.fullmatch(first["link"])
    assert re.fullmatch(r"−?[0-9]+\.[0-9]", first["speed"]), first
    assert first["strip"]
    assert first["checks"] == 0
    assert first["plate"], "the text for the end of values is made after the values"
    await expect(phone.page.locator(".plate:not([hidden])")).to_have_count(1)


# Presses what a selector finds in the moment in which the monitor is first shown.
PRESS = """(selector) => new MutationObserver((_, observer) => {
  if (document.body?.dataset.screen !== 'monitor') return;
  observer.disconnect();
  const target = document.querySelector(selector);
  target.dispatchEvent(new MouseEvent('click', {bubbles: true, cancelable: true}));
  window.openAtOnce = document.querySelectorAll('dialog[open], .screen:not([hidden])').length;
  if (target.matches('.n')) target.replaceWith(target.cloneNode(true));
}).observe(document, {attributeFilter: ['data-screen'], subtree: true})"""


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def alarmed(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    """Watches a car that drives too fast for as long as it is watched."""
    async with (
        running(*simulate("--scenario", "speeding@0")) as car,
        running(*server(tmp_path_factory.mktemp("data"), car.address)) as process,
        http_client(base_url=process.address) as client,
        asyncio.timeout(30),
    ):
        while not [one for one in (await client.get("/api/state")).json()["alarms"] if one["priority"] == "critical"]:
            await asyncio.sleep(0.2)
        yield process


@pytest.mark.own_phone
@pytest.mark.parametrize(
    ("pressed", "opened"),
    [("[data-f=menu] svg", "#sheet-menu[open]"), ("[data-f=link-age] .n", "#monitor .screen:not([hidden])")],
    ids=["a key", "a number in a key, which is written anew meanwhile"],
)
async def test_what_is_pressed_before_the_page_listens_is_pressed_once_it_does(
    phone: Phone, watch: Process, pressed: str, opened: str
) -> None:
    await phone.page.add_init_script(f"({PRESS})({json.dumps('#monitor ' + pressed)})")
    await phone.open(watch.address)
    await expect(phone.page.locator(opened)).to_be_visible()
    assert await phone.page.evaluate("window.openAtOnce") == 0


@pytest.mark.own_phone
async def test_what_is_pressed_too_early_is_not_pressed_through_an_alarm(phone: Phone, alarmed: Process) -> None:
    await phone.page.add_init_script(f"({PRESS})('#monitor [data-f=menu]')")
    await phone.open(alarmed.address)
    await expect(phone.page.locator("#sheet-alarm")).to_have_attribute("open", "")
    await expect(phone.page.locator("[data-part=checks] li").first).to_be_attached()
    await phone.page.wait_for_timeout(500)
    assert await phone.page.evaluate("window.openAtOnce") == 0
    assert await phone.page.evaluate("[...document.querySelectorAll('dialog[open]')].map(({id}) => id)") == [
        "sheet-alarm"
    ]


FAILS = {
    "soon": "Navigator.prototype.getBattery = () => { throw new Error('a browser unlike others'); };",
    "late": "Navigator.prototype.setAppBadge = () => { throw new Error('a browser unlike others'); };",
}


@pytest.mark.own_phone
@pytest.mark.parametrize("fails", FAILS)
async def test_a_page_that_cannot_begin_in_whole_shows_nothing_of_the_car(
    phone: Phone, alarmed: Process, fails: str
) -> None:
    """Live values on a page that could not raise an alarm would be a lie, and half an alarm is none."""
    await phone.page.add_init_script(FAILS[fails])
    await phone.open(alarmed.address)
    start = phone.page.locator("#start")
    for _ in range(4):
        await expect(start.locator("h1")).to_have_text("This page does not work")
        await expect(start).to_contain_text("no value and no alarm is shown")
        await expect(phone.page.locator("#monitor")).to_be_hidden()
        await expect(phone.page.locator("dialog[open], .snack:not([hidden])")).to_have_count(0)
        await expect(phone.page.locator(".frame")).to_have_attribute("data-mode", "none")
        await phone.page.wait_for_timeout(300)
    assert any("a browser unlike others" in line for line in phone.complaints)
    phone.complaints.clear()
