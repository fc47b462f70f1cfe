"""The cases of the design report, 7.5 and 7.6, that no other file drives: each named by its number.

Elsewhere: 3 and 12–14 in test_chain.py, 5 in test_scan.py, 7 in test_phone.py, 11 in test_connect.py, 17–18 in
test_alarms.py, 7.6.1 in test_tabs.py, 7.6.2 in test_files.py.
"""

from __future__ import annotations

import contextlib
import re
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Page, expect

from tests.page.conftest import LIVE, PHONE, Phone
from tests.page.processes import Drive, Process, driving, running, server, simulate, watching
from tests.page.test_tabs import TABS
from tests.ports import free_port

LONG = 45_000  # ms: the car must first stop, or come to where the other one pulls out


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def driven(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Drive]:
    async with driving(tmp_path_factory.mktemp("watch")) as drive:
        yield drive


@pytest_asyncio.fixture(loop_scope="session")
async def drive(driven: Drive) -> AsyncIterator[Drive]:
    """A simulated car without a fault, and a server that is newly connected to it: no alarm stands."""
    car, watch = driven
    await watching(watch, car.address)
    yield driven
    await car.type("stop")


@contextlib.asynccontextmanager
async def a_phone_on_each_tab(browser: Browser, address: str) -> AsyncIterator[dict[str, Page]]:
    """Five operators, each with another tab in front, live."""
    contexts = [await browser.new_context(**PHONE) for _ in TABS]
    try:
        pages = {}
        for tab, context in zip(TABS, contexts, strict=True):
            pages[tab] = await context.new_page()
            await pages[tab].goto(f"{address}/#{tab}")
            await expect(pages[tab].locator('#monitor [data-f="link-state"]')).to_have_text(LIVE, timeout=LONG)
        yield pages
    finally:
        for context in contexts:
            await context.close()


async def provoke(car: Process, fault: str, page: Page) -> None:
    """Until its alarm is there. Where the machine stood still, a check that looks back begins anew, and the fault must
    too: a position that has drifted already does not drift."""
    for _ in range(2):
        await car.type(fault)
        with contextlib.suppress(AssertionError):
            await expect(page.locator("#sheet-alarm")).to_be_visible(timeout=LONG)
            return
        await car.type("stop")


async def dialog_on_each_tab(browser: Browser, drive: Drive, fault: str, title: str, text: str) -> None:
    """The dialog stands on every tab; one OK closes it on all, and each page is where it was.

    `fault`: lasts longer than the five waits together, because an alarm that returned has no dialog.
    """
    car, watch = drive
    async with a_phone_on_each_tab(browser, watch.address) as pages:
        await provoke(car, fault, pages["home"])
        for page in pages.values():
            sheet = page.locator("#sheet-alarm")
            await expect(sheet).to_be_visible(timeout=LONG)
            await expect(sheet.locator("[data-f=title]")).to_have_text(title)
            await expect(sheet).to_contain_text(re.compile(text))
        await pages["map"].locator("#sheet-alarm [data-f=acknowledge]").tap()
        for tab, page in pages.items():
            await expect(page.locator("#sheet-alarm")).to_be_hidden()
            await expect(page.locator("#monitor")).to_be_visible()
            await expect(page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")
            await expect(page.locator('#monitor [data-f="link-state"]')).to_have_text(LIVE)
        await car.type("stop")


@pytest.mark.gate
async def test_case_01_an_address_without_a_car_opens_no_home(phone: Phone, tmp_path: Path) -> None:
    async with running(*server(tmp_path)) as watch:
        await phone.open(watch.address)
        await phone.page.fill("#address", f"127.0.0.1:{free_port()}")
        await phone.f("go", "#connect").tap()
        await expect(phone.page.locator("#sheet-failed")).to_be_visible()
        await expect(phone.page.locator("#monitor")).to_be_hidden()
        # case 10: Exit of that dialog leads to the connect screen
        await phone.page.locator("#sheet-failed [data-f=change]").tap()
        await expect(phone.page.locator("#sheet-failed")).to_be_hidden()
        await expect(phone.page.locator("#connect h1")).to_be_visible()
        await expect(phone.page.locator("#monitor")).to_be_hidden()


@pytest.mark.gate
async def test_case_02_the_right_address_opens_home(phone: Phone, drive: Drive, tmp_path: Path) -> None:
    car, _ = drive
    async with running(*server(tmp_path)) as watch:
        await phone.open(watch.address)
        await phone.page.fill("#address", car.shown)
        await phone.page.keyboard.press("Enter")
        await phone.live()
        await expect(phone.page.locator("#connect")).to_be_hidden()
        await expect(phone.page.locator("#tab-home")).to_have_attribute("aria-selected", "true")
        await phone.has_speed()


@pytest.mark.gate
@pytest.mark.timeout(120)
async def test_case_04_a_lost_link_shows_its_dialog_and_what_was_recorded_is_saved_and_listed(
    phone: Phone, tmp_path: Path
) -> None:
    """Saved and listed before the dialog states it, and before the connect screen; a link that returns goes on."""
    car = await Process(*simulate()).start()
    port = car.shown.split(":")[1]
    async with running(*server(tmp_path / "watch", car.address)) as watch:
        try:
            await phone.open(watch.address)
            await phone.live()
            await expect(phone.f("rec")).to_have_attribute("data-on", "", timeout=LONG)
            await expect(phone.f("rec-for")).to_have_text(re.compile(r"00:(0[3-9]|[1-5]\d)"), timeout=LONG)
            await car.kill()
            lost = phone.page.locator("#sheet-lost")
            await expect(lost).to_contain_text(re.compile(r"Recording saved up to \d\d:\d\d:\d\d"), timeout=LONG)
            listed = (await (await phone.page.request.get(f"{watch.address}/api/recordings")).json())["recordings"]
            assert len(listed) == 1
            first = listed[0]["id"]
            folder = tmp_path / "watch" / "recordings" / "car"
            assert [path.name for path in folder.glob("*.mcap")] == [f"{first}.mcap"]
            assert list(folder.glob("*.writing")) == []
            await expect(phone.f("rec")).not_to_have_attribute("data-on", "")
            await expect(phone.f("rec-for")).to_have_text("held")
            # the car is there again in time: the same session goes on in a second part
            car = await Process(*simulate(port=int(port))).start()
            await expect(phone.f("rec")).to_have_attribute("data-on", "", timeout=LONG)
            await expect(lost).to_be_hidden()
            await car.kill()
            await expect(lost).to_contain_text("Recording saved up to", timeout=LONG)
            # Change the address: the connect screen
            await lost.locator("[data-f=change]").tap()
            await expect(phone.page.locator("#connect h1")).to_be_visible()
            listed = (await (await phone.page.request.get(f"{watch.address}/api/recordings")).json())["recordings"]
            assert sorted(row["id"] for row in listed) == [first, f"{first}_p2"]
        finally:
            await car.kill()


@pytest.mark.gate
async def test_case_06_no_position_is_told(phone: Phone, drive: Drive) -> None:
    car, watch = drive
    await phone.open(watch.address)
    await phone.live()
    await expect(phone.f("latitude")).not_to_have_attribute("data-ink", "never")  # a position came
    await car.type("stale-gps 60")
    snack = phone.page.locator(".snack", has_text="Position silent")
    await expect(snack).to_be_visible()
    await expect(phone.f("strip")).to_contain_text("Position silent")
    await expect(phone.f("latitude")).to_have_attribute("data-ink", "stale")
    await snack.get_by_role("button", name="Acknowledge").tap()
    await car.type("stop")
    await expect(phone.f("strip")).not_to_contain_text("Position silent", timeout=LONG)


@pytest.mark.gate
@pytest.mark.timeout(120)
async def test_case_08_a_car_that_stands_is_told(phone: Phone, drive: Drive) -> None:
    car, watch = drive
    await phone.open(watch.address)
    await phone.live()
    await car.type("standing 40")
    snack = phone.page.locator(".snack", has_text="not moving")
    await expect(snack).to_contain_text(re.compile(r"standing|stood|stands", re.IGNORECASE), timeout=LONG)
    await expect(phone.page.locator("#panel-home .checks li", has_text="Moving")).to_contain_text("FAULT")
    await car.type("stop")
    await expect(snack).to_be_hidden(timeout=LONG)


@pytest.mark.gate
@pytest.mark.timeout(240)
async def test_case_09_and_19_and_20_an_obstacle_on_each_of_the_five_tabs(browser: Browser, drive: Drive) -> None:
    await dialog_on_each_tab(browser, drive, "near-object 240", "Object too near", r"3\.5")


@pytest.mark.gate
@pytest.mark.timeout(240)
async def test_case_15_and_16_an_errant_gps_on_each_of_the_five_tabs(browser: Browser, drive: Drive) -> None:
    await dialog_on_each_tab(browser, drive, "gps-drift 240", "GPS drift at standstill", r"Do not trust the position")
