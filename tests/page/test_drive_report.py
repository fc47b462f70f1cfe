"""From a finished drive to its report in two taps; the logbook and two drives compared."""

from __future__ import annotations

import csv
import io
import re
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import Browser, expect

from server.recording.catalog.annotations import media_beside
from tests.http import http_client
from tests.page.barriers import fits_all, no_barrier
from tests.page.conftest import Phone
from tests.page.drives import steady
from tests.page.processes import Process, replay, running, server, watching
from tests.server.recording.drive.story import EVIL, PHOTO, recorded

pytestmark = [pytest.mark.browser, pytest.mark.asyncio(loop_scope="session")]

A4_PX, MARGIN_PX = 794, 48
BEYOND = """(width) => [...document.querySelectorAll('article.drive *')]
  .filter((one) => one.getClientRects().length && !one.closest('svg'))
  .filter((one) => one.getBoundingClientRect().right > width + 1
    || one.clientWidth > 0 && one.scrollWidth > one.clientWidth + 1)
  .map((one) => `${one.tagName} ${one.className} ${one.textContent.trim().slice(0, 40)}`)"""
LOGBOOK_URL = re.compile(r"/api/logbook\?")


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def watch(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Process]:
    """A server with two drives, without a car."""
    folder = tmp_path_factory.mktemp("drives")
    car = folder / "data" / "recordings" / "car"
    car.mkdir(parents=True)
    for name in ("car_20231114T221320Z", "car_20231115T221320Z"):
        path = recorded(folder, name=f"{name}.mcap", session=name).rename(car / f"{name}.mcap")
        media_beside(path).mkdir()
        (media_beside(path) / "m1.photo.png").write_bytes(PHOTO)
    async with running(*server(folder / "data", None)) as process:
        yield process


@pytest_asyncio.fixture(loop_scope="session")
async def saved(phone: Phone, watch: Process) -> Phone:
    """The recordings, before a car is connected."""
    await phone.open(watch.address)
    await phone.page.locator('[data-f="saved"]').tap()
    await expect(phone.page.locator('.file[data-state="read"]')).to_have_count(2, timeout=30_000)
    return phone


async def test_two_taps_lead_to_the_report(saved: Phone, browser: Browser, watch: Process) -> None:
    page = saved.page
    await page.locator(".file[data-id]").first.tap()
    link = page.locator('[data-f="file-report"]')
    async with page.context.expect_page() as opening:
        await link.tap()
    opened = await opening.value
    await expect(opened.get_by_role("heading", name="Drive report")).to_be_visible(timeout=40_000)
    await opened.close()
    await page.bring_to_front()  # behind another tab it draws nothing
    context = await browser.new_context(viewport={"width": 360, "height": 800})
    report = await context.new_page()
    complaints: list[str] = []
    report.on("console", lambda message: complaints.append(message.text))
    await report.goto(f"{watch.address}{await link.get_attribute('href')}", timeout=90_000)
    await expect(report.get_by_role("heading", name="Drive report")).to_be_visible(timeout=40_000)
    await expect(report.locator("article.drive")).to_contain_text(EVIL)
    await expect(report.locator("article.drive img[src^=x]")).to_have_count(0)
    for width in (320, 360, 412, 820, 1440):
        await report.set_viewport_size({"width": width, "height": 900})
        assert await report.evaluate("document.documentElement.scrollWidth") <= width
        assert await report.evaluate(BEYOND, width) == [], width
    await no_barrier(report, "the report", "article.drive")
    assert await report.evaluate("origin") == "null"  # in a sandbox
    assert complaints == []
    await context.close()
    await page.keyboard.press("Escape")
    saved.complaints[:] = [line for line in saved.complaints if not line.startswith("Nothing was drawn")]  # behind it


async def test_the_report_prints_on_a4(browser: Browser, watch: Process) -> None:
    """A drive of two minutes is on a few sheets, with nothing cut at the right edge, and without the analysis."""
    context = await browser.new_context(viewport={"width": A4_PX - 2 * MARGIN_PX, "height": 1123})
    report = await context.new_page()
    await report.goto(f"{watch.address}/api/recordings/car_20231114T221320Z/report", timeout=90_000)
    await report.emulate_media(media="print")
    await expect(report.locator(".after-report").first).to_be_hidden()
    assert await report.evaluate(BEYOND, A4_PX - 2 * MARGIN_PX) == []
    printed = await report.pdf(prefer_css_page_size=True, print_background=True)
    sheets = [tuple(map(float, box.split())) for box in re.findall(rb"/MediaBox \[([\d. ]+)\]", printed)]
    assert len(sheets) == len(re.findall(rb"/Type /Page\b", printed))
    assert 2 <= len(sheets) <= 4
    assert {(round(box[2]), round(box[3])) for box in sheets} == {(595, 842)}  # pt
    await context.close()


@pytest.mark.own_phone
async def test_the_logbook_and_two_drives_along_the_way(saved: Phone) -> None:
    page = saved.page
    await page.locator('[data-f="files-logbook"]').tap()
    board = page.locator(".logbook-board")
    await board.get_by_label("Time").select_option("0")
    await expect(board.locator(".titlebar")).to_contain_text("2 drives")
    await expect(board.locator(".lb-figures")).to_contain_text("2.4")
    await page.route(LOGBOOK_URL, lambda route: route.abort("connectionrefused"))
    await board.get_by_label("Time").select_option("12")
    await expect(board.locator(".state")).to_contain_text("The server does not answer.")
    for part in (".lb-figures", ".lb-plots", ".lb-side", ".titlebar .end"):  # of what was chosen before
        await expect(board.locator(part)).to_be_empty()
    await page.unroute(LOGBOOK_URL)
    await board.get_by_label("Time").select_option("0")
    await expect(board.locator(".lb-figures")).to_contain_text("2.4")
    await expect(board.locator(".lb-drives li")).to_have_count(2)
    await expect(board.locator(".lb-check")).to_contain_text("Drives since without one")
    due = board.locator(".lb-due li")
    await expect(due).to_have_count(3)
    await expect(due.first).to_contain_text(EVIL)
    await expect(due.first).to_contain_text("never done")
    await expect(due.nth(1)).to_contain_text(re.compile(r"\d+ days and 0.2 km late"))
    await expect(due.last).to_contain_text(re.compile(r"due in \d+ days.*every 3650 days · last 1[45] Nov 2023"))
    await expect(board.locator(".lb-figures")).to_contain_text("Checks overdue")
    await no_barrier(page, "the logbook", ".logbook-board")
    await fits_all(page, "the logbook", ".logbook-board")
    await page.locator('[data-f="logbook-compare"]').tap()
    compare = page.locator(".compareway-board")
    await expect(compare.locator(".cw-plots svg")).to_have_count(4)
    for unknown in ("steering, B − A, %: not known", "commanded speed: not known"):
        await expect(compare.locator(".cw-plots")).to_contain_text(unknown)
    await expect(compare.locator(".cw-side .lb-check")).to_contain_text("as many in both")
    await compare.get_by_role("slider").press("End")
    await expect(compare.locator(".lb-figures")).to_contain_text("1.20")
    await expect(compare.locator(".lb-figures div", has_text="Interventions A")).to_contain_text(re.compile(r"A1B 1"))
    for side, line in (("A", "solid line"), ("B", "dotted line")):
        shown = compare.locator(".cw-choose", has=page.get_by_label(f"Drive {side}")).locator("span small")
        await expect(shown).to_contain_text(re.compile(rf"1\.2\d km · .* · {line}"))
    await no_barrier(page, "two drives", ".compareway-board")
    await fits_all(page, "two drives", ".compareway-board")
    async with page.expect_download() as saving:
        await compare.locator('[data-f="compare-csv"]').tap()
    table = list(csv.reader(io.StringIO(Path(await (await saving.value).path()).read_bytes().decode())))
    assert table[0][0] == "distance along A [m]"
    assert len(table) > 500
    assert {len(line) for line in table} == {24}
    assert [line[0] for line in table[-8:]] == [
        *("summary", "Interventions", "Alarms", "Speed [m/s]", "Steering [%]"),
        *("Following error [m/s]", "GPS error [m]", "Aside [m]"),
    ]
    assert any(EVIL in cell for line in table for cell in line)
    await compare.get_by_role("button", name="By time").tap()
    await expect(compare.locator(".lb-figures")).to_contain_text("2:00")
    for key, gone in (("compareway", compare), ("logbook", board)):
        await page.locator(f'[data-f="{key}-back"]').tap()
        await expect(gone).to_have_count(0)
    await expect(page.locator(".saved-board")).to_be_visible()


@pytest.mark.own_phone
async def test_a_replay_leads_to_marks_and_interventions(phone: Phone, watch: Process) -> None:
    page = phone.page
    await page.goto(f"{watch.address}/?replay=car_20231114T221320Z&t=10")
    line = page.locator(".time-line")
    await expect(line.locator(".wheel")).to_have_count(1, timeout=40_000)
    await expect(line.locator(".manual")).to_have_count(2)  # before 10 s and after 80 s
    await page.locator(".replay-line").tap()
    jumps = page.locator("#sheet-jumps")
    await expect(jumps.locator("#jumps-title")).to_contain_text("2 marks, 1 intervention", timeout=40_000)
    await expect(jumps.locator('[data-kind="flag"]').first).to_contain_text(EVIL)  # as text
    await no_barrier(page, "the jumps", "#sheet-jumps")
    await fits_all(page, "the jumps", "#sheet-jumps")
    await jumps.locator('[data-kind="wheel"]').tap()
    await expect(page.locator(".scrub .clock b")).to_have_text("01:15")  # 5 s before
    await page.goto(f"{watch.address}/?replay=car_20231114T221320Z&t=33.6#home")
    await expect(page.locator(".mark-card")).to_contain_text(EVIL, timeout=40_000)
    await no_barrier(page, "the card of a mark", ".mark-card")
    await fits_all(page, "the card of a mark", ".mark-card")


async def test_an_alarm_over_the_logbook_of_a_car_that_drives_is_acknowledged(
    phone: Phone, watch: Process, tmp_path: Path
) -> None:
    """The board leaves strip and rail where they are, keeps no dialog from a finger, and gives way to an alarm."""
    async with running(*replay(steady(tmp_path / "slow.bag", 4.2))) as car:
        await watching(watch, car.address)
        page = phone.page
        await phone.open(f"{watch.address}/#files")
        await phone.live()
        await phone.acknowledge_all()
        await page.locator('[data-f="files-logbook"]').tap()
        board = page.locator("#monitor .logbook-board")
        await expect(board.locator(".titlebar h2")).to_contain_text("logbook")
        assert await page.evaluate("document.querySelectorAll('body > [inert]').length") == 0
        strip, rail = await phone.f("strip").bounding_box(), await phone.page.locator("#monitor .rail").bounding_box()
        between = await board.bounding_box()
        assert between
        assert rail
        assert between["y"] >= strip["y"] + strip["height"] - 1
        assert between["y"] + between["height"] <= rail["y"] + 1
        async with http_client(base_url=watch.address) as client:
            await client.patch("/api/settings", json={"values": {"speed_limit.max_mps": 2.0}})
        sheet = page.locator("#sheet-alarm")
        await expect(sheet).to_contain_text("Speed above limit", timeout=15_000)
        await expect(board).to_have_count(0)
        await phone.f("acknowledge", "#sheet-alarm").tap()
        await expect(sheet).to_be_hidden()
        await expect(phone.f("strip-text")).to_contain_text("Speed above limit")
        await page.locator('[data-f="files-logbook"]').tap()
        await page.locator('[data-tab="home"]').tap()
        await expect(board).to_have_count(0)
