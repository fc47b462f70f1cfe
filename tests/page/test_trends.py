"""The last minute on Home and its chart: what was missed is fetched, what nobody heard is hatched."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import numpy as np
import pytest
import pytest_asyncio
from axe_playwright_python.async_playwright import Axe
from playwright.async_api import expect

from tests.page import drives
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


@pytest_asyncio.fixture(loop_scope="module", scope="module")
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
    async with asyncio.timeout(60), httpx.AsyncClient() as client:
        while True:
            trends = (await client.get(f"{address}/api/trends")).json()
            if sum(isinstance(one, float) for one in trends["lowest"]["speed"]) >= steps:
                return
            await asyncio.sleep(0.3)


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
    heard = speed.lstrip("/.")
    assert heard.count("I") / len(heard) > 0.7
    assert set(await columns(phone, "brake")) == {"."}
    await expect(phone.page.locator("[data-trend=brake] .n")).to_have_text("not published")
    await expect(phone.page.locator("[data-trend=speed] .n")).to_have_text(re.compile(r"[45]\.\d"))
    await expect(phone.page.locator("[data-trend=speed]")).to_have_attribute(
        "aria-label", re.compile(r"Speed: [45]\.\d m/s; open the chart")
    )
    assert not [url for url in fetched if "uPlot" in url or "chart.js" in url]  # most drives need neither
    # Once, and once more for each moment in which this machine was late; not again and again.
    assert 1 <= len([url for url in fetched if "/api/trends" in url]) <= 3


async def test_a_radio_gap_is_filled_with_what_the_server_heard_meanwhile(phone: Phone, watch: Process) -> None:
    radio = Radio(int(watch.address.rsplit(":", 1)[1]))
    async with radio.on_air() as address:
        await phone.open(f"{address}/#home")
        await lower(phone)
        await heard_for(watch.address, 100)
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
    phone: Phone, tmp_path: Path
) -> None:
    drive = drives.write(
        tmp_path / "hole.bag",
        {
            "speed": lambda t: None if 4 < t % 14 < 8 else drives.twist(4.5 + 0.5 * np.sin(t)),
            "distance": lambda t: drives.number(60.0 + np.sin(9 * t)),
        },
        seconds=56.0,
    )
    async with running(*replay(drive)) as car, running(*server(tmp_path, car.address)) as watch:
        await heard_for(watch.address, 60)  # longer than it ever speaks without a hole
        await phone.open(f"{watch.address}/#home")
        await lower(phone)
        speed, distance = await columns(phone, "speed"), await columns(phone, "distance")
    hole = re.search(r"I([/.]{3,})I", speed)
    assert hole is not None, speed
    assert "/" in hole[1]
    assert len(hole[1]) / len(speed) == pytest.approx(4 / 60, abs=0.025)
    assert distance.strip("/.").count("/") < len(hole[1]) / 2  # the other went on, but for what this machine was late


async def test_a_chart_reads_zooms_holds_and_closes_by_finger_and_key(phone: Phone, watch: Process) -> None:
    await heard_for(watch.address, 60)
    await phone.open(f"{watch.address}/#home")
    await lower(phone)
    await phone.page.locator("[data-trend=speed]").tap()
    sheet = phone.page.locator("#sheet-chart")
    await expect(sheet.locator(".u-over")).to_be_visible()
    await expect(phone.f("title", "#sheet-chart")).to_have_text("Speed, last minute")
    low, high = await numbers(phone)
    assert 3.9 < low < high < 5.1
    await expect(phone.f("part", "#sheet-chart")).to_contain_text("limit 11.0 m/s")
    plot = phone.f("plot", "#sheet-chart")
    box = await sheet.locator(".u-over").bounding_box()
    await phone.page.touchscreen.tap(box["x"] + box["width"] - 20, box["y"] + 60)
    await expect(phone.f("readout", "#sheet-chart")).to_have_text(re.compile(r"−\d\.\d s: [45]\.\d( to [45]\.\d)? m/s"))
    await plot.focus()
    await phone.page.keyboard.press("Home")
    await expect(plot).to_have_attribute("aria-valuenow", "-60.0")
    await phone.page.keyboard.press("End")
    await phone.page.keyboard.press("ArrowLeft")
    await expect(plot).to_have_attribute("aria-valuetext", re.compile(r"−1\.0 s: [45]"))
    for _ in range(2):
        await phone.f("nearer", "#sheet-chart").tap()
    await expect(phone.f("part", "#sheet-chart")).to_contain_text("−15 s to 0 s")
    await phone.page.mouse.move(box["x"] + 60, box["y"] + 60)
    await phone.page.mouse.down()
    await phone.page.mouse.move(box["x"] + 60 + box["width"] / 3, box["y"] + 60, steps=6)
    await phone.page.mouse.up()
    await expect(phone.f("part", "#sheet-chart")).to_contain_text("−20 s to −5 s")
    await phone.f("hold", "#sheet-chart").tap()
    await expect(phone.f("held", "#sheet-chart")).to_contain_text("not live")
    still = await phone.page.evaluate(DRAWN)
    await phone.page.wait_for_timeout(700)
    assert await phone.page.evaluate(DRAWN) == still
    await phone.f("hold", "#sheet-chart").tap()
    await phone.page.wait_for_function(f"still => ({DRAWN})() !== still", arg=still)
    await phone.page.keyboard.press("Escape")
    await expect(sheet).to_be_hidden()
    await expect(phone.page.locator("[data-trend=speed]")).to_be_focused()
    assert await sheet.locator("canvas").count() == 0


async def test_small_pictures_and_charts_speak_the_unit_of_this_phone(phone: Phone, watch: Process) -> None:
    await phone.page.add_init_script("localStorage.setItem('catgraph.speed-unit', 'km/h')")
    await heard_for(watch.address, 30)
    await phone.open(f"{watch.address}/#home")
    await lower(phone)
    await expect(phone.page.locator("[data-trend=speed] .row")).to_have_text(re.compile(r"Speed km/h1\d\.\d"))
    await phone.page.locator("[data-trend=speed]").tap()
    await expect(phone.f("part", "#sheet-chart")).to_contain_text("limit 39.6 km/h")
    low, high = await numbers(phone)
    assert 14.0 < low < high < 18.4


@pytest.mark.parametrize("scheme", ["dark", "light"])
async def test_nothing_is_a_barrier(phone: Phone, watch: Process, scheme: Any) -> None:
    await phone.page.emulate_media(color_scheme=scheme)
    await phone.open(f"{watch.address}/#home")
    await lower(phone)
    found = [await Axe().run(phone.page, context="[data-part=trends]")]
    await phone.page.locator("[data-trend=distance]").tap()
    await expect(phone.page.locator("#sheet-chart .u-over")).to_be_visible()
    found.append(await Axe().run(phone.page, context="#sheet-chart"))
    broken = [(one["id"], node["html"]) for run in found for one in run.response["violations"] for node in one["nodes"]]
    assert broken == []
    small = await phone.page.evaluate(
        """() => [...document.querySelectorAll('#sheet-chart button, .sparks button')].map((one) => {
          const box = one.getBoundingClientRect();
          return [one.outerHTML.slice(0, 60), box.width, box.height];
        }).filter(([, width, height]) => width < 56 || height < 56)"""
    )
    assert small == []


DRAWN = "() => document.querySelector('#sheet-chart canvas').toDataURL()"


async def numbers(phone: Phone) -> tuple[float, float]:
    await expect(phone.f("lowest", "#sheet-chart")).to_have_text(re.compile(r"\d"))
    low, high = [str(await phone.f(name, "#sheet-chart").text_content()) for name in ("lowest", "highest")]
    return float(low), float(high)
