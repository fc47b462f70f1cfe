"""The scan's tab with a real laser: what has a range is drawn, and only that."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path

import numpy as np
from playwright.async_api import expect

from tests.page.conftest import Phone
from tests.page.processes import replay, running, server, simulate

# Counts what one drawing puts on the plot: every square is a return.
LISTEN = """() => {
  const kept = CanvasRenderingContext2D.prototype.rect;
  let squares = [];
  CanvasRenderingContext2D.prototype.rect = function (x, y, w, h) {
    if (w === 5 && h === 5) squares.push([x + 2.5, y + 2.5]);
    return kept.call(this, x, y, w, h);
  };
  const begin = CanvasRenderingContext2D.prototype.drawImage;
  CanvasRenderingContext2D.prototype.drawImage = function (...all) {
    window.squares = squares;
    squares = [];
    return begin.apply(this, all);
  };
}"""


async def test_681_beams_of_a_real_laser_with_those_below_range_min_not_drawn(
    phone: Phone, tmp_path: Path, recordings: Path
) -> None:
    bag = recordings / "lidar" / "scan_tools_hokuyo_demo.bag"
    async with running(*replay(bag)) as laser, running(*server(tmp_path, laser.address)) as watch:
        await phone.page.add_init_script(f"({LISTEN})()")
        await phone.open(f"{watch.address}/#scan")
        await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile(r"\d+ of 681"), timeout=12_000)
        await phone.page.wait_for_timeout(1500)
        await phone.acknowledge_all()  # the laser stands in a room: something is always too near for a car
        await phone.page.locator("[data-range='10']").tap()
        await phone.page.wait_for_function("window.squares?.length > 100")
        squares, counts, height = await phone.page.evaluate(
            """async () => {
              const { squares } = window;
              const canvas = document.querySelector('.scanc');
              return [squares, document.querySelector('#panel-scan [data-f=beams]').textContent, canvas.clientHeight];
            }"""
        )
        usable = int(re.match(r"\d+", counts)[0])  # type: ignore[index]
        assert 500 < usable < 681
        assert abs(len(squares) - usable) <= 25  # the words change five times a second, the plot with every scan
        scale = (height - 34 - 14) / 10
        x, y = (height - 34 - np.array(squares)[:, 1]) / scale, (206 - np.array(squares)[:, 0]) / scale
        ranges = np.hypot(x, y)
        assert ranges.min() >= 0.02 - 1e-3  # the sensor's range_min; 13 342 beams of the recording lie below
        assert ranges.max() <= 5.6 + 1e-2
        await expect(phone.f("beams", "#panel-scan")).to_contain_text("too close")


async def test_the_scan_is_sent_only_while_its_tab_is_in_front(phone: Phone, tmp_path: Path) -> None:
    async with running(*simulate()) as car, running(*server(tmp_path, car.address)) as watch:
        scans: list[bytes] = []
        phone.page.on(
            "websocket",
            lambda socket: socket.on(
                "framereceived", lambda data: scans.append(data) if isinstance(data, bytes) else 0
            ),
        )
        await phone.open(f"{watch.address}/#home")
        await phone.live()
        await phone.page.wait_for_timeout(800)
        assert scans == []
        await phone.page.locator("[data-tab=scan]").tap()
        await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile(r"of 18[01]"))
        async with asyncio.timeout(8):
            while len(scans) < 6:  # Playwright tells by calling
                await asyncio.sleep(0.05)
        await phone.f("menu").tap()
        await phone.page.locator("#sheet-menu").get_by_text("About").tap()
        await phone.page.wait_for_timeout(300)
        scans.clear()
        await phone.page.wait_for_timeout(600)
        assert scans == []  # another screen lies over it
        await phone.f("back").tap()
        await phone.page.wait_for_timeout(600)
        assert scans
        await phone.page.locator("[data-tab=home]").tap()
        await phone.page.wait_for_timeout(600)
        scans.clear()
        await phone.page.wait_for_timeout(600)
        assert scans == []


async def test_a_laser_that_falls_silent_is_hatched_over(phone: Phone, tmp_path: Path) -> None:
    async with running(*simulate()) as car, running(*server(tmp_path, car.address)) as watch:
        await phone.open(f"{watch.address}/#scan")
        await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile(r"of 18[01]"), timeout=12_000)
        await expect(phone.f("none", "#panel-scan")).to_be_hidden()
        await car.type("silent-scan 60")
        await expect(phone.f("none-words", "#panel-scan")).to_have_text(re.compile(r"STALE \d"))
        await expect(phone.f("distance", "#panel-scan")).to_have_text("–")
