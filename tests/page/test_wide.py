"""Windows of every size: nothing blank, sliced, overlapping or cut off; the panes of a wide screen; its keys."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import Page, Route, expect

from tests.page.barriers import fits, no_barrier
from tests.page.canned import Canned, Json, alarm, live
from tests.page.conftest import Phone
from tests.page.screenshots import several, show, silent_car

EDGES = (346, 380, 700, 760, 1000, 1200, 1800)  # where the layout changes, as the style sheets have it
WIDTHS = sorted({*range(320, 2561, 40), *(edge + by for edge in EDGES for by in (-1, 0, 1))})
HEIGHTS = (480, 600, 900, 1059, 1180)
EMPTY = 0.16  # of the window: a list of alarms without alarms is the largest part that may be empty
LOW = 520  # up to it the gauge fills the height, as on a phone on its side
FEW = 1.0  # a list of few files may leave all below it empty
# Parts over each other, parts cut, text cut, and the largest empty rectangle.
WRONG = Path(__file__).with_name("window_faults.js").read_text(encoding="utf-8").split("\n", 1)[1].rstrip().rstrip(";")
DRAWN = "new Promise((done) => requestAnimationFrame(() => requestAnimationFrame(done)))"


async def walk(page: Page, sizes: list[tuple[int, int]], empty: float = EMPTY) -> dict[str, Any]:
    """What is wrong at each of these sizes, where something is."""
    found = {}
    for width, height in sizes:
        await page.set_viewport_size({"width": width, "height": height})
        await page.evaluate(DRAWN)
        wrong = await page.evaluate(WRONG, empty)
        if wrong:
            await page.wait_for_timeout(500)  # a part may be fetched, or begin to be drawn
            wrong = await page.evaluate(WRONG, empty)
        if height <= LOW:  # beside the gauge of a low window, what stands at the right continues under the rail
            wrong = [one for one in wrong if not one.startswith("rail over")]
        if wrong:
            found[f"{width} × {height}"] = wrong
    return found


async def test_no_window_has_a_blank_a_sliced_or_a_covered_part(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#home")  # not tapped yet: it shows that its sound is off
    await phone.live()
    await expect(phone.f("sound-off")).to_be_visible()
    await phone.page.locator("[data-tab=map]").click()
    await expect(phone.page.locator("#panel-map .phone-mark .ph")).to_be_visible()  # no head of a pane
    await phone.page.locator("[data-tab=home]").click()
    assert await walk(phone.page, [(1440, 900)]) == {}
    assert "banner" not in str(await walk(phone.page, [(915, 412)]))
    await phone.page.set_viewport_size({"width": 1920, "height": 1080})
    await expect(phone.page.locator("#monitor [data-pane=signals] li").first).to_contain_text("20.0 Hz")
    rows = phone.page.locator("#monitor [data-pane=signals] li")
    published = sum(one["freshness"] != "not_published" for one in canned.state["signals"].values())
    more = published - await rows.count()
    assert more > 0
    await expect(phone.f("head-signals")).to_have_text(f"Signals, {published - more} of {published}")
    await expect(phone.f("driven")).to_have_text("76.1")
    await expect(phone.f("head-people")).to_have_text("unknown")  # who is there is unknown
    await show(canned, phone.page, "home")
    await phone.live()
    assert await walk(phone.page, [(width, HEIGHTS[n % 5]) for n, width in enumerate(WIDTHS)]) == {}
    await phone.page.set_viewport_size({"width": 412, "height": 915})
    await show(canned, phone.page, "replay")
    assert await walk(phone.page, [(width, HEIGHTS[n % 5]) for n, width in enumerate(WIDTHS[::3])]) == {}


@pytest.mark.timeout(240)
@pytest.mark.parametrize("what", ["home", "critical", "map", "scan", "files", "settings"])
async def test_no_tab_and_no_alarm_overlaps_once_the_mark_key_is_there(phone: Phone, canned: Canned, what: str) -> None:
    """Each tab, and a critical alarm, at the edges of the layout and on low windows, with all that comes late."""
    if what == "critical":
        canned.state = critical()
    await phone.open("about:blank")
    await phone.open(f"{canned.address}/#{'home' if what == 'critical' else what}")
    await phone.live()
    await expect(phone.page.locator("#monitor > .ledge > *").first).to_be_attached(timeout=15_000)
    edges = sorted({edge + by for edge in EDGES for by in (-1, 0)} | {320, 412, 480, 820, 1440, 1920, 2560})
    low = [(width, height) for width in (1200, 1440, 1920) for height in (480, 520, 521, 560)]
    assert await walk(phone.page, [(width, HEIGHTS[n % 5]) for n, width in enumerate(edges)] + low, FEW) == {}


def critical(**more: Any) -> Json:
    """The car is too fast, and something else waits too."""
    fast = alarm(
        "speed_limit", "Speed above limit", priority="critical", place="dialog", sound="high", actions=["acknowledge"],
        measured={"value": 12.6, "unit": "m/s"}, limit={"value": 11.0, "unit": "m/s"},
    )  # fmt: skip
    return live() | {"alarms": [fast, alarm("phone_missing", "Phone position missing")]} | more


def answered(canned: Canned) -> list[str]:
    return [str(one["alarm"]) for one in canned.received if one["kind"] in ("acknowledge", "silence")]


async def until_answered(canned: Canned, *names: str) -> None:
    async with asyncio.timeout(20):
        while answered(canned) != list(names):
            await asyncio.sleep(0.05)


@pytest.mark.gate
async def test_a_critical_alarm_stands_in_its_pane_takes_no_focus_and_goes_with_the_window(
    phone: Phone, canned: Canned
) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#settings")
    await phone.live()
    find = page.locator("#panel-settings input[type=search]")
    await find.click()  # it takes the focus only once its tab is in front
    canned.state = critical()
    sheet = page.locator("#monitor [data-slot=alarm] #sheet-alarm")
    await expect(sheet).to_be_visible()
    await expect(sheet).to_contain_text("12.6")
    assert await page.locator("dialog:modal").count() == 0
    listed = page.locator("#monitor [data-pane=alarms] li")
    await expect(listed).to_have_count(1)  # what stands in the head is no row as well
    await expect(listed).to_contain_text("Phone position missing")
    await expect(page.locator("#monitor [data-f=pages]")).to_have_text("2 of 2")
    await expect(find).to_be_focused()
    await page.keyboard.type("a s ? 1")  # typed, not pressed
    await expect(find).to_have_value("a s ? 1")
    # A page in the place of the panes hides it: there it rises as on a phone; and back.
    for tab, is_modal in (("files", 1), ("home", 0)):
        await page.evaluate("tab => { location.hash = `#${tab}`; }", tab)
        await expect(page.locator("#sheet-alarm:modal")).to_have_count(is_modal)
        await expect(page.locator("#sheet-alarm")).to_be_visible()
    for width, is_modal in ((412, 1), (1440, 0)):
        await page.set_viewport_size({"width": width, "height": 900})
        await expect(page.locator("#sheet-alarm:modal")).to_have_count(is_modal)
        await expect(page.locator("#sheet-alarm")).to_be_visible()
    assert answered(canned) == []
    await sheet.get_by_role("button", name="Acknowledge").click()
    await until_answered(canned, "speed_limit")


async def test_of_a_lost_car_only_its_values_are_covered(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await show(canned, page, "link-lost")
    await page.set_viewport_size({"width": 1440, "height": 900})
    await expect(page.locator("#monitor [data-slot=link] #sheet-lost")).to_be_visible()
    on_top = """(name) => { const at = document.querySelector(name).getBoundingClientRect();
      return document.elementFromPoint(at.left + at.width / 2, at.top + at.height / 2)?.closest(name) != null; }"""
    values = [
        f"#monitor {part}"
        for part in (".gauge", "[data-part=pedals] .steer .v", "[data-part=position] .v", ".mapbox", ".plot")
    ]
    for part in values:
        assert not await page.evaluate(on_top, part), part
    for part in ("[data-pane=alarms]", "[data-pane=log]", "[data-part=checks].pane", "#monitor > .rail [data-f=stop]"):
        assert await page.evaluate(on_top, part), part
    await expect(page.locator("[data-part=trends] .row .n >> visible=true")).to_have_count(0)
    for width, height in ((820, 1180), (1180, 820)):  # also once the dialog is answered
        await page.set_viewport_size({"width": width, "height": height})
        await page.evaluate("document.querySelector('#sheet-lost').style.setProperty('visibility', 'hidden')")
        for part in values:
            assert not await page.evaluate(on_top, part), (part, width)


# The key A at the moment at which the alarm is drawn.
PRESS_AT_ONCE = """() => new Promise((done) => {
  const look = () => {
    const slot = document.querySelector('#monitor [data-slot=alarm]');
    if (!slot?.textContent.includes('Speed above limit')) return requestAnimationFrame(look);
    document.body.dispatchEvent(new KeyboardEvent('keydown', { key: 'a', bubbles: true, cancelable: true }));
    done();
  };
  look();
})"""


@pytest.mark.gate
async def test_keys_of_a_keyboard(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await expect(phone.f("head-alarms")).to_have_text("none active")  # is written by what mounts the keys
    for key, tab in (("2", "files"), ("3", "settings"), ("Escape", "home")):
        await page.keyboard.press(key)
        await expect(page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")
    canned.state = critical()
    await page.evaluate(PRESS_AT_ONCE)  # nobody can have read it yet
    await expect(page.locator(".snack.note")).to_contain_text("Not acknowledged")
    await page.wait_for_timeout(1100)
    await page.keyboard.press("s")
    await page.keyboard.press("a")
    await until_answered(canned, "speed_limit", "speed_limit")
    assert not [one for one in canned.received if one["kind"] in ("slow_down", "arm")]
    canned.state = live()
    await page.keyboard.press("?")
    keys = page.locator("#sheet-keys")
    await expect(keys).to_contain_text("Acknowledge")
    await page.keyboard.press("2")  # the sheet has the keys now
    await expect(page.locator("#tab-home")).to_have_attribute("aria-selected", "true")
    await keys.get_by_role("button", name="Turn these keys off").click()
    await page.keyboard.press("Escape")
    await expect(keys).to_have_count(0)
    await page.keyboard.press("2")
    await expect(page.locator("#tab-home")).to_have_attribute("aria-selected", "true")


async def test_no_layout_keeps_anybody_out(phone: Phone, canned: Canned) -> None:
    """In one walk: both themes, live, stale, critical and replay; where a layout has parts of its own."""
    for name, sizes in (
        ("home-fault", ((1440, 900), (820, 1180), (320, 568))),
        ("home-stale", ((1440, 900),)),
        ("replay", ((1440, 900),)),
        ("settings", ((1440, 900),)),
    ):
        await phone.page.set_viewport_size({"width": 412, "height": 915})
        await show(canned, phone.page, name)
        for width, height in sizes:
            await phone.page.set_viewport_size({"width": width, "height": height})
            await no_barrier(phone.page, f"{name} of {width} × {height}")
            await fits(phone.page, f"{name} of {width} × {height}")


async def test_what_asks_in_the_pane_leaves_room_for_the_list(phone: Phone, canned: Canned) -> None:
    """A long sentence, the banner of the sound and a chattering alarm at once: no row and no key is cut."""
    page = phone.page
    await page.set_viewport_size({"width": 1440, "height": 900})
    canned.state = several()
    canned.state["alarms"][0] |= {
        "place": "dialog", "actions": ["acknowledge"], "needs_ack": True,
        "trip_text": "Obstacle 4.98 m ahead, 5.0 m needed", "text": "Obstacle 8.8 m ahead, 4° right, 5.0 m needed",
        "advice": "The safety driver must brake or steer clear.",
    }  # fmt: skip
    canned.state["alarm_load"] |= {"chattering": ["Speed above limit"]}
    await phone.page.goto(f"{canned.address}/#home")
    await expect(page.locator(".alarms-pane #sheet-alarm")).to_be_visible()
    await expect(phone.f("sound-off", "#monitor")).to_be_visible()
    pane, foot, rows = (page.locator(f".alarms-pane{one}") for one in ("", " .alarms-foot", " .alarms > li:visible"))
    await expect(rows.first).to_be_visible()
    await page.wait_for_timeout(500)
    inside, low, row = [await one.bounding_box() for one in (pane, foot, rows.last)]
    assert inside is not None
    assert low is not None
    assert row is not None
    assert low["y"] + low["height"] <= inside["y"] + inside["height"] + 1
    assert row["y"] + row["height"] <= low["y"] + 1


#: How far something ends from each side of the page within its frame: that of an active critical alarm insets it [px].
INSETS = """(one) => {
  const [at, board] = [one.getBoundingClientRect(), document.querySelector('#monitor')];
  const [page, { paddingLeft, paddingRight }] = [board.getBoundingClientRect(), getComputedStyle(board)];
  return [at.left - page.left - parseFloat(paddingLeft), page.right - parseFloat(paddingRight) - at.right];
}"""


@pytest.mark.gate
async def test_no_old_speed_stands_in_the_bar_of_a_page(phone: Phone, canned: Canned) -> None:
    """Files of a silent car stay usable: only the speed is covered, and a server that falls silent covers all of it."""
    page = phone.page
    await page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#files")
    await phone.live()
    cover, veil = page.locator(".bar-speed > .cover"), page.locator("#monitor > .view > .veil")
    await expect(cover).to_have_css("opacity", "0")
    canned.state = silent_car(live())
    await expect(cover).to_have_css("opacity", "1")
    await expect(veil).to_have_css("opacity", "0")
    await page.locator("#panel-files .list .file[data-id]").nth(1).click()  # it is not in the way
    await expect(page.locator("#panel-files .file-dock h2")).not_to_be_empty()
    await expect(page.locator(".file .file-tag").first).to_have_css("border-top-width", "1px")
    await expect(page.locator("#monitor .top > .chip")).to_have_css(
        "border-top-width", "0px"
    )  # of the bar, not of a tag
    canned.silent = True
    await expect(veil).to_have_css("opacity", "1")
    await expect(cover).to_have_css("opacity", "1")
    sides: list[float] = await veil.evaluate(INSETS)
    assert sides == [0, 0]


@pytest.mark.own_phone
@pytest.mark.parametrize(
    ("more", "link", "text"),
    [
        ({"format": "folder", "several_files": "a folder of several files"}, None, "It is a folder of several files"),
        ({"format": "zstd", "several_files": None}, "Packed MCAP or db3", "the file as it is, packed with zstd"),
    ],
)
async def test_what_a_recording_can_be_downloaded_as(
    phone: Phone, canned: Canned, more: dict[str, str | None], link: str | None, text: str
) -> None:
    page = phone.page

    async def changed(route: Route) -> None:
        listed = await (await route.fetch()).json()
        listed["recordings"] = [row | more for row in listed["recordings"]]
        await route.fulfill(json=listed)

    await page.route(re.compile(r"/api/recordings\?"), changed)
    await page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#files")
    await phone.live()
    dock = page.locator("#panel-files .file-dock")
    await expect(dock.get_by_role("button", name="Share")).to_have_count(1 if link else 0)
    await dock.get_by_role("button", name="Download").click()
    await expect(dock).to_contain_text(text)
    await expect(dock.locator("a[download]")).to_have_count(1 if link else 0)
    if link:
        await expect(dock.get_by_role("link", name=link)).to_be_visible()
    await page.unroute_all(behavior="ignoreErrors")  # one that is still answering is no fault of the next test


async def test_files_of_a_desktop_show_the_chosen_recording_beside_the_list(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#files")
    await phone.live()
    await expect(phone.f("bar-speed")).to_have_text("4.2")  # the gauge is covered
    dock, rows = page.locator("#panel-files .file-dock"), page.locator("#panel-files .list .file[data-id]")
    await expect(dock).to_contain_text("1.8 km")  # the newest
    await expect(dock.locator(".file-raised")).to_contain_text("Speed above limit")
    await no_barrier(page, "Files of a desktop")
    await rows.nth(3).click()
    await expect(dock.locator("h2")).to_have_text("Rehearsal lot")
    await expect(rows.nth(3)).to_have_attribute("data-chosen", "")
    await dock.get_by_role("button", name="Delete").click()
    await expect(dock.locator("h2")).to_have_text("Delete Rehearsal lot?")
    await dock.get_by_role("button", name="Keep it").click()
    await expect(dock.locator("h2")).to_have_text("Rehearsal lot")  # never empty
    assert await page.locator("dialog:modal").count() == 0
    canned.state = critical()  # an alarm leaves it as it is
    await expect(page.locator("#sheet-alarm:modal")).to_be_visible()
    await expect(dock.locator("h2")).to_have_text("Rehearsal lot")
    canned.state = live()
    await expect(page.locator("#sheet-alarm")).to_be_hidden()
    await page.set_viewport_size({"width": 412, "height": 915})
    await expect(dock).to_be_hidden()
    await rows.nth(0).click()
    await expect(page.locator(".file-sheet[open]")).to_contain_text("1.8 km")


async def test_a_named_recording_takes_no_more_room_in_the_table_than_others(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#files")
    named, other = (page.locator(f"#panel-files .list [data-id=car_{n}]") for n in (3, 4))
    await expect(named.locator(".t")).to_have_text("Rehearsal lot")
    await expect(named.locator(".when")).to_be_visible()
    await expect(named.locator(".when + span")).to_have_text("CATVehicle")
    boxes = [await one.bounding_box() for one in (named, other, named.locator(".when"), named.locator(".t"))]
    assert all(boxes)
    row, plain, when, name = (box for box in boxes if box)
    assert row["height"] <= plain["height"] + 20, "its tag"
    assert abs(when["x"] - name["x"]) < 1
    assert when["y"] >= name["y"] + name["height"] - 1


@pytest.mark.gate
async def test_files_of_a_tablet_give_the_car_the_wider_column_and_leave_no_gap_among_the_keys(
    phone: Phone, canned: Canned
) -> None:
    """What stands beside a name is longer than it: when, and that the file was recovered."""
    page = phone.page
    await page.set_viewport_size({"width": 820, "height": 1180})
    await phone.open(f"{canned.address}/#files")
    keys = page.locator(".file-dock [data-f=file-actions] > li:not([hidden])")
    await expect(keys.last).to_be_visible()
    name, car = [await page.locator(f".files-heads > :nth-child({n})").bounding_box() for n in (2, 3)]
    assert name
    assert car
    assert car["width"] > 1.2 * name["width"]
    for width, height in ((820, 1180), (1440, 900), (1920, 1080)):
        await page.set_viewport_size({"width": width, "height": height})
        tops = [round(one) for one in await keys.evaluate_all("(all) => all.map((one) => one.offsetTop)")]
        assert len({tops.count(top) for top in tops}) == 1, f"each row has as many at {width} px"


async def test_advisories_are_in_no_column_of_warnings(phone: Phone, canned: Canned) -> None:
    page = phone.page
    await page.set_viewport_size({"width": 1440, "height": 900})
    await phone.open(f"{canned.address}/#files")
    await phone.live()
    counts = page.locator("#panel-files .list .file", has_text="advisories").locator(".counts").first
    await expect(counts.locator("[data-priority=advisory]")).to_have_text("3 advisories")
    ends = {
        name: await counts.locator(f"[data-priority={name}]").bounding_box()
        for name in ("critical", "warning", "advisory")
    }
    critical_box, warning_box, advisory_box = (ends[name] for name in ends)
    assert critical_box
    assert warning_box
    assert advisory_box
    assert advisory_box["y"] >= warning_box["y"] + warning_box["height"] - 1
    assert advisory_box["x"] < warning_box["x"]
    assert critical_box["y"] + critical_box["height"] <= advisory_box["y"] + 1


@pytest.mark.parametrize(("width", "height"), [(820, 1180), (1440, 900)])
async def test_nothing_scrolls_the_speed_out_of_sight(phone: Phone, canned: Canned, width: int, height: int) -> None:
    """Neither a script nor a find in the page: only panels scroll."""
    await phone.page.set_viewport_size({"width": width, "height": height})
    await phone.open(f"{canned.address}/#settings")
    await phone.live()
    speed = phone.page.locator(".gauge .speed")
    await phone.page.locator('[data-part="departure"] summary').tap()
    await expect(phone.f("sound-off")).to_be_hidden()
    last = phone.page.locator('[data-part="departure"] .dep-edit > li').first
    await expect(last).to_be_visible()
    before = await speed.bounding_box()
    for block in ("start", "center", "end"):
        await last.evaluate("(one, block) => one.scrollIntoView({ block, inline: block })", block)
        await phone.page.evaluate(DRAWN)
        assert await speed.bounding_box() == before
