"""A planned stop on the page: begun from the menu, shown under the strip on every tab, ended with one key."""

from __future__ import annotations

import re
from typing import Any

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned, alarm
from tests.page.conftest import Phone
from tests.page.test_overlaps import noticed, walk
from tests.page.test_overlaps import opened as opened_whole
from tests.page.test_parts import opened, sent, until_sent

pytestmark = pytest.mark.gate
LINE = "[data-f=planned-stop-line]"


def stop(**more: Any) -> dict[str, Any]:
    return {"reason": "workshop", "by": "A. K. (Pixel)", "since_ms": 1_790_000_000_000, "is_speed_known": True, **more}


async def test_it_is_begun_from_the_menu_with_a_reason(phone: Phone, canned: Canned) -> None:
    await opened(phone, canned)
    await expect(phone.page.locator(LINE)).to_have_count(0)
    await phone.f("menu").tap()
    await phone.page.locator("#sheet-menu [data-f=planned-stop]").tap()
    sheet = phone.page.locator("#sheet-planned-stop")
    await expect(sheet).to_contain_text("Only critical ones and those of catgraph itself sound.")
    await expect(sheet.locator("[data-reason]")).to_have_text(
        ["Parked", "In the workshop", "Charging or refuelling", "Being set up"]
    )
    await sheet.locator("[data-reason=charging]").tap()
    command = await until_sent(canned, "planned_stop")
    assert (command["reason"], command["vehicle"]) == ("charging", "car")
    await expect(sheet).to_have_count(0)


async def test_every_tab_says_it_and_one_key_ends_it(phone: Phone, canned: Canned) -> None:
    canned.state["session"]["planned_stop"] = stop()
    await opened(phone, canned)
    line = phone.page.locator(LINE)
    for tab in ("home", "map", "scan", "files", "settings"):
        await phone.page.locator(f"#tab-{tab}").tap()
        await expect(line).to_contain_text("Planned stop: in the workshop")
        await expect(line).to_contain_text(re.compile(r"since \d\d:\d\d:\d\d by A. K. \(Pixel\)"))
    await line.locator("[data-f=planned-stop-end]").tap()
    await until_sent(canned, "end_planned_stop")
    canned.state["session"]["planned_stop"] = None
    await expect(line).to_be_hidden()


async def test_a_speed_that_is_not_known_is_said(phone: Phone, canned: Canned) -> None:
    canned.state["session"]["planned_stop"] = stop(is_speed_known=False)
    await opened(phone, canned)
    await expect(phone.page.locator(LINE)).to_contain_text("Speed not known: ends by hand only.")


async def test_alarms_are_shown_with_the_mark_and_a_critical_one_still_asks(phone: Phone, canned: Canned) -> None:
    canned.state["session"]["planned_stop"] = stop()
    canned.state["alarms"] = [alarm("gps_drift", "GPS drift", sound="none", planned_stop=True)]
    await opened(phone, canned)
    await expect(phone.page.locator(".snack[data-f=warning]")).to_contain_text("planned stop")
    canned.state["alarms"].append(
        alarm("obstacle", "Obstacle ahead", priority="critical", place="dialog", sound="high", planned_stop=True)
    )
    dialog = phone.page.locator("#sheet-alarm")
    await expect(dialog).to_be_visible()
    await expect(dialog).to_contain_text("The car is in a planned stop.")
    await expect(phone.f("strip")).to_contain_text("Obstacle ahead")


async def test_what_the_server_does_not_say_any_more_is_not_shown(phone: Phone, canned: Canned) -> None:
    canned.state["session"]["planned_stop"] = stop()
    await opened(phone, canned)
    await expect(phone.page.locator(LINE)).to_be_visible()
    canned.silent = True
    await expect(phone.page.locator(LINE)).to_be_hidden(timeout=20_000)


async def test_a_refusal_is_said(phone: Phone, canned: Canned) -> None:
    canned.state["session"]["planned_stop"] = stop()
    canned.refuses["end_planned_stop"] = "The session is busy."
    await opened(phone, canned)
    await phone.page.locator("[data-f=planned-stop-end]").tap()
    await expect(phone.page.locator(".snack.note")).to_contain_text("The session is busy.")
    assert sent(canned, "end_planned_stop")


@pytest.mark.parametrize(("width", "height"), [(320, 568), (412, 590), (820, 1180), (1000, 600), (1440, 600)])
async def test_a_note_leaves_the_planned_stop_in_sight(phone: Phone, canned: Canned, width: int, height: int) -> None:
    await phone.page.set_viewport_size({"width": width, "height": height})
    canned.state["session"]["planned_stop"] = stop()
    page = await opened_whole(phone, canned)
    await noticed(page, canned)
    await expect(page.locator(LINE)).to_be_in_viewport()


@pytest.mark.parametrize(("width", "height"), [(568, 320), (640, 340), (740, 340), (820, 1100)])
async def test_a_warning_leaves_the_planned_stop_in_sight(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    await phone.page.set_viewport_size({"width": width, "height": height})
    canned.state["session"]["planned_stop"] = stop()
    canned.state["alarms"] = [alarm("gps_drift", "GPS drift", sound="none", planned_stop=True)]
    page = await opened_whole(phone, canned)
    if width >= 700:  # there the pane of the alarms has the warning, unless a notice is beside it
        await noticed(page, canned)
    await expect(page.locator("body[data-snack]")).to_be_attached()
    await expect(page.locator(LINE)).to_be_in_viewport(ratio=0.98)
    assert await walk(page, [(width, height)]) == {}


async def test_on_a_low_phone_a_warning_leaves_the_speed_in_sight(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 320, "height": 568})
    canned.state["session"]["planned_stop"] = stop()
    canned.state["alarms"] = [alarm("gps_drift", "GPS drift at standstill", sound="none", planned_stop=True)]
    await opened_whole(phone, canned)
    snack, line = phone.page.locator(".snack[data-f=warning]"), phone.page.locator(LINE)
    await expect(snack).to_be_visible()
    await expect(line).to_contain_text("Planned stop: in the workshop")
    await expect(line.locator("[data-f=planned-stop-end]")).to_be_hidden()  # also: its style sheet has come
    speed, above, below = [await one.bounding_box() for one in (phone.page.locator(".gauge .speed"), line, snack)]
    assert speed is not None
    assert above is not None
    assert below is not None
    assert above["y"] + above["height"] <= speed["y"]
    assert speed["y"] + speed["height"] <= below["y"]
