"""The one thread of a server that waits for the disk, so that the event loop never does."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from typing import TypeVar

log = logging.getLogger("catgraph.storage")
T = TypeVar("T")


class StorageThread:
    """Runs jobs one after the other, in the order of their submission."""

    def __init__(self) -> None:
        self._executor = ThreadPoolExecutor(1, "catgraph-storage")

    def submit(self, job: Callable[[], None]) -> None:
        """Queues a job whose end nobody waits for; what it raises is logged."""
        self._executor.submit(job).add_done_callback(_log_failure)

    async def run(self, job: Callable[[], T]) -> T:
        """Returns what the job returns, and raises what it raises. A cancelled caller leaves it to its end."""
        return await asyncio.wrap_future(self._executor.submit(job))

    def close(self) -> None:
        """Waits for all jobs. None can be queued afterwards: `submit` and `run` raise RuntimeError."""
        self._executor.shutdown()


def _log_failure(ended: Future[None]) -> None:
    if not ended.cancelled() and (error := ended.exception()) is not None:
        log.error("storage_job_failed error=%r", error, exc_info=error)
