"""A car and a server at one end of a radio, the page's own modules at the other; all of it on this machine."""

from __future__ import annotations

import asyncio
import contextlib
import os
import secrets
import shutil
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path

from tests.page.processes import running, simulate
from tests.radio.seen import Seen

ROOT = Path(__file__).parents[2]
IS_POSSIBLE = os.geteuid() == 0 and shutil.which("ip") is not None and Path("/dev/net/tun").exists()
SETTLES_S = 8.0  # a server that starts answers a dial late
WHY_NOT = "needs root, iproute2 and /dev/net/tun"


class Air:
    """A radio between two network namespaces."""

    def __init__(self, process: asyncio.subprocess.Process, net: str, ends: tuple[str, str]) -> None:
        self._process = process
        self.net = net
        self.ends = ends

    def within(self, end: int) -> tuple[str, ...]:
        return ("ip", "netns", "exec", self.ends[end])

    async def shape(self, line: str) -> float:
        """Changes the radio; returns when [ms since 1970]."""
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n".encode())
        await self._process.stdin.drain()
        return time.time() * 1000


@contextlib.asynccontextmanager
async def on_air(number: int, profile: str) -> AsyncIterator[Air]:
    """`number`: of this radio, 1 to 99, where several are open."""
    net, ends = f"10.77.{number}", (f"cat{os.getpid()}a{number}", f"cat{os.getpid()}b{number}")
    process = await asyncio.create_subprocess_exec(
        *(sys.executable, "-m", "tests.radio.radio", *ends, "--net", net, "--profile", profile),
        stdin=asyncio.subprocess.PIPE,
        stdout=asyncio.subprocess.PIPE,
        stderr=asyncio.subprocess.DEVNULL,
        cwd=ROOT,
    )
    try:
        assert process.stdout is not None
        assert (await process.stdout.readline()).strip() == b"ready"
        yield Air(process, net, ends)
    finally:
        process.terminate()
        await process.wait()


@contextlib.asynccontextmanager
async def serving(air: Air, data: Path, *, tree: Path = ROOT, car_end: int = 0) -> AsyncIterator[tuple[str, str]]:
    """A server of the project in `tree` before a car; yields its host and port, and the key of a program.

    `car_end` 0: the car is beside the server, the radio between server and page; 1: it is between car and server.
    """
    key = os.environ.setdefault("CATGRAPH_VIEWER_KEY", secrets.token_hex(20))
    host = "127.0.0.1" if car_end == 0 else f"{air.net}.2"
    async with running(*simulate("--host", host), folder=tree, within=air.within(car_end)) as car:
        arguments = ("serve", "--host", f"{air.net}.1", "--port", "8000", "--tls", "off", "--data", str(data))
        more = ("--vehicle", f"car={car.address}", "--no-worker")
        async with running(*arguments, *more, folder=tree, within=air.within(0)) as server:
            await asyncio.sleep(SETTLES_S)
            yield server.shown, key


@contextlib.asynccontextmanager
async def page(air: Air, host: str, key: str, *, tree: Path = ROOT, end: int = 1) -> AsyncIterator[Seen]:
    """A page for the length of the block, and what it sees."""
    seen = Seen()
    node = shutil.which("node") or "node"
    process = await asyncio.create_subprocess_exec(
        *(*air.within(end), node, str(Path(__file__).with_name("page.mjs")), str(tree), f"ws://{host}/ws", key),
        stdout=asyncio.subprocess.PIPE,
        cwd=ROOT,
    )
    assert process.stdout is not None

    async def follow() -> None:
        assert process.stdout is not None
        while line := await process.stdout.readline():
            seen.read(line.decode())

    reading = asyncio.create_task(follow())
    try:
        while not seen.begins_ms:
            await asyncio.sleep(0.02)
        yield seen
    finally:
        process.kill()
        await process.wait()
        await reading
