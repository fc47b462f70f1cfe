"""How the page begins: with the first values, then with all that answers a finger; and what it shows when it cannot."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator

import pytest
import pytest_asyncio
from playwright.async_api import expect

from tests.page.conftest import Phone
from tests.page.processes import Process, running, server, simulate

# Notes what was done in the first drawing: from one picture to the next.
PICTURES = """() => {
  window.pictures = [];
  const look = () => {
    const seen = (selector) => document.querySelector(selector)?.textContent?.trim() ?? '';
    window.pictures.push({
      screen: document.body?.dataset.screen, speed: seen('.gauge .speed'), word: seen('#monitor [data-f=word]'),
      strip: seen('#monitor [data-f="strip-text"]'), plate: document.querySelector('.plate')?.hidden,
      checks: document.querySelectorAll('[data-part=checks] li').length,
    });
    if (window.pictures.length < 400) requestAnimationFrame(look);
  };
  requestAnimationFrame(look);
}"""


@pytest_asyncio.fixture(loop_scope="module", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    async with running(*simulate()) as car, running(*server(tmp_path_factory.mktemp("data"), car.address)) as process:
        yield process


async def test_the_first_picture_of_the_car_is_whole_and_what_lies_under_the_fold_comes_after(
    phone: Phone, watch: Process
) -> None:
    await phone.page.add_init_script(f"({PICTURES})()")
    await phone.open(watch.address)
    await phone.live()
    await expect(phone.page.locator("[data-part=checks] li").first).to_be_attached()
    pictures = await phone.page.evaluate("window.pictures")
    first = next(one for one in pictures if one["screen"] == "monitor")
    assert first["word"] == "Live"
    assert re.fullmatch(r"−?[0-9]+\.[0-9]", first["speed"]), first
    assert first["strip"]
    assert first["checks"] == 0
    assert first["plate"], "what is said once values end is made after the values"
    assert not [one for one in pictures if one["screen"] == "connect"]
    await expect(phone.page.locator(".plate")).not_to_have_attribute("hidden", re.compile(""))


async def test_what_is_pressed_before_the_page_listens_is_pressed_once_it_does(phone: Phone, watch: Process) -> None:
    await phone.page.add_init_script(
        """new MutationObserver((_, observer) => {
          if (document.body?.dataset.screen !== 'monitor') return;
          observer.disconnect();
          const press = new MouseEvent('click', {bubbles: true, cancelable: true});
          document.querySelector('#monitor [data-f=menu] svg').dispatchEvent(press);
          window.openAtOnce = document.querySelector('#sheet-menu').open;
        }).observe(document, {attributeFilter: ['data-screen'], subtree: true});"""
    )
    await phone.open(watch.address)
    await expect(phone.page.locator("#sheet-menu")).to_have_attribute("open", "")
    assert await phone.page.evaluate("window.openAtOnce") is False


async def test_a_page_that_cannot_begin_in_whole_shows_nothing_of_the_car(phone: Phone, watch: Process) -> None:
    """Live values on a page that could not raise an alarm would be a lie."""
    await phone.page.add_init_script(
        "Navigator.prototype.getBattery = () => { throw new Error('a browser unlike others'); };"
    )
    await phone.open(watch.address)
    start = phone.page.locator("#start")
    await expect(start.locator("h1")).to_have_text("This page does not work")
    await expect(start).to_contain_text("no value and no alarm is shown")
    await expect(phone.page.locator("#monitor")).to_be_hidden()
    await phone.page.wait_for_timeout(1000)
    await expect(phone.page.locator("#monitor")).to_be_hidden()
    assert any("a browser unlike others" in said for said in phone.complaints)
    phone.complaints.clear()
