"""Servers, bridges and cars as the processes they are in the field: started, frozen, killed, started again."""

from __future__ import annotations

import asyncio
import contextlib
import os
import re
import signal
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path

import psutil

from tests.http import http_client
from tests.through_broker import NODE

IS_PARTED = bool(os.environ.get("CATGRAPH_THROUGH_BROKER"))  # a server is an agent, a broker and a web node


UNHURRIED = """[limits.link_late]
late_s = 10.0
critical_s = 20.0

[limits.signals]
slow_below_percent = 10.0
"""

STARTS_WITHIN_S = 180.0  # any process, on a busy machine: no test is about this limit

AT_AGENT = "/agents/car" if IS_PARTED else ""  # what stands before addresses of the recordings and the mail of a car


def page_data(data: Path) -> Path:
    """The folder with what belongs to the pages of a server, as who is paired."""
    return data / NODE if IS_PARTED else data


class Process:
    """One `python -m server …`, of the project in `folder` where one is given; `address` is what it printed."""

    def __init__(
        self,
        *arguments: str,
        module: str = "server",
        folder: Path | None = None,
        within: tuple[str, ...] = (),
        log: Path | None = None,
    ) -> None:
        """`within`: a command that runs another one, as in a network of its own; `log`: gets what it logs."""
        self._log = log
        self._given = module
        self._within = within
        self._arguments = arguments
        self._folder = folder
        self._process: asyncio.subprocess.Process | None = None
        self._reader: asyncio.Task[None] | None = None
        self.address = ""
        self.console = ""  # for a program beside the car: the agent's own address, where a server is parted

    @property
    def _modules(self) -> tuple[str, ...]:
        """The one that is started, and the one that it starts as agent and node."""
        is_parted = IS_PARTED and self._arguments[0] == "serve"
        return ("tests.through_broker", self._given) if is_parted else (self._given,)

    async def start(self) -> Process:
        """Starts it and waits until it prints its address."""
        with contextlib.ExitStack() as files:
            self._process = await asyncio.create_subprocess_exec(
                *(*self._within, sys.executable, "-m", *self._modules, *self._arguments),
                stdin=asyncio.subprocess.PIPE,
                stdout=asyncio.subprocess.PIPE,
                stderr=files.enter_context(self._log.open("ab")) if self._log else asyncio.subprocess.DEVNULL,
                cwd=self._folder,
                env={key: value for key, value in os.environ.items() if key != "PYTHONASYNCIODEBUG"},
            )
        out = self._process.stdout
        assert out is not None
        async with asyncio.timeout(STARTS_WITHIN_S):
            while True:
                line = (await out.readline()).decode()
                assert line, f"{self._arguments} ended before it printed its address"
                if at_agent := re.match(r"console at (\S+)", line):
                    self.console = f"http://{at_agent[1]}"
                elif found := re.search(r"(?:ws|https?)://[^\s/]+:\d+", line):
                    self.address = found.group()
                    self.console = self.console or self.address
                    break
        self._reader = asyncio.create_task(self._drain(out))
        return self

    @property
    def shown(self) -> str:
        """`host:port`."""
        return self.address.split("//")[1]

    async def type(self, line: str) -> None:
        """Types a line on its terminal."""
        assert self._process is not None
        assert self._process.stdin is not None
        self._process.stdin.write(f"{line}\n".encode())
        await self._process.stdin.drain()

    def freeze(self) -> None:
        """As a process that is stopped: its port still accepts, nothing answers."""
        self._send(signal.SIGSTOP)

    def thaw(self) -> None:
        self._send(signal.SIGCONT)

    async def terminate(self) -> float:
        """As a service manager ends it; answers how long it took [s]."""
        assert self._process is not None
        began_s = time.monotonic()
        self._process.terminate()
        await asyncio.wait_for(self._process.wait(), 60)
        return time.monotonic() - began_s

    async def kill(self) -> None:
        """At once; nothing happens where it never began."""
        if self._process is None:
            return
        with contextlib.suppress(ProcessLookupError):
            self._process.kill()
        await self._process.wait()
        if self._reader is not None:
            self._reader.cancel()

    def _send(self, what: signal.Signals) -> None:
        assert self._process is not None
        for part in psutil.Process(self._process.pid).children(recursive=True):  # where it is several
            part.send_signal(what)
        self._process.send_signal(what)

    @staticmethod
    async def _drain(out: asyncio.StreamReader) -> None:
        while await out.readline():
            pass


@contextlib.asynccontextmanager
async def running(
    *arguments: str,
    module: str = "server",
    folder: Path | None = None,
    within: tuple[str, ...] = (),
    log: Path | None = None,
) -> AsyncIterator[Process]:
    """A process for the length of the block."""
    process = Process(*arguments, module=module, folder=folder, within=within, log=log)
    try:
        yield await process.start()
    finally:
        await process.kill()


def server(data: Path, vehicle: str | None = None, port: int = 0, *, is_hurried: bool = False) -> tuple[str, ...]:
    """Arguments of a server; with a `vehicle` it dials from the start.

    It does not mind a machine that halts: messages may be late, and few of them come. What it judges so is not what
    the test is about, and a dialog of it would cover what the test presses. `is_hurried`: its limits are the defaults.
    """
    settings = data / "settings" / "car.toml"
    if not is_hurried and not settings.exists():
        settings.parent.mkdir(parents=True, exist_ok=True)
        settings.write_text(UNHURRIED)
    dial = ("--vehicle", f"car={vehicle}") if vehicle else ()
    return ("serve", "--port", str(port), "--data", str(data), *dial)


def simulate(*options: str, port: int = 0) -> tuple[str, ...]:
    return ("simulate", "--port", str(port), *options)


Drive = tuple[Process, Process]  # a car and a server that watches it


@contextlib.asynccontextmanager
async def driving(data: Path) -> AsyncIterator[Drive]:
    """A simulated car and a server that watches it."""
    async with running(*simulate()) as car, running(*server(data, car.address)) as watch:
        yield car, watch


async def watching(watch: Process, address: str) -> Process:
    """The server, newly connected to a car: nothing is acknowledged."""
    async with http_client(base_url=watch.address) as client:
        await client.post("/api/disconnect")
        await client.post("/api/connect", json={"address": address})
    return watch


def replay(path: Path, *options: str, port: int = 0) -> tuple[str, ...]:
    return ("replay", str(path), "--port", str(port), "--loop", *options)
