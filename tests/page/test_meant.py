"""Nobody reads an alarm that has just come and answers it: such a press was meant for what stood there before."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned, alarm
from tests.page.conftest import Phone

#: Presses each key that acknowledges as soon as the page has drawn an alarm, or another alarm, there.
AT_ONCE = """(selector) => {
  window.presses = 0;
  let shown = '';
  new MutationObserver(() => {
    const place = document.querySelector(selector);
    const key = place?.checkVisibility() ? place.querySelector('.key.solid') : null;
    if (!key || place.innerText.split('\\n')[0] === shown) return;
    shown = place.innerText.split('\\n')[0];
    window.presses += 1;
    key.click();
  }).observe(document.body, { attributes: true, childList: true, subtree: true, characterData: true });
}"""
#: The page is busy for a moment once it has drawn the dialog.
BUSY = """() => new MutationObserver((_, observer) => {
  if (!document.querySelector('#sheet-alarm[open]')) return;
  observer.disconnect();
  console.log('busy');
  for (const until_ms = performance.now() + 900; performance.now() < until_ms;);
}).observe(document.body, { attributes: true, subtree: true })"""


def dialog(name: str, title: str, **more: Any) -> dict[str, Any]:
    return alarm(name, title, priority="critical", place="dialog", sound="high", **more)


def answered(served: Canned) -> list[str]:
    return [one["alarm"] for one in served.received if one["kind"] == "acknowledge"]


async def until_answered(served: Canned, *names: str) -> None:
    async with asyncio.timeout(20):
        while answered(served) != list(names):
            await asyncio.sleep(0.05)


async def said_more(served: Canned) -> None:
    """Waits for a later message of the page: what it sent before is here by then."""
    before = len(served.received)
    async with asyncio.timeout(20):
        while len(served.received) <= before + 1:
            await asyncio.sleep(0.05)


@pytest.mark.gate
@pytest.mark.parametrize(
    ("selector", "make"),
    [("#sheet-alarm[open]", dialog), ('.snack[data-f="warning"]', alarm)],
    ids=["dialog", "snackbar"],
)
async def test_an_alarm_that_has_just_come_is_not_acknowledged(
    phone: Phone, canned: Canned, selector: str, make: Any
) -> None:
    await phone.open(canned.address)
    await phone.live()
    await phone.page.evaluate(AT_ONCE, selector)
    for count, name in enumerate(("first", "second"), 1):  # the second one takes the place of the first
        canned.state["alarms"] = [make(name, f"Alarm {name}", raised_ms=count)]
        await expect(phone.page.locator(selector)).to_contain_text(f"Alarm {name}")
        async with asyncio.timeout(20):
            while await phone.page.evaluate("presses") < count:
                await asyncio.sleep(0.05)
    assert answered(canned) == []
    await phone.page.locator(f"{selector} .key.solid").tap()
    await until_answered(canned, "second")


@pytest.mark.gate
async def test_a_finger_that_rests_while_another_alarm_comes_acknowledges_neither(phone: Phone, canned: Canned) -> None:
    canned.state["alarms"] = [dialog("speed", "Speed above limit")]
    await phone.open(canned.address)
    sheet = phone.page.locator("#sheet-alarm")
    await expect(sheet).to_be_visible()
    await expect(sheet).not_to_have_attribute("data-moved", "")
    box = await sheet.locator('[data-f="acknowledge"]').bounding_box()
    assert box is not None
    points = [{"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}]
    cdp = await phone.page.context.new_cdp_session(phone.page)
    await cdp.send("Input.dispatchTouchEvent", {"type": "touchStart", "touchPoints": points})
    canned.state["alarms"].insert(0, dialog("obstacle", "Obstacle ahead", raised_ms=1))
    await expect(sheet).to_contain_text("Obstacle ahead")
    await expect(sheet).not_to_have_attribute("data-moved", "")
    await cdp.send("Input.dispatchTouchEvent", {"type": "touchEnd", "touchPoints": []})
    await said_more(canned)
    assert answered(canned) == []
    await sheet.locator('[data-f="acknowledge"]').tap()
    await until_answered(canned, "obstacle")


@pytest.mark.gate
async def test_escape_does_not_answer_a_dialog_that_has_just_come(phone: Phone, canned: Canned) -> None:
    await phone.open(canned.address)
    await phone.live()
    sheet = phone.page.locator("#sheet-alarm")
    await sheet.evaluate("""(sheet) => {
      const showModal = sheet.showModal.bind(sheet);
      sheet.showModal = () => { showModal(); sheet.dispatchEvent(new Event('cancel', { cancelable: true })); };
    }""")
    canned.state["alarms"] = [dialog("speed", "Speed above limit")]
    await expect(sheet).to_be_visible()
    await expect(sheet).not_to_have_attribute("data-moved", "")
    assert answered(canned) == []
    await phone.page.keyboard.press("Escape")
    await until_answered(canned, "speed")


async def test_a_finger_that_came_before_the_dialog_does_not_answer_it_on_a_busy_page(
    phone: Phone, canned: Canned
) -> None:
    """The page receives the touch long after: what counts is when it began."""
    await phone.open(canned.address)
    await phone.live()
    canned.state["alarms"] = [dialog("speed", "Speed above limit")]
    sheet = phone.page.locator("#sheet-alarm")
    key = sheet.locator('[data-f="acknowledge"]')
    await expect(key).to_be_visible()
    box = await key.bounding_box()
    assert box is not None
    canned.state["alarms"] = []
    await expect(sheet).to_be_hidden()
    await phone.page.evaluate(BUSY)
    cdp = await phone.page.context.new_cdp_session(phone.page)
    async with phone.page.expect_console_message(lambda message: message.text == "busy"):
        canned.state["alarms"] = [dialog("speed", "Speed above limit", occurrence=2)]
    points = [{"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}]
    before_s = time.time() - 0.4
    await asyncio.gather(
        *(
            cdp.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": where, "timestamp": before_s})
            for kind, where in (("touchStart", points), ("touchEnd", []))
        )
    )
    await expect(sheet).not_to_have_attribute("data-moved", "")
    assert answered(canned) == []


@pytest.mark.gate
async def test_a_row_of_the_list_that_has_just_moved_is_not_acknowledged(phone: Phone, canned: Canned) -> None:
    canned.state["alarms"] = [alarm("old", "Laser silent", place="list")]
    await phone.open(canned.address)
    await phone.live()
    await phone.f("strip").tap()
    rows = phone.page.locator("[data-f=alarms] li")
    await expect(rows.first).not_to_have_attribute("data-moved", "")
    await phone.page.evaluate("""() => new MutationObserver(() => {
      const key = document.querySelector('[data-f=alarms] li [data-do=acknowledge]');
      if (window.pressed || !key?.closest('li').innerText.includes('Speed')) return;
      window.pressed = true;
      key.dispatchEvent(new MouseEvent('click', { bubbles: true, detail: 1 }));
    }).observe(document.querySelector('[data-f=alarms]'), { childList: true })""")
    canned.state["alarms"].append(alarm("new", "Speed above limit", priority="critical", place="list"))
    await expect(rows).to_have_count(2)
    await expect(rows.first).to_contain_text("Speed above limit")
    assert await phone.page.evaluate("pressed")
    assert answered(canned) == []
    await rows.first.locator("[data-do=acknowledge]").tap()
    await until_answered(canned, "new")
