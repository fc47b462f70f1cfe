"""The server itself stands still for a while, as on a computer that swaps: that is no silence of the car."""

from __future__ import annotations

import asyncio
import re
from pathlib import Path
from typing import Any

import httpx
import pytest

from tests.page.drives import steady
from tests.page.processes import replay, running, server


@pytest.mark.field
async def test_a_server_that_stood_still_reports_that_and_does_not_blame_the_car(tmp_path: Path) -> None:
    drive = steady(tmp_path / "slow.bag", 4.2)
    async with running(*replay(drive)) as car, running(*server(tmp_path / "data", car.address)) as watch:
        async with httpx.AsyncClient(base_url=watch.address, timeout=20) as client:

            async def log() -> list[dict[str, Any]]:
                return list((await client.get("/api/log.json")).json())

            async with asyncio.timeout(20):
                while (await client.get("/api/state")).json()["signals"]["speed"]["freshness"] != "fresh":
                    await asyncio.sleep(0.1)
            await asyncio.sleep(3.5)  # the grace of a new link is over
            before = len(await log())
            watch.freeze()
            await asyncio.sleep(3.0)
            watch.thaw()
            async with asyncio.timeout(20):
                while not any(event["change"] == "stalled" for event in (await log())[before:]):
                    await asyncio.sleep(0.1)
            await asyncio.sleep(1.5)
            after = (await log())[before:]
        texts = [event["text"] for event in after if event["change"] == "stalled"]
        assert len(texts) == 1, after
        assert re.fullmatch(r"The server stalled for [23]\.\d s: nothing was evaluated meanwhile\.", texts[0])
        assert [event["title"] for event in after if event["alarm"]] == []
