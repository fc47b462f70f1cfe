"""The Map tab with a car on our own bridge and a phone: true metres, honest ages, and its gestures."""

from __future__ import annotations

import asyncio
import contextlib
import math
import re
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
from playwright.async_api import expect

from server.app.config import Config
from server.vehicle.vehicle import Vehicle
from tests.page.barriers import SIZES
from tests.page.canned import Canned
from tests.page.conftest import Phone
from tests.page.radio import Radio
from tests.page.roamer import Roamer, roaming
from tests.page.touch import stroke
from tests.server.conftest import serving
from tests.server.web import map_files as maps
from tests.server.web.map_files import png
from tests.server.web.maps.test_tile_proxy import Source

FIRST = 0.135  # metres a pixel at the first look
MIDDLE = """() => { const { width, height } = document.querySelector('.mapbox').getBoundingClientRect();
  return [width / 2, height / 2]; }"""


class Map:
    """What stands on the map's glass."""

    def __init__(self, phone: Phone) -> None:
        self.phone, self.page = phone, phone.page

    def f(self, name: str) -> Any:
        return self.phone.f(name, "#panel-map")

    def svg(self, name: str) -> Any:
        return self.page.locator(f"#panel-map .mapv {name}").first

    async def press(self, name: str) -> None:
        await self.phone.press_toggle(self.f(name))

    async def numbers(self, name: str, attribute: str = "transform") -> list[float]:
        text = await self.svg(name).get_attribute(attribute) or ""
        return [float(number) for number in re.findall(r"-?\d+(?:\.\d+)?(?:e-?\d+)?", text)]

    async def until(self, script: str, arg: Any = None) -> None:
        await self.page.wait_for_function(script, arg=arg, timeout=25_000)

    async def stands(self, name: str, x: float, y: float, within: float = 0.6) -> None:
        """Waits until a mark stands so many pixels right of and below the middle."""
        async with asyncio.timeout(8):
            while math.dist(await self.from_middle(name), (x, y)) > within:
                await asyncio.sleep(0.05)

    async def reaches(self, name: str, attribute: str, value: float, within: float) -> None:
        """Waits until the first number of an attribute is this."""
        async with asyncio.timeout(8):
            while abs((await self.numbers(name, attribute))[0] - value) > within:
                await asyncio.sleep(0.05)

    async def from_middle(self, name: str) -> tuple[float, float]:
        """Where a mark stands, in pixels from the middle."""
        x, y = (await self.numbers(name))[:2]
        across, down = await self.page.evaluate(MIDDLE)
        return x - across, y - down


@contextlib.asynccontextmanager
async def looking(phone: Phone, car: Roamer, tab: str = "map", **config: Any) -> AsyncIterator[Map]:
    async with serving(Config(vehicles=(Vehicle(name="car", address=car.address),), **config)) as address:
        await phone.open(f"{address}/#{tab}")
        await phone.live()
        if tab == "map":
            await expect(phone.page.locator("#panel-map .car-mark")).to_be_visible(timeout=12_000)
        yield Map(phone)


async def lay(phone: Phone, car: Roamer, east_m: float, north_m: float, accuracy_m: float = 5.0) -> None:
    """The phone lies there: the browser tells it twice a second, as a receiver does."""
    await phone.page.context.set_geolocation({**car.place(east_m, north_m), "accuracy": accuracy_m})


@contextlib.asynccontextmanager
async def lying(
    phone: Phone, car: Roamer, east_m: float, north_m: float, accuracy_m: float = 5.0
) -> AsyncIterator[None]:
    await phone.page.context.grant_permissions(["geolocation"])

    async def tell() -> None:
        while True:
            await lay(phone, car, east_m, north_m, accuracy_m)
            await asyncio.sleep(0.5)

    task = asyncio.create_task(tell())
    try:
        yield
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task


# -- where they are ----------------------------------------------------------------------------------------------------


@pytest.mark.own_phone
async def test_car_and_phone_with_distance_bearing_and_their_errors(phone: Phone) -> None:
    """The phone lies 6 m east and 8 m south of the car: 10 m, and the car is at 323° of it."""
    async with roaming() as car, lying(phone, car, 6.0, -8.0), looking(phone, car) as it:
        await expect(it.f("apart")).to_have_text(re.compile(r"^(9\.9|10\.0|10\.1)$"))
        await expect(it.f("bearing")).to_have_text(re.compile(r"^car at 32[234]° NW$"))
        await expect(it.f("verdict-text")).to_have_text("OK", timeout=15_000)
        assert float(await it.f("allowed").text_content()) >= 10.0
        await expect(it.f("message")).to_be_hidden()
        assert await it.f("car-lat").text_content() == "32.231900°"
        assert await it.f("phone-lon").text_content() == "−110.950036°"
        await expect(it.f("phone-age")).to_have_text(re.compile(r"^\d\.\d s$"))
        await it.stands(".car-mark", 0.0, 0.0)
        assert await it.from_middle(".phone-mark") == pytest.approx((6 / FIRST, 8 / FIRST), abs=0.3)
        assert await it.numbers(".phacc", "r") == pytest.approx([5 / FIRST], abs=0.1)
        # One sigma is 2 m to the east and 3 m to the north.
        assert (await it.numbers(".acc", "rx"), await it.numbers(".acc", "ry")) == (
            pytest.approx([2 / FIRST], abs=0.1),
            pytest.approx([3 / FIRST], abs=0.1),
        )
        line = await it.numbers(".dl", "d")
        assert math.hypot(line[2] - line[0], line[3] - line[1]) * FIRST == pytest.approx(10.0, abs=0.1)
        assert (await it.numbers(".car-mark .car"))[0] == 90.0
        label = await it.page.locator("#panel-map svg[role=img]").get_attribute("aria-label")
        assert re.fullmatch(r"Map: the car is (9\.9|10\.\d) m from the phone, at 32\d° NW of it", label)
        assert re.search(r"10\.\d m32\d° NW|9\.9 m32\d° NW", await it.svg(".beside").text_content())

        car.covariance_m2 = (9.0, 9.0, 6.0)  # long to the north-east
        await expect(it.svg(".acc")).to_have_attribute("transform", re.compile(r"rotate\(45\)"))
        car.covariance_m2 = None
        await expect(it.svg(".name")).to_have_text("Car, accuracy unknown")
        await expect(it.svg(".acc")).to_be_hidden()


async def test_the_map_follows_a_car_that_drives_and_leaves_its_track(phone: Phone) -> None:
    async with roaming(speed_mps=6.0) as car, looking(phone, car) as it:
        began = await it.f("car-lon").text_content()
        await it.until("() => (document.querySelector('.mapv .tr').getAttribute('d').match(/L/g) ?? []).length > 12")
        assert await it.f("car-lon").text_content() != began
        for _ in range(5):
            await it.stands(".car-mark", 0.0, 0.0)
            await asyncio.sleep(0.1)
        box = await it.svg(".tr").bounding_box()
        middle = await it.page.evaluate("() => document.querySelector('.mapbox').getBoundingClientRect().x + 206")
        assert box["width"] > 20 / FIRST  # behind it, to the west
        assert middle - 15 / FIRST < box["x"] + box["width"] < middle  # sent once a second, smoothed
        assert box["height"] < 8
        tail = await it.numbers(".tail", "d")  # and from there to the car
        across, down = await it.page.evaluate(MIDDLE)
        assert tail[2:] == pytest.approx([across, down], abs=0.6)
        dots = await it.svg(".dots").get_attribute("d")
        await it.until("before => document.querySelector('.mapv .dots').getAttribute('d') !== before", dots)


async def test_a_page_that_comes_late_and_one_after_a_radio_gap_have_the_whole_track(phone: Phone) -> None:
    count = "document.querySelector('.mapv .tr')?.getAttribute('d')?.match(/[ML]/g)?.length ?? 0"
    async with roaming(speed_mps=8.0, covariance_m2=(0.04, 0.04, 0.0)) as car:
        async with serving(Config(vehicles=(Vehicle(name="car", address=car.address),))) as address:
            radio = Radio(int(address.rpartition(":")[2]))
            async with radio.on_air() as radio_address:
                await phone.open(f"{radio_address}/#home")
                await phone.live()
                await asyncio.sleep(3.0)
                await phone.page.evaluate("location.hash = '#map'")  # whatever alarm a busy machine raises
                await phone.page.wait_for_function(f"() => ({count}) >= 8", timeout=12_000)
                radio.cut()
                await asyncio.sleep(3.5)
                radio.mend()
                await phone.live()
                points = (await phone.page.evaluate("fetch('/api/track/points').then((a) => a.json())"))["points"]
                assert len(points) > 20
                await phone.page.wait_for_function(f"n => ({count}) >= n", arg=len(points), timeout=12_000)
                assert (await phone.page.locator(".mapv .tr").first.get_attribute("d")).count("M") == 1  # no hole in it
                assert await phone.page.locator(".mapv .unseen").get_attribute("d") == ""
                # Another connection is another track.
                await phone.page.evaluate(
                    """address => fetch('/api/connect', { method: 'POST', body: JSON.stringify({ address }),
                      headers: { 'Content-Type': 'application/json' } })""",
                    car.address,
                )
                await phone.page.wait_for_function(f"n => ({count}) < n", arg=len(points) // 2, timeout=12_000)
                await phone.open("about:blank")  # before the radio goes: else it cuts an answer in two


# -- what is not known -------------------------------------------------------------------------------------------------


@pytest.mark.own_phone
async def test_a_stale_car_loses_its_ink_and_its_line(phone: Phone) -> None:
    async with roaming() as car, lying(phone, car, 6.0, -8.0), looking(phone, car) as it:
        await expect(it.svg(".dl")).to_be_visible(timeout=12_000)
        car.tells_position, car.heading_deg = False, None
        await expect(it.svg(".car-mark")).to_have_attribute("data-ink", "stale")
        await expect(it.svg(".name")).to_have_text(re.compile(r"^Car STALE \d"))
        await expect(it.f("car-message")).to_have_text(
            re.compile(r"^The car’s position is \d+\.\d s old: the car may be")
        )
        await expect(it.f("car-age")).to_have_text(re.compile(r"^STALE \d+\.\d s$"))
        spoken = await it.f("spoken").text_content()
        assert spoken.startswith("The car’s position is ")
        await asyncio.sleep(1.5)
        assert await it.f("spoken").text_content() == spoken  # announced once, not with every second
        await expect(it.f("car-lat")).to_have_attribute("data-ink", "stale")
        for gone in (".dl", ".acc"):
            await expect(it.svg(gone)).to_be_hidden()
        await expect(it.f("apart")).to_have_text("–")
        car.tells_position, car.heading_deg = True, 90.0
        await expect(it.svg(".car-mark")).to_have_attribute("data-ink", "fresh")
        await expect(it.f("car-message")).to_be_hidden()


async def test_without_a_fix_the_coordinates_are_no_position(phone: Phone) -> None:
    async with roaming() as car, looking(phone, car) as it:
        car.status = -1
        await expect(it.f("car-message")).to_have_text("The car’s receiver has no fix: the car’s position is unknown.")
        await expect(it.f("car-age")).to_have_text("no fix")
        await expect(it.f("car-lat")).to_have_text("–")
        await expect(it.svg(".name")).to_have_text("Car was here")
        await expect(it.svg(".car-mark")).to_have_attribute("data-ink", "stale")
        await phone.page.reload()  # a page that comes only now knows it from the track
        await phone.live()
        await expect(it.svg(".name")).to_have_text("Car was here", timeout=12_000)
        await it.stands(".car-mark", 0.0, 0.0)


async def test_a_heading_that_is_not_known_points_nowhere(phone: Phone) -> None:
    async with roaming() as car, looking(phone, car) as it:
        dart, diamond, outline = it.svg("path.car"), it.page.locator(".mapv path.car").nth(1), it.svg(".nose")
        await expect(dart).to_be_visible()
        await expect(diamond).to_be_hidden()
        car.heading_deg = None
        await expect(dart).to_be_hidden(timeout=20_000)
        await expect(diamond).to_be_visible()
        await expect(outline).to_be_visible()  # where it looked once
        await expect(outline).to_have_attribute("transform", "rotate(90)")
        await expect(it.svg(".name")).to_have_text(re.compile(r"^Car ±3 m, heading \d+\.\d s old$"))
        await expect(it.svg(".car-mark")).to_have_attribute("data-ink", "fresh")


@pytest.mark.own_phone
async def test_every_reason_of_the_phone_is_said_in_words(phone: Phone) -> None:
    async with roaming() as car, looking(phone, car) as it:
        await expect(it.f("phone-message")).to_have_text("No phone is sharing its position.")
        await phone.f("sound-off").tap()  # arms the position too: this phone refuses
        await expect(it.f("phone-message")).to_have_text("Location permission denied on the phone.")
        await expect(it.f("verdict-why")).to_have_text("denied")
        async with lying(phone, car, 30.0, 40.0, accuracy_m=80.0):
            await expect(it.f("phone-message")).to_have_text(
                "Position of the phone is accurate to 80 m only; 50 m is needed.", timeout=12_000
            )
            await expect(it.f("apart")).to_have_text("–")  # not compared
            await expect(it.f("allowed")).to_have_text("–")
            await expect(it.page.locator(".mapv .name").nth(1)).to_have_text("Phone ±80 m, too coarse")
        await phone.page.context.clear_permissions()
        await expect(it.f("phone-message")).to_have_text("Location permission denied on the phone.")
        await expect(it.svg(".phone-mark")).to_have_attribute("data-ink", "stale")
        await expect(it.f("phone-age")).to_have_text(re.compile(r"^STALE \d"))


async def test_before_any_position_nothing_is_drawn_and_that_is_said(phone: Phone) -> None:
    async with roaming(tells_position=False, heading_deg=None) as car:
        async with serving(Config(vehicles=(Vehicle(name="car", address=car.address),))) as address:
            await phone.open(f"{address}/#map")
            await phone.live()
            it = Map(phone)
            await expect(it.f("none-words")).to_have_text("no position yet")
            await expect(it.f("car-message")).to_have_text("No position received from the car yet.")
            await expect(it.f("car-lat")).to_have_text("no message yet")
            for mark in (".car-mark", ".phone-mark", ".dl", ".acc", ".phacc"):
                await expect(it.svg(mark)).to_be_hidden()
            assert (await it.svg(".g").get_attribute("d")).count("M") > 5  # the grid is there


@pytest.mark.own_phone
async def test_no_place_on_earth_is_special(phone: Phone) -> None:
    for lat_deg, lon_deg in ((-17.0, 179.99999), (89.99995, 10.0), (90.0, 0.0), (-89.9999, -180.0), (0.0, 0.0)):
        async with roaming(lat_deg, lon_deg, speed_mps=4.0) as car:
            async with lying(phone, car, -6.0, 8.0) if abs(lat_deg) < 89 else contextlib.nullcontext():
                async with looking(phone, car) as it:
                    if abs(lat_deg) < 89:
                        await expect(it.f("apart")).to_have_text(re.compile(r"^(9|1\d)\.\d$"), timeout=15_000)
                    for key in ("fit", "north"):
                        await it.f(key).evaluate("key => key.click()")  # an alarm of the judge's may stand before it
                    await asyncio.sleep(0.5)
                    html = await it.page.locator("#panel-map .mapbox").inner_html()
                    assert not re.search(r"NaN|Infinity|undefined", html), (lat_deg, lon_deg)
                    x, y = await it.from_middle(".car-mark")
                    assert abs(x) < 210, (lat_deg, lon_deg)
                    assert abs(y) < 240, (lat_deg, lon_deg)
                    assert len(await it.f("car-lat").text_content()) > 5
                    await phone.open("about:blank")


# -- gestures ----------------------------------------------------------------------------------------------------------


async def drag(it: Map, dx: int, dy: int, fingers: int = 1, spread: int = 0) -> None:
    """Fingers over the map; with two, 60 px apart, they part by `spread` pixels."""
    box = await it.f("box").bounding_box()
    x, y = box["x"] + box["width"] / 2, box["y"] + box["height"] / 2
    sides, apart = ((-0.5, 0.5), 60) if fingers == 2 else ((0.0,), 0)
    await stroke(it.page, *((x + side * apart, y, x + dx + side * (apart + spread), y + dy) for side in sides))


async def test_following_leaves_the_swipe_to_the_tabs_and_free_takes_it(phone: Phone) -> None:
    async with roaming() as car, looking(phone, car) as it:
        await expect(it.f("follow")).to_have_attribute("aria-pressed", "true")
        await it.f("follow").tap()
        await expect(it.f("follow")).to_have_attribute("aria-pressed", "false")
        await drag(it, -100, 60)
        await it.stands(".car-mark", -100.0, 60.0)
        await expect(phone.page.locator("#tab-map")).to_have_attribute("aria-selected", "true")
        await asyncio.sleep(0.5)
        await it.stands(".car-mark", -100.0, 60.0)  # it stays where it was put
        await it.f("follow").tap()
        await it.stands(".car-mark", 0.0, 0.0)
        await drag(it, -250, 0)
        await expect(phone.page.locator("#tab-scan")).to_have_attribute("aria-selected", "true")


async def test_two_fingers_and_keys_change_the_scale_and_the_car_stays_in_the_middle(phone: Phone) -> None:
    async with roaming() as car, looking(phone, car) as it:
        bar = (await it.numbers(".sc", "d"))[3]
        assert bar == pytest.approx(20 / FIRST, abs=0.2)
        before = (await it.numbers(".acc", "ry"))[0]
        await drag(it, 0, 0, fingers=2, spread=90)  # from 60 px apart to 150
        await it.reaches(".acc", "ry", 2.5 * before, 0.2 * before)
        await it.stands(".car-mark", 0.0, 0.0)
        await expect(phone.page.locator("#tab-map")).to_have_attribute("aria-selected", "true")
        pinched = (await it.numbers(".acc", "ry"))[0]
        await it.f("wider").tap()
        await it.reaches(".acc", "ry", pinched / 1.6, 0.2)
        await it.f("closer").tap()
        await it.reaches(".acc", "ry", pinched, 0.2)


@pytest.mark.own_phone
async def test_both_are_brought_into_sight_and_the_heading_up(phone: Phone) -> None:
    async with roaming() as car, lying(phone, car, 300.0, 400.0, 60.0), looking(phone, car) as it:
        await expect(it.page.locator(".mapv .name").nth(1)).to_have_text("Phone ±60 m, too coarse", timeout=15_000)
        await expect(phone.f("strip")).to_contain_text("Phone position", timeout=25_000)  # its fix is too coarse
        await it.press("fit")
        await expect(it.f("fit")).to_have_attribute("aria-pressed", "true")
        await expect(it.f("follow")).to_have_attribute("aria-pressed", "false")
        across, down = await it.page.evaluate(MIDDLE)
        async with asyncio.timeout(8):
            for mark in (".car-mark", ".phone-mark"):
                while not all(
                    abs(a) <= b - 70 for a, b in zip(await it.from_middle(mark), (across, down), strict=True)
                ):
                    await asyncio.sleep(0.05)
        (cx, cy), (px, py) = await it.from_middle(".car-mark"), await it.from_middle(".phone-mark")
        assert px > cx
        assert py < cy
        await it.press("north")  # the car looks east: east is up, and north is at the left
        await expect(it.f("north")).to_have_attribute("aria-pressed", "true")
        await expect(it.svg(".car-mark .car")).to_have_attribute("transform", "rotate(0)")
        await expect(it.f("needle")).to_have_attribute("transform", "rotate(-90.0 12 12)")
        (cx, cy), (px, py) = await it.from_middle(".car-mark"), await it.from_middle(".phone-mark")
        assert px < cx
        assert py < cy
        assert "rotate" not in (await it.svg(".name").get_attribute("transform"))  # letters stay upright
        await phone.page.reload()
        await phone.live()
        await expect(it.f("fit")).to_have_attribute("aria-pressed", "true")  # remembered on this phone
        await expect(it.f("north")).to_have_attribute("aria-pressed", "true")
        await expect(it.f("needle")).to_have_attribute("transform", "rotate(-90.0 12 12)", timeout=12_000)
        car.heading_deg = None
        await expect(it.svg(".nose")).to_be_visible(timeout=20_000)
        await expect(it.f("needle")).to_have_attribute("transform", "rotate(-90.0 12 12)")  # nobody turned
        await it.press("north")
        await expect(it.f("needle")).to_have_attribute("transform", re.compile(r"rotate\(-?0\.0 12 12\)"))


async def test_keys_are_large_named_and_worked_by_a_keyboard(phone: Phone) -> None:
    async with roaming() as car, looking(phone, car) as it:
        names = []
        for key in await it.page.locator("#panel-map .map button").all():
            box = await key.bounding_box()
            assert min(box["width"], box["height"]) >= 56
            names.append(await key.get_attribute("aria-label"))
        assert names == ["Heading up", "Closer", "Wider", "Car and phone in sight", "Follow the car"]
        await it.f("box").focus()
        await it.page.keyboard.press("ArrowLeft")  # follows: nothing is moved
        await it.stands(".car-mark", 0.0, 0.0)
        for _ in range(5):
            await it.page.keyboard.press("Tab")
        await expect(it.f("follow")).to_be_focused()
        await it.page.keyboard.press("Enter")
        await expect(it.f("follow")).to_have_attribute("aria-pressed", "false")
        await it.f("box").focus()
        await it.page.keyboard.press("ArrowLeft")
        await it.page.keyboard.press("ArrowDown")
        await it.stands(".car-mark", 80.0, -80.0)
        await it.page.keyboard.press("+")
        await it.stands(".car-mark", 120.0, -120.0)
        await it.f("follow").tap()  # its keys stay within reach while the map has the focus
        await expect(it.f("follow")).to_have_attribute("aria-pressed", "true")


async def test_no_width_breaks_the_map(phone: Phone, canned: Canned) -> None:
    await phone.open(f"{canned.address}/#map")
    await phone.live()
    it = Map(phone)
    await expect(it.svg(".car-mark")).to_be_visible(timeout=12_000)
    for width, height in SIZES:
        await phone.page.set_viewport_size({"width": width, "height": height})
        await it.stands(".car-mark", 0.0, 0.0)
        place = await it.page.locator("#panel-map .map").bounding_box()
        for key in await it.page.locator("#panel-map .map button").all():
            box = await key.bounding_box()
            assert box["y"] >= place["y"], (width, height)
            assert box["y"] + box["height"] <= place["y"] + place["height"], (width, height)


COVERED = """() => {
  const at = (one) => [one, document.querySelector(`#panel-map ${one}`)?.getBoundingClientRect()];
  const names = ['.name:nth-of-type(1)', '.name:nth-of-type(2)', '.beside'].map(at);
  const marks = ['.car-mark', '.phone-mark'].map(at);
  const over = ['.fabs', '.compass', '.map-by'].map(at);
  const pairs = [...names, ...marks].flatMap((one) => over.map((other) => [one, other]));
  pairs.push(...names.flatMap((one) => marks.map((other) => [one, other])));
  const meet = (a, b, from, to) => a[from] < b[to] - 1 && b[from] < a[to] - 1;
  return pairs.filter(([[, a], [, b]]) => a?.width && b?.width)
    .filter(([[, a], [, b]]) => meet(a, b, 'left', 'right') && meet(a, b, 'top', 'bottom'))
    .map(([[a], [b]]) => `${a} under ${b}`);
}"""


@pytest.mark.parametrize("size", [(320, 640), (360, 740), (412, 915), (820, 1180), (1440, 900)])
async def test_car_phone_and_their_names_stand_clear_of_keys_and_each_other(
    phone: Phone, canned: Canned, size: tuple[int, int]
) -> None:
    canned.ground["layers"] = [
        {"title": "Plan", "tiles": "/map/{z}/{x}/{y}", "min_zoom": 0, "max_zoom": 19,
         "attribution": "Plan: test track", "bounds": [-180, -85, 180, 85]}
    ]  # fmt: skip
    canned.tile = lambda z, x, y: png(176, 190, 168)
    await phone.page.set_viewport_size({"width": size[0], "height": size[1]})
    await phone.open(f"{canned.address}/#map")
    await phone.live()
    it = Map(phone)
    for mark in (".car-mark", ".phone-mark"):
        await expect(it.svg(mark)).to_be_visible(timeout=12_000)
    await expect(it.f("by")).to_have_text("Plan: test track")
    await it.until(f"() => ({COVERED})().length === 0")
    for name in range(2):
        await expect(it.page.locator("#panel-map .mapv .name").nth(name)).to_be_visible()


# -- the ground --------------------------------------------------------------------------------------------------------


@pytest.mark.own_phone
async def test_the_map_is_fetched_when_it_comes_near_and_leaflet_only_for_tiles(phone: Phone) -> None:
    requests: list[str] = []
    phone.page.on("request", lambda request: requests.append(request.url))
    async with roaming() as car, looking(phone, car, tab="home") as it:
        map_script = re.compile(r"/js/map/map\.js|/built/map-[\w-]+\.js")  # as it is written, or joined
        assert [url for url in requests if map_script.search(url) or re.search(r"leaflet|/api/map|track", url)] == []
        await phone.page.locator("[data-tab=map]").tap()
        await expect(it.svg(".car-mark")).to_be_visible()
        assert [url for url in requests if map_script.search(url)] != []
        assert [url for url in requests if "leaflet" in url] == []
        assert await it.f("by").text_content() == ""


def plan(path: Path, lat_deg: float, lon_deg: float) -> Path:
    """One zoom level around a place: red in the tile it lies in, blue in those around."""
    n = 1 << 19
    x = int((lon_deg + 180) / 360 * n)
    y = int((1 - math.asinh(math.tan(math.radians(lat_deg))) / math.pi) / 2 * n)
    tiles = [
        (19, x + i, n - 1 - (y + j), png(*((250, 0, 0) if i == j == 0 else (0, 0, 250))))
        for i in range(-4, 5)
        for j in range(-4, 5)
    ]
    attribution = '<a href="https://example.org">© Plan</a><script>alert(1)</script>'
    return maps.write(path / "plan.mbtiles", tiles, format="png", attribution=attribution, minzoom="19", maxzoom="19")


@pytest.mark.own_phone
async def test_tiles_and_the_site_s_picture_lie_where_they_should(phone: Phone, tmp_path: Path) -> None:
    requests: list[str] = []
    phone.page.on("request", lambda request: requests.append(request.url))
    async with roaming() as car:
        site = tmp_path / "site.png"
        site.write_bytes(png(0, 200, 0, 64))
        corner = [[one["latitude"], one["longitude"]] for one in (car.place(5, 15), car.place(15, 15), car.place(5, 5))]
        site.with_name("site.png.toml").write_text(
            "attribution = '<b>Survey</b>'\n[corners]\n"
            + "\n".join(f"{k} = {v}" for k, v in zip(("top_left", "top_right", "bottom_left"), corner, strict=True))
        )
        ground = {"maps": (plan(tmp_path, car.lat_deg, car.lon_deg),), "site_image": site}
        async with looking(phone, car, **ground) as it:
            await it.until("() => document.querySelectorAll('.leaflet-tile-loaded').length >= 6")
            await expect(it.f("by")).to_have_text("© Plan · Survey")
            assert await it.page.locator("#panel-map .map-by *").count() == 0  # text, not markup
            # The tile under the car, laid where the car stands: drawn larger than it is, for there is no deeper level.
            box = await it.f("box").bounding_box()
            middle = {"x": box["x"] + box["width"] / 2, "y": box["y"] + box["height"] / 2}
            under = await it.page.evaluate(
                """({ x, y }) => [...document.querySelectorAll('.leaflet-tile-loaded')].filter((tile) => {
                  const { left, right, top, bottom } = tile.getBoundingClientRect();
                  return left <= x && x < right && top <= y && y < bottom;
                }).map((tile) => [new URL(tile.src).pathname, tile.getBoundingClientRect().width])""",
                middle,
            )
            assert len(under) == 1
            path, width = under[0]
            n = 1 << 19
            x = int((car.lon_deg + 180) / 360 * n)
            y = int((1 - math.asinh(math.tan(math.radians(car.lat_deg))) / math.pi) / 2 * n)
            assert re.fullmatch(rf"/map/[0-9a-f]{{12}}/19/{x}/{y}", path)
            metres = 40_075_016.7 / n * math.cos(math.radians(car.lat_deg))  # of that tile on a sphere
            assert width * FIRST == pytest.approx(metres, rel=0.006)
            image = await it.page.locator("#panel-map .site").bounding_box()
            assert (image["x"] - middle["x"], image["y"] - middle["y"]) == pytest.approx(
                (5 / FIRST, -15 / FIRST), abs=1
            )
            assert (image["width"], image["height"]) == pytest.approx((10 / FIRST, 10 / FIRST), abs=1)
            assert {re.match(r"\w+://[^/]+", url)[0] for url in requests} == {
                re.match(r"\w+://[^/]+", phone.page.url)[0]
            }
            # Turned, the tile under the car is still the same.
            await it.f("north").tap()
            await expect(it.f("needle")).to_have_attribute("transform", "rotate(-90.0 12 12)")
            await it.until("() => /rotate\\(-90deg\\)/.test(document.querySelector('.ground .tiles').style.transform)")
            there = await it.page.evaluate(
                """path => { const { left, right, top, bottom } =
                  document.querySelector(`.leaflet-tile-loaded[src$="${path}"]`).getBoundingClientRect();
                  return [left, right, top, bottom]; }""",
                path,
            )
            assert there[0] <= middle["x"] <= there[1]
            assert there[2] <= middle["y"] <= there[3]
            for _ in range(6):
                await it.f("wider").tap()
            await expect(it.f("by")).to_have_text("No map tiles here. © Plan · Survey")


async def test_a_fetched_map_is_drawn_named_and_there_without_internet(phone: Phone, tmp_path: Path) -> None:
    source = Source(tmp_path / "source")
    source.start()
    try:
        upstream = source.upstream(zoom=(17, 18), attribution="© Testers of maps")
        async with roaming() as car:
            async with looking(phone, car, data=tmp_path / "data", map_upstream=upstream) as it:
                await it.until("() => document.querySelectorAll('.leaflet-tile-loaded').length >= 2")
                await expect(it.f("by")).to_have_text("© Testers of maps")
                fetched = len(source.requests)
                assert {int(one["path"].split("/")[1]) for one in source.requests} == {18}, (
                    "no level but the one in sight"
                )
            source.kill()
            async with looking(phone, car, data=tmp_path / "data", map_upstream=upstream) as it:
                await it.until("() => document.querySelectorAll('.leaflet-tile-loaded').length >= 2")
                await expect(it.f("by")).to_have_text("© Testers of maps")
                await it.f("wider").tap()
                await it.f("wider").tap()
                await expect(it.f("by")).to_have_text(
                    f"The map's server 127.0.0.1:{source.port} does not answer. © Testers of maps", timeout=15_000
                )
                source.start()
                # It comes back by itself: nobody has to move the map.
                await expect(it.f("by")).to_have_text("© Testers of maps", timeout=45_000)
                await it.until("() => document.querySelectorAll('.leaflet-tile-loaded').length >= 6")
                assert len(source.requests) > fetched
    finally:
        source.kill()
