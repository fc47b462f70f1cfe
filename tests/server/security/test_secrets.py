"""Whatever a server is trusted with stays with it: through its whole life no secret stands in what it prints, in an
answer, or in a file that is not there for it."""

from __future__ import annotations

import asyncio
import json
import os
import re
import stat
import subprocess
import sys
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets
from mcap.reader import make_reader

from server.rosbridge_server.server import RosBridge
from tests.server.cars import driving
from tests.tree import PROJECT

OPERATOR_KEY = "operator-key-8d1f0c6a55e94b7e"
VIEWER_KEY = "viewer-key-41ce9be07d2a4f18"
MAIL_PASSWORD = "mail-password-93b0d7"
CAR_PASSWORD = "car-password-5c2e18"
KEEPS = {MAIL_PASSWORD: "mail/"}  # the one that must be known again after a restart, in its own file


class Life:
    """A server in the field, as a process."""

    def __init__(self, folder: Path) -> None:
        self.data, self.out = folder / "data", folder / "output"
        self._file = self.out.open("w")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "server", "serve", "--host", "0.0.0.0", "--tls", "off", "--port", "0",
             "--data", str(self.data)],
            cwd=PROJECT, stdout=self._file, stderr=subprocess.STDOUT, stdin=subprocess.DEVNULL,
            env=os.environ | {"CATGRAPH_KEY": OPERATOR_KEY, "CATGRAPH_VIEWER_KEY": VIEWER_KEY},
        )  # fmt: skip

    async def address(self) -> str:
        async with asyncio.timeout(40):
            while not (found := re.search(r"listens on http://[^\s/]+:(\d+)", self.out.read_text())):
                assert self._process.poll() is None, self.out.read_text()
                await asyncio.sleep(0.1)
        return f"http://localhost:{found[1]}"

    def end(self) -> None:
        self._process.terminate()
        self._process.wait(20)
        self._file.close()


@pytest.mark.field
async def test_no_secret_leaves_its_place(tmp_path: Path) -> None:
    bridge = RosBridge(ros_version=1)
    port = await bridge.start("127.0.0.1", 0)
    bridge.advertise("/catvehicle/vel", "geometry_msgs/Twist")
    life = Life(tmp_path)
    try:
        base = await life.address()
        async with driving(bridge):
            secrets, answers = await _live(life, base, f"127.0.0.1:{port}")
    finally:
        life.end()
        await bridge.stop()
    assert len(secrets) >= 7
    output = life.out.read_text()
    for name, secret in secrets.items():
        assert not _stands_in(secret, output), f"{name} is printed"
        for path, text in answers.items():
            assert not _stands_in(secret, text), f"{name} is answered by {path}"
    _look_through(life.data, secrets)


async def _live(life: Life, base: str, car: str) -> tuple[dict[str, str], dict[str, str]]:
    """Pairs, drives, records, mails, is refused; the secrets and all that was answered."""
    printed = (await asyncio.to_thread(_invited, life.data)).stdout
    token = re.search(r"#pair=([\w-]+)", printed)
    pin = re.search(r"\b(\d{3}\s?\d{3})\b", printed)
    assert token is not None, printed
    answers: dict[str, str] = {}
    async with httpx.AsyncClient(base_url=base, headers={"Origin": base}, timeout=30) as phone:
        async with asyncio.timeout(10):
            while (
                paired := await phone.post("/api/pair", json={"token": token[1], "name": "Pixel"})
            ).status_code != 200:
                await asyncio.sleep(0.2)
        answers["/api/pair"] = paired.text
        cookie = next(iter(phone.cookies.jar))
        assert cookie.value is not None
        settings = {"host": "127.0.0.1", "port": 9, "security": "starttls", "user": "car", "password": MAIL_PASSWORD}
        answers["mail"] = (await phone.put("/api/mail/settings", json=settings | {"sender": "car@test.example"})).text
        answers["mail test"] = (await phone.post("/api/mail/test", json={})).text
        for typed in (f"ws://ros:{CAR_PASSWORD}@{car}", f"http://ros:{CAR_PASSWORD}@{car}", car):
            answers[f"connect {len(answers)}"] = (await phone.post("/api/connect", json={"address": typed})).text
        async with asyncio.timeout(15):
            while (await phone.get("/api/state")).json()["recording"]["state"] != "recording":
                await asyncio.sleep(0.1)
        answers["wrong key"] = (await phone.get("/api/state", headers={"Authorization": f"Bearer {VIEWER_KEY}x"})).text
        ticket = (await phone.post("/api/ticket")).json()["ticket"]
        answers["socket"] = await _page(base, ticket, f"{cookie.name}={cookie.value}", car)
        await asyncio.sleep(1.5)  # some of it is recorded
        answers["disconnect"] = (await phone.post("/api/disconnect")).text
        program = {"Authorization": f"Bearer {OPERATOR_KEY}"}
        described = (await phone.get("/openapi.json", headers=program)).json()
        for path, methods in described["paths"].items():
            if "get" in methods and "{" not in path:
                answers[path] = (await phone.get(path, headers=program)).text
        assert len(answers) > 25
    secrets = {
        "the operators' key": OPERATOR_KEY,
        "the viewers' key": VIEWER_KEY,
        "the mail password": MAIL_PASSWORD,
        "the car's password": CAR_PASSWORD,
        "the cookie": cookie.value,
        "the device's secret": re.split(r"[:.]", cookie.value.strip('"'))[1],
        "the token of the link": token[1],
        "the ticket": ticket,
    }
    return secrets | ({"the PIN": pin[1].replace(" ", "")} if pin else {}), answers


def _invited(data: Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", "server", "pair", "--data", str(data)],
        cwd=PROJECT, capture_output=True, text=True, check=True,
    )  # fmt: skip


async def _page(base: str, ticket: str, cookie: str, car: str) -> str:
    """What a page is sent while it connects, by an address with a password too."""
    got = []
    address = f"{base.replace('http', 'ws')}/ws?ticket={ticket}"
    async with websockets.connect(address, additional_headers={"Origin": base, "Cookie": cookie}) as socket:
        await socket.send('{"kind":"hello"}')
        for n, typed in enumerate((f"ros:{CAR_PASSWORD}@{car}", f"ws://{car}")):
            await socket.send(json.dumps({"kind": "connect", "id": str(n), "address": typed}))
        for _ in range(30):
            text = await socket.recv()
            got.append(text if isinstance(text, str) else text.decode("latin-1"))
            if '"offer"' in got[-1]:
                await socket.send('{"kind":"take"}')
    return "\n".join(got)


def _look_through(data: Path, secrets: dict[str, str]) -> None:
    """Every file, recordings unpacked; what is kept on purpose is for the server's user only."""
    looked = 0
    for path in sorted(data.rglob("*")):
        if not path.is_file():
            continue
        looked += 1
        place = path.relative_to(data).as_posix()
        texts = [path.read_bytes().decode("latin-1"), *_messages(path)]
        for name, secret in secrets.items():
            if not any(_stands_in(secret, text) for text in texts):
                continue
            assert place.startswith(KEEPS.get(secret, "nowhere")), f"{name} stands in {place}"
            assert stat.S_IMODE(path.stat().st_mode) == 0o600, f"{place} is not for its owner only"
    assert looked >= 5
    assert list(data.rglob("*.mcap")), "something was recorded"


def _messages(path: Path) -> list[str]:
    if path.suffix != ".mcap":
        return []
    with path.open("rb") as file:
        found: list[Any] = [message.data.decode("latin-1") for _, _, message in make_reader(file).iter_messages()]
    assert found
    return found


def _stands_in(secret: str, text: str) -> bool:
    if secret.isdigit():  # six digits stand in many a number
        return re.search(rf"(?<![\d.]){secret[:3]}\s?{secret[3:]}(?![\d.])", text) is not None
    return secret in text
