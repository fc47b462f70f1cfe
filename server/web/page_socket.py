"""One page's connection, from its acceptance to its end: reads what the page sends, and has its parts act on it."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Callable
from typing import Any

import orjson
from starlette.websockets import WebSocket, WebSocketDisconnect

from server.access.identity import Principal
from server.bus.bus import PageBus
from server.protocol import commands, messages, replay_commands
from server.protocol.messages import Hello
from server.protocol.rate_limit import MAX_DEPTH, Allowance, Limits, nests_deeper
from server.protocol.state import ServerState
from server.replay.manager import ReplayManager
from server.replay.view_source import ViewSource
from server.web.cars_board import CarsBoard
from server.web.fair_wakeup import FairWakeup
from server.web.page_commands import PageCommands
from server.web.page_writer import PageWriter

log = logging.getLogger("catgraph.hub")

MAX_COMPLAINTS = 200  # a page that sends nothing sensible is closed
LONGEST_SLOW_DOWN = 400  # letters of an order to slow the car
GOING_AWAY = 1001  # a browser closes so when its page is closed, and not when its phone falls asleep (RFC 6455, 7.4.1)


class Page:
    """The socket of one page, and the parts that serve it."""

    def __init__(
        self,
        socket: WebSocket,
        bus: PageBus,
        vehicle: str,
        *,
        hello: Hello,
        principal: Principal,
        replays: ReplayManager,
        server: Callable[[], ServerState],
        limits: Limits,
        now: Callable[[], float],
        wakeup: FairWakeup,
        cars: CarsBoard,
        replay: replay_commands.OpenReplay | None = None,
    ):
        """`wakeup`: of all pages, for what is new to all. `replay`: the recording with which the page begins."""
        self._socket = socket
        self._bus = bus
        self._vehicle = vehicle
        self._hello = hello
        self._replay = replay
        self._now = now
        self._cars = cars
        self._view = view = ViewSource(
            bus,
            vehicle,
            replays,
            server=server,
            on_new=lambda kind: self._writer.on_replay(kind),
            on_turned=lambda: self._writer.on_turned(),
        )
        self._writer = PageWriter(socket, bus, vehicle, view, wakeup, now=now)
        self._commands = PageCommands(
            bus, vehicle, view, principal, limits, now=now, send=self._writer.queue, complain=self._complain
        )
        self._messages = Allowance(limits.messages, now())
        self._complaints = 0
        self._is_leaving = False

    @property
    def skipped(self) -> int:
        """Frames that were replaced by newer ones before this page took them."""
        return self._writer.skipped

    async def serve(self) -> None:
        """Runs until the page leaves."""
        unwatch = self._bus.watch(self._vehicle, self._writer.on_new)
        leave_cars = self._cars.watch(self._writer.on_new)
        writer = asyncio.create_task(self._writer.run(self._hello), name="page writer")
        reader = asyncio.create_task(self._read(), name="page reader")
        writer.add_done_callback(lambda task: self._writer_ended(task, reader))
        if self._replay is not None:
            self._commands.open_replay(self._replay)
        try:
            await reader
        except (WebSocketDisconnect, RuntimeError):
            pass  # it left, perhaps while something was being sent
        except asyncio.CancelledError:
            if not writer.done():
                raise  # the server ends; else the writer failed, and the page shall connect again
            with contextlib.suppress(WebSocketDisconnect, RuntimeError, OSError):
                await self._socket.close(code=1011, reason="the server failed to send")
        finally:
            self._is_leaving = True
            reader.cancel()
            unwatch()
            leave_cars()
            await self._commands.close()
            writer.cancel()
            with contextlib.suppress(asyncio.CancelledError, WebSocketDisconnect, RuntimeError, OSError):
                await writer
            self._writer.close()
            await self._view.leave()

    def _writer_ended(self, writer: asyncio.Task[None], reader: asyncio.Task[None]) -> None:
        """Closes a page that gets nothing any more, so that it connects again."""
        if self._is_leaving:
            return
        if writer.cancelled() or writer.exception() is not None:
            error = None if writer.cancelled() else writer.exception()
            log.error("the writer of a page ended: %s", error or "it was cancelled", exc_info=error)
            reader.cancel()

    async def _read(self) -> None:
        while self._complaints < MAX_COMPLAINTS and not self._writer.is_full:
            received = await self._socket.receive()
            if received["type"] == "websocket.disconnect":
                if received.get("code") == GOING_AWAY:
                    await self._commands.leave()
                return
            message = self._understood(received.get("text"))
            if message is not None:
                await self._obey(message)
        await self._socket.close(code=1008, reason="too many invalid messages")

    def _understood(self, text: str | None) -> dict[str, Any] | None:
        """A message of the page; None: it is none, and the page was sent why."""
        if not self._messages.takes(self._now()) and not _may_slow_down(text):
            self._complain("Too many messages at once.")
            return None
        try:
            return _parsed(text)
        except ValueError as why:
            self._complain(str(why))
            return None

    async def _obey(self, message: dict[str, Any]) -> None:
        match message.get("kind"):
            case "take":
                self._writer.take()
            case "have":
                self._writer.have_events()
            case "watch":
                self._writer.watch_scan(message.get("scan") is True)
            case "hello":
                await self._commands.begin(message)
                self._writer.begin(message.get("have_event"))
            case "present":
                await self._commands.present(message)
            case "replay":
                await self._commands.replay(message)
            case _:
                await self._commands.command(message)

    def _complain(self, reason: str) -> None:
        self._complaints += 1
        self._writer.queue(messages.problem(reason))


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
