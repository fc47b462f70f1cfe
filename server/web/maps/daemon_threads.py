"""A few threads for work that may hang on a network: unlike a pool's they keep no server from ending."""

from __future__ import annotations

import asyncio
import queue
import threading
from collections.abc import Awaitable, Callable
from typing import Any, TypeVar

T = TypeVar("T")
_Work = tuple[Callable[[], Any], "asyncio.Future[Any]"]


class DaemonThreads:
    """So many pieces of work at a time; what hangs is left to hang."""

    def __init__(self, count: int) -> None:
        self._work: queue.SimpleQueue[_Work | None] = queue.SimpleQueue()
        self._count = count
        self._threads: list[threading.Thread] = []

    def do(self, work: Callable[[], T]) -> Awaitable[T]:
        """Has it done by a thread; the threads begin with the first piece."""
        if not self._threads:
            self._threads = [
                threading.Thread(target=self._run, daemon=True, name="map tiles") for _ in range(self._count)
            ]
            for thread in self._threads:
                thread.start()
        answer: asyncio.Future[T] = asyncio.get_running_loop().create_future()
        self._work.put((work, answer))
        return answer

    def close(self) -> None:
        """Each thread ends after what it is at."""
        for _ in self._threads:
            self._work.put(None)

    def _run(self) -> None:
        while (one := self._work.get()) is not None:
            work, answer = one
            found: Any = None
            failed: BaseException | None = None
            try:
                found = work()
            except BaseException as why:  # it is raised in the caller
                failed = why
            loop = answer.get_loop()
            if not loop.is_closed():
                loop.call_soon_threadsafe(_resolve, answer, found, failed)


def _resolve(answer: asyncio.Future[Any], found: Any, failed: BaseException | None) -> None:
    if answer.done():
        return
    if failed is not None:
        answer.set_exception(failed)
    else:
        answer.set_result(found)
