"""`catgraph replay` of real drives, before the clients that people have: every message of every topic arrives whole."""

from __future__ import annotations

import json
import shutil
import sys
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from tests.page.processes import running
from tests.peers.conftest import Tally
from tests.peers.messages import compared, recorded
from tests.peers.programs import output_of

HERE = Path(__file__).parent
RATE = "8"
DRIVES = {
    "ROS 1": "catvehicle_2016-06-01.bag",
    "ROS 2": "catvehicle_2016-06-01_mcap",
    "laser, ROS 1": "lidar/scan_tools_hokuyo_demo.bag",
}
every_drive = pytest.mark.parametrize("drive", DRIVES)
true_messages = cache(recorded)


async def listened(tally: Tally, recordings: Path, drive: str, *client: str) -> dict[str, Any]:
    """What a client printed that listened to a whole replay; what differs from the recording is found."""
    path = recordings / DRIVES[drive]
    if not path.exists():
        pytest.skip(f"no {path}")
    true = true_messages(path)
    async with running("replay", str(path), "--port", "0", "--wait", "--rate", RATE) as replay:
        port = replay.address.rpartition(":")[2]
        command = [part.replace("PORT", port) for part in client]
        code, printed = await output_of(*command, within_s=240)
    assert code == 0, printed[-2000:]
    found: dict[str, Any] = json.loads(printed.splitlines()[-1])
    tally.tried(sum(row["count"] for row in true.values()))
    for finding in [*compared(found["topics"], true), *found["statuses"]]:
        tally.found(f"{drive} {client[-1]}: {finding}")
    return found


def roslibjs(encoding: str) -> tuple[str, ...]:
    return (shutil.which("node") or "node", str(HERE / "bridge_client.mjs"), "PORT", encoding)


@every_drive
@pytest.mark.parametrize("encoding", ["none", "cbor", "png"])
@pytest.mark.peers("roslib")
@pytest.mark.timeout(300)
async def test_roslibjs_reads_a_drive(tally: Tally, recordings: Path, drive: str, encoding: str) -> None:
    await listened(tally, recordings, drive, *roslibjs(encoding))
    assert tally.unexplained == []
    assert tally.run > 100


@every_drive
@pytest.mark.peers("@foxglove/rosmsg")
@pytest.mark.timeout(300)
async def test_the_flow_of_foxgloves_player_reads_a_drive(tally: Tally, recordings: Path, drive: str) -> None:
    """Types from rosapi, the ROS version by `/rosout`, cbor-raw, and the readers of its own packages."""
    found = await listened(tally, recordings, drive, *roslibjs("cbor-raw"))
    assert tally.unexplained == []
    assert found["isRos2"] is (drive == "ROS 2")


@every_drive
@pytest.mark.peers("roslibpy")
@pytest.mark.timeout(300)
async def test_roslibpy_reads_a_drive(tally: Tally, recordings: Path, drive: str) -> None:
    await listened(tally, recordings, drive, sys.executable, str(HERE / "roslibpy_listener.py"), "PORT")
    assert tally.unexplained == []
