"""One clock for a whole story: the event loop's, which jumps to the next timer as soon as nothing else is to be done.

A test marked `virtual_time` runs on such a loop. `time.monotonic`, `time.time` and their `_ns` siblings show its time
too, so that parts without a clock of their own live by it. Sockets and threads are real: time stands still while bytes
wait to be read, and passes in real time while work of an executor of the loop is under way.

It is for stories in one process. What another process, a thread of its own or a person's eye sees stays in real time.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import AsyncIterator

import looptime
import pytest

NS_PER_S = 1_000_000_000


class VirtualClock:
    """The clock of one test. `new_event_loop` makes the loop that moves it; before that it is the real one."""

    def __init__(self) -> None:
        self._began_s = time.monotonic()
        self._began_wall_ns = time.time_ns()
        self._loop: asyncio.AbstractEventLoop | None = None

    def new_event_loop(self) -> asyncio.AbstractEventLoop:
        self._loop = looptime.new_event_loop(start=self._began_s)
        return self._loop

    def monotonic(self) -> float:
        return self._began_s if self._loop is None else self._loop.time()

    def monotonic_ns(self) -> int:
        return round(self.monotonic() * NS_PER_S)

    def time_ns(self) -> int:
        return self._began_wall_ns + round((self.monotonic() - self._began_s) * NS_PER_S)

    def time(self) -> float:
        return self.time_ns() / NS_PER_S

    def install(self, monkeypatch: pytest.MonkeyPatch) -> None:
        """The functions of `time` show this clock from now on."""
        for name in ("monotonic", "monotonic_ns", "time", "time_ns"):
            monkeypatch.setattr(time, name, getattr(self, name))


@contextlib.asynccontextmanager
async def real_time() -> AsyncIterator[None]:
    """Time passes as it really does: for a block that waits for a process or for a thread of its own."""
    ended = threading.Event()
    job = asyncio.get_running_loop().run_in_executor(None, ended.wait)
    try:
        yield
    finally:
        ended.set()
        await job
