"""HTTPS as a phone meets it: a Chromium that is set to trust the server's authority, and one that was not.

The server listens as in the field; its name leads to this machine by a rule of the browser, as multicast DNS would.
"""

from __future__ import annotations

import contextlib
import os
import re
import shutil
import socket
import subprocess
from collections.abc import AsyncIterator
from dataclasses import dataclass
from pathlib import Path

import pytest
import pytest_asyncio
from playwright.async_api import BrowserContext, Error, async_playwright, expect

from server.tls.names import label_of
from tests.chromium import FLAGS
from tests.http import http_client
from tests.page import house
from tests.page.barriers import no_barrier
from tests.page.conftest import PHONE
from tests.page.processes import running
from tests.ports import free_port

HOST = f"{label_of(socket.gethostname()) or 'nameless'}.local"
HERE = {"latitude": 48.1, "longitude": 11.6, "accuracy": 5.0}
ARMED = """async () => ({
  secure: isSecureContext,
  position: await new Promise((done) => navigator.geolocation.getCurrentPosition(
    ({ coords }) => done([coords.latitude, coords.longitude]), ({ message }) => done(message))),
  awake: await navigator.wakeLock.request('screen').then((lock) => lock.type, String),
  clipboard: 'clipboard' in navigator,
})"""
WORKER = """async () => (await navigator.serviceWorker.ready).active.scriptURL"""


@dataclass(frozen=True, kw_only=True)
class Field:
    """A server in the field."""

    port: int
    setup_port: int
    ca: Path

    @property
    def secure(self) -> str:
        return f"https://{HOST}:{self.port}/"

    @property
    def setup(self) -> str:
        return f"http://{HOST}:{self.setup_port}/"


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def served(tmp_path_factory: pytest.TempPathFactory) -> AsyncIterator[Field]:
    if label_of(socket.gethostname()) == "":
        pytest.skip("this machine has no name")
    folder = tmp_path_factory.mktemp("field")
    project = house.copy(folder / "house")
    port, setup_port = free_port(), free_port()
    ports = ("--port", str(port), "--setup-port", str(setup_port))
    async with running("serve", "--host", "0.0.0.0", *ports, "--data", str(folder / "data"), folder=project):
        async with http_client() as client:
            (folder / "ca.crt").write_bytes((await client.get(f"http://127.0.0.1:{setup_port}/ca.crt")).content)
        yield Field(port=port, setup_port=setup_port, ca=folder / "ca.crt")


def output_of(*command: str) -> str:
    return subprocess.run(command, check=True, capture_output=True, text=True).stdout


@contextlib.asynccontextmanager
async def phone(chromium: str, home: Path, trusted: Path | None) -> AsyncIterator[BrowserContext]:
    """A browser with a certificate store of its own, which holds `trusted` as one that a person installed."""
    certutil = shutil.which("certutil")
    if certutil is None:
        pytest.skip("no certutil to install an authority with: it is in libnss3-tools")
    store = home / ".pki" / "nssdb"
    store.mkdir(parents=True)
    output_of(certutil, "-d", f"sql:{store}", "-N", "--empty-password")
    if trusted is not None:
        output_of(certutil, "-d", f"sql:{store}", "-A", "-t", "C,,", "-n", "catgraph", "-i", str(trusted))
    async with async_playwright() as playwright:
        browser = await playwright.chromium.launch(
            executable_path=chromium,
            args=[*FLAGS, f"--host-resolver-rules=MAP {HOST} 127.0.0.1"],
            env={**os.environ, "HOME": str(home)},
        )
        try:
            allowed = ["geolocation", "screen-wake-lock"]
            yield await browser.new_context(
                **{**PHONE, "service_workers": "allow", "permissions": allowed, "geolocation": HERE}
            )
        finally:
            await browser.close()


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def trusting(
    chromium: str, served: Field, tmp_path_factory: pytest.TempPathFactory
) -> AsyncIterator[BrowserContext]:
    async with phone(chromium, tmp_path_factory.mktemp("trusting"), served.ca) as context:
        yield context


@pytest_asyncio.fixture(loop_scope="session", scope="module")
async def stranger(
    chromium: str, served: Field, tmp_path_factory: pytest.TempPathFactory
) -> AsyncIterator[BrowserContext]:
    async with phone(chromium, tmp_path_factory.mktemp("stranger"), None) as context:
        yield context


async def test_a_phone_that_trusts_the_server_has_position_and_screen_and_shell(
    trusting: BrowserContext, served: Field
) -> None:
    page = await trusting.new_page()
    answer = await page.goto(served.secure)
    assert answer is not None
    assert answer.status == 200
    assert await page.evaluate(ARMED) == {
        "secure": True,
        "position": [HERE["latitude"], HERE["longitude"]],
        "awake": "screen",
        "clipboard": True,
    }
    assert await page.evaluate(WORKER) == f"{served.secure}worker.js"
    await page.close()


async def test_the_explaining_page_says_that_it_trusts_and_leads_on(trusting: BrowserContext, served: Field) -> None:
    page = await trusting.new_page()
    await page.goto(served.setup)
    await expect(page.locator('[data-when="yes"]')).to_be_visible()
    await expect(page.locator('[data-when="no"]')).to_be_hidden()
    await page.locator(".go").tap()
    await page.wait_for_url(served.secure)
    await page.close()


async def test_a_phone_that_does_not_is_turned_away_and_the_explaining_page_says_what_to_do(
    stranger: BrowserContext, served: Field
) -> None:
    page = await stranger.new_page()
    with pytest.raises(Error, match="ERR_CERT_AUTHORITY_INVALID"):
        await page.goto(served.secure)
    await page.close()  # Chromium goes on to its own page about it, at a moment of its own
    page = await stranger.new_page()
    await page.goto(served.setup)
    await expect(page.locator('[data-when="no"]')).to_contain_text("does not trust the server yet")
    await expect(page.locator("details[open] .key").first).to_be_visible()
    async with page.expect_download() as waiting:
        await page.locator('details[open] a[href="/ca.crt"]').first.tap()
    download = await waiting.value
    assert download.suggested_filename == "catgraph-ca.crt"
    assert Path(await download.path()).read_bytes() == served.ca.read_bytes()
    await page.close()


@pytest.mark.parametrize("which", ["port", "setup_port"])
async def test_who_forgets_the_s_of_https_finds_the_explaining_page(
    stranger: BrowserContext, served: Field, which: str
) -> None:
    page = await stranger.new_page()
    await page.goto(f"http://{HOST}:{getattr(served, which)}/somewhere?x=1")
    await expect(page.get_by_role("heading", level=1)).to_have_text("Let this device trust the server")
    assert page.url == f"http://{HOST}:{getattr(served, which)}/"
    await page.close()


async def test_the_explaining_page_can_be_read_by_everybody(stranger: BrowserContext, served: Field) -> None:
    page = await stranger.new_page()
    await page.goto(served.setup)
    await page.evaluate("for (const one of document.querySelectorAll('details')) { one.name = ''; one.open = true; }")
    await no_barrier(page, "the explaining page")
    for width in (412, 320, 1100):
        await page.set_viewport_size({"width": width, "height": 915})
        assert await page.evaluate("document.documentElement.scrollWidth") <= width
        heights = "[...document.querySelectorAll('a, summary')].map((one) => one.getBoundingClientRect().height)"
        assert min(await page.evaluate(heights)) >= 56, width
    beyond = """[...document.querySelectorAll('.shot text')].filter((text) => {
      const [inner, outer] = [text.getBoundingClientRect(), text.ownerSVGElement.getBoundingClientRect()];
      return inner.right > outer.right - 4 || inner.bottom > outer.bottom;
    }).map((text) => text.textContent)"""
    assert await page.evaluate(beyond) == [], "the drawn screens hold their text"
    await page.close()


async def test_the_code_on_the_page_is_its_own_address(stranger: BrowserContext, served: Field, tmp_path: Path) -> None:
    zbarimg = shutil.which("zbarimg")
    if zbarimg is None:
        pytest.skip("no zbarimg to read a QR code with: it is in zbar-tools")
    page = await stranger.new_page()
    await page.goto(served.setup)
    await page.locator(".share img").screenshot(path=tmp_path / "code.png")
    assert output_of(zbarimg, "-q", "--raw", str(tmp_path / "code.png")).strip() == served.setup
    await page.close()


async def test_without_https_the_page_says_what_is_lacking_and_what_to_do(
    stranger: BrowserContext, tmp_path: Path
) -> None:
    """Loopback is a secure place for a browser, and any other name is not."""
    off = ("serve", "--host", "0.0.0.0", "--port", "0", "--tls", "off", "--data", str(tmp_path))
    async with running(*off) as one:
        port = re.search(r":(\d+)$", one.address)
        assert port
        page = await stranger.new_page()
        await page.goto(f"http://{HOST}:{port[1]}/")
        assert await page.evaluate("isSecureContext") is False
        text = page.locator('#connect [data-f="insecure"]:not([hidden])')
        await expect(text).to_contain_text("start the server without --tls off")
        await page.close()
