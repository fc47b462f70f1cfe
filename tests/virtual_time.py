"""One clock for a whole story: the event loop's, which jumps to the next timer as soon as nothing else is to be done.

A test marked `virtual_time` runs on such a loop. `time.monotonic`, `time.time` and their `_ns` siblings show its time
too, so that parts without a clock of their own live by it. Sockets and threads are real: time stands still while bytes
wait to be read, and passes in real time while a job of a pool of threads is under way.

It is for stories in one process. What another process, a thread of its own or a person's eye sees stays in real time.
"""

from __future__ import annotations

import asyncio
import contextlib
import threading
import time
from collections.abc import AsyncIterator
from concurrent.futures import Executor, Future, ThreadPoolExecutor
from functools import partial
from typing import Any

import looptime
import pytest

NS_PER_S = 1_000_000_000


class _UnderWay(Executor):
    """Gives the loop a job that runs already, so that it counts as work of an executor of the loop."""

    def __init__(self, job: Future[Any]) -> None:
        self._job = job

    def submit(self, *_: Any, **__: Any) -> Future[Any]:
        return self._job


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
        submit = ThreadPoolExecutor.submit

        def noted(executor: ThreadPoolExecutor, work: Any, /, *args: Any, **options: Any) -> Future[Any]:
            job = submit(executor, work, *args, **options)
            if self._loop is not None and not self._loop.is_closed():
                self._loop.call_soon_threadsafe(partial(_wait_for, self._loop, job))
            return job

        monkeypatch.setattr(ThreadPoolExecutor, "submit", noted)


def _wait_for(loop: asyncio.AbstractEventLoop, job: Future[Any]) -> None:
    """Time passes as it really does until the job has ended."""
    loop.run_in_executor(_UnderWay(job), bool).add_done_callback(lambda ended: ended.cancelled() or ended.exception())


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
