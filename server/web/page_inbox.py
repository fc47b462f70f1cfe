"""The reader and the writer of one page's socket, until the page leaves, and what the page sends, read with care.

A page sends a limited number of JSON objects; one that sends anything else is closed.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, Coroutine
from typing import Any

import orjson
from starlette.types import Message
from starlette.websockets import WebSocket, WebSocketDisconnect

from server.protocol import commands, messages
from server.protocol.rate_limit import MAX_DEPTH, Allowance, Limits, nests_deeper

log = logging.getLogger("catgraph.hub")
MAX_COMPLAINTS = 200  # a page that sends nothing sensible is closed
GOING_AWAY = 1001  # a browser closes so when its page is closed, and not when its phone falls asleep (RFC 6455, 7.4.1)
LONGEST_SLOW_DOWN = 400  # letters of an order to slow the car

_GONE = (WebSocketDisconnect, RuntimeError, OSError)  # it left, perhaps while something was being sent


class PageInbox:
    """Of one page. `send` queues a message to it."""

    def __init__(self, limits: Limits, *, now: Callable[[], float], send: Callable[[messages.ToPage], None]) -> None:
        self._allowance = Allowance(limits.messages, now())
        self._now = now
        self._send = send
        self._complaints = 0
        self._waits_s: float | None = None  # since when a message of the page is waited for

    @property
    def is_hopeless(self) -> bool:
        """Whether the page sent too many invalid messages."""
        return self._complaints >= MAX_COMPLAINTS

    @property
    def quiet_s(self) -> float:
        """How long the page has sent nothing; 0 while a message of it is handled, and once its connection ends."""
        return 0.0 if self._waits_s is None else self._now() - self._waits_s

    async def receive(self, socket: WebSocket) -> Message:
        """What the page sends next, or its end."""
        self._waits_s = self._now()
        try:
            return await socket.receive()
        finally:
            self._waits_s = None

    async def serve(
        self,
        socket: WebSocket,
        handle: Callable[[dict[str, Any]], Awaitable[None]],
        *,
        is_full: Callable[[], bool],
        finished: Callable[[], Awaitable[None]],
        on_leave: Callable[[], Awaitable[None]],
    ) -> None:
        """Hand each message of the page to `handle` until its connection ends.

        Closed is a page that sends too many invalid messages, or requests without reading replies (`is_full`).
        What came before the end is carried out (`finished`); `on_leave` is called where the browser closed the page.
        """
        while not self.is_hopeless and not is_full():
            received = await self.receive(socket)
            if received["type"] == "websocket.disconnect":
                await finished()
                if received.get("code") == GOING_AWAY:
                    await on_leave()
                return
            message = self.read(received.get("text"))
            if message is not None:
                await handle(message)
        await finished()
        await socket.close(code=1008, reason="too many invalid messages")

    def complain(self, reason: str) -> None:
        self._complaints += 1
        self._send(messages.problem(reason))

    def read(self, text: str | None) -> dict[str, Any] | None:
        """A message of the page; None: it is none, and the page was sent why."""
        if not self._allowance.takes(self._now()) and not _may_slow_down(text):
            self.complain("Too many messages at once.")
            return None
        try:
            return _parsed(text)
        except ValueError as why:
            self.complain(str(why))
            return None


def _parsed(text: str | None) -> dict[str, Any]:
    """The message in a frame of the page. Raises ValueError with a sentence for the page."""
    if text is None or len(text) > commands.MAX_COMMAND_BYTES:
        raise ValueError("A message must be text of at most 16 kB.")
    try:
        message = orjson.loads(text)
    except orjson.JSONDecodeError:
        raise ValueError("The message is not JSON.") from None
    if not isinstance(message, dict):
        raise ValueError("A message must be an object with a kind.")
    if nests_deeper(message, MAX_DEPTH):
        raise ValueError("The message is nested too deeply.")
    return message


def _may_slow_down(text: str | None) -> bool:
    """Whether a message beyond the allowance is read all the same: it may be an order to slow the car."""
    return text is not None and len(text) <= LONGEST_SLOW_DOWN and '"slow_down"' in text


async def run_tasks(
    socket: WebSocket,
    *,
    read: Coroutine[Any, Any, None],
    write: Coroutine[Any, Any, None],
    work: Coroutine[Any, Any, None],
    leave: Callable[[], Awaitable[None]],
) -> None:
    """Runs until `read` ends; `leave` is called before the writer ends, and before the carrying out of its commands.

    A page whose writer or whose `work` failed is closed, so that it connects again.
    """
    is_leaving = False
    others = (asyncio.create_task(write, name="page writer"), asyncio.create_task(work, name="page commands"))
    reader = asyncio.create_task(read, name="page reader")

    def ended(task: asyncio.Task[None]) -> None:
        if not is_leaving and (task.cancelled() or task.exception() is not None):
            error = None if task.cancelled() else task.exception()
            name = task.get_name().removeprefix("page ")
            log.error("the %s of a page ended: %s", name, error or "it was cancelled", exc_info=error)
            reader.cancel()

    for task in others:
        task.add_done_callback(ended)
    try:
        await reader
    except (WebSocketDisconnect, RuntimeError):
        pass
    except asyncio.CancelledError:
        if not any(task.done() for task in others):
            raise  # the server ends; else one of them failed, and the page shall connect again
        with contextlib.suppress(*_GONE):
            await socket.close(code=1011, reason="the server failed to send")
    finally:
        is_leaving = True
        reader.cancel()
        await leave()
        for task in others:
            task.cancel()
        await asyncio.gather(*others, return_exceptions=True)
