"""Every check opens: why it is not checked, its numbers, its threshold changed in place, its alarms in this drive."""

from __future__ import annotations

import asyncio
import time
from typing import Any

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned, alarm, check
from tests.page.conftest import Phone


def quantity(label: str, value: float, unit: str = "m/s") -> dict[str, Any]:
    return {"label": label, "value": value, "unit": unit}


@pytest.fixture
def checked(canned: Canned) -> Canned:
    """A speed above its limit, and a drift that is not checked."""
    now_ms = time.time_ns() // 1_000_000
    canned.checks["Speed"] = check(
        "Speed", "Speed", verdict="fault", text="12.6 m/s, limit 11.0 m/s", for_s=2.3, title="Speed above limit",
        measured=quantity("Speed", 12.6), limit=quantity("Limit", 11.0), priority="critical", signal="speed",
        ends={"side": "below", "value": 10.5, "unit": "m/s"},
        settings=["speed_limit.max_mps", "speed_limit.deadband_mps"],
        minute={"step_s": 0.2, "values": [5.0, 12.6], "limits": [11.0, 11.0]},
    )  # fmt: skip
    canned.checks["GPS drift"] = check(
        "GPS drift", "GPS drift", verdict="unknown", text="The car moves", for_s=32.0,
        checked_when="Checked at standstill with a fix.",
        checks=[{"id": "GPS drift", "label": "GPS drift", "verdict": "unknown", "text": "The car moves",
                 "priority": "warning"},
                {"id": "gps_jump", "label": "GPS jump", "verdict": "ok", "text": "OK", "priority": "warning"}],
    )  # fmt: skip
    canned.checks |= {"gps_jump": check("gps_jump", "GPS jump"), "GPS fix": check("GPS fix", "GPS fix")}
    canned.state["checks"][4]["checks"].append("gps_jump")
    raised = {"n": 5, "at_ms": now_ms - 90_000, "alarm": "Speed", "change": "raised", "occurrence": 1, "by": None}
    worst = quantity("Speed", 11.9) | {"side": "above"}
    canned.log = [
        raised | {"n": 7, "at_ms": now_ms - 81_000, "change": "cleared", "worst": worst},
        raised | {"n": 6, "at_ms": now_ms - 88_900, "change": "acknowledged", "by": "Desk 1"},
        raised,
    ]
    return canned


@pytest.mark.world(n=18)
async def test_one_tap_on_its_mark_says_why_it_is_not_checked_and_what_it_needs(phone: Phone, checked: Canned) -> None:
    await phone.open(checked.address)
    await phone.live()
    marks = phone.page.locator("[data-f=marks] > span")
    await expect(marks).to_have_count(len(checked.state["checks"]) + 1)  # fuel is not published
    await marks.nth(5).scroll_into_view_if_needed()  # beside the one that is meant: a mark is smaller than a finger
    box = await marks.nth(5).bounding_box()
    assert box
    await phone.page.touchscreen.tap(box["x"] + 3, box["y"] + 10)
    await expect(phone.f("check-tag")).to_have_text("NOT CHECKED")
    await expect(phone.f("check-sentence")).to_have_text("Not checked: the car moves.")
    await expect(phone.f("check-needs")).to_have_text("Checked at standstill with a fix.")
    await expect(phone.f("check-figures")).to_contain_text("Not checked for32.0s")
    await expect(phone.f("check-place")).to_have_text("5 of 14")
    await phone.page.locator(".others button", has_text="GPS jump").tap()
    await expect(phone.f("check-title")).to_have_text("GPS jump")
    await phone.f("check-before").tap()
    await expect(phone.f("check-place")).to_have_text("4 of 14")
    await phone.f("close").tap()
    await expect(phone.page.locator(".check-view")).to_have_count(0)
    await expect(phone.page.locator(".gauge .speed")).to_be_visible()


@pytest.mark.world(n=18)
async def test_each_check_of_a_tile_has_the_icon_of_its_own_priority(phone: Phone, checked: Canned) -> None:
    """A critical one is no triangle."""
    rows = [("GPS drift", "GPS drift", "fault", "critical"), ("gps_jump", "GPS jump", "fault", "warning"),
            ("standing", "Standing", "ok", "warning")]  # fmt: skip
    checked.checks["GPS drift"]["checks"] = [
        {"id": id, "label": label, "verdict": verdict, "text": "", "priority": priority}
        for id, label, verdict, priority in rows
    ]
    await phone.open(checked.address)
    await phone.live()
    await phone.page.locator("[data-f=marks] > span").nth(5).scroll_into_view_if_needed()
    box = await phone.page.locator("[data-f=marks] > span").nth(5).bounding_box()
    assert box
    await phone.page.touchscreen.tap(box["x"] + 3, box["y"] + 10)
    icons = phone.page.locator(".others button .i use")
    await expect(icons).to_have_count(3)
    shown = [(await icons.nth(at).get_attribute("href") or "").rpartition("#")[2] for at in range(3)]
    assert shown == ["i-crit", "i-warn", "i-ok"]


@pytest.mark.gate
@pytest.mark.world(n=18)
async def test_an_alarm_opens_with_its_numbers_its_history_and_a_threshold_to_change(
    phone: Phone, checked: Canned
) -> None:
    checked.state["alarms"] = [
        alarm("Speed", "Speed above limit", priority="critical", place="list", sound="high", verdict="fault",
              text="12.6 m/s, limit 11.0 m/s", measured=quantity("Speed", 12.6), limit=quantity("Limit", 11.0),
              worst=quantity("Speed", 12.8) | {"side": "above"}, advice="The safety driver must slow the car.")
    ]  # fmt: skip
    await phone.open(checked.address)
    await phone.live()
    await phone.f("strip").press("Enter")
    await phone.page.locator("[data-f=alarms] li [data-f=open]").press("Enter")
    await expect(phone.f("check-tag")).to_have_text("FAULT")
    story = phone.f("check-alarm")
    await expect(story).to_contain_text("Highest 12.8 m/s. The safety driver must slow the car.")
    await expect(phone.f("check-figures")).to_contain_text("Speed12.6m/s")
    await expect(phone.f("check-total")).to_have_text("1 time, 9.0 s in all")
    await expect(phone.f("check-history")).to_contain_text("highest 11.9 m/s, acknowledged by Desk 1 after 1.1 s")
    await story.locator("[data-do=acknowledge]").tap()
    await expect(phone.page.locator(".check-thresholds")).to_contain_text("ends below 10.5 m/s after 2 s")
    title = phone.page.locator(".check-thresholds > .row b")
    await expect(title).to_have_text("Speed limit")
    await phone.f("check-change").tap()
    await expect(title).to_have_text("Thresholds")  # the row beneath has its own name
    number = phone.page.locator("#set-speed_limit-max_mps")
    await expect(number).to_be_focused()
    await number.fill("13")
    await number.press("Enter")
    async with asyncio.timeout(20):
        while not any(one["kind"] == "set" for one in checked.received):
            await asyncio.sleep(0.05)
    assert [one["values"] for one in checked.received if one["kind"] == "set"] == [{"speed_limit.max_mps": 13.0}]
    assert [one["alarm"] for one in checked.received if one["kind"] == "acknowledge"] == ["Speed"]
    await phone.f("check-trends").tap()
    await expect(phone.f("title")).to_have_text("Trends")
    await phone.page.keyboard.press("Escape")
    await expect(phone.f("check-tag")).to_be_visible()
    await phone.page.keyboard.press("Escape")  # back to the list from which it was opened
    await expect(phone.page.locator("ul[data-f=alarms] li")).to_have_count(1)


@pytest.mark.gate
@pytest.mark.world(n=18)
async def test_what_the_server_no_longer_says_is_not_shown_as_checked(phone: Phone, checked: Canned) -> None:
    await phone.open(checked.address)
    await phone.live()
    await phone.page.locator("[data-f=tiles] li button").first.tap()
    await expect(phone.f("check-tag")).to_have_text("FAULT")
    checked.silent = True
    await expect(phone.f("check-tag")).to_have_text("NOT CHECKED")
    await expect(phone.f("check-figures")).to_contain_text("Speed–")
    await expect(phone.f("check-sentence")).to_contain_text("It was: 12.6 m/s")


@pytest.mark.gate
async def test_a_suppressed_alarm_opens_with_its_cause(phone: Phone, checked: Canned) -> None:
    checked.state["suppressed"] = [
        {"id": "gps_jump", "title": "GPS jumps", "priority": "warning", "by": ["Connection lost"], "raised_ms": None}
    ]
    checked.checks["gps_jump"] = check(
        "gps_jump", "GPS jump", title="GPS jumps", verdict="fault", text="Moved 40 m in 0.1 s",
        suppressed_by=["Connection lost"],
    )  # fmt: skip
    await phone.open(checked.address)
    await phone.live()
    await phone.f("strip").press("Enter")
    await phone.page.locator("[data-f=alarms] li [data-f=open]").press("Enter")
    story = phone.f("check-alarm")
    await expect(story).to_contain_text("GPS jumps suppressed")
    await expect(story).to_contain_text("Cause: Connection lost. It is announced if it is still active when that ends.")
    await expect(story.locator("button")).to_have_count(0)
