"""The page among a phone's apps: what installs it, what is kept of it, and what it shows when the server is gone."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import shutil
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import pytest
import pytest_asyncio
from playwright.async_api import Browser, Error, Page, expect

from tests.http import http_client
from tests.page import house
from tests.page.barriers import no_barrier
from tests.page.conftest import LIVE, PHONE
from tests.page.processes import Process, running, server, simulate
from tests.ports import free_port

KEPT = """async () => {
  const all = {};
  const short = ({ url }) => url.slice(location.origin.length);
  for (const name of await caches.keys()) all[name] = (await (await caches.open(name)).keys()).map(short);
  return all;
}"""
WORKER = """async () => { const one = await navigator.serviceWorker.getRegistration('/');
  return one?.active?.state === 'activated' && navigator.serviceWorker.controller !== null; }"""


@pytest.fixture(scope="module")
def project(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """One copy of the project for the tests that do not change it."""
    return house.copy(tmp_path_factory.mktemp("house"))


@contextlib.asynccontextmanager
async def opened(browser: Browser, **more: Any) -> AsyncIterator[Page]:
    """A phone that lets workers be."""
    context = await browser.new_context(**{**PHONE, "service_workers": "allow", **more})
    try:
        yield await context.new_page()
    finally:
        await context.close()


async def until(page: Page, holds: str) -> None:
    """Waits until the asynchronous function `holds`, also over a load of the page."""
    async with asyncio.timeout(30):
        while True:
            with contextlib.suppress(Error):  # the page was just being loaded
                if await page.evaluate(holds):
                    return
            await asyncio.sleep(0.1)


async def kept_by(page: Page, address: str) -> dict[str, list[str]]:
    """Opens the page, waits until its shell is kept, and tells what is."""
    await page.goto(address)
    await until(page, WORKER)
    found: dict[str, list[str]] = await page.evaluate(KEPT)
    return found


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def served(project: Path, tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[str]:
    async with running(*server(tmp_path_factory.mktemp("data")), folder=project) as one:
        yield one.address


# -- what installs it --------------------------------------------------------------------------------------------------


async def test_chromium_finds_nothing_that_stands_against_installing(browser: Browser, served: str) -> None:
    async with opened(browser) as page:
        await page.goto(served)
        cdp = await page.context.new_cdp_session(page)
        manifest = await cdp.send("Page.getAppManifest")
        assert manifest["errors"] == []
        app = json.loads(manifest["data"])
        assert (app["id"], app["start_url"], app["scope"], app["display"]) == ("/", "/", "/", "standalone")
        assert {one["url"] for one in app["shortcuts"]} == {"/#map", "/#scan", "/#files", "/#settings"}
        await until(page, WORKER)
        faults = (await cdp.send("Page.getInstallabilityErrors"))["installabilityErrors"]
        # A window that leaves no traces, as each test's is, may install nothing: that is all it finds.
        assert [one["errorId"] for one in faults if one["errorId"] != "in-incognito"] == []


async def test_every_icon_is_the_picture_it_is_said_to_be(browser: Browser, served: str) -> None:
    async with opened(browser) as page, http_client(base_url=served) as client:
        manifest = (await client.get("/manifest.webmanifest")).json()
        wanted = {(one["src"], one["sizes"]) for one in manifest["icons"]}
        wanted |= {(icon["src"], icon["sizes"]) for one in manifest["shortcuts"] for icon in one["icons"]}
        text = (await client.get("/")).text
        (apple,) = re.findall(r'rel="apple-touch-icon" href="([^"]+)" sizes="180x180"', text)
        wanted |= {(apple, "180x180"), ("/favicon.ico", "48x48"), ("/apple-touch-icon.png", "180x180")}
        purposes = {(one["purpose"], one["type"]) for one in manifest["icons"]}
        assert purposes >= {(kind, "image/png") for kind in ("any", "maskable", "monochrome")}
        await page.goto(served)
        for source, sizes in wanted:
            drawn = await page.evaluate(
                """async (src) => { const one = new Image(); one.src = src; await one.decode();
                  return one.naturalWidth; }""",
                source,
            )
            assert sizes in ("any", f"{drawn}x{drawn}"), source


async def test_a_mask_takes_nothing_of_the_drawing_and_one_colour_is_enough(browser: Browser, served: str) -> None:
    """What is cut by a circle of 40 % is ground alone; of a monochrome icon only its opacity counts."""
    async with opened(browser) as page, http_client(base_url=served) as client:
        icons = (await client.get("/manifest.webmanifest")).json()["icons"]
        of = {(one["purpose"], one["sizes"]): one["src"] for one in icons}
        await page.goto(served)
        points = """async (src) => { const one = new Image(); one.src = src; await one.decode();
          const board = new OffscreenCanvas(512, 512).getContext('2d'); board.drawImage(one, 0, 0);
          const { data } = board.getImageData(0, 0, 512, 512);
          let [outside, opaque, clear, furthest] = [new Set(), 0, 0, 0];
          for (let y = 0; y < 512; y += 1) for (let x = 0; x < 512; x += 1) {
            const [r, g, b, a] = data.subarray(4 * (512 * y + x), 4 * (512 * y + x) + 4);
            if (Math.hypot(x - 255.5, y - 255.5) > 0.4 * 512) outside.add(`${r},${g},${b},${a}`);
            if (a > 200) opaque += 1;
            if (a < 10) clear += 1;
          }
          return [[...outside], opaque / 512 / 512, clear / 512 / 512]; }"""
        outside, opaque, _ = await page.evaluate(points, of["maskable", "512x512"])
        assert (outside, opaque) == (["10,12,13,255"], 1.0)
        outside, opaque, clear = await page.evaluate(points, of["monochrome", "512x512"])
        assert outside == ["0,0,0,0"]
        assert 0.03 < opaque < 0.3
        assert clear > 0.6


async def test_the_menu_offers_to_install_where_the_browser_does(browser: Browser, served: str) -> None:
    async with opened(browser) as page:
        await page.goto(served)
        key = page.locator('#sheet-menu [data-f="install"]')
        await expect(key).to_be_hidden()
        await page.evaluate(
            """() => { const offer = new Event('beforeinstallprompt', { cancelable: true });
              offer.prompt = async () => { window.calls = (window.calls ?? 0) + 1; return { outcome: 'accepted' }; };
              window.wasTaken = !window.dispatchEvent(offer); }"""
        )
        assert await page.evaluate("window.wasTaken") is True, "no browser's bar over the instruments"
        await page.evaluate("document.querySelector('#sheet-menu').showModal()")
        await key.tap()
        assert await page.evaluate("window.calls") == 1
        await expect(page.locator("#sheet-menu")).not_to_have_attribute("open", "")
        await page.evaluate("document.querySelector('#sheet-menu').showModal()")
        await expect(key).to_be_hidden()


async def test_an_iphone_is_told_how(browser: Browser, served: str) -> None:
    agent = (
        "Mozilla/5.0 (iPhone; CPU iPhone OS 18_0 like Mac OS X) AppleWebKit/605.1.15 Version/18.0 Mobile Safari/604.1"
    )
    async with opened(browser, user_agent=agent) as page:
        await page.goto(served)
        await page.evaluate("document.querySelector('#sheet-menu').showModal()")
        await page.locator('#sheet-menu [data-f="install"]').tap()
        await expect(page.locator("#sheet-install")).to_contain_text("Add to Home Screen")
        await no_barrier(page, "install")
        await page.locator('#sheet-install [data-f="no"]').tap()
        await expect(page.locator("#sheet-install")).to_be_hidden()


# -- what is kept, and what never is -----------------------------------------------------------------------------------


async def test_nothing_that_is_live_is_ever_kept(browser: Browser, project: Path, tmp_path: Path) -> None:
    """A drive with map, files and log open: in every cache there is the shell, and nothing else."""
    async with (
        running(*simulate("--seed", "2")) as car,
        running(*server(tmp_path, car.address), folder=project) as one,
        opened(browser) as page,
    ):
        await kept_by(page, one.address)
        await page.reload()
        for path in ("/api/state", "/api/health", "/api/recordings", "/api/settings", "/api/map", "/metrics"):
            assert await page.evaluate("async (path) => (await fetch(path)).status", path) == 200, path
        for tab in ("map", "scan", "files", "settings", "home"):
            await page.evaluate("tab => { location.hash = `#${tab}`; }", tab)
            await page.wait_for_timeout(300)
        found = await page.evaluate(KEPT)
        assert len(found) == 1
        ((name, addresses),) = found.items()
        assert re.fullmatch(r"catgraph-shell-[0-9a-f]{12}", name)
        shell = re.compile(
            r"/static/built/[\w-]+-[\w-]{8}\.(js|css|woff2)|/static/(js/boot/offline\.js|icons/[\w-]+\.svg)\?v=[0-9a-f]{12}"
            r"|/offline\?v=[0-9a-f]{12}"
        )
        assert [address for address in addresses if not shell.fullmatch(address)] == []
        assert len(addresses) > 15


async def test_only_the_page_and_named_files_go_through_the_worker(browser: Browser, served: str) -> None:
    async with opened(browser) as page:
        await kept_by(page, served)
        await page.reload()
        through: dict[str, bool] = {}
        page.on("response", lambda answer: through.update({answer.url: answer.from_service_worker}))
        await page.reload()
        await page.evaluate(
            "() => Promise.all(['/api/state', '/api/map', '/static/js/core/store.js'].map((one) => fetch(one)))"
        )
        by = {url.removeprefix(served): is_so for url, is_so in through.items()}
        assert by["/"]
        assert all(is_so for url, is_so in by.items() if url.startswith("/static/built/"))
        assert not any(by[url] for url in ("/api/state", "/api/map", "/static/js/core/store.js"))


# -- when the server is gone -------------------------------------------------------------------------------------------


async def test_a_phone_says_that_the_server_is_gone_and_comes_back_by_itself(
    browser: Browser, project: Path, tmp_path: Path
) -> None:
    port = free_port()
    async with running(*simulate()) as car, opened(browser) as page:
        one = await Process(*server(tmp_path, car.address, port), folder=project).start()
        await kept_by(page, f"{one.address}/#map")
        await page.wait_for_function("() => localStorage.getItem('catgraph.answered') !== null", timeout=15_000)
        await one.kill()
        await page.reload()
        offline = page.locator("#offline")
        await expect(offline).to_contain_text("The server does not answer")
        await expect(offline).to_contain_text("This device monitors nothing now.")
        await expect(offline.locator('[data-f="where"]')).to_have_text(one.shown)
        await expect(offline.locator('[data-f="answered"]')).to_have_text(re.compile(r"\d\d:\d\d:\d\d, \d+ s ago"))
        await expect(offline.locator('[data-f="then"]')).to_have_text(
            "A car was being monitored then. It may still be moving."
        )
        assert await page.locator(".gauge, #monitor, [data-panel], [role=meter]").count() == 0
        await no_barrier(page, "offline")
        await page.set_viewport_size({"width": 320, "height": 480})
        assert await page.evaluate("document.documentElement.scrollWidth") <= 320
        await page.locator('[data-f="try"]').tap()
        await expect(offline.locator('[data-f="next"]')).to_have_text("This page tries again every 3 s.")
        async with running(*server(tmp_path, car.address, port), folder=project):
            await expect(page.locator("#monitor, #connect").first).to_be_attached(timeout=15_000)
            assert page.url == f"{one.address}/#map"


async def test_a_server_that_is_frozen_is_called_so_as_well(browser: Browser, project: Path, tmp_path: Path) -> None:
    """Its port still accepts; a phone out of range waits as long."""
    async with running(*server(tmp_path), folder=project) as one, opened(browser) as page:
        await kept_by(page, one.address)
        one.freeze()
        try:
            await page.goto(one.address, timeout=20_000)
            await expect(page.locator("#offline h1")).to_have_text("The server does not answer")
        finally:
            one.thaw()
        await expect(page.locator("#connect, #start").first).to_be_attached(timeout=15_000)


# -- another version ---------------------------------------------------------------------------------------------------


@pytest.fixture
def changing(project: Path, tmp_path: Path) -> Path:
    """A copy of the project of the test's own."""
    copied = tmp_path / "house"
    shutil.copytree(project, copied)
    return copied


@pytest.mark.timeout(240)  # the page is joined twice and served twice
async def test_a_new_version_comes_at_the_next_load_and_never_mixed(
    browser: Browser, changing: Path, tmp_path: Path
) -> None:
    house.change(changing, "first")
    port = free_port()
    versions = "() => [document.documentElement.dataset.app, document.documentElement.dataset.about ?? null]"
    later = "document.querySelector('[data-screen=about]').click()"
    async with opened(browser) as page, opened_beside(page) as other:
        one = await Process(*server(tmp_path / "data", port=port), folder=changing).start()
        (before,) = await kept_by(page, one.address)
        await other.goto(one.address)
        assert await page.evaluate(versions) == ["first", None]
        await one.kill()
        house.change(changing, "second")
        async with running(*server(tmp_path / "data", port=port), folder=changing):
            # The open page goes on, with what it was made of: also what it requests only now.
            note = page.locator(".snack.note").filter(has_text="A new version is available.")
            await expect(note).to_be_visible(timeout=20_000)
            await page.evaluate(later)
            await page.wait_for_function("() => document.documentElement.dataset.about === 'first'")
            await page.evaluate("history.back()")
            # A page that loads it has the new one, whole, while the old one is still open elsewhere.
            await note.get_by_role("button", name="Reload").tap()
            await page.wait_for_function("() => document.documentElement.dataset.app === 'second'")
            await page.evaluate(later)
            await page.wait_for_function("() => document.documentElement.dataset.about === 'second'")
            assert before in await page.evaluate("caches.keys()"), "another page may still ask for its files"
            await other.evaluate(later)
            await other.wait_for_function("() => document.documentElement.dataset.about === 'first'")
            await other.close()
            await page.bring_to_front()  # behind another page nothing is drawn, and the page does not begin
            await page.goto(one.address)
            await until(
                page,
                f"async () => {{ const all = await caches.keys(); return all.length === 1 && all[0] !== '{before}'; }}",
            )
            await page.reload()
            assert await page.evaluate(versions) == ["second", None]


@contextlib.asynccontextmanager
async def opened_beside(page: Page) -> AsyncIterator[Page]:
    other = await page.context.new_page()
    yield other
    await other.close()


async def test_single_modules_are_never_kept_and_a_worker_of_before_goes(
    browser: Browser, changing: Path, tmp_path: Path
) -> None:
    port = free_port()
    async with opened(browser) as page:
        one = await Process(*server(tmp_path / "data", port=port), folder=changing).start()
        await kept_by(page, one.address)
        shutil.rmtree(changing / "static" / "built")  # as after an edit
        script = changing / "static" / "js" / "main.js"
        script.write_text(script.read_text() + "\ndocument.documentElement.dataset.app = 'edited';\n")
        await page.reload()
        await page.wait_for_function("() => document.documentElement.dataset.app === 'edited'")
        await gone(page)
        await one.kill()


async def test_a_server_that_wants_no_worker_takes_it_from_its_phones(
    browser: Browser, project: Path, tmp_path: Path
) -> None:
    port = free_port()
    async with opened(browser) as page:
        async with running(*server(tmp_path, port=port), folder=project) as one:
            await kept_by(page, one.address)
        async with running(*server(tmp_path, port=port), "--no-worker", folder=project):
            await page.goto(one.address)
            await gone(page)


async def test_a_worker_goes_also_where_no_page_helps_it(browser: Browser, project: Path, tmp_path: Path) -> None:
    port = free_port()
    async with opened(browser) as page:
        async with running(*server(tmp_path, port=port), folder=project) as one:
            await kept_by(page, one.address)
        async with running(*server(tmp_path, port=port), "--no-worker", folder=project):
            # The browser requests the worker's script by itself, at least once a day.
            await page.goto(f"{one.address}/docs")
            await page.evaluate("async () => { await (await navigator.serviceWorker.getRegistration('/')).update(); }")
            await gone(page)


async def gone(page: Page) -> None:
    await until(
        page,
        """async () => (await navigator.serviceWorker.getRegistrations()).length === 0
          && (await caches.keys()).length === 0""",
    )


# -- without it --------------------------------------------------------------------------------------------------------


async def test_without_a_worker_the_page_is_the_same(browser: Browser, project: Path, tmp_path: Path) -> None:
    async with (
        running(*simulate()) as car,
        running(*server(tmp_path, car.address), folder=project) as one,
        opened(browser) as page,
    ):
        faults: list[str] = []
        page.on("pageerror", lambda error: faults.append(str(error)))
        page.on("console", lambda message: faults.append(message.text) if message.type == "error" else None)
        await page.add_init_script(
            """navigator.serviceWorker.register = async () => {
              throw new DOMException('not trusted', 'SecurityError');
            };"""
        )
        await page.goto(one.address)
        await expect(page.locator('#monitor [data-f="link-state"]')).to_have_text(LIVE, timeout=12_000)
        await asyncio.sleep(5.0)  # by then it would have been registered
        await page.evaluate("document.querySelector('[data-screen=about]').click()")
        await expect(page.locator("#monitor .facts")).to_contain_text("because it does not trust the certificate")
        assert faults == []
