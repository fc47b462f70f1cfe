"""Tablets and desks: a critical alarm, a count-down and an order each have their place, and leave the others theirs."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.screenshots import show

SIZES = [(820, 1180), (1024, 768), (1180, 820), (1440, 900), (1920, 1080)]
# The count-down neither reaches into what stands beneath the strip nor leaves a part of the strip in sight.
COUNTED = """() => {
  const bottom = document.querySelector('#sheet-countdown').getBoundingClientRect().bottom;
  const panes = [...document.querySelectorAll('.gbox, .panel.pane, [data-part].pane, .alarms-pane')];
  const tops = panes.map((pane) => pane.getBoundingClientRect()).filter((box) => box.height).map((box) => box.top);
  return Math.abs(bottom - Math.min(...tops)) <= 0.5;
}"""
# Of a docked alarm: the gap of its keys, the size of its numbers, how far its label is from its head, what is cut.
DOCKED = """() => {
  const sheet = document.querySelector('.slot > #sheet-alarm');
  const box = (one) => one.getBoundingClientRect();
  const [first, second] = [...sheet.querySelectorAll('.rail > [data-do]')].map(box);
  const edge = box(sheet);
  const [head, bar] = [sheet.querySelector('h2'), document.querySelector('#monitor [data-f=strip]')].map(box);
  const label = box(sheet.querySelector('.versus .lab'));
  const texts = [...sheet.querySelectorAll('.versus > div:not(.cover) > *, .rail > [data-do], p')]
    .map(box).filter(({ width }) => width);
  const rows = box(document.querySelector('.alarms-pane .alarms-foot')).top - edge.bottom;
  return {
    gap: Math.max(second.top - first.bottom, second.left - first.right),
    digits: parseFloat(getComputedStyle(sheet.querySelector('[data-f=measured]')).fontSize),
    under: label.top - (head.height ? head.bottom : bar.bottom),
    isWhole: texts.every(({ left, right }) => left >= edge.left + 8 && right <= edge.right - 8),
    isClear: [...sheet.querySelectorAll('.versus .u')].every((unit) => box(unit).right < first.left),
    isInOrder: box(sheet.querySelector('p')).top >= box(sheet.querySelector('.versus')).bottom - 1,
    rows,
  };
}"""


@pytest.mark.parametrize(("width", "height"), SIZES)
async def test_a_count_down_is_as_high_as_bar_and_strip(phone: Phone, canned: Canned, width: int, height: int) -> None:
    await phone.page.set_viewport_size({"width": width, "height": height})
    await show(canned, phone.page, "countdown")
    await expect(phone.page.locator(".ledge > .mark-key")).to_be_visible()
    await expect(phone.page.locator("#sheet-countdown")).to_be_visible()
    await expect(phone.page.locator(".slot > #sheet-alarm")).to_be_visible()
    await phone.page.wait_for_function(COUNTED, timeout=10_000)


@pytest.mark.parametrize(("width", "height"), SIZES)
async def test_a_critical_alarm_in_its_pane_is_read_from_afar_and_its_keys_stand_apart(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    await phone.page.set_viewport_size({"width": width, "height": height})
    await show(canned, phone.page, "home-fault")
    await expect(phone.page.locator(".ledge > .mark-key")).to_be_visible()
    await expect(phone.page.locator(".slot > #sheet-alarm [data-f=silence]")).to_be_visible()
    found = await phone.page.evaluate(DOCKED)
    assert found["gap"] >= 8
    assert found["digits"] >= (32 if width == 1024 else 40)
    assert found["under"] >= 4
    assert found["isWhole"], found
    assert found["isClear"], found
    assert found["isInOrder"], found
    assert found["rows"] >= (128 if width == 1180 else 64), "a row of the list, two on a tablet on its side"


@pytest.mark.parametrize(("width", "height"), SIZES)
async def test_not_confirmed_stands_once_in_the_strip_and_once_where_it_is_answered(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    page = phone.page
    await page.set_viewport_size({"width": width, "height": height})
    await show(canned, page, "slow-down-not-confirmed")
    await expect(page.locator(".ledge > .mark-key")).to_be_visible()
    sheet = page.locator(".slot > #sheet-alarm")
    await expect(sheet).to_be_visible()
    await expect(phone.f("strip-text")).to_contain_text("NOT CONFIRMED")
    await expect(phone.f("order-steps")).to_be_visible()
    await expect(phone.f("order-line")).to_be_hidden()
    gauge = await page.locator(".gauge").bounding_box()
    assert gauge is not None
    assert gauge["width"] >= 260
    # without a measured value nothing is left empty beside the keys
    keys = [await key.bounding_box() for key in await sheet.locator(".rail > [data-do]").all()]
    around = await sheet.bounding_box()
    assert around is not None
    widths = [key["width"] for key in keys if key]
    assert sum(widths) >= around["width"] - 56


@pytest.mark.parametrize(("width", "height"), SIZES)
async def test_keys_of_alarms_stand_within_the_margin_of_their_pane(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    page = phone.page
    await page.set_viewport_size({"width": width, "height": height})
    await show(canned, page, "alarms")
    await expect(page.locator(".alarms-pane .alarms > li .key").first).to_be_visible()
    found = await page.evaluate("""() => {
      const right = (one) => one.getBoundingClientRect().right;
      const keys = [...document.querySelectorAll('.alarms-pane .alarms > li .key')]
        .filter((key) => key.checkVisibility());
      const foot = document.querySelector('.alarms-pane .alarms-foot').getBoundingClientRect();
      const style = getComputedStyle(document.querySelector('.alarms-pane .alarms-foot'));
      const tight = [...document.querySelectorAll('.alarms-foot > .key')].filter((key) => {
        const range = document.createRange();
        range.selectNodeContents(key);
        const [text, edge] = [range, key].map((one) => one.getBoundingClientRect());
        return text.width && (text.left < edge.left + 4 || text.right > edge.right - 4
          || (innerWidth >= 1200 && (text.top < edge.top + 3 || text.bottom > edge.bottom - 3)));
      });
      return {
        over: Math.max(...keys.map(right)) - (foot.right - parseFloat(style.paddingRight)),
        tight: tight.map((key) => key.textContent),
      };
    }""")
    assert found["over"] <= 0.5
    assert found["tight"] == []


async def ready(phone: Phone, canned: Canned, scene: str, width: int, height: int) -> None:
    await phone.page.set_viewport_size({"width": width, "height": height})
    await show(canned, phone.page, scene)
    await expect(phone.page.locator(".ledge > .mark-key")).to_be_attached()
    await phone.drawn()


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (1920, 1080)])
async def test_the_settings_of_a_desk_leave_gauge_and_mark_key_their_place(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    page = phone.page
    await ready(phone, canned, "home", width, height)
    before = await page.locator(".gauge").bounding_box()
    await ready(phone, canned, "settings", width, height)
    await expect(page.locator(".ledge > .mark-key")).to_be_visible()
    assert await page.locator(".gauge").bounding_box() == before
    drawer = await page.locator("#panel-settings").bounding_box()
    assert drawer is not None
    assert drawer["width"] <= 610
    if width == 1920:
        for pane in ("map", "scan"):
            await expect(page.locator(f"#panel-{pane}")).to_be_visible()
            box = await page.locator(f"#panel-{pane}").bounding_box()
            assert box is not None
            assert box["x"] + box["width"] <= drawer["x"] + 1


async def test_a_recording_on_the_widest_screens_leaves_the_gauge_its_size(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1920, "height": 1080})
    await show(canned, page, "replay")
    await page.wait_for_function(
        "() => document.querySelector('.gauge').getBoundingClientRect().width >= 350", timeout=10_000
    )
    await expect(page.locator("#monitor [data-pane=signals] li").nth(4)).to_be_visible()


@pytest.mark.parametrize("scene", ["stop", "slow-down-release"])
@pytest.mark.parametrize(("width", "height"), [(1440, 900), (1366, 820)])
async def test_a_question_on_a_desk_leaves_map_and_scan_in_sight(
    phone: Phone, canned: Canned, scene: str, width: int, height: int
) -> None:
    await ready(phone, canned, scene, width, height)
    await expect(phone.page.locator(".view > .sheet[open] .keys")).to_be_visible()
    await phone.page.wait_for_function(
        """() => {
          const [sheet, map, scan, trends] = ['.view > .sheet[open]', '#panel-map', '#panel-scan', '[data-part=trends]']
            .map((one) => document.querySelector(one).getBoundingClientRect());
          const keys = document.querySelector('.view > .sheet[open] .keys').getBoundingClientRect();
          return sheet.top >= Math.max(map.bottom, scan.bottom) - 2 && sheet.top <= trends.top + 2
            && keys.top > sheet.top + 60 && keys.bottom <= sheet.bottom + 1;
        }""",
        timeout=10_000,
    )


async def test_what_is_read_back_on_a_tablet_is_in_sight_and_the_speed_stands_once(
    phone: Phone, canned: Canned
) -> None:
    await ready(phone, canned, "handover", 820, 1180)
    page = phone.page
    await expect(page.locator("#sheet-handover .read-back li")).to_have_count(6)
    await expect(page.locator("#sheet-handover > .sheet-head")).to_be_hidden()
    found = await page.evaluate("""() => {
      const box = (one) => one.getBoundingClientRect();
      const body = box(document.querySelector('#sheet-handover .duty-body'));
      const keys = [...document.querySelectorAll('#sheet-handover .duty-keys > button')].map((one) => box(one).top);
      const rows = [...document.querySelectorAll('#sheet-handover .read-back li')];
      return { whole: rows.filter((row) => box(row).bottom <= body.bottom + 1).length, levels: new Set(keys).size };
    }""")
    assert found == {"whole": 5, "levels": 1}


@pytest.mark.parametrize("scene", ["fleet-asked", "fleet-offered", "fleet-flood"])
async def test_keys_and_times_of_the_queue_stand_in_columns_on_a_tablet(
    phone: Phone, canned: Canned, scene: str
) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 820, "height": 1180})
    await show(canned, page, scene)
    await expect(page.locator(".items .item").nth(1)).to_be_visible()
    found = await page.evaluate("""() => {
      const items = [...document.querySelectorAll('.items .item')].filter((one) => one.checkVisibility());
      const ends = (name, side) => new Set(items.map((one) => one.querySelector(name))
        .filter((one) => one?.checkVisibility()).map((one) => Math.round(one.getBoundingClientRect()[side]))).size;
      const wrapped = [...document.querySelectorAll('.items .key')].filter((key) => {
        const range = document.createRange();
        range.selectNodeContents(key);
        return key.checkVisibility() && range.getBoundingClientRect().height > 26;
      });
      const texts = wrapped.map((key) => key.textContent);
      return { keys: ends('.ks', 'left'), times: ends('.s', 'right'), wrapped: texts };
    }""")
    assert found == {"keys": 1, "times": 1, "wrapped": []}


async def test_the_keys_of_each_mail_in_the_outbox_are_in_sight(phone: Phone, canned: Canned) -> None:
    await phone.page.set_viewport_size({"width": 1440, "height": 900})
    await show(canned, phone.page, "outbox")
    await expect(phone.page.locator("#sheet-outbox .outbox > li")).to_have_count(3)
    await expect(phone.f("sound-off")).to_be_hidden()
    await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    over = await phone.page.evaluate("""() => {
      const foot = document.querySelector('#sheet-outbox > .keys').getBoundingClientRect().top;
      const keys = [...document.querySelectorAll('#sheet-outbox .outbox .key')];
      return Math.max(...keys.map((key) => key.getBoundingClientRect().bottom)) - foot;
    }""")
    assert over <= 0


@pytest.mark.parametrize(("width", "height"), [(1440, 900), (1920, 1080)])
async def test_the_slide_of_a_desk_has_two_lines(phone: Phone, canned: Canned, width: int, height: int) -> None:
    await ready(phone, canned, "countdown", width, height)
    text = phone.page.locator("#monitor > .rail > .slide[data-kind=armed] .tx")
    await expect(text).to_contain_text("Slide to slow")
    lines = await text.evaluate("(one) => one.clientHeight / parseFloat(getComputedStyle(one).lineHeight)")
    assert lines <= 2.2


async def test_the_text_of_a_warning_is_whole_on_a_tablet(phone: Phone, canned: Canned) -> None:
    await ready(phone, canned, "home-warning", 820, 1180)
    text = phone.page.locator(".alarms-pane .alarms [data-waits] .m").first
    await expect(text).to_be_visible()
    assert await text.evaluate("(one) => one.scrollHeight - one.clientHeight") <= 1


async def test_no_curve_of_a_lost_car_ends_now(phone: Phone, canned: Canned) -> None:
    await ready(phone, canned, "home", 820, 1180)
    now = phone.page.locator("[data-part=trends] > .head > .age")
    await expect(now).to_be_visible()
    await ready(phone, canned, "link-lost", 820, 1180)
    await expect(phone.page.locator(".view[data-veil=values]")).to_be_attached()
    await expect(now).to_be_hidden()


async def test_a_fresh_mark_on_a_tablet_covers_the_last_row_alone(phone: Phone, canned: Canned) -> None:
    await ready(phone, canned, "mark-fresh", 820, 1180)
    await expect(phone.page.locator(".fresh")).to_be_visible()
    found = await phone.page.evaluate("""() => {
      const [fresh, checks, trends] = ['.fresh', '[data-part=checks]', '[data-part=trends]']
        .map((one) => document.querySelector(one).getBoundingClientRect());
      return [fresh.top - checks.bottom, fresh.top - trends.top];
    }""")
    assert found[0] >= -3
    assert found[1] <= 1


@pytest.mark.parametrize(("width", "height", "least"), [(1920, 1080, 0), (2560, 1440, 3)])
async def test_above_a_fresh_mark_on_the_widest_screens_the_rows_of_signals_are_whole(
    phone: Phone, canned: Canned, width: int, height: int, least: int
) -> None:
    """Those that it does not cover: the stale ones are the first."""
    await ready(phone, canned, "mark-fresh", width, height)
    await expect(phone.page.locator(".fresh")).to_be_visible()
    await phone.page.wait_for_function(
        """(least) => {
          const end = document.querySelector('.fresh').getBoundingClientRect().top;
          const rows = [...document.querySelectorAll('[data-pane=signals] :is(.ph, li)')];
          const seen = rows.filter((one) => one.checkVisibility({ visibilityProperty: true }));
          const tops = seen.filter((one) => one.getBoundingClientRect().top < end);
          return seen.length > least - 1 && seen.length === tops.length
            && seen.every((one) => one.getBoundingClientRect().bottom <= end + 0.5);
        }""",
        arg=least,
    )


async def test_the_widest_screens_list_three_people_and_say_how_many_of_more(phone: Phone, canned: Canned) -> None:
    await ready(phone, canned, "home-people", 1920, 1080)
    await expect(phone.page.locator("[data-f=pane-people] > li")).to_have_count(3)
    await expect(phone.page.locator("[data-f=head-people]")).to_have_text("3 pages, alarms audible on 2")
    assert canned.state
    pages = canned.state["reach"]["pages"]
    canned.state["reach"]["pages"] = [*pages, pages[0] | {"page": "d", "name": "Desk 9"}]
    await expect(phone.page.locator("[data-f=head-people]")).to_have_text("4 pages, alarms audible on 2, 3 shown")


async def test_a_desk_lists_all_signals(phone: Phone, canned: Canned) -> None:
    await ready(phone, canned, "signals", 1440, 900)
    rows = phone.page.locator(".sig:not(.h)")
    await expect(rows.last).to_be_visible()
    last, view = await rows.last.bounding_box(), await phone.page.locator("#monitor > .view").bounding_box()
    assert last
    assert view
    assert last["y"] + last["height"] <= view["y"] + view["height"]


@pytest.mark.parametrize(("width", "height"), [(820, 1180), (1440, 900)])
async def test_the_drawer_of_the_settings_has_a_title_and_is_closed(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    page = phone.page
    await ready(phone, canned, "settings", width, height)
    drawer = page.locator("#panel-settings")
    await expect(drawer.get_by_role("heading", name="Settings", exact=True)).to_be_visible()
    await drawer.get_by_role("button", name="Close settings").click()
    await expect(drawer).to_be_hidden()
    await expect(page.locator("[data-tab=home]")).to_have_attribute("aria-selected", "true")
