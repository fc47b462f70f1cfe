"""Every key that `?` lists does what it names: the cases are made of the list itself, so a new key needs a try here."""

from __future__ import annotations

import ast
import asyncio
import re
from collections.abc import Awaitable, Callable
from pathlib import Path

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.test_messages import replaying
from tests.page.test_wide import critical

KEYS_JS = Path(__file__).resolve().parents[2] / "static" / "js" / "shell" / "keys.js"
ROW = re.compile(r"\{ keys: (\[.*?\]), shown: ('.*?'), act: '(\w+)', does: ")
ROWS = [
    (ast.literal_eval(keys), ast.literal_eval(shown), act)
    for keys, shown, act in ROW.findall(KEYS_JS.read_text("utf-8"))
]
DISPATCH = "key => document.body.dispatchEvent(new KeyboardEvent('keydown', {key, bubbles: true, cancelable: true}))"
Try = Callable[[Phone, Canned, str], Awaitable[None]]


async def desktop(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.f("head-alarms")).to_have_text("none active")  # is written by what mounts the keys


async def until_sent(phone: Phone, canned: Canned, kind: str, key: str | None = None, **fields: str) -> None:
    """Until the page sent such a message; a `key` is pressed until then."""
    async with asyncio.timeout(20):
        while not any({"kind": kind, **fields}.items() <= one.items() for one in canned.received):
            if key is not None:
                await phone.page.keyboard.press(key)
            await phone.drawn()


async def answers(phone: Phone, canned: Canned, key: str) -> None:
    await desktop(phone, canned)
    canned.state = critical()
    await expect(phone.page.locator("#monitor [data-slot=alarm]")).to_contain_text("Speed above limit")
    await until_sent(phone, canned, {"a": "acknowledge", "s": "silence"}[key], key)  # not before it can have been read


async def marks(phone: Phone, canned: Canned, key: str) -> None:
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.f("mark")).to_be_visible()
    await phone.page.evaluate(DISPATCH, key)
    await until_sent(phone, canned, "mark")


async def chooses_a_tab(phone: Phone, canned: Canned, key: str) -> None:
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.f("mark")).to_be_visible()  # comes last
    tabs = phone.page.locator("#monitor [role=tab]")
    place = int(key) - 1
    if place < await tabs.count():
        await phone.page.keyboard.press("2" if key == "1" else key)
        await phone.page.keyboard.press(key)
        await expect(tabs.nth(place)).to_have_attribute("aria-selected", "true")
    else:
        await phone.page.keyboard.press(key)
        await phone.drawn()
        await expect(tabs.nth(0)).to_have_attribute("aria-selected", "true")


async def leads_home(phone: Phone, canned: Canned, key: str) -> None:
    await desktop(phone, canned)
    await phone.page.keyboard.press("2")
    await expect(phone.page.locator("#tab-files")).to_have_attribute("aria-selected", "true")
    await phone.page.keyboard.press(key)
    await expect(phone.page.locator("#tab-home")).to_have_attribute("aria-selected", "true")


async def plays(phone: Phone, canned: Canned, key: str) -> None:
    page = await replaying(phone, canned)
    wanted = "pause" if canned.state["replay"]["is_playing"] else "play"
    await page.keyboard.press(key)
    await until_sent(phone, canned, "replay", do=wanted)


async def moves(phone: Phone, canned: Canned, key: str) -> None:
    page = await replaying(phone, canned)
    at_s = canned.state["replay"]["at_s"]
    begun = len(canned.received)
    await page.keyboard.press(key)
    async with asyncio.timeout(20):
        while not (sought := [one["at_s"] for one in canned.received[begun:] if one.get("do") == "seek"]):
            await phone.drawn()
    assert (sought[0] > at_s) == (key == "ArrowRight")


async def shows_the_list(phone: Phone, canned: Canned, key: str) -> None:
    await desktop(phone, canned)
    await phone.page.keyboard.press(key)
    await expect(phone.page.locator("#sheet-keys kbd")).to_have_text([shown for _, shown, _ in ROWS])


async def is_tried_with_two_recordings(phone: Phone, canned: Canned, key: str) -> None:
    source = Path(__file__).with_name("test_compare.py").read_text("utf-8")
    assert f'keyboard.press("{key}")' in source


TRIES: dict[str, Try] = {
    **dict.fromkeys("as", answers),
    **dict.fromkeys(("m", "AudioVolumeUp", "MediaTrackNext"), marks),
    **dict.fromkeys("123456", chooses_a_tab),
    "Escape": leads_home,
    " ": plays,
    **dict.fromkeys(("ArrowLeft", "ArrowRight"), moves),
    **dict.fromkeys("[]{}", is_tried_with_two_recordings),
    "?": shows_the_list,
}


@pytest.mark.gate
@pytest.mark.parametrize("key", [key for keys, _, _ in ROWS for key in keys])
async def test_each_key_does_what_the_list_says(phone: Phone, canned: Canned, key: str) -> None:
    await TRIES[key](phone, canned, key)


async def test_the_list_is_read_whole() -> None:
    assert len(ROWS) == KEYS_JS.read_text("utf-8").count("{ keys: [")
