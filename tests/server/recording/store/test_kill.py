"""The real programs: an upload goes on after kill -9, and a web node serves what is in the store."""

from __future__ import annotations

import asyncio
import contextlib
import hashlib
import os
import re
import secrets
import signal
import sys
import time
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import httpx
import pytest
import tomli_w

from server.recording.store.names import PART_BYTES
from tests.server.bus.broker import running_broker
from tests.server.recording.store.s3 import BUCKET, S3, s3_server

ID = "ocelot_20260921T141320Z"
STORE = ("--store", f"s3://{BUCKET}/fleet")
pytestmark = pytest.mark.slow


@pytest.fixture
def s3() -> Iterator[S3]:
    with s3_server() as one:
        yield one


@contextlib.asynccontextmanager
async def program(s3: S3, *arguments: str) -> AsyncIterator[tuple[str, asyncio.subprocess.Process]]:
    """A command of catgraph; its address, and its process."""
    login = {"AWS_ACCESS_KEY_ID": "an-id", "AWS_SECRET_ACCESS_KEY": "a-secret", "AWS_ENDPOINT_URL": s3.endpoint}
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "server", *arguments, "--port", "0", *STORE),
        stdin=asyncio.subprocess.DEVNULL,
        stdout=asyncio.subprocess.PIPE,
        env={**os.environ, **login},
    )
    try:
        assert process.stdout is not None
        address = ""
        async with asyncio.timeout(60):
            while not address:
                line = (await process.stdout.readline()).decode()
                assert line, "it ended"
                address = found.group() if (found := re.search(r"http://[^\s/]+:\d+", line)) else ""
        yield address, process
    finally:
        with contextlib.suppress(ProcessLookupError):
            process.terminate()
        await process.communicate()


def made(data: Path, parts: int) -> bytes:
    """A car's folder with one large file, whose rule is to upload it."""
    content = secrets.token_bytes(PART_BYTES * (parts - 1) + 12_345)
    folder = data / "recordings" / "ocelot"
    folder.mkdir(parents=True)
    (folder / f"{ID}.mcap").write_bytes(content)
    (data / "settings").mkdir()
    settings = {"version": 1, "limits": {"store": {"whole_files": 2.0, "rate_mb_s": 1000.0}}}
    (data / "settings" / "ocelot.toml").write_text(tomli_w.dumps(settings))
    return content


async def until_stored(client: httpx.AsyncClient, address: str) -> dict[str, object]:
    async with asyncio.timeout(90):
        while True:
            (row,) = (await client.get(f"{address}/api/recordings")).json()["recordings"]
            if row["stored"]["state"] == "stored":
                found: dict[str, object] = row["stored"]
                return found
            await asyncio.sleep(0.1)


@pytest.mark.field
async def test_kill_9_in_the_middle_sends_no_finished_part_again_and_a_node_serves_the_file(
    tmp_path: Path, s3: S3
) -> None:
    content = made(tmp_path / "car", parts=4)
    async with running_broker() as broker, httpx.AsyncClient(timeout=20) as client:
        at = ("--broker", broker.address)
        agent = ("agent", *at, "--vehicle", "ocelot=ws://127.0.0.1:9", "--data", str(tmp_path / "car"))
        s3.delay_s = lambda method, path: 1.0 if method == "PUT" and "part-" in path else 0.0
        async with program(s3, *agent) as (_, process), asyncio.timeout(90):
            while len(s3.sent("part-")) < 2:
                await asyncio.sleep(0.02)
            await asyncio.sleep(0.5)  # the second is noted, the third is on its way
            process.send_signal(signal.SIGKILL)
            await process.wait()
        before = s3.sent("part-")
        s3.delay_s = lambda method, path: 0.0
        node = ("web", *at, "--data", str(tmp_path / "node"))
        async with program(s3, *node) as (node_address, _):
            async with program(s3, *agent) as (address, _):
                copy = await until_stored(client, address)
                assert time.time() * 1000 - float(str(copy["checked_ms"])) < 60_000
                health = (await client.get(f"{address}/api/health")).json()
                assert health["status"] == "ok"
                async with asyncio.timeout(30):
                    while len(s3.sent("catalogue")) < 2:
                        await asyncio.sleep(0.05)
                await asked_through_node(client, node_address)
            after = s3.sent("part-")[len(before) :]
            assert [key[-5:] for key in before[:2]] == ["00001", "00002"]
            assert {key[-5:] for key in after} <= {"00003", "00004"}
            assert whole(s3) == hashlib.sha256(content).digest()
            await served_by_node(client, node_address, content)  # the agent is gone


async def asked_through_node(client: httpx.AsyncClient, address: str) -> None:
    """The agent answers a page of the node."""
    at = f"{address}/agents/ocelot/api/recordings"
    (row,) = (await client.get(at)).json()["recordings"]
    assert row["stored"]["state"] == "stored"
    answer = await client.post(f"{at}/{ID}/store", json={"delete": False})
    assert (answer.status_code, answer.json()["state"]) == (202, "stored")
    assert (await client.delete(f"{at}/{ID}/store")).json()["is_asked"] is False


def whole(s3: S3) -> bytes:
    """The digest of what a person with an S3 client joins."""
    parts = sorted(key for key in s3.keys() if f"/{ID}.mcap.part-" in key)
    return hashlib.sha256(b"".join(s3.keys()[key] for key in parts)).digest()


async def served_by_node(client: httpx.AsyncClient, address: str, content: bytes) -> None:
    (row,) = (await client.get(f"{address}/api/stored")).json()["recordings"]
    assert (row["id"], row["vehicle"], row["size_bytes"]) == (ID, "ocelot", len(content))
    answer = await client.get(f"{address}/api/stored/ocelot/{ID}/file")
    assert f"{ID}.mcap" in answer.headers["content-disposition"]
    assert answer.content == content
    for path, status in (
        (f"/api/stored/ocelot/{ID}x/file", 404),
        (f"/api/stored/ocelot/{ID}/clips/none.mcap", 404),
        ("/api/stored?cursor=none", 409),
    ):
        refused = await client.get(address + path)
        assert refused.status_code == status
        assert refused.json()["detail"].endswith(".")
    assert (await client.post(f"{address}/agents/ocelot/api/recordings/{ID}/store")).status_code == 503
