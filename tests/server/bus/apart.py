"""A network of its own for the parts of a car, joined to this one by a cable that can lose everything.

Linux, as root.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import os
import shutil
import subprocess
from collections.abc import AsyncIterator
from dataclasses import dataclass

_numbers = itertools.count(os.getpid() % 4000 * 4)


@dataclass(frozen=True, slots=True)
class Apart:
    """`here`: this machine's address at the cable."""

    name: str
    here: str

    @property
    def within(self) -> tuple[str, ...]:
        """What runs a command in there."""
        return ("ip", "netns", "exec", self.name)

    async def swallow(self, for_s: float) -> None:
        """Nothing gets through in either direction, and no side is notified."""
        for where in ((), self.within):
            _run(*where, "tc", "qdisc", "add", "dev", self.name, "root", "blackhole")
        try:
            await asyncio.sleep(for_s)
        finally:
            for where in ((), self.within):
                _run(*where, "tc", "qdisc", "del", "dev", self.name, "root")

    async def read(self, *command: str) -> bytes:
        """What a command in there prints."""
        process = await asyncio.create_subprocess_exec(*self.within, *command, stdout=asyncio.subprocess.PIPE)
        out, _ = await process.communicate()
        assert process.returncode == 0, command
        return out


@contextlib.asynccontextmanager
async def apart() -> AsyncIterator[Apart | None]:
    """None where this machine does not allow it."""
    made = None
    with contextlib.suppress(subprocess.CalledProcessError):
        made = _make(next(_numbers) % 12_800)
    try:
        yield made
    finally:
        if made is not None:
            _run("ip", "netns", "del", made.name)


def _make(number: int) -> Apart | None:
    """Raises CalledProcessError; nothing is left then."""
    if os.geteuid() != 0 or shutil.which("ip") is None or shutil.which("tc") is None:
        return None
    name, subnet, host = f"cg{number}", f"10.{200 + number // 64 % 50}.{number // 3200}", number % 64 * 4
    here, there = f"{subnet}.{host + 1}", f"{subnet}.{host + 2}"
    _run("ip", "netns", "add", name)
    try:
        _run("ip", "link", "add", name, "type", "veth", "peer", "name", name, "netns", name)
        _run("ip", "addr", "add", f"{here}/30", "dev", name)
        _run("ip", "link", "set", name, "up")
        inside = ("ip", "-n", name)
        _run(*inside, "addr", "add", f"{there}/30", "dev", name)
        for device in ("lo", name):
            _run(*inside, "link", "set", device, "up")
        _run("tc", "qdisc", "add", "dev", name, "root", "blackhole")
        _run("tc", "qdisc", "del", "dev", name, "root")
    except subprocess.CalledProcessError:
        _run("ip", "netns", "del", name)
        raise
    return Apart(name, here)


def _run(*command: str) -> None:
    subprocess.run(command, check=True, capture_output=True)
