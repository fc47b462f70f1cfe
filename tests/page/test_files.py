"""The Files tab: what was recorded is listed, opened by a press, called by names, fetched, deleted and taken back."""

from __future__ import annotations

import functools
import re
from collections.abc import AsyncIterator
from datetime import UTC, datetime
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Locator, expect

from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.annotations import Annotations
from tests.page.barriers import SIZES, no_barrier
from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.drives import steady
from tests.page.processes import AT_AGENT, Process, replay, running, server
from tests.page.touch import DRAWN, stroke
from tests.server.recording.made import BEGAN_MS, record

HOUR_MS = 3_600_000
HOSTILE = "<img src=x onerror=alert(1)> \u05d0\u05d1 & “lot”"


def name_of(n: int) -> str:
    """The file's name of the n-th drive, an hour after the one before."""
    return f"car_{datetime.fromtimestamp((BEGAN_MS + n * HOUR_MS) / 1000, UTC).strftime('%Y%m%dT%H%M%SZ')}"


def fill(data: Path) -> None:
    folder = data / "recordings" / "car"
    for n in range(5):
        record(folder / f"{name_of(n)}.mcap", seconds=8.0, began_ms=BEGAN_MS + n * HOUR_MS)
    loud = record(
        folder / f"{name_of(5)}.mcap", seconds=30.0, began_ms=BEGAN_MS + 5 * HOUR_MS, ended="recovered",
        alarms=[(5.0, "warning"), (9.0, "critical"), (20.0, "critical")],
    )  # fmt: skip
    annotation_store.write(loud, Annotations(title=HOSTILE, note="two\nlines", tags=("wet",)))
    record(folder / f"{name_of(6)}.mcap", seconds=8.0, began_ms=BEGAN_MS + 6 * HOUR_MS, at=None)
    (folder / "notes.mcap").write_text("hello")


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    """A server with eight recordings that watches a calm car."""
    folder = tmp_path_factory.mktemp("files")
    fill(folder / "data")
    calm = steady(folder / "calm.bag", 3.0)
    async with running(*replay(calm)) as car, running(*server(folder / "data", car.address)) as process:
        yield process


@pytest_asyncio.fixture(loop_scope="session")
async def opened(phone: Phone, watch: Process) -> Phone:
    """The Files tab with all that is to be seen in it."""
    await phone.open(f"{watch.address}/#files")
    await phone.live()
    await expect(row(phone, name_of(5))).to_have_attribute("data-state", "read", timeout=20_000)
    await expect(row(phone, name_of(0))).to_have_attribute("data-state", "read", timeout=20_000)
    return phone


def row(phone: Phone, id: str) -> Locator:
    return phone.page.locator(f'#panel-files [data-f=recordings] [data-id="{id}"]')


def sheet(phone: Phone) -> Locator:
    return phone.page.locator("#sheet-file")


async def press_long(phone: Phone, where: Locator) -> None:
    box = await where.bounding_box()
    assert box is not None
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    await stroke(phone.page, (x, y, x, y), steps=1, rest_s=0.8)


async def test_case_7_6_2_pressing_a_file_opens_its_context_menu(opened: Phone) -> None:
    """By a press, a long one, the right button, the three dots and the keyboard."""
    item = row(opened, name_of(5))
    more = item.get_by_role("button")
    await item.scroll_into_view_if_needed()
    for press in (
        item.locator(".t").tap,
        functools.partial(press_long, opened, item.locator(".t")),
        functools.partial(item.click, button="right"),
        more.tap,
        functools.partial(more.press, "Enter"),
    ):
        await press()
        await expect(sheet(opened)).to_be_visible()
        await expect(sheet(opened).locator("h2")).to_have_text(HOSTILE)
        items = await sheet(opened).locator(".menu-list li").all_inner_texts()
        assert [re.sub(r"\n.*", "", one) for one in items] == [
            "Open replay", "Drive report", "Compare along the way", "Share", "E-mail", "Download",
            "Cut out an incident", "Verify", "Rename", "Note and tags", "Delete",
        ]  # fmt: skip
        about = sheet(opened).locator(".bd")
        for text in ("00:30 min", "2 critical alarms, 1 warning", "Recovered", "wet"):
            await expect(about).to_contain_text(text)
        await opened.page.keyboard.press("Escape")
        await expect(sheet(opened)).to_be_hidden()
    await expect(more).to_be_focused()


async def test_a_scroll_is_no_press(opened: Phone) -> None:
    await stroke(opened.page, (200, 600, 200, 300))
    await opened.page.wait_for_function("() => document.querySelector('#panel-files').scrollTop > 50")
    await expect(sheet(opened)).to_be_hidden()


async def test_a_row_says_what_was_driven_and_what_was_wrong(opened: Phone) -> None:
    loud, none, broken = row(opened, name_of(5)), row(opened, name_of(6)), row(opened, "notes-")
    broken = opened.page.locator("#panel-files [data-state=unreadable]")
    await expect(loud.locator("svg.thumb .al")).to_have_count(2)
    await expect(loud.locator("svg.thumb .aw")).to_have_count(1)
    await expect(loud).to_contain_text("recovered")
    assert "2 critical alarms" in await loud.inner_text()
    await expect(none.locator(".thumb")).to_have_text("no position")
    await expect(none).to_contain_text("no alarms")
    await expect(broken).to_contain_text("notes.mcap is not a recording: it is a text file.")
    await broken.get_by_role("button").tap()
    actions = await sheet(opened).locator(".menu-list li").all_inner_texts()
    assert not {"Open replay", "E-mail", "Cut out an incident"} & set(actions)
    assert await opened.page.evaluate("document.querySelectorAll('#panel-files img').length") == 0


async def test_the_menu_leads_here(opened: Phone) -> None:
    await opened.page.evaluate("location.hash = '#home'")
    await expect(opened.page.locator("#tab-home")).to_have_attribute("aria-selected", "true")
    for first in (None, "Signals"):
        if first:
            await opened.f("menu").tap()
            await opened.page.locator("#sheet-menu").get_by_text(first).tap()
            await expect(opened.f("title")).to_have_text(first)
        await opened.f("menu").tap()
        await opened.page.locator("#sheet-menu").get_by_text("View saved data").tap()
        await expect(opened.page.locator("#tab-files")).to_have_attribute("aria-selected", "true")
        await expect(row(opened, name_of(5))).to_be_in_viewport()
        await expect(opened.f("screen")).to_be_hidden()
        await opened.page.evaluate("location.hash = '#map'")
        await expect(opened.page.locator("#tab-map")).to_have_attribute("aria-selected", "true")


async def test_a_name_a_note_and_tags_are_kept_and_found(opened: Phone) -> None:
    item = row(opened, name_of(3))
    await item.get_by_role("button").tap()
    await sheet(opened).get_by_text("Rename").tap()
    await opened.page.locator("#file-name").fill("Gate 4, night")
    await opened.page.keyboard.press("Enter")
    await expect(sheet(opened)).to_be_hidden()
    await expect(item.locator(".t")).to_have_text("Gate 4, night")
    await item.get_by_role("button").tap()
    await sheet(opened).get_by_text("Note and tags").tap()
    await opened.page.locator("#file-note").fill("Fog.\nLights on.")
    await opened.page.locator("#file-tags").fill("fog, " + "x" * 41)
    await sheet(opened).get_by_role("button", name="Save").tap()
    await expect(sheet(opened).get_by_role("alert")).to_have_text(
        "Not saved. A tag has at most 40 letters; this has 41."
    )
    assert [line for line in opened.complaints if "422" not in line] == []
    opened.complaints.clear()
    await opened.page.locator("#file-tags").fill("fog, night")
    await sheet(opened).get_by_role("button", name="Save").tap()
    await expect(item.locator(".file-tag")).to_have_text(["fog", "night"])
    rows = opened.page.locator("#panel-files [data-f=recordings] .file")
    await opened.page.get_by_label("Search recordings").fill("LIGHTS on")
    await expect(rows).to_have_count(1)
    await opened.page.get_by_label("Search recordings").fill("no such text")
    await expect(opened.page.locator("#panel-files .empty")).to_contain_text("Nothing found")
    await opened.page.get_by_label("Search recordings").fill("")
    await opened.page.get_by_label("Which recordings").select_option(label="fog")
    await expect(rows).to_have_count(1)
    await expect(rows.first.locator(".t")).to_have_text("Gate 4, night")
    await opened.page.get_by_label("Which recordings").select_option(label="All")
    await expect(rows).to_have_count(8)


async def test_delete_asks_and_can_be_taken_back_at_once_and_later(opened: Phone) -> None:
    item = row(opened, name_of(2))
    head = opened.page.locator("#panel-files .sec")
    await expect(head).to_contain_text(re.compile(r"8 recordings, \d.*free"))
    for again in (False, True):
        await item.get_by_role("button").tap()
        await sheet(opened).get_by_text("Delete", exact=False).last.tap()
        await expect(sheet(opened)).to_contain_text("can be restored")
        if again:
            await sheet(opened).get_by_role("button", name="Keep it").tap()
            await expect(sheet(opened)).to_be_hidden()
            await expect(item).to_be_visible()
            await item.get_by_role("button").tap()
            await sheet(opened).locator(".menu-list li").last.tap()
        await sheet(opened).get_by_role("button", name="Delete").tap()
        await expect(item).to_have_count(0)
        await expect(head).to_contain_text("7 recordings")
        if not again:
            await opened.page.locator(".snack.note").get_by_role("button", name="Undo").tap()
            await expect(item).to_have_count(1)
    await opened.f("files-trash", "#panel-files").tap()
    await expect(head).to_contain_text("Trash: 1 recording")
    await expect(item).to_contain_text("deleted")
    await item.get_by_role("button").tap()
    await sheet(opened).get_by_text("Restore").tap()
    await expect(opened.page.locator("#panel-files .empty")).to_contain_text("The trash is empty")
    await opened.f("files-back", "#panel-files").tap()
    await expect(item).to_have_count(1)


async def test_the_trash_is_emptied_only_after_a_question(opened: Phone, watch: Process) -> None:
    answer = await opened.page.request.delete(f"{watch.address}/api/recordings/{name_of(1)}")
    assert answer.ok
    await opened.page.reload()
    await opened.f("files-trash", "#panel-files").tap()
    await opened.f("files-empty", "#panel-files").tap()
    await expect(sheet(opened)).to_contain_text("1 recording is deleted for good")
    await sheet(opened).get_by_role("button", name="Keep").tap()
    await expect(row(opened, name_of(1))).to_be_visible()
    await opened.f("files-empty", "#panel-files").tap()
    await sheet(opened).get_by_role("button", name="Empty the trash").tap()
    await expect(opened.page.locator("#panel-files .empty")).to_contain_text("The trash is empty")
    assert (await (await opened.page.request.get(f"{watch.address}/api/trash")).json())["recordings"] == []


async def test_the_file_itself_is_saved(opened: Phone, tmp_path: Path) -> None:
    await row(opened, name_of(5)).get_by_role("button").tap()
    await sheet(opened).get_by_text("Download").tap()
    async with opened.page.expect_download() as coming:
        await sheet(opened).get_by_role("link", name="MCAP").tap()
    saved = await coming.value
    assert saved.suggested_filename.startswith(f"{name_of(5)} _img src=x onerror=alert(1)_")
    await saved.save_as(tmp_path / "it.mcap")
    assert (tmp_path / "it.mcap").read_bytes().startswith(b"\x89MCAP0\r\n")
    await expect(sheet(opened)).to_be_hidden()


async def test_another_form_is_made_while_one_waits_and_can_be_cancelled(opened: Phone, tmp_path: Path) -> None:
    await row(opened, name_of(5)).get_by_role("button").tap()
    await sheet(opened).get_by_text("Download").tap()
    await sheet(opened).get_by_role("button", name="Drive report").tap()
    await expect(sheet(opened).get_by_role("progressbar")).to_be_visible()
    await sheet(opened).get_by_role("button", name="Cancel").tap()
    await expect(sheet(opened).get_by_role("button", name="GPX track")).to_be_visible()
    await expect(sheet(opened).get_by_role("button", name="ROS 2 bag")).to_have_count(0)  # this drive is of ROS 1
    async with opened.page.expect_download(timeout=40_000) as coming:
        await sheet(opened).get_by_role("button", name="GPX track").tap()
    await (await coming.value).save_as(tmp_path / "it.gpx")
    assert "<trkpt" in (tmp_path / "it.gpx").read_text()
    await expect(sheet(opened)).to_contain_text("Done.")
    await expect(sheet(opened).get_by_role("button", name="Save again")).to_be_visible()


async def test_an_incident_becomes_a_recording_of_its_own(opened: Phone) -> None:
    await row(opened, name_of(5)).get_by_role("button").tap()
    await sheet(opened).get_by_text("Cut out an incident").tap()
    alarms = sheet(opened).locator(".menu-list li")
    await expect(alarms).to_have_count(3)
    await expect(alarms.first).to_contain_text("A warning alarm")
    await alarms.nth(1).get_by_role("button").tap()
    clip = opened.page.locator("#panel-files [data-f=recordings] .file", has_text="clip")
    await expect(clip).to_have_count(1, timeout=40_000)
    await expect(clip).to_have_attribute("data-state", "read", timeout=40_000)
    await expect(clip).to_contain_text("00:30 min")  # all of it lies within 30 s of the alarm


async def test_verify_says_whether_it_is_as_it_was_recorded(opened: Phone, watch: Process) -> None:
    await row(opened, name_of(0)).click()
    about = sheet(opened).locator(".bd")
    await expect(about.locator("[data-f=chain]")).to_have_count(0)
    await sheet(opened).get_by_role("button", name="Verify").click()
    await expect(about.locator("[data-f=verified]")).to_have_text(re.compile(r"^Intact · [0-9a-f]{8}$"))
    await expect(about).to_contain_text(re.compile(r"Intact: \d+ records, head [0-9a-f]{64}\."))
    await sheet(opened).get_by_role("button", name="Back").click()
    await expect(about.locator("[data-f=chain]")).to_have_text(re.compile(r"^Event log: Intact · [0-9a-f]{8}$"))
    await opened.page.keyboard.press("Escape")


async def test_open_replay_shows_it(opened: Phone) -> None:
    await row(opened, name_of(5)).get_by_role("button").tap()
    await sheet(opened).get_by_text("Open replay").tap()
    await expect(opened.page.locator('[data-replay="on"]')).to_have_count(1, timeout=20_000)
    await expect(sheet(opened)).to_be_hidden()


async def test_e_mail_takes_the_recording_along(opened: Phone) -> None:
    await row(opened, name_of(5)).get_by_role("button").tap()
    await sheet(opened).get_by_text("E-mail").tap()
    await expect(opened.page.locator("#sheet-mail")).to_be_visible(timeout=15_000)
    await expect(sheet(opened)).to_be_hidden()


async def test_what_is_recorded_now_stands_on_top_counts_and_is_ended_by_hand(opened: Phone) -> None:
    live = opened.page.locator("#panel-files [data-live]")
    await expect(live).to_contain_text("Recording now")
    first = await live.inner_text()
    await expect(live).not_to_have_text(first)
    await live.get_by_role("button", name="End the recording").tap()
    sheet = opened.page.locator("#sheet-record")
    await expect(sheet).to_contain_text("The car moves at")
    await sheet.get_by_role("button", name="End the recording").tap()
    await expect(live).to_contain_text("Not recording", timeout=15_000)
    newest = opened.page.locator("#panel-files [data-f=recordings] .file").first
    await expect(newest).to_contain_text("Today", timeout=15_000)
    await live.get_by_role("button", name="Record").tap()
    await expect(live).to_contain_text("Recording now")


async def test_a_phone_that_shares_no_files_shares_a_link(opened: Phone) -> None:
    await opened.page.evaluate(
        """() => {
          window.shared = [];
          navigator.canShare = () => false;
          navigator.share = async (what) => { window.shared.push(what); };
        }"""
    )
    await row(opened, name_of(5)).get_by_role("button").tap()
    await sheet(opened).get_by_text("Share", exact=True).tap()
    await expect(sheet(opened)).to_contain_text("a link is shared instead")
    await sheet(opened).get_by_role("button", name="Share the link").tap()
    await expect(sheet(opened)).to_be_hidden()
    (shared,) = await opened.page.evaluate("window.shared")
    assert shared["url"].endswith(f"{AT_AGENT}/api/recordings/{name_of(5)}/file.mcap")


async def test_a_phone_that_shares_files_is_handed_the_file(opened: Phone) -> None:
    await opened.page.evaluate(
        """() => {
          window.shared = [];
          navigator.canShare = () => true;
          navigator.share = async ({ files }) => { window.shared.push([files[0].name, files[0].size]); };
        }"""
    )
    await row(opened, name_of(5)).get_by_role("button").tap()
    await sheet(opened).get_by_text("Share", exact=True).tap()
    await sheet(opened).get_by_role("button", name="Share the file").tap()
    ((name, size),) = await opened.page.evaluate("window.shared")
    assert name == f"{name_of(5)}.mcap"
    assert size > 1000


async def test_a_silent_server_is_said_and_the_list_is_not_passed_off_as_new(opened: Phone, watch: Process) -> None:
    watch.freeze()
    try:
        await expect(opened.f("files-state", "#panel-files")).to_contain_text(
            "The server does not answer", timeout=12_000
        )
    finally:
        watch.thaw()
    await expect(opened.f("files-state", "#panel-files")).to_be_empty(timeout=20_000)


async def test_no_barrier_in_any_sheet_of_a_file(opened: Phone) -> None:
    button = row(opened, name_of(5)).get_by_role("button")
    for action in ("Download", "Cut out an incident", "Verify", "Rename", "Note and tags", "Delete"):
        await button.tap()
        await sheet(opened).locator(".menu-list li", has_text=action).tap()
        await expect(sheet(opened).locator("h2")).to_contain_text(re.compile(action.split()[0]))
        await no_barrier(opened.page, action, "#sheet-file")
        await opened.page.keyboard.press("Escape")
        await expect(sheet(opened)).to_be_hidden()


async def test_the_sheet_of_a_file_is_within_every_screen(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#files")
    await phone.live()
    await row(phone, "car_2").get_by_role("button").tap()
    await expect(sheet(phone)).to_be_visible()
    await phone.page.emulate_media(reduced_motion="reduce")
    for width, height in SIZES:
        await phone.page.set_viewport_size({"width": width, "height": height})
        await phone.page.evaluate(DRAWN)
        box = await sheet(phone).bounding_box()
        is_docked = (width >= 1000 and height >= 600) or (width >= 700 and height >= 1060)
        # beside the list it always stands, and has no key that closes it
        close = await sheet(phone).get_by_role("button", name="Close").bounding_box() if not is_docked else box
        item = await sheet(phone).locator(".menu-list li").first.bounding_box()
        assert box is not None
        assert close is not None
        assert item is not None
        assert box["y"] >= 0, (width, height)
        assert close["y"] + close["height"] <= height, (width, height)
        assert round(item["height"], 2) >= 56, (width, height)


async def test_a_row_found_by_a_mark_names_the_mark(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#files")
    await phone.live()
    await expect(phone.page.locator("#panel-files .matched")).to_have_count(0)
    await phone.page.get_by_label("Search recordings").fill("control")
    found = row(phone, "car_0").locator(".matched")
    await expect(found).to_have_text(re.compile("^Mark at 04:06: control · Steering hunts"))
    for width, height in ((360, 740), (1440, 900)):
        await phone.page.set_viewport_size({"width": width, "height": height})
        await phone.page.evaluate(DRAWN)
        box, item = await found.bounding_box(), await row(phone, "car_0").bounding_box()
        assert box is not None
        assert item is not None
        assert box["width"] > 0.5 * item["width"], width
        assert item["y"] <= box["y"] <= item["y"] + item["height"] - box["height"], width


async def test_saved_data_is_there_without_a_car(phone: Phone, tmp_path: Path) -> None:
    record(tmp_path / "recordings" / "car" / f"{name_of(0)}.mcap", seconds=8.0)
    async with running(*server(tmp_path)) as idle:
        await phone.open(idle.address)
        await phone.f("saved", "#connect").tap()
        board = phone.page.locator(".saved-board")
        await expect(board.locator(f'[data-id="{name_of(0)}"]')).to_contain_text("00:08 min", timeout=20_000)
        await board.locator(f'[data-id="{name_of(0)}"] .t').tap()
        await expect(sheet(phone)).to_be_visible()
        await phone.page.keyboard.press("Escape")
        await phone.f("saved-back", ".saved-board").tap()
        await expect(board).to_have_count(0)
        await expect(phone.page.locator("#connect h1")).to_be_visible()
        await phone.f("saved", "#connect").tap()
        await expect(board).to_be_visible()
        await phone.page.go_back()  # the phone's back key
        await expect(board).to_have_count(0)
        await phone.f("saved", "#connect").tap()
        await board.locator(f'[data-id="{name_of(0)}"] .t').tap()
        await sheet(phone).get_by_text("Open replay").tap()
        await expect(phone.page.locator('[data-replay="on"]')).to_have_count(1, timeout=20_000)
        await expect(board).to_have_count(0)
        await phone.page.get_by_role("button", name="Leave").tap()
        await expect(phone.page.locator("#connect h1")).to_be_visible()
        await phone.f("saved", "#connect").tap()
        await expect(board).to_be_visible()
        await phone.page.go_back()  # beneath is the entry of the board that the recording closed
        await expect(board).to_have_count(0)
