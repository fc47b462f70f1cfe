"""Narrow phones: nothing of bar, strip, steps or slide is cut off."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned, Json, alarm, live, slow, slowed
from tests.page.conftest import Phone
from tests.page.screenshots import at_a_planned_stop, car, too_fast

# What is wider or higher than its own room.
CUT = """(names) => names.filter((name) => [...document.querySelectorAll(name)].some((one) => one.offsetParent
  && (one.scrollWidth > one.clientWidth + 1 || one.scrollHeight > one.clientHeight + 1)))"""
# Of neighbours in a row, those whose edges cross.
CROSSING = """(name) => { const edges = [...document.querySelectorAll(name)].map((one) => {
  const range = document.createRange(); range.selectNodeContents(one); return range.getBoundingClientRect(); });
  return edges.slice(1).filter((one, n) => one.left < edges[n].right - 0.5).length; }"""
OUTSIDE = """(name) => [...document.querySelectorAll(name)].filter((one) => {
  const range = document.createRange(); range.selectNodeContents(one);
  return range.getBoundingClientRect().right > innerWidth; }).length"""


def standing(stands: str) -> Json:
    state = live() | {"decelerate": slowed(None, stands=stands, ordered_mps=0.0)}
    state["signals"]["speed"]["value"]["speed_mps"] = 0.0
    return state


async def test_the_bar_shows_the_age_the_recording_and_who_is_in_control_side_by_side(
    phone: Phone, canned: Canned
) -> None:
    await phone.open(canned.address)
    await phone.live()
    for holder in ("You", None, "Pixel 7 · ab12"):
        canned.state = live() | {"control": {"holder": holder}}
        await expect(phone.f("who-name")).to_have_text(holder or "No one")
        for width in (412, 360, 320):
            await phone.page.set_viewport_size({"width": width, "height": 800})
            assert await phone.page.evaluate(CROSSING, "#monitor .top > *") == 0, (width, holder)
            await expect(phone.f("car-name")).to_be_visible()
            least = 44 if width == 320 else 48 if width == 360 else 56
            for name in ("who", "link", "menu"):
                box = await phone.f(name).bounding_box()
                assert box is not None
                assert (box["height"], box["width"] >= least) == (56, True), (name, width)
            over = "el => el.scrollWidth - el.clientWidth"
            assert await phone.f("rec").evaluate(over) <= 0, (width, holder)
            assert await phone.f("link").evaluate(over) <= 0, (width, holder)


async def test_the_bar_holds_a_long_recording_and_the_badge_of_the_other_cars(phone: Phone, canned: Canned) -> None:
    """Twelve other cars need a person, the recording is over an hour old, the age has two digits."""
    canned.vehicle = "Caracal"
    drift: Json = {"title": "GPS drift", "priority": "critical", "state": "UNACKED"}
    canned.cars = [car("Caracal", 4.2, holder="You"), *(car(f"Serval {n}", 0.0, **drift) for n in range(12))]
    canned.state = live() | {"recording": {"state": "recording", "for_s": 3870.0}}
    await phone.open(canned.address)
    await phone.live()
    await expect(phone.f("rec-for")).to_have_text("1:04 h")
    await expect(phone.f("car-badge")).to_be_visible()
    await expect(phone.f("car-count")).to_have_text("12")
    for width in (412, 360, 320):
        await phone.page.set_viewport_size({"width": width, "height": 800})
        assert await phone.page.evaluate(CROSSING, "#monitor .top > *") == 0, width
        names = [f'#monitor .top [data-f="{name}"]' for name in ("car-name", "who-name", "rec", "link", "rec-for")]
        assert await phone.page.evaluate(CUT, names) == [], width
        assert await phone.page.evaluate(OUTSIDE, "#monitor .top *") == 0, width


async def test_the_strip_of_a_quiet_car_is_read_whole(phone: Phone, canned: Canned) -> None:
    await phone.open(canned.address)
    await phone.live()
    await expect(phone.f("strip-text")).to_have_text("No alarms")
    for width in (412, 360, 320):
        await phone.page.set_viewport_size({"width": width, "height": 800})
        assert await phone.page.evaluate(CUT, ['[data-f="strip-text"]', '[data-f="strip-end"]']) == [], width


async def test_the_strip_beside_a_slow_down_is_read_whole_with_its_checks(phone: Phone, canned: Canned) -> None:
    await phone.open(canned.address)
    await phone.live()
    for slow_down, text, end, widths in (
        (slow("armed"), "No alarms", "12 OK · 3 not checked", (412, 360, 320)),
        (slowed(True), "Slowing the car", "−1.5 m/s² ordered", (412, 360)),
        (slowed(None), "Slow-down ordered", "−1.5 m/s²", (412, 360, 320)),
    ):
        canned.state = live() | {"decelerate": slow_down}
        await expect(phone.f("strip-text")).to_have_text(text)
        await expect(phone.f("strip-end")).to_have_text(end)
        for width in widths:
            await phone.page.set_viewport_size({"width": width, "height": 800})
            assert await phone.page.evaluate(CUT, ['[data-f="strip-text"]', '[data-f="strip-end"]']) == [], (
                width,
                text,
            )


@pytest.mark.world(n=11)
async def test_an_order_on_a_standing_car_is_shown_whole_and_in_the_colour_of_an_order(
    phone: Phone, canned: Canned
) -> None:
    await phone.open(canned.address)
    await phone.live()
    for stands in ("before", "unproven"):
        canned.state = standing(stands)
        await expect(phone.f("legend-car")).to_have_text("slow-down: standing")
        order, legend = [
            await phone.page.evaluate("(name) => getComputedStyle(document.querySelector(name)).color", name)
            for name in (".order li[data-mark=ok] .i", '#monitor [data-f="legend-car"]')
        ]
        assert order == legend
        for width in (412, 360):
            await phone.page.set_viewport_size({"width": width, "height": 800})
            assert await phone.page.evaluate(OUTSIDE, ".order li b, .order li .lab, .order p") == 0, (stands, width)
            assert await phone.page.evaluate(CUT, [".board > .rail .slide .tx", '[data-f="strip-text"]']) == []
        canned.state = live()
        await expect(phone.page.locator(".order li").first).to_be_hidden()


async def test_what_to_do_of_an_order_without_effect_is_read_whole_on_the_slide(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 360, "height": 640})
    canned.state = live() | {"decelerate": slowed(False)}
    await phone.open(canned.address)
    await phone.live()
    slide = phone.page.locator(".board > .rail .slide")
    await expect(slide).to_have_text("Use the physical stop", use_inner_text=True)
    assert await phone.page.evaluate(CUT, [".board > .rail .slide .tx"]) == []


# How far the whole dial of the gauge is above the dialog of an alarm, or left of it [px].
APART = """() => {
  const box = (name) => document.querySelector(name).getBoundingClientRect();
  const [dial, sheet] = [box('.gauge svg'), box('#sheet-alarm')];
  const apart = Math.max(sheet.top - dial.bottom, sheet.left - dial.right);
  return { apart, width: dial.width }; }"""


async def test_a_critical_alarm_leaves_the_gauge_whole(phone: Phone, canned: Canned) -> None:
    fast = alarm(
        "speed_limit", "Speed above limit", priority="critical", place="dialog", sound="high", actions=["acknowledge"],
        measured={"value": 12.6, "unit": "m/s"}, limit={"value": 11.0, "unit": "m/s"},
        advice="The safety driver must slow the car.",
    )  # fmt: skip
    canned.state = live() | {"alarms": [fast]}
    await phone.open(canned.address)
    await expect(phone.page.locator("#sheet-alarm")).to_be_visible()
    for size in (
        (320, 480),
        (320, 640),
        (360, 640),
        (412, 568),
        (412, 915),
        (600, 640),
        (690, 560),
        (667, 375),
        (568, 320),
    ):
        await phone.page.set_viewport_size({"width": size[0], "height": size[1]})
        for _ in range(20):
            found = await phone.page.evaluate(APART)
            if found["apart"] >= 0:
                break
            await phone.page.wait_for_timeout(100)
        assert found["apart"] >= 0, (size, found)
        assert size[1] < 480 or found["width"] >= 272, (size, found)


@pytest.mark.parametrize("height", [740, 760, 780, 799])
async def test_a_critical_alarm_leaves_no_empty_band_over_its_sheet(phone: Phone, canned: Canned, height: int) -> None:
    """Lower phones have no room for its head, higher ones show the tabs."""
    await phone.page.set_viewport_size({"width": 360, "height": height})
    canned.state = too_fast(live())
    await phone.open(canned.address)
    await expect(phone.page.locator("#sheet-alarm")).to_be_visible()
    await expect(phone.page.locator("#alarm-title")).to_be_visible()
    under = await phone.page.evaluate(
        """() => { const { bottom } = document.querySelector('[data-part="nearest"]').getBoundingClientRect();
        return document.querySelector('#sheet-alarm').getBoundingClientRect().top - bottom; }"""
    )
    assert 0 <= under <= 48, under


#: Of each pedal: is its bar drawn, and is all of it in the view of Home?
BARS = """() => [...document.querySelectorAll('.pedals .bar')].map((bar) => {
  const [box, view] = [bar, bar.closest('.panel')].map((one) => one.getBoundingClientRect());
  return [getComputedStyle(bar).opacity !== '0', box.top >= view.top - 1 && box.bottom <= view.bottom + 1];
})"""


async def test_the_bar_of_a_pedal_is_whole_or_not_drawn(phone: Phone, canned: Canned) -> None:
    """One without its foot is read as 0."""
    page = phone.page
    await page.set_viewport_size({"width": 360, "height": 740})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await page.locator("#monitor .top .rec").tap()  # the notice that the page cannot sound takes room
    await page.wait_for_function(f"() => ({BARS})().every(([isDrawn, isWhole]) => isDrawn && isWhole)")
    canned.state = at_a_planned_stop(canned.state)  # whose notice leaves less of the view
    await expect(page.locator(".snack:not([hidden])")).to_be_visible()
    await page.set_viewport_size({"width": 412, "height": 915})
    await page.wait_for_function(f"() => ({BARS})().every(([isDrawn, isWhole]) => !isDrawn && !isWhole)")
    await page.evaluate("document.querySelector('.panel[data-panel=home]').scrollTo(0, 120)")
    await page.wait_for_function(f"() => ({BARS})().every(([isDrawn, isWhole]) => isDrawn && isWhole)")
