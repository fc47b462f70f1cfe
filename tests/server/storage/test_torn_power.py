"""Power is cut under load, at random moments: no event is lost that was shown, and no number is given twice."""

from __future__ import annotations

import asyncio
import contextlib
import json
import random
import sqlite3
import time
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.http import http_client
from tests.page.processes import Process, running, server, simulate
from tests.server.storage.torn_disk import mounted, torn_disk
from tests.server.viewer import Viewer, viewer

HURRY_S = 0.02  # between the changes of one operator
OPERATORS = 3


class Operators:
    """They change settings without a break: each change is an event, and an answer."""

    def __init__(self, address: str) -> None:
        self._address = address
        self.answered = 0
        self.waits_s: list[float] = []

    async def work(self, number: int) -> None:
        chance = random.Random(number)
        async with http_client(base_url=self._address) as client:
            while True:
                began_s = time.monotonic()
                values = {"speed_limit.max_mps": 20 + round(chance.uniform(0, 10), 2)}
                with contextlib.suppress(httpx.HTTPError):
                    answer = await client.patch("/api/settings", json={"values": values})
                    if answer.status_code == 200:
                        self.answered = max(self.answered, answer.json()["version"])
                        self.waits_s.append(time.monotonic() - began_s)
                await asyncio.sleep(HURRY_S)


def stored(data: Path) -> dict[int, dict[str, Any]]:
    """The log as the disk has it."""
    with contextlib.closing(sqlite3.connect(data / "events.sqlite")) as log:
        assert log.execute("PRAGMA integrity_check").fetchone() == ("ok",)
        if not log.execute("SELECT name FROM sqlite_master WHERE name = 'event'").fetchone():
            return {}
        return {n: json.loads(body) for n, body in log.execute("SELECT n, body FROM event")}


@pytest.mark.field
@pytest.mark.parametrize(
    "cuts",
    [
        pytest.param(5, marks=pytest.mark.timeout(600)),
        pytest.param(100, marks=[pytest.mark.soak, pytest.mark.timeout(7200)]),
    ],
)
async def test_what_was_shown_is_there_after_each_cut_and_goes_on_under_numbers_of_its_own(
    tmp_path: Path, cuts: int
) -> None:
    chance, lost, behind = random.Random(35), [], []
    with torn_disk(tmp_path) as disk:
        data = disk.folder / "data"
        async with running(*simulate()) as car, running(*server(data, car.address)) as one:
            operators = Operators(one.address)
            async with viewer(one.address, have_event=0) as page, asyncio.TaskGroup() as group:
                working = [group.create_task(operators.work(number)) for number in range(OPERATORS)]
                await page.until(lambda: len(page.events) > 10)
                for number in range(cuts):
                    await asyncio.sleep(chance.uniform(0.2, 2.0))
                    seen, answered = {event["n"]: event for event in page.events}, operators.answered
                    image = await asyncio.to_thread(disk.cut, tmp_path / "cut.img", number)
                    with mounted(image, tmp_path / f"cut {number}") as after:
                        left = await asyncio.to_thread(stored, after / "data")
                        lost.append(len([n for n, event in seen.items() if left.get(n) != event]))
                        versions = [event["settings_version"] for event in left.values()]
                        behind.append(max(0, answered - max(versions, default=0)))
                        if number in (0, cuts - 1) and not lost[-1]:
                            await goes_on(after / "data", page, seen)
                    image.unlink()
                for task in working:
                    task.cancel()
    waits_ms = sorted(1000 * wait_s for wait_s in operators.waits_s)
    p50_ms, p99_ms = (waits_ms[len(waits_ms) * percent // 100] for percent in (50, 99))
    print(f"{cuts} cuts of {len(page.events)} events: {lost} shown events lost, {behind} answered changes lost")
    print(f"answers: p50 {p50_ms:.0f} ms, p99 {p99_ms:.0f} ms")
    assert lost == [0] * cuts
    assert behind == [0] * cuts


async def goes_on(data: Path, page: Viewer, seen: dict[int, dict[str, Any]]) -> None:
    """A server on the copy: the page of before is sent what follows, under another run."""
    before = next(one["boot"] for one in page.other if one["kind"] == "hello")
    copied = Process(*server(data))
    try:
        await copied.start()
        async with http_client(base_url=copied.address) as client:
            params = {"after": max(seen), "run": before, "limit": 1000}
            answer = (await client.get("/api/events", params=params)).json()
        assert answer["run"] != before
        assert answer["resumed"]["common"] == max(seen)
        numbers = [event["n"] for event in answer["events"]]
        assert numbers == list(range(max(seen) + 1, max(seen) + 1 + len(numbers)))
    finally:
        await copied.kill()
