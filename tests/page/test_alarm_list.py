"""The list of alarms behind the strip: what has returned can be acknowledged there, and nowhere stays red for ever."""

from __future__ import annotations

import asyncio
import os
import re
from typing import Any

import pytest
from playwright.async_api import Route, expect

from tests.page.canned import Canned, alarm
from tests.page.conftest import Phone

RETURNED = {"state": "RTN_UNACKED", "active": False, "place": "list"}


DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(() => setTimeout(done, 50))))"


@pytest.fixture
def returned(canned: Canned) -> Canned:
    """Two alarms that have returned, one that stands and one that is suppressed."""
    canned.state["alarms"] = [
        alarm("link_lost", "Connection lost", priority="critical", actions=["acknowledge", "reconnect"], **RETURNED),
        alarm("gps_jump", "GPS runs away", occurrence=4, **RETURNED),
        alarm("signal_slow.scan", "Laser slower than expected", state="ACKED", acknowledged_by="Ann"),
    ]
    canned.state["suppressed"] = [
        {"id": "a", "title": "Nearest distance slow", "priority": "warning", "by": ["Most signals are slow"],
         "raised_ms": None}
    ]  # fmt: skip
    return canned


def seven() -> list[dict[str, Any]]:
    """Four that stand, one of them critical, and three that have returned."""
    return [
        alarm("speed_limit", "Speed above limit", priority="critical", place="list", sound="high", actions=[]),
        *(alarm(f"warn{n}", f"Warning {n}", place="list") for n in range(2)),
        alarm("advice", "Component warns", priority="advisory", place="list", sound="low"),
        *(alarm(f"gone{n}", f"Returned {n}", **RETURNED) for n in range(3)),
    ]


def acknowledged(served: Canned) -> list[tuple[Any, Any]]:
    return [(one["alarm"], one["occurrence"]) for one in served.received if one["kind"] == "acknowledge"]


async def received(served: Canned, count: int, kind: str = "acknowledge") -> list[str]:
    """The alarms that were answered, once there are so many."""
    async with asyncio.timeout(20):
        while len(found := [one["alarm"] for one in served.received if one["kind"] == kind]) < count:
            await asyncio.sleep(0.05)
    return found


def answer(served: Canned, names: list[str]) -> None:
    """What the server makes of acknowledgements: what returned goes, what stands is known."""
    for one in served.state["alarms"]:
        if one["id"] in names and one["active"]:
            one |= {"state": "ACKED", "acknowledged_by": "You"}
    served.state["alarms"] = [one for one in served.state["alarms"] if one["id"] not in names or one["active"]]


@pytest.mark.gate
@pytest.mark.world(n=18)
async def test_seven_alarms_are_acknowledged_with_four_taps(phone: Phone, canned: Canned) -> None:
    for width, height in ((412, 915), (360, 740)):
        canned.reset()
        canned.state["alarms"] = seven()
        await phone.page.set_viewport_size({"width": width, "height": height})
        await phone.open(canned.address)
        await phone.live()
        await phone.f("strip").tap()  # 1
        critical = phone.page.locator("[data-f=alarms] li", has_text="Speed above limit")
        await expect(critical.locator("[data-do=silence]")).to_be_visible()
        await phone.page.locator("[data-f=alarms-ended]").tap()  # 2
        answer(canned, await received(canned, 3))
        await critical.locator("[data-do=acknowledge]").tap()  # 3
        answer(canned, await received(canned, 4))
        these = phone.page.locator("[data-f=alarms-these]")
        await expect(these).to_have_text("Acknowledge these 3")
        await expect(these).to_be_enabled()
        await these.tap()  # 4
        names = await received(canned, 7)
        assert sorted(names) == sorted(one["id"] for one in seven()), "each once"
        answer(canned, names)
        await expect(phone.f("alarms-count")).to_have_text("all acknowledged")
        await expect(phone.f("strip")).to_have_attribute("data-known", "")
        await phone.page.keyboard.press("Escape")


@pytest.mark.world(n=18)
async def test_a_list_longer_than_the_screen_is_turned_and_no_row_is_sliced(phone: Phone, canned: Canned) -> None:
    canned.state["alarms"] = seven()
    await phone.page.set_viewport_size({"width": 320, "height": 640})
    await phone.open(canned.address)
    await phone.live()
    await expect(phone.page.locator(".ledge")).to_be_attached()  # it comes last, and takes room
    await phone.f("strip").press("Enter")
    rows = phone.page.locator("[data-f=alarms] li:not([hidden])")
    whole = """() => {
      const list = document.querySelector('ul[data-f=alarms]'), end = list.getBoundingClientRect().bottom;
      const parts = [...list.querySelectorAll('li:not([hidden]) :is(button, .t, .h, .s)')];
      return list.scrollHeight <= list.clientHeight + 1 && parts.every((one) => {
        const {left, right, bottom, height} = one.getBoundingClientRect();
        const least = one.matches('.key') ? 48 : one.matches('button') ? 44 : 0;
        return left >= 0 && right <= innerWidth && bottom <= end && height >= least;
      });
    }"""
    seen: list[str] = []
    for width in (320, 360, 412):
        await phone.page.set_viewport_size({"width": width, "height": 640})
        await phone.page.evaluate(DRAWN)
        await phone.page.wait_for_timeout(500)  # the next two states lay the pages anew
        while await phone.page.locator("[data-f=before][aria-disabled]").count() == 0:
            await phone.page.locator("[data-f=before]").press("Enter")
        seen = []
        while True:
            assert await phone.page.evaluate(whole), width
            seen += await rows.locator(".t").all_text_contents()
            if await phone.page.locator("[data-f=after][aria-disabled]").count():
                break
            await phone.page.locator("[data-f=after]").tap()
        assert seen == [
            "Speed above limit",
            "Warning 0",
            "Warning 1",
            "Component warns",
            "Returned 0",
            "Returned 1",
            "Returned 2",
        ]
        await expect(phone.f("pages")).to_contain_text("of 7")
    await phone.page.locator('[data-tab="scan"]').tap()  # the tabs stay in sight, and lead out of it
    await expect(phone.page.locator("ul[data-f=alarms]")).to_have_count(0)
    await expect(phone.page.locator('[data-tab="scan"]')).to_have_attribute("aria-selected", "true")


@pytest.mark.gate
@pytest.mark.own_phone
async def test_the_list_fetches_the_style_of_a_narrow_phone_that_failed_to_load(phone: Phone, canned: Canned) -> None:
    page = phone.page
    canned.state["alarms"] = seven()
    refused = asyncio.Event()

    async def refuse(route: Route) -> None:
        await route.abort()
        refused.set()

    await page.route("**/drawers*.css*", refuse)
    await page.set_viewport_size({"width": 320, "height": 640})
    await phone.open(canned.address)
    await phone.live()
    await refused.wait()
    await expect(page.locator("link[href*='drawers']")).to_have_count(0)
    await page.unroute("**/drawers*.css*")
    await phone.f("strip").tap()
    await expect(page.locator(".alarms-head h2")).to_have_css("font-size", "17px")
    phone.complaints.clear()  # of what was refused


@pytest.mark.gate
@pytest.mark.world(n=18)
async def test_silence_takes_the_sound_of_one_alarm_and_says_by_whom(phone: Phone, canned: Canned) -> None:
    canned.state["alarms"] = [alarm("warn", "Laser silent", place="list", occurrence=3)]
    await phone.open(canned.address)
    await phone.live()
    await phone.f("strip").tap()
    row = phone.page.locator("[data-f=alarms] li")
    await row.locator("[data-do=silence]").press("Enter")
    assert await received(canned, 1, "silence") == ["warn"]
    assert [one["occurrence"] for one in canned.received if one["kind"] == "silence"] == [3]
    canned.state["alarms"][0] |= {"silenced_until_ms": 45_000, "silenced_by": "Desk 1"}
    await expect(row.locator(".quiet")).to_contain_text("by Desk 1")
    await expect(row).to_contain_text("unacknowledged")
    await expect(row.locator("[data-do=silence]")).to_have_count(0)
    await expect(row.locator("[data-do=acknowledge]")).to_be_visible()


@pytest.mark.gate
@pytest.mark.world(n=18)
async def test_what_has_returned_is_acknowledged_with_one_tap_behind_the_strip(phone: Phone, returned: Canned) -> None:
    await phone.open(returned.address)
    await phone.live()
    strip = phone.f("strip")
    await expect(strip).to_have_text("Connection lost: ended1 of 4")  # acknowledged is the one that is active
    await expect(phone.page.locator(".frame")).to_have_attribute("data-mode", "none")
    box = await strip.bounding_box()
    assert box
    await phone.page.touchscreen.tap(box["x"] + 200, box["y"] + box["height"] + 12)  # the target is 56 px high
    rows = phone.page.locator("[data-f=alarms] li")
    await expect(rows).to_have_count(4)
    await expect(rows.nth(0)).to_contain_text("Connection lost")
    await expect(rows.nth(0)).to_contain_text("ended, unacknowledged")
    await expect(rows.nth(2)).to_contain_text("acknowledged by Ann")
    await expect(rows.nth(3)).to_contain_text("cause: Most signals are slow")
    await rows.nth(1).locator("[data-do=acknowledge]").tap()
    await received(returned, 1)
    assert acknowledged(returned) == [("gps_jump", 4)]
    returned.state["alarms"] = returned.state["alarms"][:1]
    await expect(rows).to_have_count(2)
    await expect(strip).to_have_text("Connection lost: ended1 of 2")
    await expect(strip).to_have_attribute("data-returned", "")
    ended = phone.page.locator("[data-f=alarms-ended]")
    await expect(ended).to_have_text("Acknowledge all that ended (1)")
    await ended.tap()
    await received(returned, 2)
    assert acknowledged(returned)[1:] == [("link_lost", 1)]
    returned.state["alarms"] = []
    await expect(strip).to_contain_text("No alarms")
    await expect(ended).to_be_disabled()
    assert await phone.page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.gate
@pytest.mark.world(n=18)
async def test_a_viewer_sees_the_list_without_keys(phone: Phone, returned: Canned) -> None:
    returned.role = "viewer"
    await phone.open(returned.address)
    await phone.live()
    await phone.f("strip").tap()
    await expect(phone.page.locator("[data-f=alarms] li")).to_have_count(4)
    await expect(phone.page.locator("[data-f=alarms] [data-do]")).to_have_count(0)
    await expect(phone.page.locator("[data-f=alarms-note]")).to_have_text("A viewer cannot acknowledge.")


@pytest.mark.gate
@pytest.mark.world(n=18)
async def test_a_warning_lies_over_the_tabs_and_never_over_the_list_of_alarms(phone: Phone, returned: Canned) -> None:
    returned.state["alarms"] = [
        alarm("signal_stale", "Laser silent", actions=["shelve", "acknowledge"]),
        alarm("moving", "Component warns", priority="advisory", place="list"),
    ]
    await phone.open(returned.address)
    await phone.live()
    snackbar = phone.page.locator("[data-f=warning]")
    await expect(snackbar).to_contain_text("Shelve")
    returned.state["alarms"][0] |= {**RETURNED, "place": "snackbar"}
    await expect(snackbar).to_contain_text("Returned to normal")
    await expect(snackbar.get_by_text("Shelve")).to_be_hidden()  # as in the list: what has returned is acknowledged
    await expect(phone.f("strip")).to_have_text("Laser silent: ended1 of 3")
    await phone.f("strip").tap()
    await expect(phone.page.locator("[data-f=alarms] li")).to_have_count(3)  # and the suppressed one
    await expect(snackbar).to_be_hidden()
    await phone.f("close").tap()
    await expect(snackbar).to_be_visible()


@pytest.mark.gate
@pytest.mark.world(n=17)
async def test_the_empty_list_of_a_paused_car_does_not_say_that_there_are_no_alarms(
    phone: Phone, returned: Canned
) -> None:
    returned.state["alarms"] = []
    await phone.open(returned.address)
    await phone.f("strip").tap()
    none = phone.page.locator("[data-f=alarms-none]")
    await expect(none).to_have_text("No alarms.")
    returned.state["session"] |= {"paused": True, "paused_for_s": 42.1}
    await expect(none).to_have_text("Monitoring is paused: no alarm can be raised.")
    note = phone.page.locator("[data-f=alarms-note]")
    await expect(note).to_have_text("Paused: the alarms of the car are suppressed until Resume.")
    returned.state["suppressed"] = []
    await expect(none).to_be_visible()
    await expect(note).to_be_empty()  # that it is paused is read once


@pytest.mark.gate
async def test_a_quiet_list_says_what_was_lately_and_makes_way_for_what_waits(phone: Phone, canned: Canned) -> None:
    at_ms = 1_778_076_238_000
    common = {"alarm": "not_moving", "title": "Car not moving", "text": "", "occurrence": 1, "priority": "advisory"}
    canned.log = [
        {"n": 117, "at_ms": at_ms, "change": "cleared"} | common,
        {"n": 116, "at_ms": at_ms - 9000, "change": "raised"} | common,
    ]
    canned.state["alarm_load"] |= {"in_10_min": 2}
    await phone.open(canned.address)
    await phone.live()
    await phone.f("strip").tap()
    lately = phone.f("alarms-lately")
    await expect(lately).to_have_text(re.compile(r"^Last: Car not moving, ended \d\d:03:58. In 10 min: 2 alarms.$"))
    if folder := os.environ.get("CATGRAPH_LOOK"):
        await phone.page.screenshot(path=f"{folder}/lately.png")
    canned.state["alarms"] = [alarm("gps_jump", "GPS runs away", **RETURNED)]
    await expect(lately).to_be_hidden()
    canned.state["alarms"] = []
    await expect(lately).to_be_visible()
    canned.silent = True
    await expect(lately).to_be_hidden()


@pytest.mark.gate
async def test_an_alarm_of_another_version_is_a_dialog_with_its_words(phone: Phone, canned: Canned) -> None:
    """As an agent with a newer version sends it: with an id, a priority, a place and a sound that no page knows."""
    about = {"text": "rear left", "trip_text": "rear left"}
    canned.state["alarms"] = [
        alarm("wheel_lost", "Wheel lost", priority="extreme", place="ceiling", sound="siren", **about)
    ]
    await phone.open(canned.address)
    await phone.live()
    sheet = phone.page.locator("#sheet-alarm")
    await expect(sheet).to_have_attribute("data-priority", "critical")
    await expect(sheet).to_contain_text("Wheel lost")
    await expect(phone.page.locator(".frame")).to_have_attribute("data-mode", "asking")
    await expect(phone.f("strip")).to_contain_text("Wheel lost")
    await phone.f("acknowledge", "#sheet-alarm").tap()
    assert await received(canned, 1) == ["wheel_lost"]
    canned.state["alarms"][0] |= {"state": "ACKED", "place": "list"}
    await expect(sheet).to_be_hidden()
    await phone.f("strip").tap()
    row = phone.page.locator("[data-f=alarms] li", has_text="Wheel lost")
    await expect(row).to_have_attribute("data-priority", "critical")
    await expect(row).to_contain_text("rear left")
