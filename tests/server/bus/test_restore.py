"""The data folder of an agent, copied and put back: a web node goes on with the car as it was (docs/guide/fleet.md)."""

from __future__ import annotations

import asyncio
import shutil
from pathlib import Path

import pytest

from tests.http import http_client
from tests.server.bus.fleet_parts import journal_of, parts, settled

pytestmark = [pytest.mark.slow, pytest.mark.timeout(120)]
LIMIT_MPS = 17.25


@pytest.mark.field
async def test_an_agent_restored_from_a_copy_goes_on_where_the_copy_ends(tmp_path: Path) -> None:
    """It is killed first, so that the copy is of a folder that nobody closed."""
    data, kept = tmp_path / "ocelot", tmp_path / "kept"
    async with parts(tmp_path) as (_, made):
        await settled(made)
        agent, node = made["agent"], made["room-1"]
        async with http_client(base_url=node.process.address, params={"vehicle": "ocelot"}) as client:
            limit = {"values": {"speed_limit.max_mps": LIMIT_MPS}}
            assert (await client.patch("/api/settings", json=limit)).is_success
            async with asyncio.timeout(20):
                while not (recorded := [*data.glob("recordings/ocelot/*")]):
                    await asyncio.sleep(0.1)
            before = await journal_of(agent)
            await agent.process.kill()
            shutil.copytree(data, kept)
            shutil.rmtree(data)
            shutil.copytree(kept, data)
            await agent.again()
            await settled(made)
            after = await journal_of(agent)
            assert after[: len(before)] == before
            assert [event["n"] for event in after] == list(range(1, len(after) + 1))
            settings = (await client.get("/api/settings")).json()
            assert settings["values"]["speed_limit.max_mps"] == LIMIT_MPS
    names = {path.name.split(".")[0] for path in data.glob("recordings/ocelot/*")}
    assert {path.name.split(".")[0] for path in recorded} <= names
