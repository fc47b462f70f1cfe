"""At a web node: replays that run at an agent, in the place of those of this machine."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from urllib.parse import urlencode

import orjson

from server.access.identity import Role
from server.bus import nats_http as http
from server.bus.bus import NotServed
from server.bus.nats_http_node import BrokeOff, HttpNode, new_id
from server.replay.manager import ENDED, NoReplay, ReplayClient, ReplayManager, ReplaySource
from server.replay.protocol import MOST_BYTES
from server.web.agents.kept import REPLAYS

MOST = 100  # of all pages of a node; each agent has its own limit
LOST_S = 12.0  # a replay whose agent is silent for so long is over: soon the agent closes it
LEAST_S = 0.03  # between two questions
RETRY_S = 0.5


class RemoteReplay(ReplayClient):
    """One page's replay at the agent of the vehicle that the page shows."""

    def __init__(
        self, node: HttpNode, vehicle: str, recording: str, *, now: Callable[[], float], on_new: Callable[[str], None]
    ) -> None:
        super().__init__(recording, now=now, on_new=on_new)
        self._node = node
        self._vehicle = vehicle
        self._theirs: str | None = None  # the agent's token of it
        self._have = {"state": 0, "scan": 0, "timeline": 0}  # by the agent's numbers
        self._following: asyncio.Task[None] | None = None
        self._sending: set[asyncio.Task[Any]] = set()

    async def open(self, source: ReplaySource | None, opening: Mapping[str, Any]) -> None:
        """Has the agent open it and waits for its first state. Raises NoReplay."""
        before = self.instead
        query = {"instead": before._theirs} if isinstance(before, RemoteReplay) and before._theirs is not None else {}
        body = {"recording": self.recording, "opening": dict(opening)}
        found = await self._json("POST", "", body, urlencode(query))
        self._theirs = str(found["token"])
        self._source = ReplaySource(path=Path(), vehicle=str(found["vehicle"]), title=str(found["title"]))
        self._following = asyncio.create_task(self._follow(), name=f"replay of {self.recording}")
        await self._until_ready()

    async def close(self) -> None:
        theirs, self._theirs = self._theirs, None
        tasks = [*self._sending, *([self._following] if self._following is not None else [])]
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
        if theirs is not None:
            with contextlib.suppress(NoReplay, TimeoutError):
                async with asyncio.timeout(1.0):
                    await self._json("DELETE", f"/{theirs}")
        self._let_go()

    async def ask(self, order: Mapping[str, Any]) -> dict[str, Any]:
        if self.failed is not None or self._theirs is None:
            raise NoReplay(self.failed or "This replay is over.")
        return await self._json("POST", f"/{self._theirs}/ask", order)

    def watch_scan(self, is_wanted: bool) -> None:
        self._send_soon({"kind": "scan", "wanted": is_wanted})

    def pass_gaps(self, is_wanted: bool) -> None:
        self._send_soon({"kind": "pass_gaps", "wanted": is_wanted})

    def _send_soon(self, order: Mapping[str, Any]) -> None:
        if self.failed is None:
            task = asyncio.create_task(self._send(order))
            self._sending.add(task)
            task.add_done_callback(self._sending.discard)

    async def _send(self, order: Mapping[str, Any]) -> None:
        with contextlib.suppress(NoReplay):
            await self.ask(order)

    async def _json(
        self, method: str, rest: str, body: Mapping[str, Any] | None = None, query: str = ""
    ) -> dict[str, Any]:
        """Raises NoReplay."""
        status, raw = await self._call(method, rest, b"" if body is None else orjson.dumps(body), query)
        try:
            found = orjson.loads(raw)
        except orjson.JSONDecodeError:
            raise NoReplay(ENDED) from None
        if status != 200 or not isinstance(found, dict):
            raise NoReplay(str(found.get("detail") or ENDED) if isinstance(found, dict) else ENDED)
        return found

    async def _call(self, method: str, rest: str, body: bytes = b"", query: str = "") -> tuple[int, bytes]:
        """Raises NoReplay."""
        begin = http.Begin(
            id=new_id(),
            method=method,
            path=f"{REPLAYS}{rest}",
            query=query,
            headers={"content-type": "application/json"},
            sender=http.Sender(id=f"replay {self.token}", role=Role.VIEWER.value),
        )
        raw = bytearray()
        try:
            async with self._node.call(self._vehicle, begin, body) as answer:
                async for chunk in answer.chunks:
                    raw += chunk
                    if len(raw) > MOST_BYTES:
                        raise NoReplay(ENDED)
                return answer.status, bytes(raw)
        except (NotServed, BrokeOff, http.Refused) as why:
            text = str(why).rstrip(".")
            raise NoReplay(f"{text[:1].upper()}{text[1:]}.") from None

    # -- frames --------------------------------------------------------------------------------------------------------

    async def _follow(self) -> None:
        """The newest frames, one answer after the other."""
        while self.failed is None:
            try:
                status, raw = await self._call("GET", f"/{self._theirs}", query=urlencode(self._have))
                if status != 200:
                    self._fail("This replay is over.")
                    return
                self._read_frames(raw)
            except NoReplay as why:
                if self.silent_s > LOST_S:
                    self._fail(str(why))
                    return
                await asyncio.sleep(RETRY_S)
            except (ValueError, KeyError, TypeError):
                self._fail(ENDED)
                return
            await asyncio.sleep(LEAST_S)

    def _read_frames(self, raw: bytes) -> None:
        """Raises ValueError, KeyError, TypeError."""
        line, _, rest = raw.partition(b"\n")
        head = orjson.loads(line)
        at = 0
        for kind, length in head["parts"]:
            if kind in ("state", "position", "scan", "timeline"):
                self._take(kind, rest[at : at + length])
            at += length
        self._have = {kind: int(head["numbers"][kind]) for kind in self._have}
        self._heard_s = self._now() - float(head["silent_s"])
        if head["failed"] is not None:
            self._fail(str(head["failed"])[:500])


class RemoteReplays(ReplayManager):
    """Of a web node."""

    def __init__(self, node: HttpNode, *, now: Callable[[], float]) -> None:
        super().__init__(lambda _: None, now=now, most=MOST)
        self._node = node

    def _made(self, recording: str, opening: Mapping[str, Any], on_new: Callable[[str], None]) -> ReplayClient:
        return RemoteReplay(self._node, str(opening["vehicle"]), recording, now=self._now, on_new=on_new)

    async def _begin(self, client: ReplayClient, opening: Mapping[str, Any]) -> None:
        await client.open(None, opening)
