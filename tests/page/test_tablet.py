"""Tablets and desks: nothing that a sheet leaves in sight is cut, and no label is too small to be read."""

from __future__ import annotations

import pytest
from playwright.async_api import expect

from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.screenshots import show

RISEN = """() => Promise.all(
  document.getAnimations().filter((one) => one.animationName === 'rise').map((one) => one.finished),
)"""
# Blocks of the view of which a sheet leaves a part in sight.
CUT_BY_A_SHEET = """() => {
  const sheet = document.querySelector('.view > .sheet[open]').getBoundingClientRect();
  const names = ['.gbox', '.drive > .block', '.alarms-pane', '.slot', '.panel.pane', '[data-part].pane'];
  const parts = document.querySelectorAll(names.map((name) => `.pager ${name}`).join());
  return [...parts].filter((part) => {
    const box = part.getBoundingClientRect();
    return box.height > 0 && box.top < sheet.top - 1 && box.bottom > sheet.top + 4;
  }).map((part) => part.className || part.dataset.part);
}"""
# Labels of the gauge below 12 px, as they are on the glass.
SMALL = """() => {
  const gauge = document.querySelector('.gauge');
  return [...gauge.querySelectorAll('text, tspan')]
    .filter((text) => text.textContent.trim() && text.getClientRects().length)
    .filter((text) => (parseFloat(getComputedStyle(text).fontSize) * gauge.clientWidth) / 380 < 11.95)
    .map((text) => `${text.textContent}: ${getComputedStyle(text).fontSize}`);
}"""


@pytest.mark.parametrize("scene", ["stop", "slow-down-release"])
@pytest.mark.parametrize(("width", "height"), [(820, 1180), (740, 1180), (800, 1280), (820, 1106)])
async def test_a_sheet_on_a_tablet_cuts_no_row_of_what_is_behind_it(
    phone: Phone, canned: Canned, scene: str, width: int, height: int
) -> None:
    await phone.page.set_viewport_size({"width": width, "height": height})
    await show(canned, phone.page, scene)
    await expect(phone.page.locator(".view > .sheet[open] > .sheet-head")).to_be_hidden()  # the gauge has the speed
    await phone.page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    await phone.page.evaluate(RISEN)
    assert await phone.page.evaluate(CUT_BY_A_SHEET) == []
    gauge, sheet = [await phone.page.locator(one).bounding_box() for one in (".gauge", ".view > .sheet[open]")]
    assert gauge is not None
    assert sheet is not None
    assert gauge["y"] + gauge["height"] <= sheet["y"]
    await expect(phone.page.locator(".gauge .speed")).to_be_in_viewport(ratio=1.0)


async def test_no_label_of_a_small_gauge_is_below_12_px(phone: Phone, canned: Canned) -> None:
    page = phone.page
    for scene in ("home", "question", "slow-down-ordered", "slow-down-not-confirmed-warned"):
        for width, height in ((820, 1180), (1440, 900)):
            await page.set_viewport_size({"width": width, "height": height})
            await show(canned, page, scene)
            await expect(page.locator(".ledge > .mark-key")).to_be_visible()
            assert await page.evaluate(SMALL) == [], (scene, width)


#: Whether the first letters of an element can be seen: nothing lies over them.
SEEN = """(one) => {
  const { left, top, height } = one.getBoundingClientRect();
  return height > 10 && one.contains(document.elementFromPoint(left + 4, top + height / 2));
}"""


@pytest.mark.parametrize(("width", "height"), [(820, 1180), (1180, 820), (1440, 900)])
async def test_a_map_with_a_track_and_no_position_says_so(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    await phone.page.set_viewport_size({"width": width, "height": height})
    await show(canned, phone.page, "map-none")
    message = phone.page.locator("[data-panel=map] [data-f=car-message]")
    await expect(message).to_have_text("No position received from the car yet.")
    await expect(phone.page.locator("link[href*=map-drawn]")).to_be_attached()
    await phone.drawn()
    assert await message.evaluate(SEEN)


async def test_a_question_on_a_tablet_leaves_the_speed_its_size(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 820, "height": 1180})
    await show(canned, page, "home")
    await expect(page.locator(".ledge > .mark-key")).to_be_visible()
    before = await page.locator(".gauge").bounding_box()
    await show(canned, page, "question")
    await expect(page.locator(".ledge > .mark-key")).to_be_visible()
    after = await page.locator(".gauge").bounding_box()
    assert before is not None
    assert after is not None
    assert after["width"] >= 0.9 * before["width"]


@pytest.mark.parametrize("scene", ["mail", "outbox"])
@pytest.mark.parametrize(("width", "height"), [(820, 1180), (1180, 820), (1440, 900), (1920, 1080)])
async def test_a_sheet_over_files_covers_whole_parts_and_shows_all_it_has(
    phone: Phone, canned: Canned, scene: str, width: int, height: int
) -> None:
    page = phone.page
    await page.set_viewport_size({"width": width, "height": height})
    await show(canned, page, scene)
    await page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    await expect(phone.f("sound-off")).to_be_hidden()
    await page.evaluate(RISEN)
    cut = await page.evaluate(
        """(name) => {
          const sheet = document.getElementById(`sheet-${name}`).getBoundingClientRect();
          return [...document.querySelectorAll('.files-side, .file-dock')].filter((part) => {
            const box = part.getBoundingClientRect();
            const [left, right] = [Math.max(box.left, sheet.left), Math.min(box.right, sheet.right)];
            const [top, bottom] = [Math.max(box.top, sheet.top), Math.min(box.bottom, sheet.bottom)];
            const covered = Math.max(0, right - left) * Math.max(0, bottom - top);
            return covered > 4 * box.height && covered < (box.width - 4) * (box.height - 4);
          }).map((part) => part.className);
        }""",
        scene,
    )
    assert cut == []
    if scene == "mail" and (width, height) != (1180, 820):
        form = page.locator("#sheet-mail .what")
        assert await form.evaluate("(form) => form.scrollHeight - form.clientHeight") <= 1


@pytest.mark.parametrize(("width", "height"), [(360, 740), (820, 1180), (1440, 900), (1920, 1080)])
async def test_a_long_name_of_the_car_is_within_the_map(phone: Phone, canned: Canned, width: int, height: int) -> None:
    page = phone.page
    await page.set_viewport_size({"width": width, "height": height})
    await show(canned, page, "map-coarse")
    name = page.locator("#panel-map .mapv .name").first
    await expect(name).to_have_text("Car, accuracy unknown, heading 12.0 s old")
    await expect(name).to_be_visible()
    inside = """(name) => {
      const [text, map] = [name, name.closest('.mapbox')].map((one) => one.getBoundingClientRect());
      const rooms = [text.left - map.left, map.right - text.right, text.top - map.top, map.bottom - text.bottom];
      return rooms.every((room) => room >= 0);
    }"""
    assert await name.evaluate(inside)
    # the track passes beneath the number of the scale
    halo = page.locator("#panel-map .mapv .sc + text")
    assert await halo.evaluate("(text) => parseFloat(getComputedStyle(text).strokeWidth)") >= 10


#: Without a thread of its own the page draws the scan: what it writes, from the newest drawing.
WRITTEN = """() => {
  window.Worker = undefined;
  const { fillText, drawImage } = CanvasRenderingContext2D.prototype;
  let now = [];
  CanvasRenderingContext2D.prototype.fillText = function (text, x, y) {
    const { clientWidth, clientHeight } = this.canvas;
    if (this.canvas.matches('.scanc')) now.push([text, x - clientWidth / 2, clientHeight - y]);
    return fillText.apply(this, arguments);
  };
  CanvasRenderingContext2D.prototype.drawImage = function () {
    if (this.canvas.matches('.scanc')) [window.written, now] = [now, []];
    return drawImage.apply(this, arguments);
  };
}"""


@pytest.mark.own_phone
async def test_the_limit_of_the_scan_is_named_on_a_tablet(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.add_init_script(f"({WRITTEN})()")
    await page.set_viewport_size({"width": 820, "height": 1180})
    await show(canned, page, "scan")
    await page.wait_for_function("() => window.written?.length")
    written = {text: (x, y) for text, x, y in await page.evaluate("window.written")}
    assert "stop 7.1 m" in written
    # The sector without a return is ahead at the right: a label over it near the car would make it look free.
    assert written["limit 5.0 m"][0] < 0
    assert written["no return"][1] > 34 + 30, "so far above the laser [px]"


async def test_on_the_widest_screens_a_sheet_covers_all_of_the_settings(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1920, "height": 1080})
    await show(canned, page, "topic")
    await expect(page.locator("#sheet-topic[open], .pick-sheet[open]").first).to_be_visible()
    await page.evaluate(RISEN)
    sheet, drawer = [
        await page.locator(one).first.bounding_box() for one in (".view > .sheet[open]", "#panel-settings")
    ]
    assert sheet is not None
    assert drawer is not None
    assert abs(sheet["x"] - drawer["x"]) <= 2
    assert abs(sheet["width"] - drawer["width"]) <= 4


async def test_a_threshold_that_is_typed_is_whole_and_beside_its_unit(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 820, "height": 1180})
    await show(canned, page, "check-change")
    value = page.locator(".check-rows .v:focus")
    await expect(value).to_be_visible()
    assert await value.evaluate(
        """(value) => {
          const box = value.getBoundingClientRect();
          const [x, style] = [box.left + box.width / 2, getComputedStyle(value)];
          const beyond = parseFloat(style.outlineOffset) + parseFloat(style.outlineWidth);
          const unit = value.closest('.row').querySelector('.u').getBoundingClientRect();
          return document.elementFromPoint(x, box.bottom - 2) === value && box.right + beyond <= unit.left;
        }"""
    )


async def test_filter_and_search_of_the_alarm_log_are_of_one_height(phone: Phone, canned: Canned) -> None:
    page = phone.page
    for width, height in ((412, 915), (820, 1180), (1440, 900)):
        await page.set_viewport_size({"width": width, "height": height})
        await show(canned, page, "alarm-log")
        kinds, field = [await page.locator(f".log-tools > .{one}").bounding_box() for one in ("kinds", "field")]
        assert kinds is not None
        assert field is not None
        assert (kinds["y"], kinds["height"]) == (field["y"], field["height"])


@pytest.mark.parametrize("scene", ["files", "connect-saved"])
async def test_the_recordings_of_a_tablet_are_whole_rows_of_one_height(
    phone: Phone, canned: Canned, scene: str
) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 820, "height": 1180})
    await show(canned, page, scene)
    await expect(page.locator(".file-dock [data-f=file-actions] > li").last).to_be_visible()
    found = await page.evaluate("""() => {
      const box = (one) => one.getBoundingClientRect();
      const all = (names) => [...document.querySelectorAll(names)].filter((one) => one.checkVisibility());
      const heights = (names) => [...new Set(all(names).map((one) => Math.round(box(one).height)))];
      const edge = box(document.querySelector('.file-dock')).top;
      const cut = all('.files .file, .files-foot > .key').map(box).filter((one) => one.top < edge && one.bottom > edge);
      return {
        cut: cut.length,
        rows: heights('.files .list .file'),
        keys: heights('.file-dock [data-f=file-actions] > li'),
        none: getComputedStyle(document.querySelector('.files .list .thumb.none'), '::before').content,
      };
    }""")
    assert found["cut"] == 0
    assert len(found["rows"]) == 1
    assert len(found["keys"]) == 1
    assert "–" in found["none"], "a track that is not known is a dash"


async def test_the_list_of_cars_of_a_tablet_has_its_key_in_sight(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 820, "height": 1180})
    await show(canned, page, "cars")
    await page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    await expect(page.locator(".ledge > .mark-key")).to_be_visible()
    found = await page.evaluate("""() => {
      const sheet = document.querySelector('#sheet-cars').getBoundingClientRect();
      const key = document.querySelector('#sheet-cars [data-f=cars-control]');
      const [icon, text] = [key.querySelector('.i'), key.lastElementChild].map((one) => {
        const range = document.createRange();
        range.selectNodeContents(one);
        return (one.matches('.i') ? one : range).getBoundingClientRect();
      });
      return [sheet.bottom - key.getBoundingClientRect().bottom, text.left - icon.right];
    }""")
    assert found[0] >= 0, "whole"
    assert found[1] <= 16, "the icon stands beside its text"


@pytest.mark.parametrize(("width", "height"), [(820, 1180), (1440, 900)])
async def test_addresses_used_before_drop_down_from_their_field(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    page = phone.page
    await page.set_viewport_size({"width": width, "height": height})
    await show(canned, page, "connect-recent")
    await page.wait_for_function("() => document.querySelector(\"link[href*='drawers']\")?.sheet")
    await page.wait_for_function(RISEN)
    field, sheet = [await page.locator(one).bounding_box() for one in (".field:has(#address)", "#sheet-history")]
    assert field
    assert sheet
    assert abs(sheet["y"] - field["y"] - field["height"]) <= 4
    assert abs(sheet["x"] - field["x"]) <= 1
    assert abs(sheet["width"] - field["width"]) <= 1
