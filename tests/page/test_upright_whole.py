"""Upright phones: rows are whole or more is announced, texts are whole, and each value is shown once."""

from __future__ import annotations

import pytest
from playwright.async_api import Page, expect

from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.screenshots import COMPLETE, show
from tests.page.test_upright import boxes
from tests.page.test_upright import shown as shown_in_its_font

STYLED = """() => document.querySelector("link[href*='drawers']")?.sheet"""
TAG = "(of) => getComputedStyle(of, '::after').visibility"


async def shown(phone: Phone, canned: Canned, scene: str, width: int, height: int) -> Page:
    await phone.page.set_viewport_size({"width": width, "height": height})
    await show(canned, phone.page, scene)
    await phone.page.wait_for_function(COMPLETE)
    return phone.page


@pytest.mark.parametrize(
    ("scene", "what"),
    [
        ("cars", "#sheet-cars .cars"),
        ("settings", "#panel-settings"),
        ("map-stale", "#panel-map"),
        ("check-change", ".check-body"),
        ("fleet-asked", "#fleet .floor"),
        ("fleet-hundred", "#fleet .floor"),
    ],
)
async def test_of_a_list_that_goes_on_it_is_said_until_its_end(
    phone: Phone, canned: Canned, scene: str, what: str
) -> None:
    page = await shown(phone, canned, scene, 360, 740)
    if "fleet" not in scene:
        await page.wait_for_function(STYLED)
    rows = page.locator(what)
    await rows.evaluate("(rows) => rows.scrollTo(0, 0)")
    assert await rows.evaluate("(rows) => rows.scrollHeight - rows.clientHeight") > 8
    await expect(rows).to_be_visible()
    wait = f"([what, is]) => ({TAG})(document.querySelector(what)) === is"
    await page.wait_for_function(wait, arg=[what, "visible"])
    await rows.evaluate("(rows) => rows.scrollTo(0, rows.scrollHeight)")
    await page.wait_for_function(wait, arg=[what, "hidden"])


async def test_over_a_sheet_stands_the_gauge_though_home_was_scrolled(phone: Phone, canned: Canned) -> None:
    page = await shown(phone, canned, "home", 412, 915)
    await page.wait_for_function(STYLED)
    home = page.locator("#panel-home")
    for meanwhile_px, after_px in ((0, 240), (60, 60)):
        await home.evaluate("(home) => home.scrollTo(0, 240)")
        await page.locator("#monitor > .rail [data-f=stop]").tap()
        await expect(page.locator("#sheet-stop > .sheet-head")).to_be_visible()
        await page.wait_for_function("() => document.querySelector('#panel-home').scrollTop === 0")
        await expect(page.locator("#panel-home .gauge")).to_be_in_viewport(ratio=0.9)
        await home.evaluate("(home, at) => home.scrollTo(0, at)", meanwhile_px)
        await page.locator("#sheet-stop [data-f=no]").tap()
        await expect(page.locator("#sheet-stop")).to_be_hidden()
        await page.wait_for_function("(at) => document.querySelector('#panel-home').scrollTop === at", arg=after_px)


@pytest.mark.parametrize("scene", ["planned-stop-returned", "home-warning"])
async def test_over_a_notice_the_nearest_object_is_named_and_reads_as_on_home(
    phone: Phone, canned: Canned, scene: str
) -> None:
    page = await shown_in_its_font(phone, canned, scene, 360, 740)
    # The longest values stand in the same line.
    canned.state["signals"]["distance"]["value"]["distance_m"] = 72.4
    canned.state["nearest"] = {"time_gap_s": 17.2, "stopping_m": 17.1}
    await expect(page.locator("#panel-home [data-f=gap]")).to_have_text("17.2")
    name, *values, view, gauge = await boxes(
        page, *(f"#panel-home {one}" for one in (".head > span", "[data-f=distance-part]", "[data-f=bearing-part]",
                                                 "[data-f=gap-part]", "[data-f=stops]")),
        "#monitor > .view", "#panel-home .gauge",
    )  # fmt: skip
    assert name["x"] == values[0]["x"] == 16
    assert name["y"] >= gauge["y"] + gauge["height"] - 1
    assert [one["x"] for one in values] == sorted(one["x"] for one in values)
    assert values[-1]["x"] + values[-1]["width"] <= 344.5
    for one in values:
        assert one["y"] >= name["y"] + name["height"] - 1
        assert one["y"] + one["height"] <= view["y"] + view["height"] + 0.5
    assert gauge["width"] > 280


@pytest.mark.parametrize("width", [320, 344])
async def test_what_is_to_be_done_is_whole_in_the_strip(phone: Phone, canned: Canned, width: int) -> None:
    page = await shown(phone, canned, "slow-down-not-confirmed-warned", width, 568)
    text = page.locator("#monitor > .strip > [data-f=strip-text]")
    await expect(text).to_have_text("NOT CONFIRMED – use the physical stop")
    await page.wait_for_function(
        "() => { const text = document.querySelector('#monitor > .strip > [data-f=strip-text]');"
        " return text.scrollWidth <= text.clientWidth && text.scrollHeight <= text.clientHeight + 1 }"
    )
    strip, line = await boxes(page, "#monitor > .strip", "#monitor > .strip > [data-f=strip-text]")
    assert line["y"] >= strip["y"]
    assert line["y"] + line["height"] <= strip["y"] + strip["height"]


@pytest.mark.parametrize("hand", ["right", "left"])
async def test_the_slide_has_two_lines_at_most(phone: Phone, canned: Canned, hand: str) -> None:
    page = await shown(phone, canned, "slow-down-armed", 412, 915)
    await page.evaluate("(hand) => document.documentElement.dataset.hand = hand", hand)
    await page.wait_for_function(
        "() => { const text = document.querySelector('#monitor > .rail .slide .tx');"
        " return text.offsetHeight <= 2.2 * parseFloat(getComputedStyle(text).lineHeight) }"
    )


async def test_a_topic_keeps_clear_of_the_edge_of_the_slide(phone: Phone, canned: Canned) -> None:
    page = await shown(phone, canned, "home", 412, 915)
    await page.wait_for_function(
        "() => { const slide = document.querySelector('#monitor > .rail .slide');"
        " return slide.textContent.includes('/catvehicle/cmd_vel')"
        " && slide.querySelector('.tx').getBoundingClientRect().right <= slide.getBoundingClientRect().right - 8 }"
    )


async def test_the_bar_of_the_steering_is_whole_or_absent(phone: Phone, canned: Canned) -> None:
    for height in (740, 764, 780):
        page = await shown(phone, canned, "home", 360, height)
        await page.wait_for_function(STYLED)
        await expect(page.locator(".ledge > .mark-key")).to_be_attached()
        await page.wait_for_function(
            "() => { const bar = document.querySelector('#panel-home .sbar').getBoundingClientRect();"
            " return bar.height === 0"
            " || bar.bottom <= document.querySelector('#monitor > .view').getBoundingClientRect().bottom + 0.5 }"
        )
    await expect(page.locator("#panel-home .sbar").first).to_be_visible()


async def test_above_a_limit_that_is_changed_no_piece_of_the_chart_stands(phone: Phone, canned: Canned) -> None:
    page = await shown(phone, canned, "check-change", 360, 740)
    body, chart, section = await boxes(page, ".check-body", ".check-body .minute", ".check-body .check-thresholds")
    assert chart["y"] + chart["height"] <= body["y"]
    assert abs(section["y"] - body["y"]) <= 1


async def test_the_track_passes_beneath_the_scale(phone: Phone, canned: Canned) -> None:
    page = await shown(phone, canned, "map", 412, 915)
    await page.locator(".mapv .scg").wait_for(state="attached")
    ground, text, bar = await boxes(page, ".mapv .scg", ".mapv .sc + text", ".mapv .sc")
    for one in (text, bar):
        assert ground["x"] <= one["x"]
        assert ground["y"] <= one["y"]
        assert one["x"] + one["width"] <= ground["x"] + ground["width"]
        assert one["y"] + one["height"] <= ground["y"] + ground["height"]
    order = "[...document.querySelector('.mapv:has(.scg)').children].map((one) => one.getAttribute('class'))"
    drawn = await page.evaluate(order)
    assert drawn.index("tr tail") < drawn.index("scg") < drawn.index("car-mark") < drawn.index("sc")
