"""The reader and the writer of one page's socket, until the page leaves."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

from starlette.websockets import WebSocket, WebSocketDisconnect

log = logging.getLogger("catgraph.hub")

_GONE = (WebSocketDisconnect, RuntimeError, OSError)  # it left, perhaps while something was being sent


async def run(
    socket: WebSocket,
    *,
    read: Coroutine[Any, Any, None],
    write: Coroutine[Any, Any, None],
    leave: Callable[[], Awaitable[None]],
) -> None:
    """Runs until `read` ends; `leave` is called before the writer ends.

    A page whose writer failed gets nothing any more: it is closed, so that it connects again.
    """
    is_leaving = False
    writer = asyncio.create_task(write, name="page writer")
    reader = asyncio.create_task(read, name="page reader")

    def writer_ended(task: asyncio.Task[None]) -> None:
        if not is_leaving and (task.cancelled() or task.exception() is not None):
            error = None if task.cancelled() else task.exception()
            log.error("the writer of a page ended: %s", error or "it was cancelled", exc_info=error)
            reader.cancel()

    writer.add_done_callback(writer_ended)
    try:
        await reader
    except (WebSocketDisconnect, RuntimeError):
        pass
    except asyncio.CancelledError:
        if not writer.done():
            raise  # the server ends; else the writer failed, and the page shall connect again
        with contextlib.suppress(*_GONE):
            await socket.close(code=1011, reason="the server failed to send")
    finally:
        is_leaving = True
        reader.cancel()
        await leave()
        writer.cancel()
        with contextlib.suppress(asyncio.CancelledError, *_GONE):
            await writer
