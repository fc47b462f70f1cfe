"""Marks placed on a phone: by a tap, by voice, with a photo and text, while the server is away; each stored once."""

from __future__ import annotations

import asyncio
import contextlib
import struct
import time
import zlib
from collections.abc import AsyncIterator, Awaitable, Callable
from pathlib import Path
from typing import Any

import httpx
import pytest
import pytest_asyncio
from playwright.async_api import Browser, Locator, async_playwright, expect

from tests.chromium import FLAGS
from tests.http import http_client
from tests.page.barriers import fits_all, no_barrier
from tests.page.conftest import PHONE, Phone, phone_in
from tests.page.processes import Process, running, server, simulate
from tests.ports import free_port

HOSTILE = "<img src=x onerror=alert(1)>"
pytestmark = pytest.mark.timeout(120)


def picture() -> bytes:
    """A grey PNG of 6 megapixels."""

    def chunk(kind: bytes, data: bytes) -> bytes:
        return struct.pack(">I", len(data)) + kind + data + struct.pack(">I", zlib.crc32(kind + data))

    width, height = 3000, 2000
    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    rows = zlib.compress((b"\0" + bytes(width)) * height)
    return b"\x89PNG\r\n\x1a\n" + chunk(b"IHDR", head) + chunk(b"IDAT", rows) + chunk(b"IEND", b"")


class Drive:
    """A phone at a server that watches a car, and the marks as a program sees them."""

    def __init__(self, phone: Phone, watch: Process) -> None:
        self.phone = phone
        self.watch = watch

    @property
    def key(self) -> Locator:
        return self.phone.page.locator('[data-f="mark"]')

    async def open(self) -> None:
        await self.phone.open(self.watch.address)
        await self.phone.live()
        await expect(self.key).to_be_visible()
        await self.phone.acknowledge_meanwhile()

    async def get(self, path: str) -> httpx.Response:
        async with http_client(base_url=self.watch.address) as client:
            return await client.get(path)

    async def marks(self) -> list[dict[str, Any]]:
        found: list[dict[str, Any]] = (await self.get("/api/marks?vehicle=car")).json()["marks"]
        return found

    async def stored(self, count: int, **having: Any) -> list[dict[str, Any]]:
        """Waits until so many marks are stored, the newest with these fields."""
        async with asyncio.timeout(20):
            while True:
                marks = await self.marks()
                if len(marks) == count and (not marks or having.items() <= marks[-1].items()):
                    return marks
                await asyncio.sleep(0.1)

    async def hold(self, for_s: float) -> None:
        """A finger on the key."""
        page = self.phone.page
        box = await self.key.bounding_box()
        assert box is not None
        await page.mouse.move(box["x"] + 40, box["y"] + 28)
        await page.mouse.down()
        await asyncio.sleep(for_s)
        await page.mouse.up()

    async def speak_while(self, act: Callable[[], Awaitable[None]]) -> None:
        """A finger on the key, while something else is done that takes a second or more."""
        page = self.phone.page
        box = await self.key.bounding_box()
        assert box is not None
        await page.mouse.move(box["x"] + 40, box["y"] + 28)
        await page.mouse.down()
        await expect(page.locator(".fresh[data-speaking]")).to_contain_text("Listening")
        await act()
        await page.mouse.up()


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def car() -> AsyncIterator[Process]:
    async with running(*simulate()) as process:
        yield process


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def hearing(chromium: str) -> AsyncIterator[Browser]:
    """A browser with a microphone that beeps; each context sets whether it may be used."""
    async with async_playwright() as playwright:
        flags = [*FLAGS, "--use-fake-device-for-media-stream"]
        browser = await playwright.chromium.launch(executable_path=chromium, args=flags)
        yield browser
        await browser.close()


@contextlib.asynccontextmanager
async def drive(browser: Browser, data: Path, car: Process, **more: Any) -> AsyncIterator[Drive]:
    context = await browser.new_context(**PHONE | more)
    async with running(*server(data, car.address, free_port())) as watch:
        one = Drive(await phone_in(context), watch)
        await one.open()
        yield one
    await context.close()


@pytest.mark.gate
async def test_a_tap_stores_a_mark_and_undo_takes_it_back(browser: Browser, car: Process, tmp_path: Path) -> None:
    async with drive(browser, tmp_path, car) as one:
        await one.key.tap()
        await one.stored(1)
        await expect(one.phone.page.locator(".fresh")).to_contain_text("stored")
        await one.phone.page.keyboard.press("m")
        await one.stored(2)
        await one.phone.page.locator('[data-f="mark-undo"]').tap()
        await one.stored(1)
        await one.phone.page.reload()
        await one.phone.live()
        await one.stored(1)
        assert one.phone.faults == []


async def test_a_mark_with_voice_photo_and_words(hearing: Browser, car: Process, tmp_path: Path) -> None:
    async with drive(hearing, tmp_path, car, permissions=["microphone"]) as one:
        page = one.phone.page
        await one.key.tap()  # one tap
        pressed_ms = time.time() * 1000
        (mark,) = await one.stored(1)
        assert abs(mark["marked_ms"] - pressed_ms) < 1000 * one.phone.slack_s
        panel = page.locator(".fresh")
        await expect(panel).to_contain_text("stored")
        await no_barrier(page, "a fresh mark", ".ledge")
        await fits_all(page, "a fresh mark", ".ledge")

        await one.speak_while(lambda: no_barrier(page, "a mark that is spoken of", ".ledge"))
        *_, mark = await one.stored(2, voice=True)
        voice = await one.get(f"/api/marks/{mark['mark']}/voice?vehicle=car")
        assert voice.content.startswith(b"\x1a\x45\xdf\xa3")
        assert len(voice.content) > 2000

        async with page.expect_file_chooser() as chosen:
            await page.locator('[data-f="mark-photo"]').tap()
        await (await chosen.value).set_files({"name": "a.png", "mimeType": "image/png", "buffer": picture()})
        await one.stored(2, photo=True)
        assert (await one.get(f"/api/marks/{mark['mark']}/photo?vehicle=car")).content.startswith(b"\xff\xd8\xff")

        await one.key.tap()
        await page.locator('[data-f="mark-words"]').tap()
        sheet = page.locator("#sheet-mark")
        await sheet.get_by_role("button", name="Control").tap()
        await sheet.get_by_role("button", name="−0.1 s").tap()
        await sheet.locator("textarea").fill(HOSTILE)
        await no_barrier(page, "a mark", "#sheet-mark")
        await fits_all(page, "a mark", "#sheet-mark")
        before = (await one.stored(3))[-1]["marked_ms"]
        await sheet.get_by_role("button", name="Keep").tap()
        await one.stored(3, category="control", words=HOSTILE)
        assert (await one.marks())[-1]["marked_ms"] <= before

        await page.evaluate("document.activeElement.blur()")
        await page.keyboard.press("m")
        await one.stored(4)
        await page.locator('[data-f="mark-undo"]').tap()
        await one.stored(3)
        await one.phone.f("menu").tap()
        await page.locator('#sheet-menu [data-f="marks"]').tap()
        rows = page.locator("#sheet-marks .mark-rows li")
        await expect(rows).to_have_count(3)
        await expect(rows.first).to_contain_text(HOSTILE)
        await no_barrier(page, "the list of marks", "#sheet-marks")
        await fits_all(page, "the list of marks", "#sheet-marks")
        assert one.phone.faults == []


STALLS = """() => addEventListener('pointerdown', (event) => {
  window.came_ms = performance.timeOrigin + event.timeStamp;
  for (const until_ms = performance.now() + 700; performance.now() < until_ms;);
}, { capture: true, once: true })"""


# Fifty presses, 90 ms apart: a busy page would run timers of one start at once, and two at once are one.
PRESSES = """async (key) => {
  for (let i = 0; i < 50; i += 1) {
    key.click();
    await new Promise((done) => setTimeout(done, 90));
  }
}"""

# How many marks the phone keeps.
KEPT = """() => new Promise((resolve, reject) => {
  const request = indexedDB.open('catgraph-marks');
  request.onerror = () => resolve(0);
  request.onupgradeneeded = () => request.transaction.abort(); // the page makes it
  request.onsuccess = () => {
    const count = request.result.transaction('marks').objectStore('marks').count();
    count.onsuccess = () => { request.result.close(); resolve(count.result); };
    count.onerror = () => reject(count.error);
  };
})"""


async def test_a_tap_on_a_busy_page_marks_when_the_finger_came(hearing: Browser, car: Process, tmp_path: Path) -> None:
    async with drive(hearing, tmp_path, car) as one:
        await one.phone.page.evaluate(STALLS)
        await one.key.tap()
        (mark,) = await one.stored(1)
        assert abs(mark["marked_ms"] - await one.phone.page.evaluate("came_ms")) < 200
        await expect(one.phone.page.locator(".snack.note")).to_have_count(0)  # it was no held press: nothing is refused


async def test_two_taps_on_a_busy_page_are_two_marks(hearing: Browser, car: Process, tmp_path: Path) -> None:
    async with drive(hearing, tmp_path, car) as one:
        await one.phone.page.evaluate(STALLS)
        box = await one.key.bounding_box()
        assert box is not None
        cdp = await one.phone.page.context.new_cdp_session(one.phone.page)
        points = [{"x": box["x"] + 40, "y": box["y"] + 28}]
        now_s = time.time()
        sent = [
            cdp.send("Input.dispatchTouchEvent", {"type": kind, "touchPoints": where, "timestamp": now_s + after_s})
            for after_s in (0.0, 0.2)
            for kind, where in (("touchStart", points), ("touchEnd", []))
        ]
        await asyncio.gather(*sent)  # the page receives all of them when it is free again
        await one.stored(2)


async def test_marks_of_a_stopped_server_are_delivered_once(hearing: Browser, car: Process, tmp_path: Path) -> None:
    async with drive(hearing, tmp_path, car) as one:
        page = one.phone.page
        await one.watch.kill()
        await expect(one.key).to_contain_text("stored on this device", timeout=15_000)
        # The dialog that the connection is lost may cover it.
        await one.key.evaluate("(key) => { key.click(); setTimeout(() => key.click(), 100); }")
        await expect(page.locator('[data-f="marks-wait"]')).to_have_text("2 wait")
        pressed_ms = time.time() * 1000
        async with asyncio.timeout(15):
            while await page.evaluate(KEPT) < 2:
                await asyncio.sleep(0.05)
        await page.goto("about:blank")  # the page is closed
        port = int(one.watch.address.rpartition(":")[2])
        async with running(*server(tmp_path, car.address, port)) as watch:
            one.watch = watch
            await one.open()
            marks = await one.stored(2)
            assert all(abs(mark["marked_ms"] - pressed_ms) < 1000 * one.phone.slack_s for mark in marks)
            await page.reload()
            await one.phone.live()
            await expect(one.key).to_contain_text("hold: voice")
            assert await one.marks() == marks


async def test_a_refused_microphone_leaves_the_mark(hearing: Browser, car: Process, tmp_path: Path) -> None:
    async with drive(hearing, tmp_path, car) as one:
        await one.hold(0.9)
        await expect(one.phone.page.locator(".snack.note")).to_contain_text("The microphone was refused")
        (mark,) = await one.stored(1)
        assert not mark["voice"]
        no_photo = {"name": "a.jpg", "mimeType": "image/jpeg", "buffer": bytes(2_000_000)}
        async with one.phone.page.expect_file_chooser() as chosen:
            await one.phone.page.locator('[data-f="mark-photo"]').tap()
        await (await chosen.value).set_files(no_photo)  # type: ignore[arg-type]
        await expect(one.phone.page.locator(".snack.note")).to_contain_text("This picture could not be read")
        await one.key.evaluate(PRESSES)
        await one.stored(51)
