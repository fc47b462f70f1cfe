"""kill -9 of the browser, at times of the server too, while marks are placed: none of 1 s is lost, none doubled."""

from __future__ import annotations

import asyncio
import contextlib
import random
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import psutil
import pytest
from playwright.async_api import BrowserContext, Playwright, async_playwright, expect
from playwright.async_api import Error as PlaywrightError

from tests.chromium import FLAGS
from tests.http import http_client
from tests.page.conftest import PHONE
from tests.page.processes import Process, running, server, simulate
from tests.ports import free_port

SETTINGS = "[limits.link_late]\nlate_s = 10.0\ncritical_s = 20.0\n"  # this machine is shared: that is not tested here
OLD_MS = 1000  # a mark so old outlives everything; the browser's database confirms one some milliseconds too early
SERVER_TOO = 0.3  # of the kills
# The page presses its own key, until it is killed, and reports each press and each mark that it shows as stored.
MARKS = """() => {
  let waits = null;
  const panel = () => document.querySelector('.fresh:not([hidden])');
  setInterval(() => {
    if (waits !== panel()?.dataset.mark || !/(^|· )stored/.test(panel().querySelector('.m').textContent)) return;
    confirmed(waits);
    waits = null;
  }, 10);
  setInterval(() => {
    const key = document.querySelector('[data-f="mark"]');
    if (!key || key.getAttribute('aria-disabled') === 'true') return;
    const at_ms = performance.timeOrigin + performance.now();
    key.click();
    waits = panel().dataset.mark;
    pressed(waits, at_ms);
  }, 230 + 60 * Math.random());
}"""

# Of what the phone keeps, all was acknowledged by the server.
NONE_WAITS = """() => new Promise((resolve) => {
  const request = indexedDB.open('catgraph-marks');
  request.onerror = () => resolve(false);
  request.onupgradeneeded = () => request.transaction.abort(); // the page makes it
  request.onsuccess = () => {
    const all = request.result.transaction('marks').objectStore('marks').getAll();
    all.onsuccess = () => {
      request.result.close();
      resolve(all.result.length > 0 && all.result.every(({ stored }) => stored > 0));
    };
  };
})"""


class Phone:
    """A browser whose profile outlives it."""

    def __init__(self, playwright: Playwright, chromium: str, profile: Path) -> None:
        self._playwright = playwright
        self._chromium = chromium
        self._profile = profile
        self.pressed_ms: dict[str, float] = {}
        self.confirmed: set[str] = set()

    async def start(self) -> BrowserContext:
        context = await self._playwright.chromium.launch_persistent_context(
            self._profile, executable_path=self._chromium, args=list(FLAGS), **PHONE
        )
        await context.expose_binding("pressed", lambda _, mark, at_ms: self.pressed_ms.update({mark: at_ms}))
        await context.expose_binding("confirmed", lambda _, mark: self.confirmed.add(mark))
        return context

    async def kill(self) -> None:
        """All of its processes, at once."""
        named = f"--user-data-dir={self._profile}"
        mine = psutil.Process().children(recursive=True)
        (main,) = [one for one in mine if named in _words(one) and not any("--type=" in part for part in _words(one))]
        killed = [main, *main.children(recursive=True)]
        for process in killed:
            with contextlib.suppress(psutil.NoSuchProcess):
                process.kill()
        await asyncio.to_thread(psutil.wait_procs, killed, 10)


def _words(process: psutil.Process) -> list[str]:
    try:
        return process.cmdline()
    except psutil.Error:
        return []


@contextlib.asynccontextmanager
async def marking(phone: Phone, address: str) -> AsyncIterator[None]:
    """The page is open, and marks until the end of the block, which kills it."""
    context = await phone.start()
    page = context.pages[0]
    await page.goto(address)
    await expect(page.locator('[data-f="mark"]')).to_be_visible(timeout=20_000)
    before = len(phone.confirmed)
    await page.evaluate(MARKS)
    async with asyncio.timeout(20):
        while len(phone.confirmed) == before:
            await asyncio.sleep(0.02)
    yield
    await phone.kill()
    with contextlib.suppress(PlaywrightError):
        await context.close()


@pytest.mark.slow
@pytest.mark.parametrize(
    "kills",
    [
        pytest.param(2, id="2", marks=pytest.mark.timeout(180)),
        pytest.param(100, id="100", marks=[pytest.mark.soak, pytest.mark.timeout(5400)]),
    ],
)
async def test_what_the_page_said_is_stored_survives_its_kill(
    chromium: str, tmp_path: Path, kills: int, record_property: Callable[[str, object], None]
) -> None:
    data, port, chance = tmp_path / "data", free_port(), random.Random(kills)
    (data / "settings").mkdir(parents=True)
    (data / "settings" / "car.toml").write_text(SETTINGS)
    must: set[str] = set()
    async with running(*simulate()) as car, async_playwright() as playwright:
        watch = await Process(*server(data, car.address, port)).start()
        try:
            phone = Phone(playwright, chromium, tmp_path / "profile")
            for _ in range(kills):
                async with marking(phone, watch.address):
                    await asyncio.sleep(chance.uniform(0.0, 4.0))
                    if chance.random() < SERVER_TOO:
                        await watch.kill()
                        await asyncio.sleep(chance.uniform(0.0, 3.0))
                    killed_ms = time.time() * 1000
                must |= {mark for mark, at_ms in phone.pressed_ms.items() if at_ms <= killed_ms - OLD_MS}
                if not await is_there(watch.address):
                    watch = await Process(*server(data, car.address, port)).start()
            context = await phone.start()
            page = context.pages[0]
            await page.goto(watch.address)
            async with asyncio.timeout(60):
                while not await page.evaluate(NONE_WAITS):
                    await asyncio.sleep(0.2)
            await context.close()
            await watch.terminate()
            watch = await Process(*server(data, car.address, port)).start()
            marks = await recorded(watch.address, must)
        finally:
            await watch.kill()
    unreported = marks.keys() - phone.pressed_ms.keys()  # a kill came between the press and its report
    off_ms = max(abs(marks[mark] - at_ms) for mark, at_ms in phone.pressed_ms.items() if mark in marks)
    record_property("marks that had to survive", len(must))
    record_property("marks in the recordings", len(marks))
    record_property("younger ones that were shown as stored and are lost", len(phone.confirmed - marks.keys()))
    record_property("farthest from its press [ms]", round(off_ms))
    print(f"{kills} kills, {len(must)} marks had to survive, {len(marks)} are there, at most {off_ms:.0f} ms off")
    print(f"shown as stored: {len(phone.confirmed)}, of them lost: {len(phone.confirmed - marks.keys())}")
    assert {mark: phone.pressed_ms[mark] for mark in must - marks.keys()} == {}
    assert len(unreported) <= kills, "one press, two marks"


async def is_there(address: str) -> bool:
    async with http_client(base_url=address) as client:
        try:
            return (await client.get("/api/health")).status_code < 500
        except httpx.HTTPError:
            return False


async def recorded(address: str, must: set[str]) -> dict[str, float]:
    """The moments of all marks in the recordings, once nothing is missing or a minute passed; each is there once."""
    until_s = time.monotonic() + 60
    async with httpx.AsyncClient(base_url=address, timeout=30.0) as client:
        while True:
            found: dict[str, float] = {}
            times: Counter[str] = Counter()
            for row in (await client.get("/api/recordings", params={"limit": 200})).json()["recordings"]:
                marks: list[dict[str, Any]] = (await client.get(f"/api/recordings/{row['id']}/marks")).json()["marks"]
                times.update(mark["mark"] for mark in marks)
                found |= {mark["mark"]: mark["marked_ms"] for mark in marks}
            if must <= found.keys() or time.monotonic() > until_s:
                assert {mark: count for mark, count in times.items() if count > 1} == {}
                return found
            await asyncio.sleep(0.5)
