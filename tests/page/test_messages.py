"""How many messages a page sends, and what stands beside a replay on a desktop: its log, its trends, its time."""

from __future__ import annotations

import asyncio
import json
import math
import re
import time
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Locator, Page, WebSocket, expect

from tests.http import http_client
from tests.page import drives
from tests.page.canned import Canned, check, live
from tests.page.conftest import Phone
from tests.page.processes import running, server, simulate
from tests.page.screenshots import replayed, replayed_timeline
from tests.server.recording import made

A_SECOND = 25
DESKTOP = {"width": 1440, "height": 900}
OPENS_MS = 40_000
LIVE_EVENT = {
    "n": 117, "at_ms": 1_790_000_000_000, "alarm": "phone_missing", "occurrence": 1, "change": "raised",
    "priority": "warning", "title": "Phone position missing", "text": "", "by": None,
}  # fmt: skip


@dataclass
class Sent:
    """What a page sends, with its time [s]."""

    times_s: list[float] = field(default_factory=list)
    kinds: list[str] = field(default_factory=list)

    def watch(self, page: Page) -> None:
        def note(payload: str | bytes) -> None:
            self.times_s.append(time.monotonic())
            self.kinds.append(json.loads(payload)["kind"])

        def begin(socket: WebSocket) -> None:
            socket.on("framesent", note)

        page.on("websocket", begin)

    @property
    def most_in_a_second(self) -> int:
        return max((sum(a <= b < a + 1.0 for b in self.times_s) for a in self.times_s), default=0)


async def states(page: Page) -> int:
    return int(await page.evaluate("Number(document.documentElement.dataset.states ?? 0)"))


async def replaying(phone: Phone, canned: Canned) -> Page:
    """The canned recording of four minutes on a desktop."""
    canned.state, canned.timeline = replayed(live()), replayed_timeline()
    await phone.page.set_viewport_size(DESKTOP)  # type: ignore[arg-type]
    await phone.open(f"{canned.address}/?replay=car_0&t=246#home")
    await phone.page.wait_for_selector('html[data-replay="on"]', state="attached", timeout=OPENS_MS)
    await expect(phone.page.locator(".scrub .time-line:not([inert])")).to_be_visible()
    return phone.page


@pytest.mark.gate
async def test_a_page_that_is_flooded_with_offers_sends_a_bounded_number_of_messages_for_each_picture(
    phone: Phone, canned: Canned
) -> None:
    page = await replaying(phone, canned)
    canned.floods = True
    await phone.drawn(3)
    begun, drawn = len(canned.received), await states(page)
    await phone.drawn(8)
    assert len(canned.received) - begun <= A_SECOND * (await states(page) - drawn)
    canned.floods = False


@pytest.mark.gate
async def test_beside_a_replay_stands_its_own_log_and_the_tape_is_no_time_of_day(phone: Phone, canned: Canned) -> None:
    canned.log = [LIVE_EVENT]
    page = await replaying(phone, canned)
    log = page.locator("#monitor [data-pane=log]")
    await expect(log.locator("li")).to_have_count(1)
    await expect(log.locator("li")).to_contain_text("Speed above limit")
    await expect(log).to_contain_text("of the recording")
    await expect(log).not_to_contain_text("Phone position missing")
    await expect(page.locator(".replay-top .n")).to_have_text("04:06 of 08:32")
    canned.state["replay"]["at_s"] = 380.0
    await expect(log.locator("li").first).to_contain_text("GPS drift")
    await expect(log.locator("li").nth(1)).to_contain_text("Speed above limit: ended")
    await expect(page.locator("#monitor [data-part=reach]")).to_contain_text("Live:")


@pytest.mark.gate
async def test_of_a_recording_the_criticals_are_listed_first_and_a_press_opens_the_replay_there(
    phone: Phone, canned: Canned
) -> None:
    canned.timeline = replayed_timeline()
    page = phone.page
    await page.set_viewport_size(DESKTOP)  # type: ignore[arg-type]
    await phone.open(f"{canned.address}/#files")
    await phone.live()
    rows = page.locator("#panel-files .file-raised button")
    await expect(rows).to_have_count(3)
    await expect(rows.first).to_contain_text("Speed above limit")
    columns = page.locator("#panel-files .files-heads span")
    assert await columns.all_inner_texts() == ["Track", "Recording", "Car", "Length", "Size", "Critical", "Warning"]
    await rows.first.click()
    await expect(page.locator("html[data-replay]")).to_be_attached()
    opened = [one for one in canned.received if one["kind"] == "replay" and one["do"] == "open"]
    assert [round(one["at_s"]) for one in opened] == [251], "5 s before"


CUT = """(selector) => {
  const isCut = (part, box) => {
    const at = part.getBoundingClientRect();
    const { textOverflow, display } = getComputedStyle(part);
    const isWider = part.scrollWidth > part.clientWidth + 1 && textOverflow !== 'ellipsis' && display !== 'inline';
    return at.top < box.top - 1 || at.bottom > box.bottom + 1 || at.right > box.right + 1 || isWider;
  };
  const seen = (part) => part.checkVisibility() && part.textContent.trim() && !part.children.length;
  return [...document.querySelectorAll(selector)].filter((one) => one.checkVisibility()).flatMap((one) => {
    const box = one.getBoundingClientRect();
    const cut = [...one.querySelectorAll('*')].filter((part) => seen(part) && isCut(part, box));
    return cut.map((part) => `${part.textContent} ${Math.round(box.height)}`);
  });
}"""
SIZES = [(1200, 700), (1366, 768), (1440, 900), (1920, 1080), (2560, 1440)]


async def test_no_value_of_the_trends_is_cut(phone: Phone, canned: Canned) -> None:
    page = await replaying(phone, canned)
    await expect(page.locator(".trends-pane")).to_have_count(4)
    for width, height in SIZES:
        await page.set_viewport_size({"width": width, "height": height})
        await phone.drawn(2)
        assert await page.evaluate(CUT, ".trends-head") == [], (width, height)


async def test_on_the_widest_screens_no_tile_is_cut_and_a_sheet_covers_whole_panes(
    phone: Phone, canned: Canned
) -> None:
    page = phone.page
    canned.state["checks"] = [
        {**canned.state["checks"][0], "label": f"Check {n}", "verdict": "unknown", "brief": "not checked: no receiver"}
        for n in range(24)
    ]
    canned.checks = {one["id"]: check(one["id"], one["label"]) for one in canned.state["checks"]}
    for width, height in ((1920, 1080), (2560, 1440), (1800, 860)):
        await page.set_viewport_size({"width": width, "height": height})
        await phone.open("about:blank")
        await phone.open(f"{canned.address}/#home")
        await phone.live()
        await expect(page.locator("#monitor [data-pane=signals] li").first).to_be_visible()
        await expect(page.locator("[data-f=tiles] li")).to_have_count(25)
        await phone.drawn(2)
        assert await page.evaluate(CUT, "[data-f=tiles] li > button") == [], (width, height)
        await page.locator("[data-f=tiles] li button").first.press("Enter")
        await expect(page.locator("#monitor .check-view")).to_be_visible()
        await phone.drawn(2)
        sliced = await page.evaluate(SLICED)
        assert sliced == [], (width, height)


SLICED = """() => {
  const cover = document.querySelector('#monitor > .view > .screen').getBoundingClientRect();
  const parts = '#monitor .pager > :is(section, .panel), #monitor .pane, #monitor .drive';
  return [...document.querySelectorAll(parts)].filter((one) => one.checkVisibility()).flatMap((one) => {
    const at = one.getBoundingClientRect();
    const width = Math.min(at.right, cover.right) - Math.max(at.left, cover.left);
    const height = Math.min(at.bottom, cover.bottom) - Math.max(at.top, cover.top);
    const isCut = width > 2 && height > 2 && (width < at.width - 2 || height < at.height - 2);
    return isCut && at.width ? [`${one.className} ${width} of ${at.width}`] : [];
  });
}"""
PLACES = {
    ".facts-line > :nth-child(1)": 3,
    ".facts-line > :nth-child(2)": 4,
    "[data-priority=critical]": 5,
    "[data-priority=warning]": 6,
}  # of a row: the head over it


@pytest.mark.parametrize(("width", "height"), [(820, 1180), (1024, 768), (1200, 620), (1440, 900), (1920, 1080)])
async def test_files_have_their_keys_at_the_foot_and_each_figure_under_its_head(
    phone: Phone, canned: Canned, width: int, height: int
) -> None:
    page = phone.page
    await page.set_viewport_size({"width": width, "height": height})
    await phone.open(f"{canned.address}/#files")
    await phone.live()
    files = page.locator("#panel-files")
    await expect(files.locator(".file-raised button")).to_have_count(3)
    dock, keys = files.locator(".file-dock"), files.locator("[data-f=file-actions]")
    outer, inner = await dock.bounding_box(), await keys.bounding_box()
    assert outer is not None
    assert inner is not None
    assert abs(outer["y"] + outer["height"] - inner["y"] - inner["height"]) <= 4, "at the foot"
    right = "one => Math.round(one.getBoundingClientRect().right)"
    heads = [await one.evaluate(right) for one in await files.locator(".files-heads span").all()]
    row = files.locator(".file[data-id]").first
    for place, column in PLACES.items():
        assert abs(await row.locator(place).evaluate(right) - heads[column]) <= 2, (place, heads)


# -- with a real server ----------------------------------------------------------------------------------------------


def speed(t: float) -> Any:
    """Too fast from 30 s to 38 s; silent, with all else, from 50 s to 56 s."""
    return None if 50 <= t < 56 else drives.twist(12.4 if 30 <= t < 38 else 6.0 + math.sin(t / 5))


def scan(t: float) -> Any:
    return None if t < 8 or 50 <= t < 56 else drives.street(t, gap_m=20.0)


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def street(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[tuple[str, dict[str, str]]]:
    """A server with a live car, a bag whose first scan comes after 8 s, and a recording with its alarms; its address,
    and the recordings by the names of their files."""
    data = tmp_path_factory.mktemp("data")
    folder = data / "recordings" / "car"
    folder.mkdir(parents=True)
    drives.write(folder / "street.bag", {"speed": speed, "scan": scan}, seconds=80.0)
    warnings = [(1.0 + n / 2, "warning") for n in range(12)]
    made.record(folder / "car_20260921T142640Z.mcap", seconds=30.0, alarms=[*warnings, (20.0, "critical")])
    async with running(*simulate()) as car, running(*server(data, car.address)) as process:
        async with http_client() as client, asyncio.timeout(60):
            while len(rows := (await client.get(f"{process.address}/api/recordings")).json()["recordings"]) < 2:
                await asyncio.sleep(0.2)
        yield process.address, {Path(row["file"]).suffix: row["id"] for row in rows}


@pytest.mark.parametrize("width", [412, 1440, 1920])
async def test_a_page_sends_at_most_25_messages_a_second_live_and_in_any_replay(
    phone: Phone, street: tuple[str, dict[str, str]], width: int
) -> None:
    address, recording = street[0], street[1][".bag"]
    page, sent = phone.page, Sent()
    sent.watch(page)
    await page.set_viewport_size({"width": width, "height": 1000})
    await phone.open(f"{address}/#home")
    await phone.live()
    await phone.drawn(15)
    await phone.open(f"{address}/?replay={recording}&t=0#home")
    await page.wait_for_selector('html[data-replay="on"]', state="attached", timeout=OPENS_MS)
    await expect(page.locator(".scrub .time-line:not([inert])")).to_be_visible()
    await phone.drawn(15)  # before the first scan
    slider = page.get_by_role("slider", name="Position in the recording")
    await slider.press("End")
    await phone.drawn(5)
    await slider.press("Home")  # and back to there
    await phone.drawn(15)
    await page.get_by_label("Playback speed").select_option("16")
    await page.get_by_role("button", name="Play", exact=True).click()
    await phone.drawn(15)
    box = await slider.bounding_box()
    assert box is not None
    await page.mouse.move(box["x"] + 10, box["y"] + 40)
    await page.mouse.down()
    for n in range(120):
        await page.mouse.move(box["x"] + 10 + (box["width"] - 20) * abs(math.sin(n / 20)), box["y"] + 40)
    await page.mouse.up()
    assert sent.most_in_a_second <= A_SECOND, sent.kinds[-200:]
    assert "replay" in sent.kinds


@pytest.mark.parametrize(
    ("recording", "alarm", "at"),
    [(".mcap", "A critical alarm", "00:1[567]"), (".bag", "Speed above limit", "00:2[567]")],
)
async def test_a_critical_alarm_of_a_recording_is_found_and_watched_in_six_presses(
    phone: Phone, street: tuple[str, dict[str, str]], recording: str, alarm: str, at: str
) -> None:
    """As somebody who never saw the page, on a desktop: alarms that were recorded, and those of a bag judged anew."""
    page = phone.page
    await page.set_viewport_size(DESKTOP)  # type: ignore[arg-type]
    await phone.open(f"{street[0]}/#home")
    await phone.live()
    await phone.acknowledge_all()
    presses = 0

    async def press(what: Locator) -> None:
        nonlocal presses
        await what.click()
        presses += 1

    await press(page.get_by_role("tab", name="Files"))
    row = page.locator(f'#panel-files [data-id="{street[1][recording]}"]')
    await expect(row).to_have_attribute("data-state", "read", timeout=OPENS_MS)
    await press(row.locator(".t"))
    if recording == ".mcap":
        raised = page.locator("#panel-files .file-raised li")
        await expect(raised.first).to_contain_text(alarm)
        await expect(raised.last).to_have_text("and 5 more in the replay")
        await press(raised.first.get_by_role("button"))
    else:
        await press(page.locator("#panel-files .file-dock").get_by_role("button", name="Open replay"))
        await page.wait_for_selector('html[data-replay="on"]', state="attached", timeout=OPENS_MS)
        await expect(page.locator(".unread")).to_have_count(0, timeout=OPENS_MS)
        await press(page.locator(".replay-line"))
        await press(page.locator("#sheet-jumps").get_by_role("button").filter(has_text=alarm).first)
    await page.wait_for_selector('html[data-replay="on"]', state="attached", timeout=OPENS_MS)
    await expect(page.locator(".scrub .clock b")).to_have_text(re.compile(at), timeout=OPENS_MS)
    await press(page.get_by_role("button", name="Play", exact=True))
    if recording == ".mcap":  # its alarm is of no check that there is: the replay plays past it
        await expect(page.locator(".scrub .clock b")).to_have_text(re.compile("00:(2|3)"), timeout=OPENS_MS)
    else:
        log = page.locator("#monitor [data-pane=log] li")
        await expect(log.filter(has_text=alarm).first).to_be_visible(timeout=OPENS_MS)
        await expect(page.locator(".gauge .speed")).to_have_text("12.4")
        await expect(page.locator(".replay-line")).to_contain_text(alarm)
    assert presses <= 6
