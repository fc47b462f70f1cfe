"""One command in the logs of the web node and of the agent: whole processes, and a real broker between."""

from __future__ import annotations

import asyncio
import json
import sys
from pathlib import Path
from typing import Any

import pytest

from server.access.order_signer import OrderSigner
from tests.http import http_client
from tests.server.bus.broker import running_broker

TRACE = "nightly-4711"


class Logged:
    """A server that logs as JSON; `lines` are those it wrote."""

    def __init__(self, *arguments: str) -> None:
        self._arguments = arguments
        self.lines: list[dict[str, Any]] = []
        self.address = ""

    async def __aenter__(self) -> Logged:
        options = ("--port", "0", "--log-format", "json", "--log-level", "info")
        self._process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "server", *self._arguments, *options),
            stdout=asyncio.subprocess.PIPE,
            stderr=asyncio.subprocess.PIPE,
        )
        out, err = self._process.stdout, self._process.stderr
        assert out is not None
        assert err is not None
        while "http" not in (line := (await out.readline()).decode()):
            assert line
        self.address = next(part for part in line.split() if part.startswith("http")).rstrip("/")
        self._reading = asyncio.gather(self._read(err), self._drain(out))
        return self

    async def __aexit__(self, *_: object) -> None:
        self._process.kill()
        await self._process.wait()
        await self._reading

    async def _read(self, err: asyncio.StreamReader) -> None:
        while line := await err.readline():
            self.lines.append(json.loads(line))

    async def _drain(self, out: asyncio.StreamReader) -> None:
        while await out.readline():
            pass

    async def of(self, trace: str) -> list[str]:
        """The messages about this command, once there are any."""
        while not (found := [line["message"] for line in self.lines if line.get("trace") == trace]):
            await asyncio.sleep(0.02)
        return found


@pytest.mark.timeout(60)
async def test_a_command_has_one_id_in_the_logs_of_node_and_agent(tmp_path: Path) -> None:
    async with running_broker() as broker:
        at = ("--broker", broker.address)
        agent = Logged("agent", *at, "--vehicle", "ocelot=ws://127.0.0.1:9", "--data", str(tmp_path / "agent"))
        node = Logged("web", *at, "--data", str(tmp_path / "node"))
        async with agent, node, http_client(base_url=node.address, params={"vehicle": "ocelot"}) as client:
            while not (state := await client.get("/api/state")).is_success:
                await asyncio.sleep(0.1)
            challenge = state.json()["server"]["challenge"]
            headers = OrderSigner().header({"kind": "pause"}, vehicle="ocelot", by="Ann", challenge=challenge)
            assert (await client.post("/api/pause", headers={**headers, "X-Catgraph-Trace": TRACE})).is_success
            assert (await client.post("/api/pause", headers={"X-Catgraph-Trace": "unsigned"})).status_code == 409
            async with asyncio.timeout(20):
                assert await agent.of(TRACE) == ["command kind=pause by=Ann ok=True reason="]
                (passed_on,) = await node.of(TRACE)
                assert passed_on.startswith("command_passed_on kind=pause")
                (refused,) = await agent.of("unsigned")
                assert refused.startswith("command_not_admitted vehicle=ocelot")
