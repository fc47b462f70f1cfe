"""Nothing lies over what can be pressed or over a safety text, with every notice, sheet and alarm up, in any window."""

from __future__ import annotations

import asyncio
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Page, Route, expect

from tests.page.canned import Canned, Json, alarm, live, slow, slowed
from tests.page.conftest import Phone
from tests.page.screenshots import at_a_planned_stop, car, show

OVERLAPS = Path(__file__).with_name("overlaps.js").read_text(encoding="utf-8").split("\n", 1)[1].rstrip()
WIDTHS = (320, 360, 412, 480, 640, 699, 700, 740, 820, 915, 999, 1000, 1180, 1199, 1200, 1440, 1799, 1800, 1920, 2560)
HEIGHTS = (360, 412, 480, 560, 600, 640, 720, 780, 900, 1059, 1180, 1440)
SIZES = [(width, height) for width in WIDTHS for height in HEIGHTS]
GATE = [(360, 640), (820, 1180), (1440, 900)]
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"
#: A notice goes by itself; its twin stays.
KEPT = """() => {
  const note = document.querySelector('.snacks > .note');
  const twin = note.cloneNode(true);
  note.replaceWith(twin);
}"""
#: So does a fresh mark, which takes its room as before.
KEPT_MARK = """() => {
  const panel = document.querySelector('.fresh:not([hidden])');
  const twin = panel.cloneNode(true);
  panel.replaceWith(twin);
  new ResizeObserver(() => document.body.style.setProperty('--fresh', `${twin.offsetHeight}px`)).observe(twin);
}"""
LONG = "The newest fix of the phone (Ann-Kathrin, of 3 phones) is 12 s old and comes too late over the radio. " * 2


def warned(**more: Any) -> Json:
    return live() | {"alarms": [alarm("phone_missing", "Phone position missing", text=LONG)]} | more


def critical() -> Json:
    return alarm(
        "speed_limit", "Speed above limit", priority="critical", place="dialog", sound="high", actions=["acknowledge"],
        measured={"value": 12.6, "unit": "m/s"}, limit={"value": 11.0, "unit": "m/s"},
        text="12.6 m/s. The safety driver must slow the car.",
    )  # fmt: skip


async def opened(phone: Phone, canned: Canned, tab: str = "home") -> Page:
    """The page with what it fetches once its first values stand."""
    await phone.open("about:blank")
    await phone.open(f"{canned.address}/#{tab}")
    await phone.live()
    await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    await expect(phone.page.locator("#monitor > .ledge > *").first).to_be_attached()
    return phone.page


async def noticed(page: Page, canned: Canned) -> None:
    """A notice of the page itself, which stays."""
    canned.refuses["pause"] = "Ben is in control."
    await page.evaluate("document.querySelector('#monitor [data-f=pause]').click()")
    await expect(page.locator(".snacks > .note")).to_be_attached()
    await page.evaluate(KEPT)


async def walk(page: Page, sizes: list[tuple[int, int]]) -> dict[str, list[str]]:
    """What lies over what at each of these sizes, where something does."""
    found = {}
    for width, height in sizes:
        await page.set_viewport_size({"width": width, "height": height})
        await page.evaluate(DRAWN)
        wrong = await page.evaluate(OVERLAPS)
        if wrong:  # a part that moves with the next state of the car, or is fetched
            await page.wait_for_timeout(400)
            wrong = await page.evaluate(OVERLAPS)
        if wrong:
            found[f"{width} × {height}"] = wrong
    return found


def several(canned: Canned) -> None:
    """A warning, a request for control and another car's critical alarm."""
    canned.vehicle = "Ocelot"
    fast: Json = {"title": "Speed above limit", "priority": "critical", "state": "UNACKED"}
    canned.cars = [car("Ocelot", 4.2, holder="You"), car("Serval", 12.6, **fast)]
    canned.state = warned(decelerate=slow("not_armed"))
    canned.state["control"] |= {"requests": [{"name": "Ben", "page": "other", "left_s": 22.0}]}


async def nothing_lies_over_another(
    phone: Phone, canned: Canned, sizes: list[tuple[int, int]], tab: str, *, is_critical: bool = False
) -> None:
    several(canned)
    page = await opened(phone, canned, tab)
    await noticed(page, canned)
    for kind in ("prompt:not(.other)", "other", "note"):
        await expect(page.locator(f".snacks > .{kind}")).to_be_attached()
    if is_critical:
        canned.state["alarms"].append(critical())
        await expect(page.locator("#sheet-alarm")).to_be_visible()
    assert await walk(page, sizes) == {}


@pytest.mark.gate
async def test_no_notice_lies_over_a_key_a_gauge_or_another_alarm(phone: Phone, canned: Canned) -> None:
    await nothing_lies_over_another(phone, canned, GATE, "home")


@pytest.mark.gate
async def test_over_two_notices_the_distance_is_in_sight(phone: Phone, canned: Canned) -> None:
    sizes = [(360, 900), (412, 915), (480, 900), (480, 945), (640, 900), (1000, 600), (1180, 600)]
    await nothing_lies_over_another(phone, canned, sizes, "home")


@pytest.mark.gate
async def test_over_a_warning_the_distance_is_in_sight_and_the_gauge_is_large(phone: Phone, canned: Canned) -> None:
    canned.state = warned()
    page = await opened(phone, canned)
    assert await walk(page, [(412, 915), (480, 900), (699, 900)]) == {}


@pytest.mark.gate
async def test_over_two_notices_beside_a_planned_stop_and_a_question_the_speed_is_read(
    phone: Phone, canned: Canned
) -> None:
    await show(canned, phone.page, "question")
    warning = alarm("phone_missing", "Phone position missing", text=LONG)
    canned.state = at_a_planned_stop(canned.state)
    canned.state["alarms"] += [warning]
    await expect(phone.page.locator("[data-f=warning]")).to_be_visible()
    await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drive']\")?.sheet")
    await noticed(phone.page, canned)
    for width, height in ((360, 900), (412, 915)):
        await phone.page.set_viewport_size({"width": width, "height": height})
        await phone.page.evaluate(DRAWN)
        box = await phone.page.locator("#panel-home .gauge").bounding_box()
        assert box is not None
        assert box["width"] >= 120, (width, height, box)


#: Whether the name of the waiting warning and both its keys are whole in the list of the floor, and no letter is cut.
LISTED = """() => {
  const [list] = document.querySelectorAll('.alarms-pane > .body .alarms');
  const foot = document.querySelector('.alarms-pane .alarms-foot');
  const row = [...(list?.querySelectorAll('[data-waits]') ?? [])].find((one) => /Phone/.test(one.textContent));
  if (!foot || !row) return false; // it is being moved
  const { top } = foot.getBoundingClientRect();
  const keys = [...row.querySelectorAll('.ac .key')].map((one) => one.getBoundingClientRect());
  return row.querySelector('.t').getBoundingClientRect().height < 30 && keys.length === 2
    && keys.every(({ bottom, height }) => height >= 40 && bottom <= top + 1);
}"""


@pytest.mark.gate
@pytest.mark.parametrize("is_critical", [False, True])
async def test_on_a_low_tablet_on_its_side_a_warning_is_read_and_answered(
    phone: Phone, canned: Canned, *, is_critical: bool
) -> None:
    canned.state = warned()
    page = await opened(phone, canned)
    await phone.f("sound-off").tap()
    await expect(phone.f("sound-off")).to_be_hidden()
    if is_critical:
        canned.state["alarms"].append(critical())
        await expect(page.locator("#sheet-alarm")).to_be_visible()
    for width, height in ((1000, 600), (1024, 660), (1024, 768), (1180, 700)):
        await page.set_viewport_size({"width": width, "height": height})
        if is_critical:  # the list begins with it
            await expect(page.locator(".alarms-pane #sheet-alarm")).to_be_visible()
        await page.wait_for_function(LISTED)


#: How far the notices lie over the trends [px], and how many there are.
OVER_TRENDS = """() => {
  const box = (one) => document.querySelector(one).getBoundingClientRect();
  const [trends, notices] = ['.pager [data-part=trends].pane', '.snacks'].map(box);
  const seen = [...document.querySelectorAll('.snacks > .snack')].filter((one) => one.checkVisibility());
  return [Math.max(0, Math.round(trends.bottom - notices.top - 1)), seen.length];
}"""


#: Keeps how many notices there are at the moment when the window has become a floor.
COUNTED = """() => {
  matchMedia('(width >= 62.5em) and (height >= 37.5em)').addEventListener('change', () => {
    window.counted = document.querySelectorAll('.snacks > .snack:not([hidden])').length;
  });
}"""


@pytest.mark.gate
async def test_on_a_low_wall_the_notices_lie_under_the_trends(phone: Phone, canned: Canned) -> None:
    several(canned)
    page = await opened(phone, canned)
    await noticed(page, canned)
    for width, height in ((1800, 860), (1920, 900), (1920, 1080)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.evaluate(DRAWN)
        assert await page.evaluate(OVER_TRENDS) == [0, 3], (width, height)


async def test_a_window_made_larger_has_a_warning_once(phone: Phone, canned: Canned) -> None:
    several(canned)
    page = await opened(phone, canned)
    await noticed(page, canned)
    await expect(page.locator(".snacks > [data-f=warning]")).not_to_have_attribute("hidden", "")
    await page.evaluate(COUNTED)
    await page.set_viewport_size({"width": 1800, "height": 860})
    await page.wait_for_function("() => 'counted' in window")
    assert await page.evaluate("counted") == 3


#: A slow-down as it stands beside a warning.
ORDERS = {"none": lambda: slow("armed"), "slows": slowed, "not confirmed": lambda: slowed(False)}
LOW = [
    (320, 600), (320, 704), (360, 560), (360, 640), (375, 667), (412, 700), (412, 740), (412, 780), (412, 830),
    (680, 600),
]  # fmt: skip


SPEED_IN_SIGHT = """() => {
  const at = (one) => document.querySelector(one).getBoundingClientRect();
  const [speed, notice] = ['.gauge .speed', '.snack:not([hidden])'].map(at);
  return speed.height > 12 && speed.bottom <= notice.top;
}"""


@pytest.mark.gate
@pytest.mark.parametrize("order", ORDERS)
async def test_over_a_notice_speed_distance_and_a_stale_age_are_in_sight(
    phone: Phone, canned: Canned, order: str
) -> None:
    canned.state = warned(decelerate=ORDERS[order]())
    page = await opened(phone, canned)
    for freshness in ("live", "stale"):
        canned.state["signals"]["distance"] |= {"freshness": freshness, "age_s": 123.4}
        await phone.drawn()
        await expect(page.locator("[data-part=nearest] .age[data-ink=stale]")).to_have_count(int(freshness == "stale"))
        assert await walk(page, LOW) == {}, freshness
    for width, height in ((320, 568), (360, 560)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.wait_for_function(SPEED_IN_SIGHT)


#: Whether these parts of the nearest object are in the view, and neither under the notice nor beyond the gauge's edge.
BESIDE_THE_NOTICE = """(names) => {
  const at = (one) => document.querySelector(one).getBoundingClientRect();
  const [notice, view] = ['.snack:not([hidden])', '#monitor > .view'].map(at);
  return notice.height > 0 && names.every((name) => {
    const { left, right, top, bottom, height } = at(`[data-part=nearest] ${name}`);
    return height > 10 && left >= 0 && right <= innerWidth && top >= view.top - 4 && bottom <= view.bottom + 1
      && (right <= notice.left || bottom <= notice.top + 1);
  });
}"""
LYING = ((568, 320), (640, 360), (740, 360))


@pytest.mark.gate
@pytest.mark.parametrize("order", ["none", "not confirmed"])
async def test_over_a_notice_the_time_gap_is_in_sight(phone: Phone, canned: Canned, order: str) -> None:
    canned.state = warned(decelerate=ORDERS[order]())
    canned.state["nearest"] = {"time_gap_s": 2.3, "stopping_m": 9.9}
    page = await opened(phone, canned)
    for width, height in ((320, 568), (412, 740), *LYING) if order == "none" else LYING:
        await page.set_viewport_size({"width": width, "height": height})
        stops = [] if order != "none" else ["[data-f=stops]"]
        await page.wait_for_function(BESIDE_THE_NOTICE, arg=["[data-f=distance]", "[data-f=gap]", *stops])
    canned.state["signals"]["distance"] |= {"freshness": "stale", "age_s": 123.4}
    await expect(page.locator("[data-part=nearest] .age[data-ink=stale]")).to_be_attached()
    for width, height in LYING:
        await page.set_viewport_size({"width": width, "height": height})
        await page.wait_for_function(BESIDE_THE_NOTICE, arg=["[data-f=distance]", ".age"])


@pytest.mark.gate
async def test_a_request_for_control_beside_a_slow_down_leaves_strip_and_distance_in_sight(
    phone: Phone, canned: Canned
) -> None:
    canned.state = live() | {"decelerate": slowed()}
    canned.state["control"] |= {"requests": [{"name": "Ben", "page": "other", "left_s": 22.0}]}
    page = await opened(phone, canned)
    await expect(page.locator(".snacks > .prompt")).to_be_visible()
    for width, height in (*LYING, (915, 412)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.wait_for_function(BESIDE_THE_NOTICE, arg=["[data-f=distance]"])
    assert await walk(page, [*LYING, (915, 412)]) == {}


@pytest.mark.gate
@pytest.mark.own_phone
async def test_a_warning_is_one_row_before_the_style_of_the_drive_comes(phone: Phone, canned: Canned) -> None:
    async def refuse(route: Route) -> None:
        await route.abort()

    await phone.page.route("**/drive*.css*", refuse)
    canned.state = warned()
    page = await opened(phone, canned)
    assert await page.locator("link[href*=drive]").count() == 0
    for width, height in ((320, 568), (568, 320), (640, 360), (740, 360)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.wait_for_function("() => document.querySelector('.snack[data-f=warning]').offsetHeight < 76")
    phone.complaints.clear()  # of what was refused


@pytest.mark.timeout(600)
@pytest.mark.parametrize("tab", ["home", "map", "scan", "files", "settings"])
async def test_none_does_in_any_window(phone: Phone, canned: Canned, tab: str) -> None:
    await nothing_lies_over_another(phone, canned, SIZES if tab == "home" else SIZES[::3], tab)


@pytest.mark.timeout(600)
@pytest.mark.parametrize("tab", ["home", "map", "files"])
async def test_nor_beside_a_critical_alarm(phone: Phone, canned: Canned, tab: str) -> None:
    await nothing_lies_over_another(phone, canned, SIZES[1::3], tab, is_critical=True)


@pytest.mark.gate
@pytest.mark.parametrize("hand", ["right", "left"])
async def test_the_mark_key_lies_over_no_other_key_on_a_phone_on_its_side(
    phone: Phone, canned: Canned, hand: str
) -> None:
    canned.state = live()
    page = await opened(phone, canned)
    await page.evaluate(f"document.documentElement.dataset.hand = '{hand}'")
    for down in (0, 150, 300, 450):
        await page.evaluate(f"document.querySelector('[data-panel=home]').scrollTo(0, {down})")
        assert await walk(page, [(640, 360), (740, 360), (915, 412), (1000, 480), (1180, 412)]) == {}, down


#: Whether the name of a stale distance is more than its first letters, and each press at its age is for it.
AGE_ACTS = """() => {
  const age = document.querySelector('[data-part=nearest] .age');
  const name = document.querySelector('[data-part=nearest] .head > span');
  const { left, top, right, bottom } = age.getBoundingClientRect();
  const x = Math.min(right - 2, left + 30);
  const isFree = [top + 1, (top + bottom) / 2, bottom - 3].every((y) => document.elementFromPoint(x, y) === age);
  return age.dataset.ink === 'stale' && isFree && name.clientWidth > 56;
}"""


@pytest.mark.gate
async def test_beside_the_gauge_a_stale_distance_is_named_and_its_age_acts(phone: Phone, canned: Canned) -> None:
    canned.state = warned(decelerate=slow("armed"))
    canned.state["signals"]["distance"] |= {"freshness": "stale", "age_s": 123.4}
    page = await opened(phone, canned)
    for width, height in ((375, 667), (412, 700)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.wait_for_function(AGE_ACTS)


#: Whether these parts are in the window, and not under the panel of the fresh mark.
BESIDE_THE_MARK = """(names) => {
  const at = (one) => document.querySelector(one).getBoundingClientRect();
  const [mark, view] = ['.fresh', '#monitor > .view'].map(at);
  const isFree = ({ left, right, top, bottom }) =>
    left >= mark.right || right <= mark.left || top >= mark.bottom || bottom <= mark.top;
  const isCut = (one) => at(one).width < 12 || (/gauge|near/.test(one) && at(one).bottom > view.bottom);
  return mark.height > 0 && mark.top >= 0 && at('#monitor > .rail .slide').bottom <= innerHeight
    && names.every((one) => isFree(at(one)) && !isCut(one));
}"""
LEFT_FREE = ["#monitor > .rail .slide", ".gauge .speed", "#monitor > .strip"]
WITH_DISTANCE = ((360, 640), (375, 667), (412, 740), (740, 360), (915, 412))


@pytest.mark.gate
@pytest.mark.parametrize(
    ("width", "height"), [(320, 568), (375, 560), (568, 320), (640, 360), (667, 375), *WITH_DISTANCE]
)
async def test_a_fresh_mark_leaves_slide_and_speed_in_sight_on_a_small_phone(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    canned.state = live() | {"decelerate": slow("armed")}
    page = await opened(phone, canned)
    await page.set_viewport_size({"width": width, "height": height})
    await page.locator(".mark-key").tap()
    await page.evaluate(KEPT_MARK)
    near = [".near [data-f=distance]"] if (width, height) in WITH_DISTANCE else []
    await page.wait_for_function(BESIDE_THE_MARK, arg=LEFT_FREE + near)


#: Whether the keys of the fresh mark stand beside one another, each as wide as its text.
KEYS_APART = """() => {
  const keys = [...document.querySelectorAll('.fresh-keys .key')];
  const at = keys.map((one) => one.getBoundingClientRect());
  const isApart = at.every(({ right, top }, one) => !at[one + 1] || right <= at[one + 1].left || top < at[one + 1].top);
  return keys.length === 3 && at[0].width > 0 && isApart && keys.every((one) => one.scrollWidth <= one.clientWidth);
}"""


@pytest.mark.gate
async def test_the_keys_of_a_fresh_mark_lie_over_none_of_each_other(phone: Phone, canned: Canned) -> None:
    canned.state = live() | {"decelerate": slow("armed")}
    page = await opened(phone, canned)
    await page.set_viewport_size({"width": 1180, "height": 480})
    await page.locator(".mark-key").tap()
    await page.evaluate(KEPT_MARK)
    for width, height in ((1180, 480), (800, 500), (1180, 412), (568, 320), (360, 640)):
        await page.set_viewport_size({"width": width, "height": height})
        await page.wait_for_function(KEYS_APART)


#: Whether the warning's name stands whole.
NAMED = """(name) => {
  const title = document.querySelector('.snack[data-f=warning] .tx > b');
  const isWhole = title.scrollHeight <= title.clientHeight + 1 && title.scrollWidth <= title.clientWidth;
  return title.textContent.includes(name) && title.clientHeight > 12 && isWhole;
}"""


@pytest.mark.gate
@pytest.mark.parametrize(("width", "height"), [(320, 568), (568, 320), (640, 360), (740, 360)])
async def test_the_name_of_a_warning_is_whole_on_a_small_phone(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    canned.state = warned()
    page = await opened(phone, canned)
    await page.set_viewport_size({"width": width, "height": height})
    for name in ("Phone position missing", "Sources of the speed disagree", "Sources of the position disagree"):
        canned.state["alarms"] = [alarm(name, name, text=LONG)]
        await page.wait_for_function(NAMED, arg=name)


#: Whether a press at the middle of Stop, Pause and slide is for them, and the Mark key is no higher than they are.
RAIL_ACTS = """() => {
  const rail = document.querySelector('#monitor > .rail');
  const [mark, top] = [document.querySelector('.mark-key'), rail.getBoundingClientRect().top];
  return [...rail.querySelectorAll('[data-f=stop], [data-f=pause], .slide')].every((key) => {
    const at = key.getBoundingClientRect();
    return key.contains(document.elementFromPoint((at.left + at.right) / 2, (at.top + at.bottom) / 2));
  }) && (!mark.checkVisibility() || mark.getBoundingClientRect().top >= top - 1);
}"""


@pytest.mark.gate
@pytest.mark.parametrize(("width", "height"), [(640, 360), (740, 360), (915, 412), (1250, 500)])
async def test_a_screen_that_is_opened_over_home_leaves_the_keys_of_a_phone_on_its_side_free(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    canned.state = live() | {"decelerate": slow("armed")}
    page = await opened(phone, canned)
    await page.set_viewport_size({"width": width, "height": height})
    await page.evaluate("document.querySelector('#monitor [data-f=link]').click()")
    await expect(page.get_by_role("heading", name="Signals")).to_be_visible()
    await page.evaluate(DRAWN)
    assert await page.evaluate(RAIL_ACTS)


@pytest.mark.gate
@pytest.mark.parametrize("kind", ["warning", "note"])
async def test_a_notice_that_comes_to_a_fresh_mark_lies_over_nothing_on_a_phone_on_its_side(
    phone: Phone, canned: Canned, kind: str
) -> None:
    canned.state = live() | {"decelerate": slow("armed")}
    page = await opened(phone, canned)
    await page.set_viewport_size({"width": 568, "height": 320})
    await page.locator(".mark-key").tap()
    await page.evaluate(KEPT_MARK)
    if kind == "warning":
        canned.state = warned(decelerate=slow("armed"))
    else:
        await noticed(page, canned)
    await expect(page.locator(f".snacks > {'[data-f=warning]' if kind == 'warning' else '.note'}")).to_be_visible()
    assert await walk(page, [(568, 320), (640, 360), (667, 375), (740, 360), (915, 412), (1180, 480)]) == {}


# What is read of the gauge below the count-down, whether all its words and keys are whole, and the size of its key.
COUNTS = """() => {
  const box = (one) => document.querySelector(one).getBoundingClientRect();
  const [banner, veto] = [box('#sheet-countdown'), box('#sheet-countdown [data-f=veto]')];
  const cut = [...document.querySelectorAll('#sheet-countdown :is(h2, p, button), #sheet-alarm .slide .tx')]
    .filter((one) => one.checkVisibility())
    .filter((one) => one.scrollWidth > one.clientWidth + 1 || one.scrollHeight > one.clientHeight + 2);
  return {
    covered: Math.max(0, Math.round(banner.bottom - box('#panel-home .gauge .speed').top)),
    cut: cut.map((one) => one.textContent.trim()),
    isVetoLarge: veto.height >= 44 && veto.width >= 80 && veto.bottom <= banner.bottom,
  };
}"""


@pytest.mark.gate
async def test_a_count_down_covers_no_digit_of_the_speed(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, canned)
    countdown = {"trigger": "speed", "title": "Speed above limit", "text": "12.6 m/s, limit 11.0 m/s", "left_s": 1.4}
    canned.state = live() | {"decelerate": slow("armed", countdown=countdown), "alarms": [critical()]}
    await expect(page.locator("#sheet-countdown")).to_be_visible()
    await expect(page.locator("#sheet-alarm")).to_be_visible()
    upright, low = [(320, 568), (360, 640), (360, 740), (412, 915)], [(568, 320), (640, 360), (740, 360), (915, 412)]
    for width, height in [*upright, *low, (820, 1180), (1180, 820), (1440, 900), (1920, 1080)]:
        await page.set_viewport_size({"width": width, "height": height})
        await phone.drawn()
        assert await page.evaluate(COUNTS) == {"covered": 0, "cut": [], "isVetoLarge": True}, (width, height)


async def test_no_edge_of_the_slide_is_left_beside_a_critical_alarm(phone: Phone, canned: Canned) -> None:
    page = await opened(phone, canned)
    canned.state["alarms"] = [critical()]
    await expect(page.locator("#sheet-alarm")).to_be_visible()
    await page.set_viewport_size({"width": 412, "height": 360})
    await expect(page.locator("#monitor > .rail > .slide")).to_be_hidden()
    await expect(page.locator("#sheet-alarm .slide")).to_be_visible()


async def click(page: Page, selector: str) -> None:
    await page.evaluate("selector => document.querySelector(selector).click()", selector)


#: What the operator opens, by the key that opens it.
SHEETS = {
    "sheet-menu": "#monitor [data-f=menu]",
    "sheet-slow": "#monitor > .rail [data-f=slow]",
    "sheet-stop": "#monitor > .rail [data-f=stop]",
    "sheet-cars": "#monitor [data-f=who]",
    "sheet-keys": "#sheet-menu [data-f=keys]",
    "sheet-preferences": "#sheet-menu [data-screen=preferences]",
    "sheet-this-phone": "#sheet-menu [data-f=this-phone]",
    "sheet-duty": "#sheet-menu [data-f=duty]",
}
#: Of the head of the open sheet: what it shows, and whether the sheet covers the strip, the rail or the bar.
#: On an upright phone the strip right above the head names the worst alarm; anywhere else the head does.
HEAD = """() => {
  const box = (selector) => document.querySelector(selector).getBoundingClientRect();
  const sheet = document.querySelector('.view > dialog[open]');
  const at = sheet.getBoundingClientRect();
  const head = sheet.querySelector('.sheet-head');
  const [strip, rail, speed] = ['strip', 'rail'].map((one) => box(`#monitor > .${one}`)).concat(box('.gauge .speed'));
  const covers = (a, b) => a.left < b.right - 1 && a.right > b.left + 1 && a.top < b.bottom - 1 && a.bottom > b.top + 1;
  const isUpright = innerWidth < 700 && innerHeight > 520;
  const named = isUpright ? document.querySelector('#monitor > .strip') : head;
  return {
    strip: covers(at, strip), rail: covers(at, rail), bar: covers(at, box('#monitor > .top')),
    isModal: sheet.matches(':modal'),
    isCarShown: head.checkVisibility()
      ? [/4\\.2\\s*m\\/s/, /\\d s/].every((one) => one.test(head.innerText))
        && /Phone position missing/.test(named.innerText)
      : speed.height > 12 && !covers(at, speed),
    isSeen: at.top >= 0 && at.bottom <= innerHeight && at.height > 60,
  };
}"""


#: Once the open sheet has risen.
STANDS = """() => {
  const moves = document.querySelector('.view > dialog[open]').getAnimations();
  return Promise.all(moves.map((one) => one.finished)).then(() => {});
}"""


async def sheets_leave_the_car_in_sight(
    phone: Phone, canned: Canned, sizes: list[tuple[int, int]], sheets: list[str]
) -> None:
    canned.state = warned(decelerate=slow("not_armed"))
    page = await opened(phone, canned)
    for name in sheets:
        await click(page, SHEETS[name])
        await expect(page.locator(f"#{name}")).to_have_attribute("open", "")
        await expect(page.locator(f"#{name} > .sheet-head")).to_be_attached()
        found = {}
        for width, height in sizes:
            await page.set_viewport_size({"width": width, "height": height})
            await page.evaluate(DRAWN)
            await page.evaluate(STANDS)
            seen = await page.evaluate(HEAD)
            good = {"strip": False, "rail": False, "bar": False, "isModal": False, "isCarShown": True, "isSeen": True}
            if seen != good:
                found[f"{width} × {height}"] = seen
        assert found == {}, name
        if sizes is not GATE:
            assert await walk(page, sizes) == {}, name


@pytest.mark.gate
async def test_a_sheet_leaves_strip_rail_and_speed_in_sight(phone: Phone, canned: Canned) -> None:
    await sheets_leave_the_car_in_sight(phone, canned, GATE, ["sheet-menu", "sheet-slow"])


#: Whether the menu has the height of a row between its head and its key, and the warning beside it can be answered.
MENU_BESIDE_A_WARNING = """() => {
  const box = (one) => document.querySelector(one).getBoundingClientRect();
  const [head, keys] = ['.sheet-head', '.keys'].map((one) => box(`#sheet-menu > ${one}`));
  const answer = document.querySelector('.snack[data-f=warning] .key.solid');
  const at = answer.getBoundingClientRect();
  const hit = document.elementFromPoint((at.left + at.right) / 2, (at.top + at.bottom) / 2);
  return keys.top - head.bottom > 56 && answer.contains(hit);
}"""


@pytest.mark.gate
async def test_beside_a_warning_a_sheet_shows_more_than_its_key_in_a_low_window(phone: Phone, canned: Canned) -> None:
    sizes = [(740, 560), (820, 560), (740, 600), (999, 640)]
    await sheets_leave_the_car_in_sight(phone, canned, sizes, ["sheet-menu"])
    for width, height in sizes:
        await phone.page.set_viewport_size({"width": width, "height": height})
        await phone.page.wait_for_function(MENU_BESIDE_A_WARNING)


@pytest.mark.gate
async def test_what_a_sheet_leaves_in_sight_acts_and_escape_closes_the_sheet_alone(
    phone: Phone, canned: Canned
) -> None:
    page = await opened(phone, canned)
    menu = page.locator("#sheet-menu")
    await page.evaluate("dispatchEvent(new CustomEvent('catgraph-open', { detail: { screen: 'signals' } }))")
    await expect(phone.f("screen")).to_be_visible()
    await phone.f("menu").tap()
    await phone.f("pause").tap()
    async with asyncio.timeout(20):
        while not any(one["kind"] == "pause" for one in canned.received):
            await asyncio.sleep(0.05)
    await expect(menu).to_be_visible()
    await page.keyboard.press("Escape")
    await expect(menu).to_be_hidden()
    await expect(phone.f("screen")).to_be_visible()
    await phone.f("menu").tap()
    await expect(menu).to_be_visible()
    await phone.f("strip").tap()  # it leads to another screen
    await expect(menu).to_be_hidden()


@pytest.mark.timeout(900)
@pytest.mark.parametrize("name", SHEETS)
async def test_each_sheet_does_in_any_window(phone: Phone, canned: Canned, name: str) -> None:
    await sheets_leave_the_car_in_sight(phone, canned, SIZES[2::5], [name])


@pytest.mark.gate
@pytest.mark.own_phone
async def test_a_sheet_leaves_a_docked_alarm_free_though_the_look_of_drawers_fails_and_is_asked_for_again(
    phone: Phone, canned: Canned
) -> None:
    page = phone.page
    requests: list[str] = []

    async def refuse(route: Route) -> None:
        requests.append(route.request.url)
        await route.abort()

    await page.route("**/drawers*.css*", refuse)
    await page.set_viewport_size({"width": 1440, "height": 900})
    canned.state = warned()
    canned.state["alarms"].append(critical())
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    docked = page.locator(".alarms-pane #sheet-alarm")
    await expect(docked).to_be_visible()
    menu = page.locator("#sheet-menu")
    for _ in range(2):
        before = len(requests)
        await expect(page.locator("link[href*='drawers']")).to_have_count(0)  # none is under way
        await click(page, SHEETS["sheet-menu"])
        await expect(menu).to_be_visible()
        box, pane = await menu.bounding_box(), await page.locator(".alarms-pane").bounding_box()
        assert box is not None
        assert pane is not None
        assert box["x"] + box["width"] <= pane["x"] + 1
        async with asyncio.timeout(10):
            while len(requests) == before:
                await asyncio.sleep(0.05)
        await page.keyboard.press("Escape")
        await expect(menu).to_be_hidden()
    await page.unroute("**/drawers*.css*")
    await click(page, SHEETS["sheet-menu"])
    await expect(page.locator("link[href*='drawers']")).to_be_attached()
    await page.wait_for_function("() => document.querySelector('link[href*=\"drawers\"]').sheet")
    phone.complaints.clear()  # of what was refused
