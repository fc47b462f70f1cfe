"""The one thread of a server that waits for the disk, so that the event loop never does."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import Any, TypeVar

log = logging.getLogger("catgraph.storage")
T = TypeVar("T")


class StorageThread:
    """Runs jobs one after the other, in the order of their submission."""

    def __init__(self) -> None:
        self._executor = ThreadPoolExecutor(1, "catgraph-storage")
        self._under_way: set[Future[Any]] = set()

    @property
    def waiting(self) -> int:
        """How many jobs have not ended."""
        return len(self._under_way)

    def submit(self, job: Callable[[], None]) -> None:
        """Queue a job without waiting for it; its exceptions are logged."""
        self._submit(job).add_done_callback(_log_failure)

    async def run(self, job: Callable[[], T]) -> T:
        """Returns what the job returns, and raises what it raises. A cancelled caller leaves it to its end."""
        return await asyncio.wrap_future(self._submit(job))

    def close(self) -> None:
        """Waits for all jobs. None can be queued afterwards: `submit` and `run` raise RuntimeError."""
        self._executor.shutdown()

    def _submit(self, job: Callable[[], T]) -> Future[T]:
        future = self._executor.submit(job)
        self._under_way.add(future)
        future.add_done_callback(self._under_way.discard)
        return future


def _log_failure(ended: Future[None]) -> None:
    if not ended.cancelled() and (error := ended.exception()) is not None:
        log.error("storage_job_failed error=%r", error, exc_info=error)
