"""Another browser than Chromium: WebKitGTK's MiniBrowser, by the W3C WebDriver protocol, on a screen of its own."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import locale
import os
import shutil
import socket
from collections.abc import AsyncIterator, Iterator
from glob import glob
from pathlib import Path
from typing import Any

import httpx

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
        """Waits until the function's body answers something."""
        async with asyncio.timeout(within_s):
            while not (found := await self.run(script)):
                await asyncio.sleep(0.1)
        return found

    async def press(self, selector: str) -> None:
        found = await self._ask("POST", "/element", using="css selector", value=selector)
        await self._ask("POST", f"/element/{next(iter(found.values()))}/click")

    async def picture(self, path: Path) -> None:
        path.write_bytes(base64.b64decode(await self._ask("GET", "/screenshot")))

    async def _ask(self, method: str, path: str, **body: Any) -> Any:
        answer = await self._client.request(
            method, f"/session/{self._session}{path}", json=body if method == "POST" else None
        )
        value = answer.json()["value"]
        assert answer.status_code == 200, value
        return value


@contextlib.asynccontextmanager
async def webkit(scratch: Path) -> AsyncIterator[WebKit]:
    """A new browser with an empty profile, 420 × 900."""
    with socket.socket() as probe:
        probe.bind(("127.0.0.1", 0))
        port = probe.getsockname()[1]
    screen_in, screen_out = os.pipe()
    screen = await asyncio.create_subprocess_exec(
        *(SCREEN, "-displayfd", str(screen_out), "-screen", "0", "420x900x24", "-nolisten", "tcp"),
        pass_fds=(screen_out,),
        stderr=asyncio.subprocess.DEVNULL,
    )
    os.close(screen_out)
    display = (await asyncio.to_thread(os.read, screen_in, 20)).decode().strip()
    os.close(screen_in)
    own = {"DISPLAY": f":{display}", "HOME": str(scratch), "LC_ALL": LANGUAGE}
    driver = await asyncio.create_subprocess_exec(
        *(DRIVER, "-p", str(port)),
        env=os.environ | own | {"XDG_CACHE_HOME": str(scratch), "XDG_DATA_HOME": str(scratch)},
        stdout=asyncio.subprocess.DEVNULL,
        stderr=asyncio.subprocess.DEVNULL,
    )
    options = {"binary": glob(BROWSERS)[0], "args": ["--automation"]}
    wanted = {"browserName": "MiniBrowser", "webkitgtk:browserOptions": options}
    try:
        async with httpx.AsyncClient(base_url=f"http://127.0.0.1:{port}", timeout=60) as client:
            async with asyncio.timeout(20):
                while True:
                    with contextlib.suppress(httpx.TransportError):
                        await client.get("/status")
                        break
                    await asyncio.sleep(0.1)
            answer = (await client.post("/session", json={"capabilities": {"alwaysMatch": wanted}})).json()["value"]
            session = answer["sessionId"]
            await client.post(f"/session/{session}/window/rect", json={"x": 0, "y": 0, "width": 420, "height": 900})
            yield WebKit(client, session)
            await client.delete(f"/session/{session}")
    finally:
        for process in (driver, screen):
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
