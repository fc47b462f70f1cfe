"""A server in the field as a process, and a phone that does with it all that is usual."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import ssl
import subprocess
import sys
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import httpx
import websockets

from server.rosbridge_server.server import RosBridge
from tests.server.cars import driving
from tests.server.mail.post import posting
from tests.server.marks.media_samples import VOICE
from tests.server.viewer import Viewer
from tests.tree import PROJECT

KEY = "operator-key-of-usual-work"
TOO_FAST_MPS = 13.0


class Process:
    """`python -m MODULE serve …` on a data folder, by HTTPS of its own authority."""

    def __init__(self, folder: Path, *, module: str = "server", project: Path = PROJECT, **environment: str) -> None:
        self.data, self.out = folder / "data", folder / "out.txt"
        self._out = self.out.open("w")
        kept = {name: value for name, value in os.environ.items() if name != "PYTHONASYNCIODEBUG"}
        self.process = subprocess.Popen(
            [sys.executable, "-m", module, "serve", "--host", "0.0.0.0", "--port", "0", "--data", str(self.data)],
            cwd=project,
            stdout=self._out,
            stderr=subprocess.STDOUT,
            stdin=subprocess.PIPE,
            env=kept | {"CATGRAPH_KEY": KEY} | environment,
        )

    async def address(self) -> str:
        """Where it is reached, once it listens."""
        async with asyncio.timeout(60):
            while not (found := re.search(r"listens on https://[^\s/]+:(\d+)", self.out.read_text())):
                assert self.process.poll() is None, self.out.read_text()
                await asyncio.sleep(0.1)
        return f"https://localhost:{found[1]}"

    def begin_watch(self) -> None:
        """From now on the accesses of a `watched_server` count."""
        assert self.process.stdin is not None
        self.process.stdin.write(b"\n")
        self.process.stdin.flush()

    def end(self, *, within_s: float = 30.0) -> int:
        """Ends it as a terminal does; its exit code."""
        self.process.terminate()
        try:
            return self.process.wait(within_s)
        finally:
            self.kill()

    def kill(self) -> None:
        """Ends it as a loss of power does."""
        self.process.kill()
        self.process.wait()
        self._out.close()
        if self.process.stdin is not None:
            with contextlib.suppress(OSError):
                self.process.stdin.close()


class Phone:
    """A paired phone, which sends requests by HTTPS and has the page open."""

    def __init__(self, client: httpx.AsyncClient) -> None:
        self.client = client

    async def ask(self, method: str, path: str, **more: Any) -> httpx.Response:
        """An answer, which is a success."""
        answer = await self.client.request(method, path, **more)
        assert answer.is_success, (method, path, answer.status_code, answer.text)
        return answer

    async def until(self, path: str, fits: Callable[[Any], Any], within_s: float = 40.0) -> Any:
        """Repeat the request until the answer fits; return what fitted."""
        async with asyncio.timeout(within_s):
            while not (found := fits((await self.ask("GET", path)).json())):
                await asyncio.sleep(0.1)
        return found

    @contextlib.asynccontextmanager
    async def page(self) -> AsyncIterator[Viewer]:
        """The page's socket."""
        ticket = (await self.ask("POST", "/api/ticket")).json()["ticket"]
        base = str(self.client.base_url).rstrip("/")
        cookies = "; ".join(f"{one.name}={one.value}" for one in self.client.cookies.jar)
        socket = websockets.connect(
            f"{base.replace('https', 'wss')}/ws?ticket={ticket}",
            additional_headers={"Origin": base, "Cookie": cookies},
            ssl=untrusting(),
        )
        async with socket as opened:
            one = Viewer(opened)
            await one.send({"kind": "hello", "have_event": 0})
            reading = asyncio.create_task(one.read())
            try:
                yield one
            finally:
                reading.cancel()
                await asyncio.gather(reading, return_exceptions=True)


def untrusting() -> ssl.SSLContext:
    """Takes any certificate: the server's is of its own authority."""
    context = ssl.create_default_context()
    context.check_hostname = False
    context.verify_mode = ssl.CERT_NONE
    return context


@contextlib.asynccontextmanager
async def paired(base: str, name: str = "Pixel", role: str = "operator") -> AsyncIterator[Phone]:
    """A phone that is invited by a program with a key, and pairs."""
    headers = {"Origin": base}
    async with httpx.AsyncClient(base_url=base, headers=headers, verify=untrusting(), timeout=40) as client:
        invited = await client.post(
            "/api/devices/invite", json={"role": role}, headers={"Authorization": f"Bearer {KEY}"}
        )
        answer = await client.post("/api/pair", json={"pin": invited.json()["pin"], "name": name})
        assert answer.status_code == 200, answer.text
        yield Phone(client)


async def do_all(base: str, folder: Path) -> None:
    """Pairs, connects, records, changes settings, exports, mails, replays, and looks at everything there is."""
    bridge = RosBridge(ros_version=1)
    port = await bridge.start("127.0.0.1", 0)
    bridge.advertise("/catvehicle/vel", "geometry_msgs/Twist")
    bridge.advertise("/scan", "sensor_msgs/LaserScan")
    speed = [4.2]
    try:
        async with (
            posting(folder / "post") as post,
            driving(bridge, speed=lambda n: speed[0], scans=True, steers=True),
            paired(base) as phone,
            phone.page() as page,
        ):
            await _load(phone)
            await _drive(phone, page, f"ws://127.0.0.1:{port}", speed)
            recording = await phone.until("/api/recordings", finished)
            await _use(phone, page, recording, post.port)
            await _administer(phone)
            await asyncio.sleep(6)  # the certificate is looked at, the catalogue walked, the alarm log tried
    finally:
        await bridge.stop()


def finished(listed: Any) -> str | None:
    """The newest recording of a list that is all read; None: it is not yet."""
    ready = [one["id"] for one in listed["recordings"] if one["state"] not in ("waiting", "reading")]
    return ready[0] if ready and listed["waiting"] == 0 else None


async def _load(phone: Phone) -> None:
    """What a browser loads."""
    page = (await phone.ask("GET", "/")).text
    for address in dict.fromkeys(re.findall(r'(?:src|href)="(/[^"#]+)"', page)):
        await phone.ask("GET", address.replace("&amp;", "&"))
    for address in ("/service-worker.js", "/offline", "/manifest.webmanifest", "/favicon.ico", "/static/js/main.js"):
        answer = await phone.client.get(address)
        assert answer.status_code in (200, 404), (address, answer.status_code)


async def _drive(phone: Phone, page: Viewer, car: str, speed: list[float]) -> None:
    """A drive that is recorded, too fast for a while."""
    await page.ask(kind="control", do="take")
    assert (await page.ask(kind="connect", address=car))["ok"]
    await page.state(lambda s: s["session"]["phase"] == "monitoring", within_s=20)
    await page.send({"kind": "watch", "scan": True})
    await page.state(lambda s: s["recording"]["state"] == "recording", within_s=20)
    assert (await page.ask(kind="mark", mark="m-1", words="a swerve"))["ok"]
    await phone.ask("POST", "/api/marks/m-1/voice", content=VOICE, headers={"Content-Type": "audio/webm"})
    await phone.ask("GET", "/api/marks/m-1/voice")
    speed[0] = TOO_FAST_MPS
    event = await page.until(lambda: next((e for e in page.events if e["alarm"] == "speed_limit"), None), 20)
    occurrence = event["occurrence"]
    assert (await page.ask(kind="acknowledge", alarm="speed_limit", occurrence=occurrence))["ok"]
    speed[0] = 4.2
    assert (await page.ask(kind="set", values={"speed_limit.max_mps": 9.5}))["ok"]
    toml = (await phone.ask("GET", "/api/settings.toml")).text
    await phone.ask("PUT", "/api/settings.toml", content=toml)
    assert (await page.ask(kind="set_departure_list", items=[{"id": "doors", "title": "Doors shut"}]))["ok"]
    for path in ("/api/departure", "/api/departure.toml"):
        await phone.ask("GET", path)
    for kind in ("pause", "resume"):
        assert (await page.ask(kind=kind))["ok"]
    await asyncio.sleep(2)
    assert (await page.ask(kind="record", on=False))["ok"]
    await page.state(lambda s: s["recording"]["state"] != "recording", within_s=20)


async def _use(phone: Phone, page: Viewer, recording: str, smtp_port: int) -> None:
    """A recording is annotated, fetched, exported, cut, mailed, replayed, deleted and taken back."""
    at = f"/api/recordings/{recording}"
    await phone.ask("PATCH", at, json={"title": "First lap", "note": "wet", "tags": ["wet"]})
    row = (await phone.ask("GET", at)).json()
    await phone.ask("GET", f"{at}/file.mcap", headers={"Range": "bytes=0-99"})
    await phone.ask("GET", f"{at}/track.svg")
    assert (await phone.ask("GET", f"{at}/marks")).json()["marks"][0]["voice"]
    for path in (f"{at}/marks/m-1/voice", f"{at}/export/csv", f"{at}/course", f"{at}/report"):
        await phone.ask("GET", path)
    for path in ("/api/logbook", "/api/logbook.csv"):
        await phone.ask("GET", path)
    exported = (await phone.ask("GET", "/api/exports")).json()["exports"][0]["job"]
    await phone.ask("DELETE", f"/api/exports/{exported}")
    job = (await phone.ask("POST", f"{at}/clip", json={"at_ms": row["started_ms"] + 1000})).json()["job"]
    await phone.until(f"/api/exports/{job}", lambda found: found["state"] == "done")
    settings = {"host": "127.0.0.1", "port": smtp_port, "security": "none", "sender": "car@test.example"}
    await phone.ask("PUT", "/api/mail/settings", json=settings)
    await phone.ask("POST", "/api/mail/test", json={})
    order = {"recordings": [recording], "to": ["ann@example.org"], "format": "csv"}
    number = (await phone.ask("POST", "/api/mail", json=order)).json()["n"]
    await phone.until(f"/api/mail/{number}", lambda found: found["state"] == "sent")
    for do, more in (("open", {"recording": recording}), ("play", {}), ("pause", {}), ("leave", {})):
        assert (await page.ask(within_s=30, kind="replay", do=do, **more))["ok"], do
    await phone.ask("DELETE", at)
    await phone.ask("POST", f"/api/trash/{recording}/restore")


async def _administer(phone: Phone) -> None:
    """All that can be looked at, and the list of devices."""
    described = (await phone.ask("GET", "/openapi.json")).json()
    for path, methods in described["paths"].items():
        if "get" in methods and "{" not in path and path != "/api/stored":  # this server has no store
            await phone.ask("GET", path)
    base = str(phone.client.base_url).rstrip("/")
    async with paired(base, "Tablet", "viewer"):
        listed = (await phone.ask("GET", "/api/devices")).json()
        tablet = next(one["id"] for one in listed["devices"] if one["name"] == "Tablet")
        await phone.ask("PATCH", f"/api/devices/{tablet}", json={"name": "Big tablet"})
        await phone.ask("DELETE", f"/api/devices/{tablet}")
