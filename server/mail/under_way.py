"""The one mail that is being made or sent now, and how its task is waited for and ended."""

from __future__ import annotations

import asyncio
import contextlib
from dataclasses import dataclass, field
from typing import Any

from server.mail.smtp_connection import Connection

_BREAK_OFF_S = 10.0  # a cancelled mail that was handed over already waits so long for its answer


@dataclass(slots=True)
class Underway:
    """What is being made or sent now."""

    letter: int
    task: asyncio.Future[Any] = field(default_factory=lambda: asyncio.get_running_loop().create_future())
    share: float = 0.0
    connection: Connection | None = None
    over: asyncio.Event = field(default_factory=asyncio.Event)  # and what came of it is on the disk

    async def break_off(self) -> None:
        """End it and wait until that is on the disk; a mail that was handed over is waited for instead."""
        if self.connection is None or not self.connection.is_doubtful:
            self.task.cancel()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(_BREAK_OFF_S):
                await self.over.wait()


async def joined(task: asyncio.Future[Any]) -> None:
    """Wait for a task to end; a cancellation of the caller cancels the task too."""
    try:
        await asyncio.wait([task])
    except asyncio.CancelledError:
        await _ended(task)
        raise


async def _ended(task: asyncio.Future[Any]) -> None:
    """Cancel a task repeatedly, because wait_for of Python 3.11 (used by aiosmtplib) can swallow a cancellation."""
    while not task.done():
        task.cancel()
        await asyncio.wait([task], timeout=0.5)
