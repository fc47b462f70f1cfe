"""Recordings of ours before the readers of MCAP's own people: whole, recovered after a kill, cut out."""

from __future__ import annotations

import asyncio
import json
import shutil
from pathlib import Path

import pytest
from mcap.reader import make_reader

from tests.http import http_client
from tests.page.processes import running, server, simulate
from tests.peers.conftest import Tally
from tests.peers.programs import output_of
from tests.server.recording.mcap import test_summary
from tests.server.recording.mcap.doctor import examined

READERS = Path(__file__).with_name("mcap_readers.mjs")
MAKES = {
    "closed": test_summary.closed_with_attachment,
    "killed": test_summary.killed,
    "cut out": test_summary.cut_out,
    "without messages": test_summary.without_messages,
}
ENOUGH = 300_000  # bytes of a recording of the simulated car: some seconds


async def driven(folder: Path, *, is_killed: bool) -> Path:
    """What a server recorded of a simulated car; where it was killed, as the next server recovered it."""
    data = folder / "data"
    async with running(*simulate()) as car, running(*server(data, car.address)) as watch:
        async with http_client(base_url=watch.address) as client, asyncio.timeout(90):
            await client.post("/api/record", json={"on": True})
            while sum(path.stat().st_size for path in _files(data)) < ENOUGH:
                await asyncio.sleep(0.2)
        await (watch.kill() if is_killed else watch.terminate())
    if is_killed:
        async with running(*server(data)) as watch, http_client(base_url=watch.address) as client, asyncio.timeout(90):
            while not (rows := (await client.get("/api/recordings")).json()["recordings"]):
                await asyncio.sleep(0.2)
            assert rows
    return max((path for path in _files(data) if path.suffix == ".mcap"), key=lambda path: path.stat().st_size)


def _files(data: Path) -> list[Path]:
    return [path for path in (data / "recordings").rglob("*") if path.is_file()]


async def made(kind: str, folder: Path) -> Path:
    if kind in MAKES:
        return await asyncio.to_thread(MAKES[kind], folder / "car_1.mcap")
    return await driven(folder, is_killed=kind == "driven, killed")


def counts(path: Path) -> dict[str, int]:
    """Messages of each topic, as the library of Python reads them."""
    found: dict[str, int] = {}
    with path.open("rb") as file:
        for _, channel, _ in make_reader(file).iter_messages():
            found[channel.topic] = found.get(channel.topic, 0) + 1
    return found


every_kind = pytest.mark.parametrize("kind", [*MAKES, "driven", "driven, killed"])


@every_kind
@pytest.mark.peers("@mcap/core")
@pytest.mark.timeout(300)
async def test_mcap_core_reads_it_forward_by_index_and_backward(kind: str, tally: Tally, tmp_path: Path) -> None:
    path = await made(kind, tmp_path)
    code, printed = await output_of(shutil.which("node") or "node", READERS, path, within_s=120)
    assert code == 0, printed[-2000:]
    found, true = json.loads(printed.splitlines()[-1]), counts(path)
    for way, order in (("forward", None), ("indexed", "grows"), ("backward", "falls")):
        tally.tried(max(sum(true.values()), 1))
        if found[way]["topics"] != true:
            tally.found(f"{kind}, {way}: {found[way]['topics']}, not {true}")
        if order and not found[way][order]:
            tally.found(f"{kind}, {way}: not in order of time")
    assert tally.unexplained == []
    assert found["isDone"]
    assert found["attachments"] == found["records"].get("Attachment", 0) == (1 if kind in ("closed", "killed") else 0)


@every_kind
@pytest.mark.peers("pymcap-cli")
@pytest.mark.timeout(300)
async def test_a_doctor_finds_nothing_wrong(kind: str, tally: Tally, tmp_path: Path) -> None:
    path = await made(kind, tmp_path)
    tally.tried()
    findings, summary = await asyncio.to_thread(examined, path)
    for one in findings:
        tally.found(f"{one['code']}: {kind}: {one}", kind, is_advice=one["severity"] == "info")
    assert tally.unexplained == []
    assert (summary["errors"], summary["complete"], summary["messages"]) == (0, True, sum(counts(path).values()))
