"""A press acts on what it began on, though the page moves beneath the finger."""

from __future__ import annotations

import asyncio

import pytest
from playwright.async_api import CDPSession, Locator, expect

from tests.page.canned import Canned
from tests.page.conftest import Phone

#: Once the finger is lifted, what stands above Home grows by a key's height, as for an alarm's strip.
GROWS = """() => addEventListener('pointerup', () => {
  document.querySelector('#monitor > .strip').style.minHeight = '105px';
}, { capture: true, once: true })"""
SCROLL = "element => element.scrollIntoView({ block: 'center' })"


async def _middle(key: Locator) -> list[dict[str, float]]:
    """Where a finger would press it, after it was brought to the middle of the view."""
    await key.evaluate(SCROLL)
    box = await key.bounding_box()
    assert box is not None
    return [{"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}]


async def _touch(cdp: CDPSession, kind: str, points: list[dict[str, float]]) -> None:
    await cdp.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})


async def test_the_first_touch_opens_what_it_pressed_and_only_then_the_note_of_the_sound_goes(
    phone: Phone, canned: Canned
) -> None:
    await phone.open(canned.address)
    note = phone.f("sound-off")
    await expect(note).to_be_visible()
    key = phone.page.locator('[data-part="reach"]')
    before = await _middle(key)
    cdp = await phone.page.context.new_cdp_session(phone.page)
    await _touch(cdp, "touchStart", before)
    await phone.page.keyboard.press("Shift")  # arms the sound, as the lifted finger does
    await asyncio.sleep(0.6)
    await expect(note).to_be_visible()
    await _touch(cdp, "touchEnd", [])
    await expect(phone.page.locator("#sheet-this-phone")).to_be_visible()
    await expect(note).to_be_hidden()


@pytest.mark.parametrize("grows", [False, True])
async def test_a_click_that_comes_down_on_another_key_than_the_one_pressed_does_nothing(
    phone: Phone, canned: Canned, grows: bool
) -> None:
    await phone.open(canned.address)
    await phone.f("sound-off").tap()
    await expect(phone.f("sound-off")).to_be_hidden()
    points = await _middle(phone.page.locator('[data-part="slow"]'))
    if grows:
        await phone.page.evaluate(GROWS)
    cdp = await phone.page.context.new_cdp_session(phone.page)
    await _touch(cdp, "touchStart", points)
    await _touch(cdp, "touchEnd", [])
    if not grows:
        await expect(phone.page.locator("dialog[open]")).to_have_count(1)
        return
    await asyncio.sleep(1)
    await expect(phone.page.locator("dialog[open]")).to_have_count(0)
    await phone.page.locator('[data-part="reach"]').tap()  # the next press is one like any other
    await expect(phone.page.locator("#sheet-this-phone")).to_be_visible()
