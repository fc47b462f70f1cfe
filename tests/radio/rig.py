"""A car and a server at one end of a radio, the page's own modules at the other; or a car and its agent at one end, a
broker and a web node at the other. All of it on this machine."""

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

from server.bus import broker_users
from tests.fleet import TODAY
from tests.page.processes import running, simulate
from tests.radio.seen import Seen
from tests.server.bus.broker import nats_server

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
async def brokered(air: Air, data: Path) -> AsyncIterator[str]:
    """The radio between an agent with its car and the broker with a web node; yields the node's host and port, for a
    page beside it. The agent logs each command into `data`/agent.log."""
    users: tuple[tuple[str, broker_users.Kind], ...] = (("ocelot", "agent"), ("room", "web"))
    for name, kind in users:
        (data / f"{name}.key").write_text(broker_users.add(data, name, kind, today=TODAY)[1])
    address = f"{air.net}.1:4222"
    (data / "broker.conf").write_text(f"listen: {address}\ninclude ./{broker_users.CONF}\n")

    def options(name: str) -> tuple[str, ...]:
        at_broker = ("--broker", f"nats://{address}", "--key", str(data / f"{name}.key"))
        return (*at_broker, "--port", "0", "--data", str(data / name), "--log-level", "info", "--log-format", "json")

    async with nats_at(air, data / "broker.conf"), running(*simulate(), within=air.within(1)) as car:
        agent = ("agent", *options("ocelot"), "--vehicle", f"ocelot={car.address}")
        node = ("web", *options("room"), "--expect", "ocelot")
        async with (
            running(*agent, within=air.within(1), log=data / "agent.log"),
            running(*node, within=air.within(0), log=data / "node.log") as at_room,
        ):
            await asyncio.sleep(SETTLES_S)
            yield at_room.shown


@contextlib.asynccontextmanager
async def nats_at(air: Air, conf: Path) -> AsyncIterator[None]:
    """A broker at the first end, once it is ready."""
    command = (*air.within(0), nats_server(), "-c", str(conf))
    with conf.with_suffix(".log").open("wb") as log:
        process = await asyncio.create_subprocess_exec(*command, stderr=log)
    try:
        async with asyncio.timeout(30):
            while b"Server is ready" not in conf.with_suffix(".log").read_bytes():
                await asyncio.sleep(0.05)
        yield
    finally:
        process.kill()
        await process.wait()


@contextlib.asynccontextmanager
async def page(air: Air, host: str, key: str, *, tree: Path = ROOT, end: int = 1, of: str = "") -> AsyncIterator[Seen]:
    """A page for the length of the block, and what it sees; `of`: the car, where it is to be named."""
    seen = Seen()
    node = shutil.which("node") or "node"
    script, address = Path(__file__).with_name("page.mjs"), f"ws://{host}/ws{of and f'?vehicle={of}'}"
    process = await asyncio.create_subprocess_exec(
        *(*air.within(end), node, str(script), str(tree), address, key),
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
