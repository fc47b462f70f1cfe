"""Another browser than Chromium: WebKitGTK's MiniBrowser, by the W3C WebDriver protocol, on a screen of its own."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import locale
import os
import shutil
import time
from collections.abc import AsyncIterator, Iterator, Mapping
from glob import glob
from pathlib import Path
from typing import Any

import httpx

from tests.ports import free_port

DRIVER, SCREEN = "WebKitWebDriver", "Xvfb"
LANGUAGE = "en_US.UTF-8"  # in the C locale the driver waits for its browser for ever
BROWSERS = "/usr/lib/*/webkit2gtk-4.*/MiniBrowser"


def lacking() -> str | None:
    """What is not installed here, as a sentence; None: nothing."""
    for program in (DRIVER, SCREEN):
        if shutil.which(program) is None:
            return f"{program} is not installed here (Debian: apt install webkit2gtk-driver xvfb)"
    if not glob(BROWSERS):
        return "WebKitGTK's MiniBrowser is not installed here"
    try:
        with in_locale(LANGUAGE):
            return None
    except locale.Error:
        return f"the locale {LANGUAGE} is not there (Debian: localedef -i en_US -f UTF-8 {LANGUAGE})"


@contextlib.contextmanager
def in_locale(language: str) -> Iterator[None]:
    """This process in another locale, for a moment. Raises locale.Error where there is none of that name."""
    before = locale.setlocale(locale.LC_CTYPE)
    try:
        locale.setlocale(locale.LC_CTYPE, language)
        yield
    finally:
        locale.setlocale(locale.LC_CTYPE, before)


class Refused(Exception):
    """The browser did not do it; its reason."""


class WebKit:
    """A page in WebKit."""

    def __init__(self, client: httpx.AsyncClient, session: str) -> None:
        self._client = client
        self._session = session

    async def open(self, address: str) -> None:
        await self._ask("POST", "/url", url=address)

    async def run(self, script: str) -> Any:
        """What a function's body answers."""
        return await self._ask("POST", "/execute/sync", script=script, args=[])

    async def until(self, script: str, within_s: float = 20.0) -> Any:
        """Waits until the function's body answers something. Raises AssertionError with what the page shows instead."""
        until_s = time.monotonic() + within_s
        while not (found := await self.run(script)):
            if time.monotonic() > until_s:
                shown = await self.run(
                    "return document.querySelector('#monitor')?.innerText ?? document.body.innerText"
                )
                raise AssertionError(f"not within {within_s:g} s: {script}\nThe page shows:\n{shown}")
            await asyncio.sleep(0.1)
        return found

    async def press(self, selector: str, within_s: float = 8.0) -> None:
        """Presses a key; again where a sheet that still slides, or the cover of a slow machine, lay over it."""
        until_s = time.monotonic() + within_s
        while True:
            found = await self._ask("POST", "/element", using="css selector", value=selector)
            try:
                return await self._ask("POST", f"/element/{next(iter(found.values()))}/click")
            except Refused:
                if time.monotonic() > until_s:
                    raise
            await asyncio.sleep(0.2)

    async def close(self) -> None:
        await self._client.delete(f"/session/{self._session}")

    async def picture(self, path: Path) -> None:
        path.write_bytes(base64.b64decode(await self._ask("GET", "/screenshot")))

    async def _ask(self, method: str, path: str, **body: Any) -> Any:
        answer = await self._client.request(
            method, f"/session/{self._session}{path}", json=body if method == "POST" else None
        )
        value = answer.json()["value"]
        if answer.status_code != 200:
            raise Refused(value)
        return value


@contextlib.asynccontextmanager
async def webkit(scratch: Path) -> AsyncIterator[WebKit]:
    """A new browser with an empty profile, 420 × 900."""
    async with screen() as display:
        own = {"DISPLAY": display, "HOME": str(scratch), "LC_ALL": LANGUAGE}
        own |= {"XDG_CACHE_HOME": str(scratch), "XDG_DATA_HOME": str(scratch)}
        async with driver(os.environ | own) as client:
            page = WebKit(client, await session_of(client))
            yield page
            await page.close()


@contextlib.asynccontextmanager
async def screen() -> AsyncIterator[str]:
    """The name of a screen of its own."""
    reads, writes = os.pipe()
    process = await asyncio.create_subprocess_exec(
        *(SCREEN, "-displayfd", str(writes), "-screen", "0", "420x900x24", "-nolisten", "tcp"),
        pass_fds=(writes,),
        stderr=asyncio.subprocess.DEVNULL,
    )
    os.close(writes)
    with os.fdopen(reads) as line:  # the whole of it: the screen ends where it cannot write the rest
        name = (await asyncio.to_thread(line.readline)).strip()
    async with ended(process):
        yield f":{name}"


@contextlib.asynccontextmanager
async def driver(environment: Mapping[str, str]) -> AsyncIterator[httpx.AsyncClient]:
    """A client of a driver that answers."""
    port = free_port()
    process = await asyncio.create_subprocess_exec(
        *(DRIVER, "-p", str(port)),
        env=environment,
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.DEVNULL,
    )
    async with ended(process), httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", timeout=60) as client:
        async with asyncio.timeout(20):
            while True:
                with contextlib.suppress(httpx.TransportError):
                    await client.get("/status")
                    break
                await asyncio.sleep(0.1)
        yield client


@contextlib.asynccontextmanager
async def ended(process: asyncio.subprocess.Process) -> AsyncIterator[None]:
    """The process is ended at the end of the block."""
    try:
        yield
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.wait()


async def session_of(client: httpx.AsyncClient) -> str:
    """The name of a new session."""
    options = {"binary": glob(BROWSERS)[0], "args": ["--automation"]}
    wanted = {"browserName": "MiniBrowser", "webkitgtk:browserOptions": options}
    body = {"capabilities": {"alwaysMatch": wanted}}
    answer = (await client.post("/session", json=body)).json()["value"]
    session: str = answer["sessionId"]
    await client.post(f"/session/{session}/window/rect", json={"x": 0, "y": 0, "width": 420, "height": 900})
    return session
