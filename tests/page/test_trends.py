"""The last minute on Home and the chart of the drive: what was missed is fetched, what was not received is hatched."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator

import numpy as np
import pytest
import pytest_asyncio
from playwright.async_api import expect

from tests.http import http_client
from tests.page import drives
from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.processes import Process, replay, running, server
from tests.page.radio import Radio

# For each column of a small picture: I ink of the car, / hatching, . neither (dark theme).
COLUMNS = """name => {
  const canvas = document.querySelector(`[data-trend="${name}"] canvas`);
  const { width, height } = canvas;
  const copy = new OffscreenCanvas(width, height).getContext('2d', { willReadFrequently: true });
  copy.drawImage(canvas, 0, 0);
  const pixels = copy.getImageData(0, 0, width, height).data;
  return Array.from({ length: width }, (_, x) => {
    let kind = '.';
    for (let y = 0; y < height; y += 1) {
      const [r, g, b] = pixels.slice(4 * (y * width + x));
      if (r > 200) return 'I';
      if (r > 60 && r < 110 && b < 125 && g < 125) kind = '/';
    }
    return kind;
  }).join('');
}"""


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    """A server that watches a car at 4 to 5 m/s with something far ahead; neither brake nor steering are published."""
    data = tmp_path_factory.mktemp("trends")
    drive = drives.write(
        data / "drive.bag",
        {
            "speed": lambda t: drives.twist(4.5 + 0.5 * np.sin(t)),
            "distance": lambda t: drives.number(60.0 + np.sin(9 * t)),
            "bearing": lambda t: drives.number(0.01 * np.sin(7 * t)),
        },
        seconds=90.0,
    )
    async with running(*replay(drive)) as car, running(*server(data, car.address)) as process:
        yield process


async def columns(phone: Phone, name: str) -> str:
    return str(await phone.page.evaluate(COLUMNS, name))


async def lower(phone: Phone) -> None:
    """Down to the small pictures, once they are live."""
    await phone.live()
    async with asyncio.timeout(30):
        while True:
            await phone.page.locator("[data-trend=accelerator]").scroll_into_view_if_needed()
            if (await columns(phone, "speed")).count("I") >= 16:
                return
            await asyncio.sleep(0.2)


async def heard_for(address: str, steps: int) -> None:
    """Waits until the server has so many steps of the speed."""
    async with asyncio.timeout(60), http_client() as client:
        while True:
            trends = (await client.get(f"{address}/api/trends")).json()
            if sum(isinstance(one, float) for one in trends["lowest"]["speed"]) >= steps:
                return
            await asyncio.sleep(0.3)


@pytest.mark.own_phone
async def test_a_page_that_opens_late_shows_what_it_missed_and_hatches_what_nobody_heard(
    phone: Phone, watch: Process
) -> None:
    await heard_for(watch.address, 60)
    fetched: list[str] = []
    phone.page.on("request", lambda request: fetched.append(request.url))
    await phone.open(f"{watch.address}/#home")
    await lower(phone)
    speed = await columns(phone, "speed")
    assert speed.count("I") / len(speed) > 0.17  # 12 s of 60 although the page is younger
    # Hatched before it was connected, then a line up to now, but for the moments in which this machine was late.
    assert speed.startswith("/" * 20)
    async with asyncio.timeout(30):  # a busy machine is late for some seconds, and what it missed comes then
        while (drawn := speed.lstrip("/.")).count("I") / max(1, len(drawn)) <= 0.7:
            await asyncio.sleep(0.3)
            speed = await columns(phone, "speed")
    assert set(await columns(phone, "brake")) == {"."}
    await expect(phone.page.locator("[data-trend=brake] .row .n")).to_have_text("–")  # for more there is no room
    await expect(phone.page.locator("[data-trend=brake]")).to_have_attribute(
        "aria-label", re.compile("Brake: not published")
    )
    await expect(phone.page.locator("[data-trend=speed] .row .n")).to_have_text(re.compile(r"[45]\.\d"))
    await expect(phone.page.locator("[data-trend=speed]")).to_have_attribute(
        "aria-label", re.compile(r"Speed: [45]\.\d m/s; open the chart of the drive")
    )
    assert not [url for url in fetched if "uPlot" in url or "drive-chart" in url]  # most drives need neither
    # Once, and once more for each moment in which this machine was late; not again and again.
    assert 1 <= len([url for url in fetched if "/api/trends" in url]) <= 3


async def test_a_radio_gap_is_filled_with_what_the_server_heard_meanwhile(phone: Phone, watch: Process) -> None:
    radio = Radio(int(watch.address.rsplit(":", 1)[1]))
    async with radio.on_air() as address:
        await phone.open(f"{address}/#home")
        await lower(phone)
        await heard_for(watch.address, 75)
        radio.cut()
        await phone.page.wait_for_timeout(4000)
        radio.mend()
        await phone.live()
        await phone.page.wait_for_timeout(1200)
        speed = (await columns(phone, "speed")).strip("/.")
    assert len(speed) > 40
    # 4 s would be 11 columns; what this machine was late is shorter.
    assert max(map(len, re.findall(r"[/.]+", speed)), default=0) < 7, speed


async def test_a_signal_that_fell_silent_leaves_a_hatched_hole_that_no_line_bridges(
    phone: Phone, canned: Canned
) -> None:
    """The distance was unknown for 5 s of the minute before the page came, the speed never."""
    await phone.open(f"{canned.address}/#home")
    await lower(phone)
    async with asyncio.timeout(20):  # a busy machine is late for some seconds, and what the page missed comes then
        while "/" in (await columns(phone, "speed")).strip("/."):
            await asyncio.sleep(0.3)
    distance = await columns(phone, "distance")
    hole = re.search(r"I([/.]{3,})I", distance)
    assert hole is not None, distance
    assert "/" in hole[1]
    assert len(hole[1]) / len(distance) == pytest.approx(5 / 60, abs=0.025)


async def test_a_tap_opens_the_chart_of_the_drive_which_is_moved_read_and_left(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#home")
    await lower(phone)
    await phone.page.locator("[data-trend=speed]").tap()
    stage = phone.page.locator(".trends-stage")
    over = phone.page.locator(".trends-panes .u-over").first
    await expect(phone.page.locator(".trends-pane")).to_have_count(4)
    await expect(phone.f("title")).to_have_text("Trends")
    await expect(phone.page.locator("#monitor > .titlebar .head-speed")).to_have_text("4.2m/s")
    await expect(phone.page.locator(".trends-strip .line")).to_have_attribute("d", re.compile("M.*M"))  # cut by a gap
    await expect(phone.page.locator(".trends-marks > g")).to_have_count(4)
    await expect(phone.page.locator(".trends-state")).to_be_hidden()  # live
    box = await over.bounding_box()
    assert box is not None

    await phone.page.touchscreen.tap(box["x"] + box["width"] * 0.6, box["y"] + 20)
    await expect(phone.page.locator(".tag-text")).to_have_text(re.compile(r"\d\d:\d\d:\d\d"))
    await expect(stage).to_have_attribute("aria-valuetext", re.compile(r"Speed \d\.\d.* m/s, Nearest object ahead"))
    await phone.page.touchscreen.tap(box["x"] + box["width"] * 0.6, box["y"] + 20)
    await expect(phone.page.locator(".tag-text")).to_have_count(0)

    # A drag to the right looks back: the chart is held and shows it, until it is set to follow again.
    await drag(phone, box["x"] + 40, box["x"] + 160, box["y"] + 30)
    await expect(phone.page.locator(".trends-state")).to_contain_text(re.compile(r"Held at .*: not live"))
    assert await phone.page.locator(".trends-tools [aria-pressed=true]").count() == 0
    await phone.page.locator(".trends-state .key").tap()
    await expect(phone.page.locator(".trends-state")).to_be_hidden()

    # Two fingers apart show a shorter time, about where they are.
    before = await width_s(phone)
    await pinch(phone, box, 1.0, 3.0)
    assert await width_s(phone) < before / 2
    await phone.page.locator(".trends-tools button").nth(2).tap()
    await phone.page.wait_for_function("() => document.querySelector('.trends-stage').ariaValueMin === '0.0'")
    assert await width_s(phone) > 500

    # The strip of the drive moves the window.
    strip = await phone.page.locator(".trends-strip").bounding_box()
    assert strip is not None
    await phone.page.locator(".trends-tools button").first.tap()
    await phone.page.touchscreen.tap(strip["x"] + strip["width"] / 4, strip["y"] + 30)
    await expect(phone.page.locator(".trends-state")).to_contain_text("not live")
    await phone.page.keyboard.press("Escape")
    await expect(stage).to_be_hidden()
    await expect(phone.page.locator("#monitor > .titlebar .head-speed")).to_be_hidden()


async def test_the_chart_by_wheel_and_keys(phone: Phone, canned: Canned) -> None:
    await chart(phone, canned)
    stage = phone.page.locator(".trends-stage")
    box = await phone.page.locator(".trends-panes .u-over").first.bounding_box()
    assert box is not None
    await phone.page.mouse.move(box["x"] + box["width"] * 0.9, box["y"] + 20)
    await phone.page.mouse.wheel(0, -500)
    assert await width_s(phone) < 250
    await stage.focus()
    for key in ("-", "-"):
        await phone.page.keyboard.press(key)
    assert await width_s(phone) > 500
    await phone.page.keyboard.press("+")
    await phone.page.keyboard.press("Home")
    await expect(stage).to_have_attribute("aria-valuemin", "0.0")
    await expect(phone.page.locator(".trends-state")).to_contain_text("not live")
    await phone.page.keyboard.press("ArrowLeft")
    first = float(await stage.get_attribute("aria-valuenow") or "nan")
    await phone.page.keyboard.press("ArrowLeft")
    assert float(await stage.get_attribute("aria-valuenow") or "nan") < first
    await phone.page.keyboard.press("Escape")  # first the cursor, then the screen
    await expect(stage).to_be_visible()
    await phone.page.keyboard.press("End")
    await expect(phone.page.locator(".trends-state")).to_be_hidden()


@pytest.mark.gate
@pytest.mark.own_phone
async def test_signals_are_chosen_and_what_is_seen_is_saved(phone: Phone, canned: Canned) -> None:
    await phone.page.add_init_script("localStorage.setItem('catgraph.speed-unit', 'km/h')")
    await chart(phone, canned)
    await expect(phone.page.locator(".trends-pane[data-signal=speed] .trends-head")).to_have_text("Speed15.1km/h")
    await phone.page.locator(".trends-tools .key").tap()
    sheet = phone.page.locator(".trends-pick")
    await expect(sheet.locator("input:checked")).to_have_count(4)
    await expect(sheet.locator("input:not(:checked)").first).to_be_disabled()
    await sheet.locator("input[value=brake]").uncheck()
    await sheet.locator("input[value=heading]").check()
    panes = phone.page.locator(".trends-pane")
    await expect(panes.locator(".lab")).to_have_text(["Speed", "Nearest", "Steering", "Heading"])
    async with phone.page.expect_download() as table:
        await sheet.locator("button", has_text="Table").tap()
    text = (await (await table.value).path()).read_text(encoding="utf-8")
    head = text.splitlines()[0]
    assert head.startswith("time_utc,seconds,Speed lowest [km/h],Speed highest [km/h]")
    assert head.endswith("Heading lowest [°],Heading highest [°]")
    assert len(text.splitlines()) > 150
    async with phone.page.expect_download() as picture:
        await sheet.locator("button", has_text="Picture").tap()
    assert (await (await picture.value).path()).read_bytes()[:8] == b"\x89PNG\r\n\x1a\n"
    await sheet.locator("[data-f=no]").tap()
    await phone.page.wait_for_function("() => history.state?.over !== true")  # its way back would end the reload
    await phone.page.reload()
    await lower(phone)
    await phone.page.locator("[data-trend=brake]").tap()  # first among those that were chosen
    await expect(panes.locator(".lab")).to_have_text(["Brake", "Speed", "Nearest", "Steering"])


@pytest.mark.gate
@pytest.mark.own_phone
async def test_without_an_answer_the_chart_does_not_look_live(phone: Phone, canned: Canned) -> None:
    await chart(phone, canned)
    await phone.page.locator(".trends-tools button").first.tap()
    await expect(phone.page.locator(".trends-pane[data-signal=speed] .v")).to_have_text(re.compile(r"\d"))
    await phone.page.route("**/api/trends/drive**", lambda route: route.abort())
    await expect(phone.page.locator(".trends-state")).to_contain_text("No answer since", timeout=10_000)
    await expect(phone.page.locator(".trends-pane[data-signal=speed] .v")).to_have_text("–")
    await phone.page.unroute("**/api/trends/drive**")
    await expect(phone.page.locator(".trends-state")).to_be_hidden()
    phone.complaints.clear()  # the browser tells of each request that was broken off


async def test_nothing_is_too_small_to_press(phone: Phone, canned: Canned) -> None:
    await chart(phone, canned)
    small = await phone.page.evaluate(
        """() => [...document.querySelectorAll('.trends button, .sparks button')].map((one) => {
          const box = one.getBoundingClientRect();
          return [one.outerHTML.slice(0, 60), box.width, box.height];
        }).filter(([, width, height]) => width && (width < 56 || height < 56))"""
    )
    assert small == []


async def chart(phone: Phone, canned: Canned) -> None:
    """Opens the chart of the drive."""
    await phone.open(f"{canned.address}/#home")
    await phone.live()
    await phone.page.locator("[data-trend=speed]").tap()
    await expect(phone.page.locator(".trends-pane canvas")).to_have_count(4)
    await expect(phone.page.locator(".trends-strip .line")).to_have_attribute("d", re.compile("M"))


async def width_s(phone: Phone) -> float:
    """The time in view."""
    return float(
        await phone.page.evaluate(
            """() => {
              const stage = document.querySelector('.trends-stage');
              return stage.ariaValueMax - stage.ariaValueMin;
            }"""
        )
    )


async def drag(phone: Phone, from_x: float, to_x: float, y: float) -> None:
    await phone.page.mouse.move(from_x, y)
    await phone.page.mouse.down()
    await phone.page.mouse.move(to_x, y, steps=6)
    await phone.page.mouse.up()


async def pinch(phone: Phone, box: dict[str, float], from_share: float, to_share: float) -> None:
    """Two fingers about the middle, at a distance of 60 px times a share."""
    cdp = await phone.page.context.new_cdp_session(phone.page)
    x, y = box["x"] + box["width"] / 2, box["y"] + 20

    async def touch(kind: str, share: float | None) -> None:
        points = (
            [] if share is None else [{"x": x + 30 * share * side, "y": y, "id": i} for i, side in enumerate((-1, 1))]
        )
        await cdp.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": points})

    await touch("touchStart", from_share)
    for step in range(1, 7):
        await touch("touchMove", from_share + (to_share - from_share) * step / 6)
    await touch("touchEnd", None)
    await cdp.detach()
