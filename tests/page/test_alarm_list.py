"""The list of alarms behind the strip: what has returned can be acknowledged there, and nowhere stays red for ever."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import expect

from tests.page.canned import Canned, alarm
from tests.page.conftest import Phone

RETURNED = {"state": "RTN_UNACKED", "active": False, "place": "list"}


@pytest_asyncio.fixture(loop_scope="module")
async def canned() -> AsyncIterator[Canned]:
    served = Canned()
    served.state["alarms"] = [
        alarm("link_lost", "Connection lost", priority="critical", actions=["acknowledge", "reconnect"], **RETURNED),
        alarm("gps_jump", "GPS runs away", occurrence=4, **RETURNED),
        alarm("signal_slow.scan", "Laser slower than expected", state="ACKED", acknowledged_by="Ann"),
    ]
    served.state["suppressed"] = [
        {"id": "a", "title": "Nearest distance slow", "priority": "warning", "by": ["Most signals are slow"],
         "raised_ms": None}
    ]  # fmt: skip
    async with served.running():
        yield served


def acknowledged(served: Canned) -> list[tuple[Any, Any]]:
    return [(one["alarm"], one["occurrence"]) for one in served.heard if one["kind"] == "acknowledge"]


@pytest.mark.world(n=18)
async def test_what_has_returned_is_acknowledged_with_one_tap_behind_the_strip(phone: Phone, canned: Canned) -> None:
    await phone.open(canned.address)
    await phone.live()
    strip = phone.f("strip")
    await expect(strip).to_contain_text("Laser slower than expected")  # it stands, the other ones do not any more
    await expect(phone.page.locator(".frame")).to_have_attribute("data-mode", "none")
    box = await strip.bounding_box()
    assert box
    await phone.page.touchscreen.tap(box["x"] + 200, box["y"] + box["height"] + 12)  # the target is 56 px high
    rows = phone.page.locator("[data-f=alarms] li")
    await expect(rows).to_have_count(4)
    await expect(rows.nth(0)).to_contain_text("Connection lost")
    await expect(rows.nth(0)).to_contain_text("returned unacknowledged")
    await expect(rows.nth(2)).to_contain_text("acknowledged by Ann")
    await expect(rows.nth(3)).to_contain_text("cause: Most signals are slow")
    await rows.nth(1).locator("[data-do=acknowledge]").tap()
    for _ in range(40):
        if acknowledged(canned):
            break
        await phone.page.wait_for_timeout(50)
    assert acknowledged(canned) == [("gps_jump", 4)]
    canned.state["alarms"] = canned.state["alarms"][:1]
    await expect(rows).to_have_count(2)
    await expect(strip).to_have_text("Connection was lost, now back1 alarm")
    await expect(strip).to_have_attribute("data-returned", "")
    ended = phone.page.locator("[data-f=alarms-ended]")
    await expect(ended).to_have_text("Acknowledge all that ended 1")
    await ended.tap()
    for _ in range(40):
        if len(acknowledged(canned)) > 1:
            break
        await phone.page.wait_for_timeout(50)
    assert acknowledged(canned)[1:] == [("link_lost", 1)]
    canned.state["alarms"] = []
    await expect(strip).to_contain_text("No alarms")
    await expect(ended).to_be_disabled()
    assert await phone.page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.world(n=18)
async def test_a_viewer_sees_the_list_without_keys(phone: Phone, canned: Canned) -> None:
    canned.role = "viewer"
    await phone.open(canned.address)
    await phone.live()
    await phone.f("strip").tap()
    await expect(phone.page.locator("[data-f=alarms] li")).to_have_count(4)
    await expect(phone.page.locator("[data-f=alarms] button")).to_have_count(0)
    await expect(phone.page.locator("[data-f=alarms-note]")).to_have_text("A viewer cannot acknowledge.")


@pytest.mark.world(n=18)
async def test_a_warning_lies_over_the_tabs_and_never_over_the_list_of_alarms(phone: Phone, canned: Canned) -> None:
    canned.state["alarms"] = [
        alarm("signal_stale", "Laser silent", actions=["shelve", "acknowledge"]),
        alarm("moving", "Component warns", priority="advisory", place="list"),
    ]
    await phone.open(canned.address)
    await phone.live()
    snackbar = phone.page.locator("[data-f=warning]")
    await expect(snackbar).to_contain_text("Shelve")
    canned.state["alarms"][0] |= {**RETURNED, "place": "snackbar"}
    await expect(snackbar).to_contain_text("Returned to normal")
    await expect(snackbar.get_by_text("Shelve")).to_be_hidden()  # as in the list: what has returned is acknowledged
    await expect(phone.f("strip")).to_have_text("Laser silent: ended2 alarms")
    await phone.f("strip").tap()
    await expect(phone.page.locator("[data-f=alarms] li")).to_have_count(3)  # and the suppressed one
    await expect(snackbar).to_be_hidden()
    await phone.f("back").tap()
    await expect(snackbar).to_be_visible()


@pytest.mark.world(n=17)
async def test_the_empty_list_of_a_paused_car_does_not_say_that_there_are_no_alarms(
    phone: Phone, canned: Canned
) -> None:
    canned.state["alarms"] = []
    await phone.open(canned.address)
    await phone.f("strip").tap()
    none = phone.page.locator("[data-f=alarms-none]")
    await expect(none).to_have_text("No alarms.")
    canned.state["session"] |= {"paused": True, "paused_for_s": 42.1}
    await expect(none).to_have_text("Monitoring is paused: no alarm can be raised.")
