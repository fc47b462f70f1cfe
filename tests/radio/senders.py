"""Pages beside a web node that give orders over a radio, and the log of the agent: what became of each order."""

from __future__ import annotations

import asyncio
import contextlib
import json
import re
import shutil
from collections.abc import AsyncIterator
from dataclasses import dataclass
from datetime import datetime
from pathlib import Path
from typing import Any

from tests.radio.rig import ROOT, Air


@dataclass(frozen=True, kw_only=True)
class Order:
    """`answer`: what its page was answered; `final`: what it knew in the end. Times are ms since 1970."""

    id: str  # "": it was never sent
    what: str
    pressed_ms: float
    answer: str
    final: str
    known_ms: float
    reason: str


class Senders:
    def __init__(self, process: asyncio.subprocess.Process, count: int) -> None:
        self._process = process
        self._count = count
        self._given = 0
        self._changed = asyncio.Event()
        self.orders: list[Order] = []

    async def follow(self) -> None:
        assert self._process.stdout is not None
        while line := await self._process.stdout.readline():
            self.orders.append(Order(**json.loads(line)))
            self._changed.set()

    async def give(self, within_ms: int, *kinds: str) -> None:
        """Each gives one order within so long, of these kinds by turns."""
        assert self._process.stdin is not None
        self._given += self._count
        self._process.stdin.write(f"{within_ms} {' '.join(kinds)}\n".encode())
        await self._process.stdin.drain()

    async def known(self, within_s: float) -> None:
        """Until each knows what became of its order."""
        async with asyncio.timeout(within_s):
            while len(self.orders) < self._given:
                self._changed.clear()
                await self._changed.wait()


@contextlib.asynccontextmanager
async def senders(air: Air, host: str, count: int) -> AsyncIterator[Senders]:
    """So many pages in one program, at the node's end of the radio; each has a state of the car."""
    node = shutil.which("node") or "node"
    script = Path(__file__).with_name("senders.mjs")
    process = await asyncio.create_subprocess_exec(
        *(*air.within(0), node, str(script), str(ROOT), f"ws://{host}/ws?vehicle=ocelot", str(count)),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        cwd=ROOT,
    )
    assert process.stdout is not None
    reading = None
    try:
        async with asyncio.timeout(60):
            assert await process.stdout.readline() == b"ready\n"
        found = Senders(process, count)
        reading = asyncio.create_task(found.follow())
        yield found
    finally:
        process.kill()
        await process.wait()
        if reading is not None:
            await reading


def carried_out(log: Path) -> dict[str, float]:
    """The ids of the commands that the agent carried out, and when [ms since 1970]."""
    found: dict[str, float] = {}
    for line in log.read_text().splitlines():
        row: dict[str, Any] = json.loads(line) if line.startswith("{") else {}
        if re.match(r"command kind=.* ok=True ", row.get("message", "")):
            assert row["trace"] not in found, "carried out twice"
            found[row["trace"]] = datetime.fromisoformat(row["time"]).timestamp() * 1000
    return found
