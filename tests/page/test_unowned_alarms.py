"""A person who signs on is shown the alarms that people who are off duty left acknowledged, and takes them over."""

from __future__ import annotations

import re
from typing import Any

import pytest
from playwright.async_api import expect

from tests.page.barriers import no_barrier
from tests.page.canned import Canned, alarm
from tests.page.conftest import Phone
from tests.page.test_parts import opened, until_sent

pytestmark = pytest.mark.gate
OFF_MS = 1_790_000_000_000
ME: dict[str, Any] = {
    "person": "mr", "name": "M. R.", "role": "operator", "title": "operator", "device": "Pixel 7", "since_ms": OFF_MS,
}  # fmt: skip
DUTY: dict[str, Any] = {
    "kind": "duty", "me": ME, "signs": "M. R. (Pixel 7)", "ended": None, "people": 2, "on_duty": [ME],
}  # fmt: skip


def left(name: str, title: str, **more: Any) -> dict[str, Any]:
    """An acknowledged alarm whose owner is off duty."""
    owner = {"state": "ACKED", "acknowledged_by": "A. K. (Desk)", "off_duty_ms": OFF_MS}
    return alarm(name, title, text="6.3 m, 2.0 m are allowed", **owner | more)


async def test_who_signs_on_takes_over_what_is_left(phone: Phone, canned: Canned) -> None:
    canned.duty = DUTY
    gps, fuel = left("gps_drift", "GPS drift"), left("fuel", "Fuel low")
    canned.state["alarms"] = [gps, fuel]
    await opened(phone, canned)
    sheet = phone.page.locator("#sheet-left")
    await expect(sheet).to_contain_text("0 of 2 taken over")
    await expect(sheet.locator("li").first).to_contain_text("Acknowledged by A. K. (Desk), off duty since")
    await no_barrier(phone.page, "alarms without an owner", "#sheet-left")
    done = sheet.locator("[data-f=left-done]")
    await expect(done).to_have_text("Later")
    for name, one in (("GPS drift", gps), ("Fuel low", fuel)):
        key = sheet.get_by_role("button", name=f"Take over: {name}")
        await expect(key).to_have_text("Take")
        await expect(sheet.locator("ul")).not_to_have_attribute("data-moved", re.compile(""))
        canned.received.clear()
        await key.tap()
        command = await until_sent(canned, "take_alarm")
        assert (command["alarm"], command["occurrence"], command["vehicle"]) == (one["id"], 1, "car")
        one |= {"acknowledged_by": "M. R. (Pixel 7)", "off_duty_ms": None}
        await expect(key).to_have_attribute("aria-pressed", "true")
    await expect(done).to_have_text("Done")
    await done.tap()
    await expect(sheet).to_have_count(0)


async def test_what_nobody_took_stands_in_the_list_with_its_key(phone: Phone, canned: Canned) -> None:
    canned.duty = DUTY | {"me": None, "people": 0}
    canned.state["alarms"] = [left("gps_drift", "GPS drift")]
    await opened(phone, canned)
    await expect(phone.page.locator("#sheet-left")).to_have_count(0)  # nobody has signed on
    await phone.f("strip").tap()
    row = phone.page.locator("[data-f=alarms] > li")
    await expect(row).to_contain_text("acknowledged by A. K. (Desk), off duty since")
    await expect(phone.f("alarms-count")).to_have_text("1 without an owner on duty")
    await row.get_by_role("button", name="Take over: GPS drift").tap()
    await until_sent(canned, "take_alarm")


async def test_it_opens_also_where_the_car_knows_of_the_end_of_the_duty_a_moment_later(
    phone: Phone, canned: Canned
) -> None:
    canned.duty = DUTY
    gps = left("gps_drift", "GPS drift", off_duty_ms=None)
    canned.state["alarms"] = [gps]
    await opened(phone, canned)
    await phone.drawn()
    gps |= {"off_duty_ms": OFF_MS}
    await expect(phone.page.locator("#sheet-left")).to_contain_text("0 of 1 taken over")


async def test_a_gap_of_the_server_closes_it_and_it_comes_back(phone: Phone, canned: Canned) -> None:
    canned.duty = DUTY
    canned.state["alarms"] = [left("gps_drift", "GPS drift")]
    await opened(phone, canned)
    sheet = phone.page.locator("#sheet-left")
    await expect(sheet).to_contain_text("0 of 1 taken over")
    canned.silent = True
    await expect(sheet).to_have_count(0)
    canned.silent = False
    await expect(sheet).to_contain_text("0 of 1 taken over")


async def test_its_row_is_read_whole_beside_its_two_keys(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 360, "height": 740})
    canned.state["alarms"] = [left("gps_drift", "GPS drift at standstill")]
    await opened(phone, canned)
    await phone.f("strip").tap()
    row = phone.page.locator("[data-f=alarms] > li")
    await expect(row.locator(".ac .key")).to_have_text(["Shelve", "Take over"])
    text, keys = await row.locator(".tx").bounding_box(), await row.locator(".ac").bounding_box()
    assert text is not None
    assert keys is not None
    assert text["width"] >= 150, "the text of one column"
    assert text["x"] + text["width"] <= keys["x"]


async def test_a_low_phone_shows_people_to_choose_among(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 360, "height": 740})
    canned.duty = DUTY | {"me": None}
    await opened(phone, canned)
    sheet = phone.page.locator("#sheet-duty")
    await sheet.locator("[data-person]").first.tap()
    await expect(sheet.locator(".roles button")).to_have_count(4)
    rows, body = sheet.locator("[data-person]"), await sheet.locator(".duty-body").bounding_box()
    second = await rows.nth(1).bounding_box()
    assert body is not None
    assert second is not None
    assert second["y"] + second["height"] <= body["y"] + body["height"] + 1, "two rows are whole"
