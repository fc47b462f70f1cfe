"""The questions to the operator in control: card, sheet, the line that stays; and the sheet Signals."""

from __future__ import annotations

import re
from typing import Any

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned, alarm
from tests.page.canned_questions import FRONT, NOT_CHOSEN, REAR, brake_unit, laser_offers, two_lasers
from tests.page.conftest import Phone

pytestmark = pytest.mark.gate
OVERLAP = """([a, b]) => {
    const [one, other] = [a, b].map((it) => document.querySelector(it).getBoundingClientRect());
    return Math.min(one.right, other.right) > Math.max(one.left, other.left)
        && Math.min(one.bottom, other.bottom) > Math.max(one.top, other.top);
}"""
CARD = ".questions .card"


def ask(canned: Canned, *questions: dict[str, Any]) -> None:
    """The canned car has these questions."""
    canned.state["questions"] = list(questions)
    canned.candidates = {"scan": laser_offers()}
    for one in questions:
        canned.state["signals"][one["signal"]] |= NOT_CHOSEN


def sent(canned: Canned) -> list[dict[str, Any]]:
    """The changes of settings that the page has sent."""
    return [one for one in canned.received if one["kind"] == "set"]


async def home(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#home")
    await phone.live()


async def test_two_lasers_are_answered_in_two_taps(phone: Phone, canned: Canned) -> None:
    ask(canned, two_lasers())
    await home(phone, canned)
    card = phone.page.locator(CARD)
    await expect(card).to_contain_text("Two lasers: which one faces forward?")
    await phone.f("question-open").tap()
    sheet = phone.page.locator("#sheet-question[open]")
    await expect(sheet.locator("h2")).to_have_text("Two lasers: which one faces forward?")
    option = sheet.locator(f'[data-value="{FRONT}"]')
    await expect(option).to_contain_text("frame front_laser")
    await option.tap()
    await expect(sheet).to_have_count(0)
    assert [(one.get("topics"), one.get("units")) for one in sent(canned)] == [({"scan": FRONT}, None)]
    assert "version" in sent(canned)[0]
    canned.state["questions"] = []
    await expect(card).to_be_hidden()


async def test_each_laser_is_drawn_and_drawn_again(phone: Phone, canned: Canned) -> None:
    ask(canned, two_lasers())
    await home(phone, canned)
    await phone.f("question-open").tap()
    sketch = phone.page.locator(f'#sheet-question [data-value="{FRONT}"] .sketch .points')
    await expect(sketch).to_have_attribute("d", re.compile(r"^M.*h0$"))
    assert await phone.page.locator("#sheet-question .sketch").count() == 2
    first = str(await sketch.get_attribute("d"))
    offers = laser_offers()
    offers[0]["ranges_m"] = [4.0] * 72
    canned.candidates = {"scan": offers}
    await expect(sketch).not_to_have_attribute("d", first)
    offers[1].pop("angle_min_rad")  # what cannot be drawn has no drawing
    canned.candidates = {"scan": offers}
    await expect(phone.page.locator(f'#sheet-question [data-value="{REAR}"] .sketch')).to_be_hidden()


async def test_later_leaves_a_line_that_stays_and_opens_it_again(phone: Phone, canned: Canned) -> None:
    ask(canned, two_lasers())
    await home(phone, canned)
    await phone.f("question-later").tap()
    card, line = phone.page.locator(CARD), phone.f("question-waiting")
    await expect(card).to_be_hidden()
    await expect(line).to_have_text("Not chosen: Laser")
    await home(phone, canned)  # the page is opened again
    await expect(line).to_be_visible()
    await expect(card).to_be_hidden()
    canned.state["questions"][0]["options"].append({"value": "/third/scan", "label": "/third/scan", "why": ""})
    await line.tap()
    await phone.page.locator('#sheet-question [data-value="/third/scan"]').tap()
    await expect(phone.page.locator("#sheet-question")).to_have_count(0)
    assert sent(canned)[-1]["topics"] == {"scan": "/third/scan"}
    assert sent(canned) == [one for one in sent(canned) if one["topics"]]  # to put it off sends nothing


async def test_a_unit_is_chosen_and_a_refusal_is_told(phone: Phone, canned: Canned) -> None:
    ask(canned, brake_unit())
    canned.refuses["set"] = "The settings were changed by somebody else."
    await home(phone, canned)
    await expect(phone.f("brake")).to_have_text("unit unknown")
    await phone.f("question-open").tap()
    share = phone.page.locator('#sheet-question [data-value="share"]')
    await share.tap()
    await expect(phone.page.locator("#sheet-question .bad")).to_contain_text("changed by somebody else")
    canned.refuses.clear()
    await share.tap()
    await expect(phone.page.locator("#sheet-question")).to_have_count(0)
    assert sent(canned)[-1]["units"] == {"brake": "share"}
    assert "topics" not in sent(canned)[-1]


async def test_who_is_not_in_control_reads_the_question_and_cannot_answer(phone: Phone, canned: Canned) -> None:
    ask(canned, two_lasers())
    canned.state["control"] = {"holder": "Pixel 8", "page": "another", "fence": 1}
    await home(phone, canned)
    await expect(phone.f("question-others")).to_have_text(
        "Two lasers: which one faces forward? The operator in control answers."
    )
    await expect(phone.page.locator(CARD)).to_be_hidden()
    canned.state["control"] = {"holder": "You"}
    await expect(phone.page.locator(CARD)).to_be_visible()
    await expect(phone.f("question-others")).to_be_hidden()
    await phone.f("question-open").tap()
    await expect(phone.page.locator("#sheet-question[open]")).to_be_visible()
    canned.state["control"] = {"holder": "Pixel 8", "page": "another", "fence": 2}
    await expect(phone.page.locator("#sheet-question")).to_have_count(0)


@pytest.mark.parametrize("size", [(360, 740), (412, 915), (820, 1180), (1440, 900)])
async def test_the_card_covers_nothing_and_an_alarm_goes_first(
    phone: Phone, canned: Canned, size: tuple[int, int]
) -> None:
    await phone.page.set_viewport_size({"width": size[0], "height": size[1]})
    ask(canned, two_lasers(), brake_unit())
    canned.state["alarms"] = [alarm("gps_drift", "GPS drift at standstill", text="6.3 m, 2.0 m are allowed")]
    await home(phone, canned)
    await expect(phone.page.locator(CARD)).to_be_visible()
    for other in (".strip", "#monitor > .top", "#monitor .view", "#monitor > .rail", ".snacks", ".rail .slide"):
        assert not await phone.page.evaluate(OVERLAP, [CARD, other]), other
    for key in ("question-open", "question-later"):
        box = await phone.f(key).bounding_box()
        assert box is not None
        assert box["height"] >= 48
    assert await phone.page.evaluate("document.documentElement.scrollWidth <= innerWidth")
    canned.state["alarms"] = [
        alarm("obstacle", "Obstacle ahead", priority="critical", place="dialog", sound="high", needs_ack=True)
    ]
    await expect(phone.page.locator("#sheet-alarm[open]")).to_be_visible()
    await expect(phone.page.locator(CARD)).to_be_hidden()


async def test_what_is_not_chosen_says_so_on_home_scan_and_signals(phone: Phone, canned: Canned) -> None:
    question = two_lasers()
    ask(canned, question, question | {"signal": "speed"}, question | {"signal": "distance"})
    await home(phone, canned)
    await expect(phone.page.locator(".gauge .note")).to_have_text("not chosen")
    await expect(phone.page.locator(".near [data-f=none]")).to_have_text("not chosen")
    await phone.show("scan")
    await expect(phone.f("none-words", "#panel-scan")).to_have_text("laser not chosen")
    await phone.f("none-words", "#panel-scan").tap()  # what stands behind it
    row = phone.page.locator('.sigs .sig[aria-expanded="true"]')
    await expect(row).to_contain_text("Laser")
    await expect(row).to_contain_text("not chosen")


async def test_the_age_of_a_value_leads_to_its_source_and_to_what_else_there_is(phone: Phone, canned: Canned) -> None:
    offers = [
        {"topic": "/catvehicle/nearest distance", "type": "std_msgs/Float64"},
        {"topic": "/rear/distance", "type": "std_msgs/Float64", "frame": "rear", "why": "no publisher"},
    ]
    canned.candidates = {"distance": offers}
    canned.state["signals"]["distance"] |= {"why": "its name and type", "frame": "front_bumper"}
    await home(phone, canned)
    await phone.f("age", '[data-part="nearest"]').tap()
    more = phone.page.locator(".sig-more:not([hidden])")
    for text in ("its name and type", "front_bumper", "/rear/distance", "no publisher"):
        await expect(more).to_contain_text(text)
    assert (await more.inner_text()).count("/catvehicle/nearest distance") == 1  # it is no other
    await more.get_by_role("button", name="Choose another topic").tap()
    await phone.page.locator("#sheet-topic button", has_text="/rear/distance").tap()
    await expect(phone.page.locator("#sheet-topic[open]")).to_have_count(0)
    assert sent(canned)[-1]["topics"] == {"distance": "/rear/distance"}


async def test_the_unit_of_a_signal_is_picked_in_signals(phone: Phone, canned: Canned) -> None:
    canned.settings = {"units": {"brake": "share"}}
    await phone.open(f"{canned.address}/#settings")
    await phone.live()
    await phone.f("open-signals").tap()
    await phone.page.locator(".sigs .sig", has_text="Brake").tap()
    units = phone.page.locator(".sig-more:not([hidden]) .unit-keys")
    await expect(units.locator('[aria-pressed="true"]')).to_have_text("0 to 1")
    await units.get_by_role("button", name="0 to 100 %").tap()
    await phone.drawn()
    await units.get_by_role("button", name="as found").tap()
    await phone.drawn()
    assert [one["units"] for one in sent(canned)] == [{"brake": "percent"}, {"brake": None}]
    await phone.page.locator(".sigs .sig", has_text="Brake").tap()
    await phone.page.locator(".sigs .sig", has_text="Laser").tap()
    await expect(units).to_have_count(0)  # it has no choice of units


@pytest.mark.parametrize(
    ("text", "setting", "title"),
    [
        ("assumed to look ahead: no transforms, and no setting", "mounting.yaw_deg", "Laser turned to the left"),
        ("gap from the laser: no bumper set", "obstacle.bumper_ahead_m", "Front bumper ahead of the rear axle"),
    ],
)
async def test_a_note_on_the_mounting_stands_on_scan_and_leads_to_its_settings(
    phone: Phone, canned: Canned, text: str, setting: str, title: str
) -> None:
    canned.state["signals"]["scan"]["note"] = text
    canned.settings = {"schema": {setting: FIELD | {"title": title}}, "values": {setting: 0.0}, "defaults": {}}
    await phone.open(f"{canned.address}/#scan")
    await phone.live()
    note = phone.f("note", "#panel-scan")
    await expect(note).to_contain_text(text)
    await expect(note).to_be_in_viewport(ratio=1)
    await note.tap()
    await expect(phone.page.locator("#tab-settings")).to_have_attribute("aria-selected", "true")
    await expect(phone.page.locator(f'[data-setting="{setting}"]')).to_be_visible()
    canned.state["signals"]["scan"]["note"] = None
    await phone.page.locator("#tab-scan").tap()
    await expect(note).to_be_hidden()


@pytest.mark.parametrize("size", [(820, 1080), (1440, 900)])
async def test_on_a_wide_screen_keys_scale_and_note_cover_one_another_nowhere(
    phone: Phone, canned: Canned, size: tuple[int, int]
) -> None:
    await phone.page.set_viewport_size({"width": size[0], "height": size[1]})
    canned.state["signals"]["scan"]["note"] = "assumed to look ahead: no transforms, and no setting"
    canned.state["signals"]["distance"] |= {"value": None, "age_s": None, "freshness": "not_measured"}
    await home(phone, canned)
    await expect(phone.page.locator(".mapv .sc")).to_be_attached()
    await expect(phone.f("note", "#panel-scan")).to_be_visible()
    await phone.drawn()
    for one, other in ((".mapv .sc", ".fabs"), (".scan-note", '[data-panel="scan"] .zoom'), (".compass", ".mapv .sc")):
        assert not await phone.page.evaluate(OVERLAP, [one, other]), one
    trend = '.trends-pane[data-signal="distance"] .v' if size[0] == 1440 else '[data-trend="distance"] .row .n'
    await expect(phone.page.locator(trend)).to_have_text("–")
    await phone.f("note", "#panel-scan").click()
    await expect(phone.page.locator("#tab-settings")).to_have_attribute("aria-selected", "true")


FIELD = {
    "title": "Laser turned to the left", "heading": "Vehicle", "unit": "°", "default": 0.0, "minimum": -180.0,
    "maximum": 180.0, "step": 0.5,
}  # fmt: skip
