"""Replay in the page, with a real recording, a live simulated car beside it, and the real server."""

from __future__ import annotations

import asyncio
import math
import re
from collections.abc import AsyncIterator
from dataclasses import dataclass
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page, expect

from tests.http import http_client
from tests.page import drives
from tests.page.barriers import no_barrier
from tests.page.conftest import PHONE, Phone, phone_in
from tests.page.processes import Process, running, server, simulate
from tests.page.replay_places import LONG_ONE, PLACES
from tests.page.touch import DRAWN

OPENS_MS = 40_000


def speed(t: float) -> Any:
    """Too fast from 20 s to 28 s; silent, with all else, from 40 s to 46 s."""
    return None if 40 <= t < 46 else drives.twist(12.4 if 20 <= t < 28 else 6.0 + math.sin(t / 5))


@dataclass(frozen=True)
class Watch:
    address: str
    recording: str
    car: Process


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Watch]:
    data = tmp_path_factory.mktemp("data")
    folder = data / "recordings" / "car"
    folder.mkdir(parents=True)
    drives.write(
        folder / "street.bag",
        {"speed": speed, "scan": lambda t: None if 40 <= t < 46 else drives.street(t, gap_m=20.0)},
        seconds=70.0,
    )
    async with running(*simulate()) as car, running(*server(data, car.address)) as process:
        async with http_client() as client, asyncio.timeout(30):
            while not (rows := (await client.get(f"{process.address}/api/recordings")).json()["recordings"]):
                await asyncio.sleep(0.2)
        yield Watch(process.address, rows[-1]["id"], car)


async def replayed(phone: Phone, watch: Watch, at_s: float, tab: str = "home") -> Page:
    page = phone.page
    await phone.open(f"{watch.address}/?replay={watch.recording}&t={at_s}#{tab}")
    await shown(page)
    return page


async def shown(page: Page) -> None:
    await page.wait_for_selector('html[data-replay="on"]', state="attached", timeout=OPENS_MS)
    await expect(page.locator(".scrub .all")).to_have_attribute("d", re.compile("L"), timeout=OPENS_MS)
    await expect(page.locator(".scrub .time-line:not([inert])")).to_be_visible()  # drawn once: it can be pressed


def clock(page: Page) -> Any:
    return page.locator(".scrub .clock b")


async def test_a_link_leads_to_a_moment_and_one_tap_back_to_live(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 24.0)
    await expect(page.locator(".gauge .speed")).to_have_text("12.4")
    await expect(page.locator(".replay-date")).to_contain_text("Recorded 1 Jun 2016")
    await expect(page.locator(".replay-line")).to_contain_text("Speed above limit")
    await expect(page.locator(".replay-line")).to_contain_text("re-evaluated")
    await expect(page).to_have_title(re.compile("REPLAY"))
    icon = page.locator(
        'link[rel="icon"]'
    )  # another one while the live car has an alarm, as one does on a busy machine
    await expect(icon).to_have_attribute("href", re.compile("catgraph-replay"), timeout=30_000)
    await expect(page.locator("#monitor > .rail")).to_be_hidden()
    assert not await page.locator("#sheet-alarm[open]").count(), "what was an alarm then has no dialog now"
    await page.get_by_role("button", name="Leave").tap()
    await phone.live()
    await expect(page.locator("#monitor > .rail")).to_be_visible()
    assert not await page.locator(".replay-band, .scrub").count()
    assert "replay" not in page.url
    assert await page.evaluate("() => document.documentElement.dataset.replay") is None


async def test_it_plays_pauses_and_changes_its_pace(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 2.0)
    await expect(clock(page)).to_have_text("00:02")
    await page.get_by_label("Playback speed").select_option("8")
    await page.get_by_role("button", name="Play", exact=True).tap()
    await expect(clock(page)).to_have_text(re.compile("00:(1[0-9]|[2-6])"), timeout=10_000)
    await page.get_by_role("button", name="Pause").tap()
    await expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible()
    await page.keyboard.press("Space")  # on the key that was pressed
    await expect(page.get_by_role("button", name="Pause")).to_be_visible()
    await page.locator("#panel-home").focus()
    await page.keyboard.press("Space")
    await expect(page.get_by_role("button", name="Play", exact=True)).to_be_visible()
    await page.wait_for_timeout(500)  # a frame of before is under way
    stands = await clock(page).text_content()
    await page.wait_for_timeout(1200)
    assert await clock(page).text_content() == stands


async def test_the_finger_and_the_keys_lead_to_any_moment(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 5.0)
    slider = page.get_by_role("slider", name="Position in the recording")
    box = await slider.bounding_box()
    assert box is not None
    assert box["height"] >= 56
    await page.mouse.move(box["x"] + box["width"] * 0.1, box["y"] + 40)
    await page.mouse.down()
    await page.mouse.move(box["x"] + box["width"] * 24 / 70, box["y"] + 40, steps=6)
    await page.mouse.up()
    await expect(page.locator(".gauge .speed")).to_have_text("12.4")
    await expect(clock(page)).to_have_text(re.compile("00:2[345]"))
    await slider.press("End")
    await expect(clock(page)).to_have_text("01:09")
    await slider.press("Home")
    await expect(clock(page)).to_have_text("00:00")
    await slider.press("ArrowRight")
    await expect(slider).to_have_attribute("aria-valuetext", "3 seconds of 1 minute 9 seconds")
    assert re.search(r"[?&]t=", page.url)


async def test_marks_stand_at_the_alarms_and_keys_lead_there(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 10.0)
    await expect(page.locator(".marks .critical").first).to_be_attached(timeout=OPENS_MS)
    await expect(page.locator(".unread")).to_have_count(0, timeout=OPENS_MS)
    await page.get_by_role("button", name="Next event").tap()
    await expect(page.locator(".replay-line")).to_contain_text(re.compile("Speed above limit|Obstacle ahead"))
    await expect(clock(page)).to_have_text("00:20")
    await page.get_by_role("slider", name="Position in the recording").press("End")
    await expect(clock(page)).to_have_text("01:09")
    await page.get_by_role("button", name="Previous event").tap()
    await expect(clock(page)).not_to_have_text("01:09")


async def test_what_was_not_recorded_is_said_and_hatched(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 45.0)
    await expect(page.locator(".replay-line")).to_contain_text(re.compile("Nothing recorded for [45]"))
    await expect(page.locator(".gaps rect")).to_have_count(1, timeout=OPENS_MS)
    assert not await page.locator(".veil[data-on]").count(), "the server answers: nothing is covered"


async def test_two_pages_look_at_different_moments_and_a_third_at_live(
    browser: Browser, phone: Phone, watch: Watch
) -> None:
    page = await replayed(phone, watch, 24.0)
    others = [await browser.new_context(**PHONE) for _ in range(2)]
    second, live = [await phone_in(context) for context in others]
    await replayed(second, watch, 60.0)
    await live.open(f"{watch.address}/#home")
    await live.live()
    await expect(clock(page)).to_have_text("00:24")
    await expect(clock(second.page)).to_have_text("01:00")
    assert not await live.page.locator(".replay-band").count()
    for context in others:
        await context.close()


async def test_the_scan_is_that_of_the_recording_and_does_not_grow_old(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 30.0, "scan")
    nearest = page.locator('#panel-scan [data-f="distance"]')
    await expect(nearest).to_have_text(re.compile("^(19|20)"), timeout=15_000)
    await page.wait_for_timeout(2500)  # it stands, and is sent again and again
    await expect(nearest).to_have_text(re.compile("^(19|20)"))
    assert "stale" not in str(await page.locator("#panel-scan").inner_text()).lower()


async def test_nothing_is_ordered_from_a_replay(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 3.0)
    async with http_client() as client:
        before = (await client.get(f"{watch.address}/api/settings")).json()["values"]["speed_limit.max_mps"]
    await page.evaluate("() => { location.hash = '#settings'; }")
    number = page.locator('#panel-settings input[type="text"], #panel-settings input[inputmode]').first
    await expect(number).to_be_visible(timeout=10_000)
    await number.fill("9")
    await number.press("Enter")
    await expect(page.locator("body")).to_contain_text("shows a replay", timeout=10_000)
    async with http_client() as client:
        after = (await client.get(f"{watch.address}/api/settings")).json()["values"]["speed_limit.max_mps"]
    assert before == after


async def test_a_check_opens_with_the_minute_and_the_alarms_of_the_recording(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 24.0)
    await page.locator("[data-f=tiles] li button").first.press("Enter")
    await expect(phone.f("check-tag")).to_have_text("FAULT")
    await expect(page.locator("canvas.minute")).to_have_attribute("aria-label", re.compile(r"highest 12\.4 m/s"))
    history = phone.f("check-history").locator("li")
    await expect(history).to_have_count(1, timeout=OPENS_MS)  # the whole recording is read for it
    await expect(history).to_contain_text("active, highest 12.4 m/s")
    await expect(phone.f("check-change")).to_be_hidden()
    await no_barrier(page, "a check of a replay")
    await page.evaluate("document.querySelector('.check-view [data-f=close]').click()")
    await page.evaluate("document.querySelector('[data-f=strip]').click()")
    await expect(phone.f("alarms-note")).to_contain_text("nothing can be acknowledged in it")
    await expect(phone.f("alarms-ended")).to_be_hidden()


async def test_a_live_alarm_reaches_who_looks_at_a_recording(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 3.0)
    await watch.car.type("speeding 60")
    sheet = page.locator("#sheet-live[open]")
    await expect(sheet).to_contain_text(
        "Live: Speed above limit", timeout=45_000
    )  # it takes the bends of its way slowly
    await expect(sheet).to_contain_text("This is live")
    await expect(page).to_have_title(re.compile("LIVE Speed above limit"))
    await page.get_by_role("button", name="Stay in the replay").tap()
    await expect(page.locator(".replay-live")).to_contain_text("Live: Speed above limit")
    await expect(page.locator(".frame")).to_have_attribute("data-mode", "asking")
    await expect(clock(page)).to_have_text("00:03")
    await page.locator(".replay-live").tap()
    await expect(page.locator("#sheet-alarm[open]")).to_be_visible()
    await watch.car.type("stop")
    await phone.f("acknowledge", "#sheet-alarm").tap()


WHEN = """() => {
  const keys = [...document.querySelectorAll('#sheet-file .menu-list button')];
  const key = keys.find((one) => one.textContent === 'Open replay');
  key.addEventListener('click', () => {
    const began_ms = performance.now();
    const timer = setInterval(() => {
      if (!/L/.test(document.querySelector('.scrub .all')?.getAttribute('d') ?? '')) return;
      clearInterval(timer);
      document.body.dataset.traceMs = performance.now() - began_ms;
    }, 5);
  }, {capture: true});
}"""


async def test_from_files_it_opens_on_home_with_its_speed_within_a_second(phone: Phone, watch: Watch) -> None:
    page = phone.page
    await phone.open(f"{watch.address}/#files")
    await phone.live()
    row = page.locator(f'#panel-files [data-id="{watch.recording}"]')
    await expect(row).to_have_attribute("data-state", "read", timeout=20_000)
    await phone.acknowledge_all()
    await page.evaluate("() => import('/static/js/replay/replay.js').catch(() => {})")
    await row.locator(".t").tap()
    await expect(page.locator("#sheet-file")).to_be_visible()
    await page.evaluate(WHEN)
    await page.get_by_role("button", name="Open replay").tap()
    await page.wait_for_selector("body[data-trace-ms]", timeout=20_000)
    assert float(await page.evaluate("() => document.body.dataset.traceMs")) < 1000 + 1000 * phone.slack_s
    await shown(page)
    await expect(page.locator('[data-tab="home"]')).to_have_attribute("aria-selected", "true")
    await expect(page.locator(".replay-date")).to_contain_text("Recorded 1 Jun 2016, car")
    assert await page.locator(".replay-band").count() == 1
    await expect(page.locator(".replay-calm, .replay-live:not([hidden])").first).to_contain_text("recording")
    await page.locator(".scrub .leave").tap()
    await phone.live()


async def test_its_alarms_are_a_list_to_jump_to(phone: Phone, watch: Watch) -> None:
    """By a tap, and by keys alone; nothing in it can be acknowledged."""
    page = await replayed(phone, watch, 60.0)
    await expect(page.locator(".unread")).to_have_count(0, timeout=OPENS_MS)
    await expect(page.locator(".replay-line .count")).to_have_text(re.compile(r"^\d+ alarms?$"))
    await page.locator(".replay-line").tap()
    jumps = page.locator("#sheet-jumps[open]")
    await expect(jumps).to_contain_text("Each opens 5 s before it begins.")
    fast = jumps.get_by_role("button").filter(has_text="Speed above limit").first
    await expect(fast).to_contain_text(re.compile(r"00:20.*(9|10)(\.\d)? s", re.DOTALL))
    await expect(jumps.get_by_role("button").filter(has_text="Nothing recorded")).to_contain_text("6.")
    await fast.tap()
    await expect(page.locator("#sheet-jumps")).to_be_hidden()
    await expect(clock(page)).to_have_text("00:15")
    await page.locator(".replay-line").press("Enter")
    await expect(jumps.get_by_role("button").first).to_be_visible()
    await page.keyboard.press("End")
    await page.keyboard.press("Home")
    await page.keyboard.press("ArrowDown")
    await expect(jumps.get_by_role("button").nth(1)).to_be_focused()
    at_s = await jumps.get_by_role("button").nth(1).get_attribute("data-at")
    await page.keyboard.press("Enter")
    await expect(page.locator(".time-line")).to_have_attribute("aria-valuenow", f"{float(at_s or 'nan'):.1f}")
    assert (
        not await page.get_by_role("button", name=re.compile("acknowledge", re.IGNORECASE))
        .locator("visible=true")
        .count()
    )


async def test_a_tap_on_the_chart_leads_to_the_moment(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 24.0)
    await page.locator("[data-trend=speed]").tap()
    await expect(page.locator(".trends-strip .line")).to_have_attribute("d", re.compile("M"))
    await page.locator(".trends-tools button").nth(2).tap()
    await expect(page.locator(".trends-state")).to_be_hidden(timeout=OPENS_MS)  # all is read, and nothing is live
    stage = page.locator(".trends-stage")
    await expect(stage).to_have_attribute("aria-valuemax", re.compile(r"^(69|70)\."))  # the recording's end
    await expect(stage).to_have_attribute("aria-valuenow", "24.0")
    await expect(stage).to_have_attribute("aria-valuetext", re.compile(r"Speed 12\.4 m/s"))
    over = await page.locator(".trends-panes .u-over").first.bounding_box()
    assert over is not None
    await page.touchscreen.tap(over["x"] + over["width"] * 43.5 / 70, over["y"] + 20)
    await expect(clock(page)).to_have_text(re.compile("00:4[34]"))
    await expect(stage).to_have_attribute("aria-valuetext", re.compile("Speed no data"))
    await expect(page.locator(".trends-marks .critical").first).to_be_attached()
    await page.keyboard.press("Escape")
    await expect(stage).to_be_hidden()


async def test_a_recording_that_is_not_there_is_refused_and_live_goes_on(phone: Phone, watch: Watch) -> None:
    await phone.open(f"{watch.address}/?replay=../../etc/passwd#home")
    await expect(phone.page.locator(".snack.note")).to_contain_text(
        "There is no recording named ../../etc/passwd.", timeout=15_000
    )
    await phone.live()


async def test_nothing_overlaps_or_overflows_or_is_too_small(phone: Phone, watch: Watch) -> None:
    page = await replayed(phone, watch, 24.0)
    await no_barrier(page, "replay")
    small = await page.evaluate(
        """() => [...document.querySelectorAll('.scrub button, .scrub label, .leave, .time-line')]
        .map((key) => [key.textContent, key.getBoundingClientRect()])
        .filter(([, box]) => box.width < 56 || box.height < 56).map(([text]) => text)"""
    )
    assert small == []
    for width, height in ((320, 640), (360, 780), (412, 915), (915, 412), (1280, 800)):
        await page.set_viewport_size({"width": width, "height": height})
        assert await page.evaluate(LONG_ONE) <= 0, width
        await page.evaluate(DRAWN)
        boxes = await page.evaluate(PLACES)
        for selector, left, right, top, bottom in boxes:
            assert -0.5 <= left <= right <= width + 0.5, (selector, width)
            assert -0.5 <= top <= bottom <= height + 0.5, (selector, width)
        for i, (a, *one) in enumerate(boxes):
            for b, *two in boxes[i + 1 :]:
                apart = one[1] <= two[0] + 1 or two[1] <= one[0] + 1 or one[3] <= two[2] + 1 or two[3] <= one[2] + 1
                assert apart, (a, b, width)
