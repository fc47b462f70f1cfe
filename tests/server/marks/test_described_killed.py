"""kill -9 of a server while an intervention is described: what was answered last is what its recording has, once."""

from __future__ import annotations

import asyncio
import random
from pathlib import Path
from typing import Any

import httpx
import pytest

from server.recording.catalog import annotations as annotation_store
from server.recording.drive.facts import read_facts
from server.recording.folder import FINISHED
from server.recording.read.read import open_recording
from server.simulator.service import CarService
from tests.server.marks.test_marks_killed import served


async def intervention(client: httpx.AsyncClient) -> str:
    async with asyncio.timeout(60):
        while not (found := (await client.get("/api/state")).json()["mode"]["open"]):
            await asyncio.sleep(0.1)
    return str(found[0]["id"])


async def say(client: httpx.AsyncClient, id: str, words: str) -> bool:
    answer = await client.post(f"/api/interventions/{id}/describe", json={"what": words})
    return answer.status_code == 200


def described(folder: Path, id: str) -> list[tuple[str, int]]:
    """The descriptions of this intervention in each complete recording, and how often it is beside the file."""
    found = []
    for path in folder.iterdir():
        if path.name.endswith(FINISHED):
            with open_recording([path]) as recording:
                log = read_facts(recording).log
            beside = [row for row in annotation_store.read(path).described if row["intervention"] == id]
            found += [(one.what, len(beside)) for one in log.interventions if one.intervention == id] if log else []
    return found


@pytest.mark.field
@pytest.mark.slow
@pytest.mark.timeout(240)
async def test_what_was_answered_survives(tmp_path: Path) -> None:
    data, chance = tmp_path / "data", random.Random(1)
    service = CarService(scenarios=("manual-takeover@5+3",), seed=1)
    car = f"ws://127.0.0.1:{await service.start()}"
    answered: list[str] = []
    try:
        id = ""
        for kill in range(3):
            async with served(data, car) as (process, base), httpx.AsyncClient(base_url=base, timeout=30.0) as client:
                id = id or await intervention(client)
                for number in range(3):
                    if await say(client, id, f"{kill}.{number}"):
                        answered.append(f"{kill}.{number}")
                    await asyncio.sleep(chance.uniform(0.0, 0.4))
                process.kill()
        async with served(data, car):
            found: list[Any] = []
            async with asyncio.timeout(60):
                while [what for what, _ in found] != answered[-1:]:
                    await asyncio.sleep(0.5)
                    found = await asyncio.to_thread(described, data / "recordings" / "car", id)
        assert len(answered) == 9
        assert found == [("2.2", 1)]
    finally:
        await service.stop()
