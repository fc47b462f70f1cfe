"""kill -9 of a server while it is marked over HTTP and from a page: what was answered is there, and each once."""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import re
import subprocess
import sys
import time
from collections import Counter
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import httpx
import pytest
import websockets

from server.rosbridge_server.server import RosBridge
from tests.http import http_client
from tests.server.cars import driving
from tests.server.marks.marked_drive import WEBM, now_ms
from tests.server.marks.media_samples import VOICE
from tests.server.viewer import viewer
from tests.tree import PROJECT

PAUSE_S = 0.25  # a hundred rounds stay below the most marks of a drive, which goes on after each kill


@dataclass
class Answered:
    """What the server acknowledged."""

    marks: set[str] = field(default_factory=set)
    voices: set[str] = field(default_factory=set)


def started(data: Path, car: str, out: Path) -> subprocess.Popen[bytes]:
    with out.open("wb") as file:
        return subprocess.Popen(
            [sys.executable, "-m", "server", "serve", "--port", "0", "--data", str(data), "--vehicle", f"car={car}"],
            cwd=PROJECT,
            stdout=file,
            stderr=subprocess.STDOUT,
            env={name: value for name, value in os.environ.items() if name != "PYTHONASYNCIODEBUG"},
        )


@contextlib.asynccontextmanager
async def served(data: Path, car: str) -> AsyncIterator[tuple[subprocess.Popen[bytes], str]]:
    """`catgraph serve` as a process, and its address; killed where it still runs at the end."""
    out = data.parent / "out.txt"
    process = started(data, car, out)
    try:
        async with asyncio.timeout(60):
            while not (found := re.search(r"http://[^\s/]+:(\d+)", out.read_text())):
                assert process.poll() is None, out.read_text()
                await asyncio.sleep(0.05)
        base = f"http://127.0.0.1:{found[1]}"
        async with http_client(base_url=base) as client, asyncio.timeout(60):
            while True:
                with contextlib.suppress(httpx.HTTPError):
                    await client.get("/api/health")
                    break
                await asyncio.sleep(0.05)
        yield process, base
    finally:
        process.kill()
        process.wait()


async def mark_over_http(base: str, prefix: str, answered: Answered) -> None:
    """Until the server is gone; each third mark gets a voice note, and each is sent twice."""
    async with httpx.AsyncClient(base_url=base, timeout=10.0) as client:
        for number in range(100_000):
            mark = f"{prefix}-{number}"
            body = {"mark": mark, "at_ms": now_ms(), "words": mark}
            for _ in range(2):
                if (await client.post("/api/mark", json=body)).status_code == 200:
                    answered.marks.add(mark)
            await asyncio.sleep(PAUSE_S)
            if number % 3 == 0:
                voice = await client.post(f"/api/marks/{mark}/voice", content=VOICE, headers=WEBM)
                if voice.status_code == 200:
                    answered.voices.add(mark)


async def mark_from_page(base: str, prefix: str, answered: Answered) -> None:
    async with viewer(base) as page:
        for number in range(100_000):
            mark = f"{prefix}-page-{number}"
            if (await page.ask(kind="mark", mark=mark, at_ms=now_ms()))["ok"]:
                answered.marks.add(mark)
            await asyncio.sleep(PAUSE_S)


async def kill_often(bridge: RosBridge, data: Path, kills: int) -> Answered:
    answered, chance = Answered(), random.Random(kills)
    car = str(bridge.address)  # type: ignore[attr-defined]
    async with driving(bridge):
        for kill in range(kills):
            async with served(data, car) as (process, base):
                marking = [
                    asyncio.create_task(mark_over_http(base, f"m{kill}", answered)),
                    asyncio.create_task(mark_from_page(base, f"m{kill}", answered)),
                ]
                before = len(answered.marks)
                async with asyncio.timeout(60):
                    while len(answered.marks) < before + 3:
                        await asyncio.sleep(0.01)
                await asyncio.sleep(chance.uniform(0.0, 3.0))
                process.kill()
                process.wait()
                for task in marking:
                    task.cancel()
                for ended in await asyncio.gather(*marking, return_exceptions=True):
                    gone = (httpx.HTTPError, websockets.ConnectionClosed, asyncio.CancelledError, TimeoutError)
                    assert isinstance(ended, gone), ended
        async with served(data, car) as (_, base):
            await check(base, answered, within_s=60.0 + 2.0 * kills)
    return answered


async def check(base: str, answered: Answered, within_s: float) -> None:
    async with httpx.AsyncClient(base_url=base, timeout=60.0) as client:
        listed = (await client.get("/api/marks")).json()["marks"]
        times = Counter(row["mark"] for row in listed)
        assert answered.marks <= times.keys(), answered.marks - times.keys()
        assert set(times.values()) == {1}
        placed = Counter(event["mark"] for event in await log_of(client, "mark"))
        assert set(placed.values()) == {1}
        assert answered.voices <= {row["mark"] for row in listed if row["voice"]}
        in_recordings: Counter[str] = Counter()

        async def unsettled() -> str:
            """What is not yet as it must be; '': all is."""
            rows = (await client.get("/api/recordings", params={"limit": 200})).json()["recordings"]
            in_recordings.clear()
            for row in rows:
                found = (await client.get(f"/api/recordings/{row['id']}/marks")).json()["marks"]
                in_recordings.update(one["mark"] for one in found)
            # Those that a kill cut off are kept beside their recordings.
            if missing := answered.marks - in_recordings.keys():
                return f"in no recording: {sorted(missing)}"
            if twice := [mark for mark, count in in_recordings.items() if count != 1]:
                return f"in more than one recording: {sorted(twice)}"
            for mark in sorted(answered.voices):
                answer = await client.get(f"/api/marks/{mark}/voice")
                if answer.status_code != 200 or answer.content != VOICE:
                    return f"the voice of {mark} is answered with {answer.status_code}"
            return ""

        until_s = time.monotonic() + within_s
        while why := await unsettled():
            assert time.monotonic() < until_s, why
            await asyncio.sleep(0.5)
        assert in_recordings.keys() <= times.keys()


async def log_of(client: httpx.AsyncClient, change: str) -> list[dict[str, Any]]:
    found: list[dict[str, Any]] = []
    query: dict[str, Any] = {"limit": 500}
    while events := (await client.get("/api/log", params=query)).json()["events"]:
        found += [event for event in events if event["change"] == change]
        query["before"] = events[-1]["n"]
    return found


@pytest.mark.field
@pytest.mark.slow
@pytest.mark.timeout(240)
async def test_what_was_answered_survives(bridge: RosBridge, tmp_path: Path) -> None:
    await kill_often(bridge, tmp_path / "data", 2)


@pytest.mark.soak
@pytest.mark.timeout(5400)
async def test_what_was_answered_survives_a_hundred_kills(
    bridge: RosBridge, tmp_path: Path, record_property: Callable[[str, object], None]
) -> None:
    answered = await kill_often(bridge, tmp_path / "data", 100)
    record_property("marks that were answered", len(answered.marks))
    record_property("of them with a voice", len(answered.voices))
