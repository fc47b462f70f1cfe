"""The scan's tab with a real laser: what has a range is drawn, and only that."""

from __future__ import annotations

import asyncio
import itertools
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import pytest_asyncio
from playwright.async_api import Worker, expect

from server.app.config import Config
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.page import drives
from tests.page.conftest import Phone
from tests.page.processes import Drive, driving, replay, running, server
from tests.page.roamer import roaming
from tests.page.test_tabs import in_front, swipe
from tests.page.touch import stroke
from tests.server.conftest import serving

LASER = drives.TOPICS["scan"][0]
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

# The corridor's edges beyond the stopping distance are the only dashed lines: the points of the newest drawing.
LINES = """() => {
  let points = [];
  const prototype = CanvasRenderingContext2D.prototype;
  for (const name of ['moveTo', 'lineTo']) {
    const kept = prototype[name];
    prototype[name] = function (x, y) {
      if (this.getLineDash()[0] === 7) points.push([x, y]);
      return kept.call(this, x, y);
    };
  }
  const begin = prototype.drawImage;
  prototype.drawImage = function (...all) {
    if (points.length) window.dashed = points;
    points = [];
    return begin.apply(this, all);
  };
}"""
PICTURE = """() => {
  const [canvas, copy] = [document.querySelector('.scanc'), document.createElement('canvas')];
  [copy.width, copy.height] = [canvas.width, canvas.height];
  copy.getContext('2d').drawImage(canvas, 0, 0);
  return copy.toDataURL();
}"""
# What the page draws itself can be listened to; else a thread draws.
WITHOUT_A_THREAD = "delete HTMLCanvasElement.prototype.transferControlToOffscreen"


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def driven(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Drive]:
    async with driving(tmp_path_factory.mktemp("data")) as drive:
        yield drive


@pytest_asyncio.fixture(loop_scope="session")
async def drive(driven: Drive) -> AsyncIterator[Drive]:
    """A simulated car whose laser speaks, and a server that watches it."""
    yield driven
    await driven[0].type("stop")


@pytest.mark.own_phone
async def test_681_beams_of_a_real_laser_with_those_below_range_min_not_drawn(
    phone: Phone, tmp_path: Path, recordings: Path
) -> None:
    bag = recordings / "lidar" / "scan_tools_hokuyo_demo.bag"
    async with running(*replay(bag)) as laser, running(*server(tmp_path, laser.address)) as watch:
        await phone.page.add_init_script(f"{WITHOUT_A_THREAD}; ({LISTEN})()")
        await phone.open(f"{watch.address}/#scan")
        await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile(r"\d+ of 681"), timeout=12_000)
        await phone.page.wait_for_timeout(1500)
        await phone.acknowledge_all()  # the laser stands in a room: something is always too near for a car
        await phone.page.locator("[data-range='10']").tap()
        await phone.page.wait_for_function("() => window.squares?.length > 100")
        squares, counts, height = await phone.page.evaluate(
            """async () => {
              const { squares } = window;
              const canvas = document.querySelector('.scanc');
              return [squares, document.querySelector('#panel-scan [data-f=beams]').textContent, canvas.clientHeight];
            }"""
        )
        usable = int(re.match(r"\d+", counts)[0])  # type: ignore[index]
        assert 500 < usable < 681
        assert abs(len(squares) - usable) <= 25  # the text changes five times a second, the plot with every scan
        scale = (height - 34 - 14) / 10
        x, y = (height - 34 - np.array(squares)[:, 1]) / scale, (206 - np.array(squares)[:, 0]) / scale
        ranges = np.hypot(x, y)
        assert ranges.min() >= 0.02 - 1e-3  # the sensor's range_min; 13 342 beams of the recording lie below
        assert ranges.max() <= 5.6 + 1e-2
        await expect(phone.f("beams", "#panel-scan")).to_contain_text("too close")


@pytest.mark.own_phone
async def test_the_scan_is_sent_only_while_its_tab_is_in_front(phone: Phone, drive: Drive) -> None:
    _, watch = drive
    scans: list[bytes] = []
    phone.page.on(
        "websocket",
        lambda socket: socket.on("framereceived", lambda data: scans.append(data) if isinstance(data, bytes) else 0),
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


@pytest.mark.gate
async def test_case_05_no_scan_being_published_the_boundary_scan_graph_does_not_change(
    phone: Phone, drive: Drive
) -> None:
    """Frozen as it was, hatched over, with its age: never shown as live. It goes on by itself."""
    car, watch = drive
    await phone.open(f"{watch.address}/#scan")
    await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile(r"of 18[01]"), timeout=12_000)
    await expect(phone.f("none", "#panel-scan")).to_be_hidden()
    await car.type("silent-scan 60")
    stale = phone.f("none-words", "#panel-scan")
    await expect(stale).to_have_text(re.compile(r"STALE \d"))
    for name in ("distance", "bearing", "stops"):
        await expect(phone.f(name, "#panel-scan")).to_have_text("–")
    before, first = await phone.page.evaluate(PICTURE), await stale.text_content()
    await expect(stale).not_to_have_text(first or "")
    assert await phone.page.evaluate(PICTURE) == before
    assert age(await stale.text_content()) > age(first)
    assert await phone.page.locator(".scanc").get_attribute("aria-label") != ""
    await expect(phone.page.locator(".scanc")).to_have_attribute("aria-label", re.compile("STALE"))
    await phone.f("aim", "#panel-scan").tap(position={"x": 150, "y": 200})
    await expect(phone.f("marked", "#panel-scan")).to_be_hidden()  # nothing is read off a dead picture
    await car.type("stop")
    await expect(phone.f("none", "#panel-scan")).to_be_hidden(timeout=12_000)
    await phone.page.wait_for_function(f"before => ({PICTURE})() !== before", arg=before)


async def test_two_fingers_zoom_the_plot_and_leave_the_tab_where_it_is(phone: Phone, drive: Drive) -> None:
    _, watch = drive
    await phone.open(f"{watch.address}/#scan")
    await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile(r"of 18[01]"), timeout=12_000)
    await phone.acknowledge_all()
    await phone.acknowledge_meanwhile()
    twenty = phone.page.locator("[data-range='20']")
    await twenty.tap()
    await expect(twenty).to_have_attribute("aria-pressed", "true")
    await stroke(phone.page, (206, 250, 206, 200), (206, 350, 206, 400))  # 100 px apart, then 200
    assert await reach(phone) == pytest.approx(10.0, rel=0.15)
    await expect(twenty).to_have_attribute("aria-pressed", "false")
    await in_front(phone, "scan")
    await stroke(phone.page, (100, 300, 150, 300), (320, 300, 260, 300))  # across, where a swipe would go
    assert await reach(phone) == pytest.approx(20.0, rel=0.3)
    await in_front(phone, "scan")
    await swipe(phone, -250)
    await in_front(phone, "files")
    await swipe(phone, 250)
    await in_front(phone, "scan")
    for key in ("nearer", "farther"):
        box = await phone.f(key, "#panel-scan").bounding_box()
        assert min(box["width"], box["height"]) >= 56
    ten = phone.page.locator("[data-range='10']")
    await phone.no_snackbar()
    await phone.press_toggle(ten)
    await phone.f("farther", "#panel-scan").tap()
    assert await reach(phone) == pytest.approx(14.1, abs=0.1)
    await phone.f("farther", "#panel-scan").tap()
    await expect(twenty).to_have_attribute("aria-pressed", "true")
    await phone.f("aim", "#panel-scan").focus()
    await phone.page.keyboard.press("+")
    await phone.page.keyboard.press("+")
    await expect(ten).to_have_attribute("aria-pressed", "true")
    await phone.page.keyboard.press("-")
    await phone.page.reload()
    await phone.live()
    await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile(r"of 18[01]"), timeout=12_000)
    assert await reach(phone) == pytest.approx(14.1, abs=0.1)  # remembered


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def street(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[str]:
    """A server that watches a car at 4.2 m/s in a street, its wheels turned to the left, something 12 m ahead."""
    data = tmp_path_factory.mktemp("street")
    drive = drives.write(
        data / "street.bag",
        {
            "speed": lambda t: drives.twist(4.2 + 0.001 * np.sin(9 * t)),
            "steering": lambda _: drives.steering(0.08),
            "scan": lambda t: drives.street(t, 1440),
        },
        seconds=60.0,
    )
    async with running(*replay(drive)) as car, running(*server(data, car.address)) as watch:
        yield watch.address


async def test_a_tapped_return_is_told_in_words_and_stays_until_tapped_away(phone: Phone, street: str) -> None:
    await phone.open(f"{street}/#scan")
    await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile("of 1440"), timeout=12_000)
    await phone.page.locator("[data-range='20']").tap()
    aim, marked = phone.f("aim", "#panel-scan"), phone.f("marked", "#panel-scan")
    # The wall stands 6 m to the left; touched beside it, a thumb's width away.
    height = (await aim.bounding_box())["height"]
    scale = (height - 34 - 14) / 20
    place = {"x": 206 - 6 * scale + 15, "y": height - 34 - 6 * scale}
    await aim.tap(position=place)
    await expect(marked).to_have_text(re.compile(r"Marked: \d\.\d m, 4\d° left, 0\.\d\d s ago"))
    spoken = await phone.f("live", "#panel-scan").text_content()
    assert 7.5 < float(re.match(r"[\d.]+", spoken)[0]) < 9.5  # type: ignore[index]
    await phone.page.wait_for_timeout(700)
    await expect(marked).to_be_visible()  # it is followed from scan to scan
    assert await phone.f("live", "#panel-scan").text_content() == spoken  # and announced once
    await aim.tap(position={"x": 206 + 60, "y": height - 34 - 9 * scale})  # where nothing is
    await expect(marked).to_be_hidden()
    await aim.focus()
    await phone.page.keyboard.press("Enter")
    await expect(aim).to_have_attribute("aria-valuetext", re.compile(r"6\.\d m, [89]\d° (left|right)"))
    first = await aim.get_attribute("aria-valuetext")
    inward = "ArrowLeft" if "right" in first else "ArrowRight"  # both walls are as near
    for _ in range(20):  # beams of an eighth of a degree
        await phone.page.keyboard.press(inward)
    await expect(aim).not_to_have_attribute("aria-valuetext", first)
    await expect(aim).to_have_attribute("aria-valuetext", re.compile(r"\d m, \d+° (left|right)"))
    await in_front(phone, "scan")  # the arrows were the plot's
    await phone.page.keyboard.press("Escape")
    await expect(marked).to_be_hidden()
    await expect(aim).to_have_attribute("aria-valuetext", "no return marked")


@pytest.mark.own_phone
async def test_corridor_gap_and_stopping_distance_are_those_of_the_judge(phone: Phone, street: str) -> None:
    await phone.page.add_init_script(f"{WITHOUT_A_THREAD}; ({LINES})()")
    await phone.open(f"{street}/#scan")
    await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile("of 1440"), timeout=12_000)
    await expect(phone.f("stops", "#panel-scan")).to_have_text("7.1")  # 4.2·1 + 4.2²/6
    async with http_client() as client:
        state = (await client.get(f"{street}/api/state")).json()
    (obstacle,) = [one for one in state["checks"] if one["label"] == "Obstacle"]
    gap = re.search(r"([\d.]+) m", obstacle["text"])
    shown = float(await phone.f("distance", "#panel-scan").text_content())
    assert gap is not None
    assert shown == pytest.approx(float(gap[1]), abs=0.1)  # a scan later
    # The strip turns about a centre 2.62 / tan(0.08) m to the left of the rear axle, 2.5 m behind the laser.
    await phone.page.wait_for_function("() => window.dashed?.length > 10")
    lines, height = await phone.page.evaluate("[window.dashed, document.querySelector('.scanc').clientHeight]")
    scale = (height - 34 - 14) / 20
    x_m, y_m = (height - 34 - np.array(lines)[:, 1]) / scale, (206 - np.array(lines)[:, 0]) / scale
    centre_m = 2.62 / np.tan(0.08)
    radius_m = np.hypot(x_m + 2.5, y_m - centre_m)
    inner, outer = centre_m - 1.2, np.hypot(2.5, centre_m) + 1.2
    assert np.minimum(np.abs(radius_m - inner), np.abs(radius_m - outer)).max() < 0.05
    await expect(phone.f("straight", "#panel-scan")).to_be_hidden()
    await expect(phone.page.locator("#scan-described")).to_have_text(
        re.compile(r"invalid from \d+° right to \d+° right")
    )


async def test_of_a_thread_that_draws_no_more_the_page_takes_over(phone: Phone, drive: Drive) -> None:
    """A picture that stands still is not shown as live meanwhile."""
    _, watch = drive
    thread = await painted_by_thread(phone, f"{watch.address}/#scan")
    assert await thread.evaluate("[...fonts].map((one) => one.status)") == ["loaded", "loaded"]
    await expect(phone.f("none", "#panel-scan")).to_be_hidden()
    await phone.page.evaluate(NOTE_STALE)
    await thread.evaluate("onmessage = () => {}")
    await phone.page.wait_for_function("() => window.wasStale", timeout=8_000)
    await expect(phone.f("none", "#panel-scan")).to_be_hidden()
    assert phone.page.workers == []
    assert [line for line in phone.complaints if "now draws the scan itself" in line] != []
    phone.complaints.clear()


async def test_the_thread_draws_what_the_page_would(phone: Phone, tmp_path: Path) -> None:
    """With a car of its own, for the corridor is drawn from its speed and steering, too."""
    async with driving(tmp_path) as (car, watch):
        await phone.open(f"{watch.address}/#scan")
        await phone.acknowledge_meanwhile()
        await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile(r"of 18[01]"), timeout=12_000)
        await car.type("silent-scan 60")
        await expect(phone.f("none-words", "#panel-scan")).to_have_text(re.compile(r"STALE \d"))
        by_thread = await pictures(phone)
        await painter(phone).evaluate("onmessage = () => {}")
        await phone.f("nearer", "#panel-scan").tap()
        async with asyncio.timeout(8):
            while phone.page.workers:
                await asyncio.sleep(0.05)
        by_page = await pictures(phone)
        assert len(set(by_thread)) == 3
        assert by_page == by_thread
        phone.complaints.clear()


# It is stale for half a second only, between 1 s and the page's taking over: who looks now and then may miss it.
NOTE_STALE = """() => {
  const text = document.querySelector('#panel-scan [data-f="none-words"]');
  const note = () => { window.wasStale ||= text.checkVisibility() && text.textContent.startsWith('STALE 1'); };
  const all = { subtree: true, childList: true, characterData: true, attributes: true };
  new MutationObserver(note).observe(text.closest('#panel-scan'), all);
}"""


def painter(phone: Phone) -> Worker:
    (thread,) = [one for one in phone.page.workers if "scan-painter" in one.url]
    return thread


async def painted_by_thread(phone: Phone, address: str) -> Worker:
    """Opens the plot; anew where this machine halted for a second and the page took over from the thread at once."""
    for _ in range(3):
        await phone.open("about:blank")
        phone.complaints.clear()
        await phone.open(address)
        await expect(phone.f("beams", "#panel-scan")).to_have_text(re.compile(r"of 18[01]"), timeout=12_000)
        if phone.page.workers:
            break
    return painter(phone)


async def pictures(phone: Phone) -> list[str]:
    """The plot as it is at three reaches."""
    found = []
    for reach_m in (10, 20, 40):
        await phone.page.locator(f"[data-range='{reach_m}']").tap()
        await phone.page.wait_for_timeout(400)
        found.append(await phone.page.evaluate(PICTURE))
    return found


ODD = {
    "one beam": lambda t: drives.laser(t, [5.0 + 0.1 * np.sin(t)], angle_min=0.0, increment=0.0),
    "no beams": lambda t: drives.laser(t, []),
    "10 000 beams": lambda t: drives.street(t, 10_000),
    "clockwise": lambda t: drives.laser(t, 7.0 + 0.1 * np.sin(np.arange(181) + t), np.pi / 2, -np.pi / 180),
    "backwards": lambda t: drives.laser(t, 7.0 + 0.1 * np.sin(np.arange(91) + t), 0.75 * np.pi, np.pi / 180),
    "blind": lambda t: drives.laser(t, np.full(181, np.nan)),
    "narrow": lambda t: drives.laser(t, 7.0 + 0.1 * np.sin(np.arange(61) + t), -np.pi / 6, np.pi / 180),
}
EXPECTED = {
    "one beam": ("blind", "1 of 1 beams", "not in view"),
    "no beams": ("blind", "0 of 0 beams", "not in view"),
    "10 000 beams": ("12.0", "of 10000 beams", "invalid"),
    "clockwise": ("6.", "181 of 181 beams", ""),
    "backwards": ("blind", "91 behind, not drawn", "not in view"),
    "blind": ("blind", "0 of 181 beams", "invalid"),
    "narrow": ("6.", "61 of 61 beams", "not in view from 90° left to 30° left"),
}


def as_json(scan: Any) -> dict[str, Any]:
    """A laser's message as a bridge has it."""
    stamp = {"secs": scan.header.stamp.sec, "nsecs": scan.header.stamp.nanosec}
    numbers = ("angle_min", "angle_max", "angle_increment", "time_increment", "scan_time", "range_min", "range_max")
    return {
        "header": {"seq": 0, "stamp": stamp, "frame_id": "laser"}, **{name: getattr(scan, name) for name in numbers},
        "ranges": scan.ranges, "intensities": scan.intensities,
    }  # fmt: skip


async def test_no_scan_is_too_odd(phone: Phone) -> None:
    """Whatever a laser sends, the page draws it or shows why not, and its console stays clean."""
    async with roaming() as car:
        car.bridge.advertise(LASER, "sensor_msgs/LaserScan")
        laser = {"scan": ODD["narrow"]}

        async def scan() -> None:
            for n in itertools.count():
                car.bridge.publish(LASER, as_json(laser["scan"](n / 10)))
                await asyncio.sleep(0.1)

        scanning = asyncio.create_task(scan())
        async with serving(Config(vehicles=(Vehicle(name="car", address=car.address),))) as address:
            await phone.open(f"{address}/#scan")
            for odd, (distance, beams, text) in EXPECTED.items():
                laser["scan"] = ODD[odd]
                await expect(phone.f("beams", "#panel-scan")).to_contain_text(beams, timeout=12_000)
                await phone.acknowledge_all()
                await expect(phone.f("distance", "#panel-scan")).to_contain_text(distance)
                await expect(phone.page.locator("#scan-described")).to_contain_text(text)
                await expect(phone.f("straight", "#panel-scan")).to_be_visible()
                await phone.f("aim", "#panel-scan").tap(position={"x": 206, "y": 100})
                await phone.f("aim", "#panel-scan").focus()
                for key in ("Enter", "ArrowLeft", "ArrowRight", "+", "-", "Escape"):
                    await phone.page.keyboard.press(key)
        scanning.cancel()


def age(text: str | None) -> float:
    found = re.search(r"[\d.]+", text or "")
    assert found is not None
    return float(found[0])


async def reach(phone: Phone) -> float:
    return float(await phone.page.evaluate("localStorage.getItem('catgraph.range')"))
