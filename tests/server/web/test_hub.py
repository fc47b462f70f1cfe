"""A page's hello over another connection ends its older one only where that waits for the page, and nothing in it."""

from __future__ import annotations

import asyncio
import json
import time
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from typing import Any, cast

import pytest
from starlette.websockets import WebSocket

from server.access.identity import LOCAL
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.protocol.messages import Hello
from server.protocol.rate_limit import Limits
from server.protocol.state import ServerState
from server.replay.manager import ReplayClient, ReplayManager
from server.web.hub import QUIET_S, Hub

pytestmark = pytest.mark.virtual_time

LONG_S = QUIET_S + 0.5  # a car's answer is waited for 3 s


class SlowTape(ReplayClient):
    """A replay that is never open, and whose opening takes a while to end."""

    is_over = False

    async def open(self, *_: Any) -> None:
        try:
            await asyncio.sleep(60.0)
        finally:
            await asyncio.sleep(1.0)
            self.is_over = True


class Tapes(ReplayManager):
    tape: SlowTape

    def _made(self, recording: str, _opening: Mapping[str, Any], on_new: Any) -> ReplayClient:
        self.tape = SlowTape(recording, now=self._now, on_new=on_new)
        return self.tape


class Socket:
    """What a page sends and gets."""

    def __init__(self) -> None:
        self._from_page = asyncio.Queue[dict[str, Any]]()
        self.got: list[dict[str, Any]] = []

    def sends(self, **message: object) -> None:
        self._from_page.put_nowait({"type": "websocket.receive", "text": json.dumps(message)})

    def ends(self) -> None:
        self._from_page.put_nowait({"type": "websocket.disconnect", "code": 1005})

    async def accept(self) -> None:
        pass

    async def close(self, **_: object) -> None:
        pass

    async def receive(self) -> dict[str, Any]:
        return await self._from_page.get()

    async def send_text(self, text: str) -> None:
        self.got.append(json.loads(text))


class Pages:
    """The pages of one hub, and its car, which takes long to carry out a pause, and to answer a status."""

    def __init__(self) -> None:
        self.tapes = Tapes(lambda _: None, now=time.monotonic)
        self.paused = 0
        self.bus = LocalBus(Journal(None), now=time.monotonic)
        self.bus.serve("car", self._car)
        self._hub = Hub(
            self.bus,
            replays=self.tapes,
            server=lambda: cast(ServerState, {}),
            limits=Limits(),
            now=time.monotonic,
            wall_ms=lambda: round(time.time() * 1000),
        )
        self.tasks: list[asyncio.Task[None]] = []

    async def _car(self, message: Mapping[str, Any]) -> Mapping[str, Any]:
        if message["kind"] in ("pause", "present"):
            await asyncio.sleep(LONG_S)
            self.paused += message["kind"] == "pause"
        return {"ok": True}

    def connect(self) -> Socket:
        """A connection of the same page."""
        socket, hello = Socket(), cast(Hello, {"kind": "hello"})
        serving = self._hub.serve(cast(WebSocket, socket), "car", lambda: hello, principal=LOCAL)
        self.tasks.append(asyncio.create_task(serving))
        socket.sends(kind="hello", page="page-ann", build="1")
        return socket

    @property
    def count(self) -> int:
        return self._hub.pages


@asynccontextmanager
async def serving_pages() -> AsyncIterator[Pages]:
    pages = Pages()
    try:
        yield pages
    finally:
        for task in pages.tasks:
            task.cancel()
        await asyncio.gather(*pages.tasks, return_exceptions=True)


def writers() -> int:
    return sum(task.get_name() == "page writer" for task in asyncio.all_tasks())


async def test_a_connection_that_ends_by_itself_is_not_interrupted() -> None:
    async with serving_pages() as pages:
        old = pages.connect()
        old.sends(kind="replay", do="open", recording="street", id="1")
        await asyncio.sleep(LONG_S)
        old.ends()
        await asyncio.sleep(0.1)
        pages.connect()
        await asyncio.sleep(0.1)
        assert not pages.tapes.tape.is_over
        await asyncio.sleep(2.0)
        assert pages.tapes.tape.is_over
        assert (pages.count, writers()) == (1, 1)


async def test_a_command_that_takes_long_is_carried_out_and_answered_over_the_connection_on_which_it_came() -> None:
    async with serving_pages() as pages:
        old = pages.connect()
        old.sends(kind="pause", id="1")
        await asyncio.sleep(LONG_S - 0.2)
        pages.connect()
        await asyncio.sleep(QUIET_S)
        assert pages.paused == 1
        assert [reply["ok"] for reply in old.got if reply.get("id") == "1"] == [True]
        assert pages.count == 2
        await asyncio.sleep(LONG_S)
        pages.connect()
        await asyncio.sleep(0.1)
        assert pages.count == 1, "those that wait for the page"


async def test_states_go_on_while_neither_a_status_nor_a_command_is_answered() -> None:
    async with serving_pages() as pages:
        page = pages.connect()
        await asyncio.sleep(0.1)
        page.sends(kind="present", visible=True, sound="ready", awake="ready")
        page.sends(kind="pause", id="1")
        for number in range(5):
            pages.bus.put("car", "state", f'{{"kind":"state","number":{number}}}')
            await asyncio.sleep(0.1)
            page.sends(kind="take", seq=number + 1)
            await asyncio.sleep(0.1)
        assert [message["number"] for message in page.got if message["kind"] == "state"] == [0, 1, 2, 3, 4]
