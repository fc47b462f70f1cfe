"""How an alarm looks in each of its states: readable, in one order, framed while it is active, with keys that act."""

from __future__ import annotations

from typing import Any

import pytest
from playwright.async_api import Page, expect

from tests.page.canned import Canned, alarm, live, slow
from tests.page.conftest import Phone

SIZES = [(320, 640), (360, 740), (412, 915), (740, 360), (820, 1180), (1180, 820), (1440, 900), (1920, 1080)]
#: What is cut by the frame: parts of the page that reach under it.
CUT = """() => {
  const in_px = parseFloat(getComputedStyle(document.querySelector('.frame')).borderTopWidth) || 0;
  const parts = [...document.querySelectorAll('#monitor :is(button, .box, .i, .n, b, h2, canvas, .chain)')];
  return [in_px, ...parts.filter((one) => {
    const isSeen = one.checkVisibility({ visibilityProperty: true });
    if (!isSeen || one.closest('[inert], .veil, .unseen, .gauge')) return false;
    const { left, right, top, bottom, width, height } = one.getBoundingClientRect();
    const isHit = one.matches('.top > *');  // the hand reaches farther than the eye
    if (!width || !height || isHit) return false;
    const view = one.closest('.view')?.getBoundingClientRect();
    const low = view ? Math.min(bottom, view.bottom) : bottom;  // what is scrolled away is cut by no frame
    return Math.min(left, innerWidth - right, top, innerHeight - low) < in_px - 0.6;
  }).map((one) => `${one.className || one.tagName} ${one.textContent}`.slice(0, 40))];
}"""


def speeding(**more: Any) -> dict[str, Any]:
    """A critical alarm with what was measured against its limit."""
    return alarm("speed_limit", "Speed above limit", **(CRITICAL | more))


CRITICAL: dict[str, Any] = {
    "priority": "critical", "place": "dialog", "sound": "high", "needs_ack": True, "actions": ["acknowledge"],
    "text": "12.0 m/s, limit 11.0 m/s", "trip_text": "11.5 m/s, limit 11.0 m/s",
    "measured": {"label": "Speed", "value": 12.0, "unit": "m/s"},
    "limit": {"label": "Speed limit", "value": 11.0, "unit": "m/s"},
    "advice": "The safety driver must slow the car.",
}  # fmt: skip
ENDED: dict[str, Any] = {"state": "RTN_UNACKED", "active": False}
ACKED: dict[str, Any] = {"state": "ACKED", "acknowledged_by": "Ann"}


async def opened(phone: Phone, canned: Canned, width: int = 412, height: int = 915) -> Page:
    await phone.page.set_viewport_size({"width": width, "height": height})
    await phone.page.emulate_media(reduced_motion="reduce")
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    return phone.page


@pytest.mark.gate
async def test_a_critical_alarm_that_ended_is_dashed_titled_and_unframed(phone: Phone, canned: Canned) -> None:
    canned.state = live() | {"alarms": [speeding()]}
    page = await opened(phone, canned)
    sheet, root = page.locator("#sheet-alarm"), page.locator("html")
    edges = """sheet => ['::before', '::after'].map((part) => {
      const style = getComputedStyle(sheet, part);
      return style.content === 'none' ? 0 : parseFloat(style.borderTopWidth);
    })"""
    await expect(sheet).to_contain_text("The safety driver must slow the car.")
    await expect(root).to_have_attribute("data-framed", "")
    assert await sheet.evaluate(edges) == [6, 0], "active, it brings the frame"
    await phone.page.emulate_media(reduced_motion="no-preference")
    assert await sheet.evaluate(edges) == [6, 3], "and it pulses within it"
    canned.state["alarms"] = [speeding(**ENDED), alarm("slow", "The link is too slow", **ACKED)]
    head = sheet.locator("h2")
    for width, height in ((412, 915), (360, 640), (740, 360)):
        await page.set_viewport_size({"width": width, "height": height})
        await expect(head).to_have_text("Speed above limit: ended")
        assert (await head.bounding_box() or {})["height"] > 20, "titled"
        assert await head.evaluate("one => getComputedStyle(one).borderTopStyle") == "dashed"
        assert await sheet.evaluate(edges) == [0, 0]
    await expect(sheet).to_contain_text("It has returned to normal")
    await expect(sheet).not_to_contain_text("must")
    await expect(root).not_to_have_attribute("data-framed", "")
    await expect(page.locator(".frame")).to_have_attribute("data-mode", "none")
    await expect(phone.f("strip")).to_have_text("Speed above limit: ended1 of 2")
    assert await phone.f("strip").evaluate("one => getComputedStyle(one).borderTopStyle") == "dashed"


@pytest.mark.gate
async def test_strip_snackbar_and_list_name_the_same_alarm_first(phone: Phone, canned: Canned) -> None:
    canned.state = live() | {
        "alarms": [
            alarm("phone_missing", "Phone position missing", raised_ms=9, **ACKED),
            alarm("gone", "GPS drift", raised_ms=8, **ENDED),
            alarm("silent", "Position silent", raised_ms=7),
        ]
    }
    page = await opened(phone, canned)
    for title in ("Position silent", "GPS drift: ended", "Phone position missing"):
        await expect(phone.f("strip-text")).to_have_text(title)
        await phone.f("strip").press("Enter")
        await expect(page.locator("[data-f=alarms] .t").first).to_have_text(title.removesuffix(": ended"))
        await page.keyboard.press("Escape")
        if len(canned.state["alarms"]) > 1:
            await expect(page.locator("[data-f=warning] b")).to_contain_text(title.removesuffix(": ended"))
        canned.state["alarms"].pop()


@pytest.mark.gate
async def test_under_a_dialog_no_dead_key_looks_live_and_its_slide_says_what_comes_first(
    phone: Phone, canned: Canned
) -> None:
    canned.state = live() | {"alarms": [speeding()], "decelerate": slow("not_armed")}
    page = await opened(phone, canned)
    slide = page.locator("#sheet-alarm .slide")
    await expect(slide).to_have_text("Acknowledge first\nthen arm it", use_inner_text=True)
    live_keys = """() => [...document.querySelectorAll('#monitor button')].filter((one) => {
      let opacity = 1;
      for (let at = one; at; at = at.parentElement) opacity *= Number(getComputedStyle(at).opacity);
      const isSeen = one.checkVisibility({ visibilityProperty: true }) && !one.closest('.view');
      return isSeen && one.offsetWidth > 0 && opacity > 0.5;
    }).map((one) => one.dataset.f)"""
    named = {"who", "link", "strip"}  # they name the car, the link and the alarm: only what marks them as keys goes
    assert set(await page.evaluate(live_keys)) <= named
    await expect(page.locator("#monitor .chip .more")).to_have_css("visibility", "hidden")
    await slide.tap()
    await expect(page.locator("#sheet-alarm")).to_contain_text("acknowledge the alarm, then arm it")
    await page.locator("#sheet-alarm [data-f=acknowledge]").tap()
    canned.state["alarms"] = [speeding(**ACKED)]
    await expect(phone.f("slow")).to_contain_text("press to arm")
    await expect(page.locator("body")).not_to_have_attribute("data-held", "")
    assert set(await page.evaluate(live_keys)) > named


@pytest.mark.parametrize(("width", "height"), SIZES)
async def test_the_frame_of_an_active_alarm_cuts_nothing(phone: Phone, canned: Canned, width: int, height: int) -> None:
    canned.state = live() | {"alarms": [speeding(**ACKED)]}
    page = await opened(phone, canned, width, height)
    await expect(page.locator(".frame")).to_have_attribute("data-mode", "critical")
    for state in (speeding(**ACKED), speeding()):
        canned.state["alarms"] = [state]
        await phone.drawn(3)
        assert await page.evaluate(CUT) == [6], state["state"]


@pytest.mark.gate
async def test_the_frame_cuts_nothing_on_a_tablet(phone: Phone, canned: Canned) -> None:
    await test_the_frame_of_an_active_alarm_cuts_nothing(phone, canned, 820, 1180)
