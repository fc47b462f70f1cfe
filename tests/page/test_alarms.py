"""Alarms at the glass: the dialog on every tab, its acknowledgement, pause and resume, texts that mean harm."""

from __future__ import annotations

import re
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import expect

from tests.http import http_client
from tests.page.conftest import Phone
from tests.page.drives import diagnostics, number, steady, twist, write
from tests.page.processes import Process, replay, running, server, watching
from tests.page.test_tabs import TABS

HOSTILE = (
    "<img src=x onerror=\"document.title='owned'\">",
    "</span><script>document.title='owned'</script>",
    "‮gnp.exe\u0000\u0007 {{7*7}} ${7*7}",
    "x" * 4000,
)


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def track(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[tuple[Process, Process, Process]]:
    """Two cars, one at 12.6 m/s with the limit at 11.0 and one at 4.2 m/s, and a server that can watch either."""
    folder = tmp_path_factory.mktemp("drives")
    fast, slow = steady(folder / "fast.bag", 12.6), steady(folder / "slow.bag", 4.2)
    async with (
        running(*replay(fast)) as hare,
        running(*replay(slow)) as snail,
        running(*server(folder)) as watch,
    ):
        yield hare, snail, watch


@pytest_asyncio.fixture(loop_scope="session")
async def speeding(track: tuple[Process, Process, Process]) -> Process:
    """The server, newly connected to the fast car: nothing is acknowledged."""
    hare, _, watch = track
    return await watching(watch, hare.address)


@pytest_asyncio.fixture(loop_scope="session")
async def calm(track: tuple[Process, Process, Process]) -> Process:
    """The server, newly connected to the slow car."""
    _, snail, watch = track
    return await watching(watch, snail.address)


@pytest.mark.gate
async def test_case_17_and_18_a_speed_alarm_on_each_tab_and_its_acknowledgement(
    phone: Phone, speeding: Process, track: tuple[Process, Process, Process]
) -> None:
    sheet = phone.page.locator("#sheet-alarm")
    for tab in TABS:
        await watching(speeding, track[0].address)  # another drive, another occurrence
        await phone.open("about:blank")
        await phone.open(f"{speeding.address}/#{tab}")
        await expect(sheet).to_be_visible()
        await expect(sheet).to_have_attribute("role", "alertdialog")
        await expect(phone.f("title", "#sheet-alarm")).to_have_text("Speed above limit")
        await expect(phone.f("measured", "#sheet-alarm")).to_have_text("12.6")
        await expect(phone.f("limit", "#sheet-alarm")).to_have_text("11.0")
        await expect(sheet).to_contain_text("The safety driver must slow the car.")
        await expect(phone.f("acknowledge", "#sheet-alarm")).to_be_focused()
        await expect(phone.page.locator(".frame")).to_have_attribute("data-mode", "asking")
        await expect(phone.f("strip")).to_contain_text("Speed above limit")
        if tab == "map":
            await expect(sheet).not_to_have_attribute("data-moved", "")
            await phone.page.keyboard.press("Escape")  # and the phone's back key: seen
        else:
            await phone.f("acknowledge", "#sheet-alarm").tap()
        await expect(sheet).to_be_hidden()
        await expect(phone.page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")
        await expect(phone.f("strip")).to_contain_text("Speed above limit")  # it stands, and is known
        await expect(phone.page.locator(".frame")).to_have_attribute("data-mode", "critical")
        await phone.drawn()
        await expect(sheet).to_be_hidden()


@pytest.mark.gate
async def test_above_the_limit_the_gauge_and_the_tile_say_fault(phone: Phone, speeding: Process) -> None:
    await phone.open(speeding.address)
    await expect(phone.page.locator(".gauge")).to_have_attribute("data-over", "")
    tile = phone.page.locator(".checks li.crit")
    await expect(tile).to_contain_text("Speed")
    await expect(tile).to_contain_text(re.compile(r"FAULT 12\.6 m/s"))
    assert await phone.speed() == "12.6"
    async with http_client() as client:  # another page acknowledges: the dialog goes here too
        alarm = (await client.get(f"{speeding.address}/api/alarms")).json()["alarms"][0]
        await client.post(
            f"{speeding.address}/api/alarms/{alarm['id']}/acknowledge", json={"occurrence": alarm["occurrence"]}
        )
    await expect(phone.page.locator("#sheet-alarm")).to_be_hidden()


@pytest.mark.gate
async def test_before_a_touch_the_page_says_that_it_cannot_sound(phone: Phone, speeding: Process) -> None:
    await phone.open(speeding.address)
    await expect(phone.f("sound-off")).to_be_visible()
    await expect(phone.f("sound-off")).to_have_text("Alarm sound off: tap")
    await phone.f("acknowledge", "#sheet-alarm").tap()
    await expect(phone.f("sound-off")).to_be_hidden()


@pytest.mark.gate
async def test_paused_no_alarm_comes_and_every_tab_says_so(phone: Phone, calm: Process) -> None:
    await phone.open(calm.address)
    await phone.live()
    await phone.f("pause").tap()
    await expect(phone.f("strip")).to_have_text(re.compile(r"Paused 0:0\d: no alarm is raised"))
    await expect(phone.page.locator(".frame")).to_have_attribute("data-mode", "paused")
    await expect(phone.f("pause-label")).to_have_text("Resume")
    await expect(phone.page.locator(".checks li.ok")).to_have_count(0)
    await expect(phone.page.locator(".checks li", has_text="Speed").first).to_contain_text("paused")
    assert re.fullmatch(r"4\.2", await phone.speed())  # the values go on
    await phone.page.locator("[data-tab=settings]").tap()
    await expect(phone.f("strip")).to_contain_text("Paused")
    await phone.f("pause").tap()
    await expect(phone.f("strip")).not_to_contain_text("Paused")
    await expect(phone.page.locator(".frame")).not_to_have_attribute("data-mode", "paused")


@pytest.mark.gate
async def test_the_slow_down_says_why_it_is_off(phone: Phone, calm: Process) -> None:
    await phone.open(calm.address)
    await phone.live()
    slide = phone.page.locator(".board > .rail .slide")
    await expect(slide).to_have_attribute("data-kind", "off")
    await expect(slide.locator("[data-f=slow-why]")).to_have_text(
        "press for the reason"
    )  # it is too long for the slide
    await slide.tap()
    sheet = phone.page.locator("#sheet-slow")
    await expect(sheet).to_contain_text("Slow-down not available")
    await expect(sheet).to_contain_text("The car has no command topic: pick one for Command in Settings.")
    await expect(sheet).to_contain_text("The safety driver stops the car.")


async def test_texts_that_mean_harm_are_only_text(phone: Phone, tmp_path: Path) -> None:
    """Every text of a car stands on the page letter by letter, and breaks nothing."""
    drive = write(
        tmp_path / "hostile.bag",
        {
            "speed": lambda _: twist(4.2),
            "distance": lambda t: number(70 + 0.01 * t),
            "bearing": lambda t: number(0.01 * t),
            "diagnostics": lambda _: diagnostics(*((text, 2, text) for text in HOSTILE)),
        },
    )
    async with running(*replay(drive)) as car, running(*server(tmp_path / "data", car.address)) as watch:
        await phone.open(watch.address)
        await phone.live()
        before = await phone.page.locator("script, img, iframe, object").count()
        await phone.f("menu").tap()
        await phone.page.locator("#sheet-menu").get_by_text("Signals").tap()
        row = phone.page.locator(".sig", has_text="Diagnostics")
        await expect(row).to_contain_text("ERROR")
        await row.tap()
        await expect(phone.page.locator(".sig-more:not([hidden])")).to_contain_text("<img src=x onerror=")
        assert await phone.page.locator("script, img, iframe, object").count() == before
        assert "owned" not in await phone.page.title()
        assert await phone.page.evaluate("document.documentElement.scrollWidth <= innerWidth")


@pytest.mark.gate
@pytest.mark.own_phone
async def test_who_acknowledged_stands_in_the_alarm_log_on_every_phone(phone: Phone, speeding: Process) -> None:
    await phone.page.add_init_script("localStorage.setItem('catgraph.device', 'Pixel 7 · a3f2')")
    await phone.open(f"{speeding.address}/#home")
    await phone.f("acknowledge", "#sheet-alarm").tap()
    await expect(phone.page.locator("#sheet-alarm")).to_be_hidden()
    async with http_client() as client:
        alarms = (await client.get(f"{speeding.address}/api/alarms")).json()["alarms"]
    assert next(alarm for alarm in alarms if alarm["id"] == "speed_limit")["acknowledged_by"] == "Pixel 7 · a3f2"
    await expect(phone.f("strip")).to_contain_text("Speed above limit")
    await phone.f("strip").tap()
    listed = phone.page.locator("[data-f=alarms] li", has_text="Speed above limit")
    await expect(listed).to_contain_text("acknowledged by Pixel 7 · a3f2")
    await phone.page.locator("[data-f=screen] button[data-screen=log]").tap()
    row = phone.page.locator("[data-f=standing] li", has_text="Speed above limit")
    await expect(row).to_contain_text("12.6 m/s, limit 11.0 m/s · acknowledged by Pixel 7 · a3f2")
    await expect(phone.page.locator("[data-f=screen] .three .v").first).to_have_text(re.compile(r"[1-9]\d*"))
    await expect(phone.page.locator("[data-f=trouble]")).to_be_hidden()
