"""Nobody is kept out: every tab, sheet and dialog in both themes as axe measures it, at every size."""

from __future__ import annotations

from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio
from axe_playwright_python.async_playwright import Axe
from playwright.async_api import expect

from tests.page.conftest import Phone
from tests.page.processes import Process, free_port, running, server, simulate

TABS = ("home", "map", "scan", "files", "settings")
SIZES = [(320, 640), (360, 740), (412, 915), (640, 400), (915, 412), (800, 1100), (1280, 800)]
# Of the panels that are seen whole: on a wide screen the neighbours of the one in front may be cut.
HANGS_OVER = """() => {
  const over = (one) => {
    const box = one.getBoundingClientRect();
    return box.width > 0 && (box.right > innerWidth + 1 || box.left < -1);
  };
  const cut = [...document.querySelectorAll('#monitor .panel')].filter(over);
  return [...document.querySelectorAll('#monitor *')]
    .filter((one) => one.getClientRects().length && !one.closest('svg, canvas, .leaflet-container, [inert]'))
    .filter((one) => !one.matches('.unseen, .clip *, .turn, .turn *, .moves, .pager'))
    .filter((one) => over(one) && !cut.some((panel) => panel.contains(one)))
    .map((one) => `${one.tagName} ${one.className} ${one.textContent.trim().slice(0, 40)}`);
}"""
PRESSED = "button, a[href], input:not(.unseen), select, summary, [role=button], [role=slider]"
TOO_SMALL = f"""() => [...document.querySelectorAll('#monitor :is({PRESSED})')]
  .filter((one) => one.getClientRects().length && !one.closest('[inert], .leaflet-control-attribution'))
  .map((one) => [(one.closest('label') ?? one).getBoundingClientRect(), one])
  .filter(([box]) => Math.min(box.width, box.height) < 24)
  .map(([box, one]) => `${{one.outerHTML.slice(0, 90)}} ${{box.width}}×${{box.height}}`)"""


@pytest_asyncio.fixture(loop_scope="module", scope="module")
async def drive(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[tuple[Process, Process]]:
    async with running(*simulate()) as car, running(*server(tmp_path_factory.mktemp("data"), car.address)) as watch:
        yield car, watch


async def no_barrier(phone: Phone, where: str) -> None:
    """In both themes, once what moves has come to rest."""
    for theme in ("dark", "light"):
        await phone.page.emulate_media(color_scheme=theme, reduced_motion="reduce")
        await phone.page.wait_for_timeout(200)
        found = (await Axe().run(phone.page)).response["violations"]
        assert [(one["id"], one["nodes"][0]["html"]) for one in found] == [], f"{where}, {theme}"


@pytest.mark.parametrize("tab", TABS)
async def test_every_tab(phone: Phone, drive: tuple[Process, Process], tab: str) -> None:
    await phone.open(f"{drive[1].address}/#{tab}")
    await phone.live()
    await no_barrier(phone, tab)
    assert await phone.page.evaluate(TOO_SMALL) == []


async def test_every_sheet_of_a_calm_drive(phone: Phone, drive: tuple[Process, Process]) -> None:
    await phone.open(drive[1].address)
    await phone.live()
    await phone.f("menu").tap()
    await no_barrier(phone, "menu")
    await phone.page.locator("#sheet-menu").get_by_text("Preferences").tap()
    await no_barrier(phone, "preferences")
    await phone.page.keyboard.press("Escape")
    await phone.f("stop").tap()
    await no_barrier(phone, "stop")
    await phone.page.keyboard.press("Escape")
    await phone.f("pause").tap()
    await expect(phone.f("strip")).to_contain_text("Paused")
    await no_barrier(phone, "paused")
    await phone.f("pause").tap()
    await expect(phone.f("strip")).not_to_contain_text("Paused")


async def test_the_dialog_of_an_alarm(phone: Phone, drive: tuple[Process, Process]) -> None:
    car, watch = drive
    await phone.open(watch.address)
    await phone.live()
    await car.type("near-object 20")
    sheet = phone.page.locator("#sheet-alarm")
    await expect(sheet).to_be_visible(timeout=20_000)
    await no_barrier(phone, "alarm")
    await car.type("stop")
    await sheet.locator("[data-f=acknowledge]").tap()
    await expect(sheet).to_be_hidden()


async def test_the_dialogs_about_the_chain_and_the_connect_screen(phone: Phone, tmp_path: Path) -> None:
    async with running(*simulate()) as car, running(*server(tmp_path)) as watch:
        await phone.open(watch.address)
        await expect(phone.page.locator("#connect h1")).to_be_visible()
        await no_barrier(phone, "connect")
        await phone.f("history", "#connect").tap()
        await no_barrier(phone, "history")
        await phone.page.keyboard.press("Escape")
        await phone.page.fill("#address", f"127.0.0.1:{free_port()}")
        await phone.f("go", "#connect").tap()
        await expect(phone.page.locator("#sheet-failed")).to_be_visible()
        await no_barrier(phone, "failed")
        await phone.page.locator("#sheet-failed [data-f=change]").tap()
        await expect(phone.page.locator("#sheet-failed")).to_be_hidden()
        await phone.page.fill("#address", car.shown)
        await phone.f("go", "#connect").tap()
        await phone.live()
        car.freeze()
        await expect(phone.page.locator("#sheet-lost")).to_be_visible()
        await no_barrier(phone, "lost")
        car.thaw()


@pytest.mark.parametrize("size", SIZES, ids=str)
async def test_nothing_hangs_over_the_edge_of_any_tab(
    phone: Phone, drive: tuple[Process, Process], size: tuple[int, int]
) -> None:
    """A small phone, a large one, both ways, a tablet, and a desktop at once and twice its size."""
    await phone.page.set_viewport_size({"width": size[0], "height": size[1]})
    await phone.open(drive[1].address)
    await phone.live()
    for tab in TABS:
        await phone.page.evaluate("tab => { location.hash = `#${tab}`; }", tab)
        await expect(phone.page.locator(f"#tab-{tab}")).to_have_attribute("aria-selected", "true")
        await phone.page.wait_for_function(
            """tab => {
              const box = document.querySelector(`#panel-${tab}`).getBoundingClientRect();
              return box.left > -1 && box.right < innerWidth + 1;
            }""",
            arg=tab,
        )
        assert await phone.page.evaluate("document.documentElement.scrollWidth") <= size[0], tab
        assert await phone.page.evaluate(HANGS_OVER) == [], tab
