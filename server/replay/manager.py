"""The replays of one server: one process per viewing page, limited in number."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import os
import secrets
import sys
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from server.protocol.state import LiveState, LiveSummary, ReplayEnvelope, ReplayPosition, ReplayState, ServerState
from server.replay.protocol import HEAD, KINDS, MOST_BYTES

log = logging.getLogger("catgraph.playback")

MOST_REPLAYS = 8  # each is a process of some 100 MB
OPENS_WITHIN_S = 20.0  # a long file that was never closed is read through first
ANSWERS_WITHIN_S = 3.0
HUNG_S = 2.0  # a process without output for this time is reported as hanging
LIVE_ALARMS = 8
ROOT = str(Path(__file__).resolve().parent.parent.parent)  # where `server` is found
ENDED = "The replay failed; the server's log has the reason."


@dataclass(frozen=True, slots=True, kw_only=True)
class ReplaySource:
    """A finished recording, with its data of the catalog."""

    path: Path
    vehicle: str
    title: str = ""
    sketch: Sequence[float | None] = ()  # its speed in equal steps; empty: not known yet
    trends: Mapping[str, Any] | None = None  # all its signals in some hundred buckets; None: not known yet


class NoReplay(Exception):
    """It cannot be replayed; `str()` is one sentence for a person."""


class ReplayClient:
    """One page's replay: the last output of its process, and its command channel."""

    def __init__(self, recording: str, *, now: Callable[[], float], on_new: Callable[[str], None]) -> None:
        self.recording = recording
        self.instead: ReplayClient | None = None  # the one that is closed once this one is open
        self.token = secrets.token_hex(8)
        self.failed: str | None = None  # why there is no more to come, as a sentence
        self.numbers = {"state": 0, "scan": 0, "timeline": 0}
        self.scan: bytes = b""
        self.timeline: bytes = b""
        self._state: bytes = b""
        self._notes: list[str] = []  # of the file, as its time line has them
        self._source: ReplaySource | None = None
        self._position: ReplayPosition | None = None  # None: nothing received yet
        self._now = now
        self._on_new = on_new
        self._last_message_s = now()
        self._asked = itertools.count(1)
        self._waiting: dict[int, asyncio.Future[dict[str, Any]]] = {}
        self._ready = asyncio.Event()
        self._process: asyncio.subprocess.Process | None = None
        self._reader: asyncio.Task[None] | None = None

    async def open(self, source: ReplaySource | None, opening: Mapping[str, Any]) -> None:
        """Starts the process and waits for its first state; `source` None: there is no such recording. Raises
        NoReplay."""
        if source is None:
            raise NoReplay(f"There is no recording named {_seen(self.recording)}.")
        self._source = source
        paths = os.pathsep.join(filter(None, (ROOT, os.environ.get("PYTHONPATH"))))
        self._process = await asyncio.create_subprocess_exec(
            *(sys.executable, "-m", "server.replay.process"),
            stdin=asyncio.subprocess.PIPE,
            stdout=asyncio.subprocess.PIPE,
            env={**os.environ, "PYTHONPATH": paths},
        )
        self._reader = asyncio.create_task(self._read(self._process), name=f"replay of {self.recording}")
        sketches = {"sketch": list(source.sketch), "trends": source.trends}
        self._order({"path": str(source.path), "name": self.recording, **sketches, **opening})
        await self._until_ready()

    async def _until_ready(self) -> None:
        """Raises NoReplay."""
        try:
            async with asyncio.timeout(OPENS_WITHIN_S):
                await self._ready.wait()
        except TimeoutError:
            self.failed = f"{self.recording} could not be opened within {OPENS_WITHIN_S:g} s."
        if self.failed is not None:
            raise NoReplay(self.failed)

    async def close(self) -> None:
        """Its process ends with its input, or is ended."""
        process, self._process = self._process, None
        if process is None:
            return
        if process.stdin is not None:
            process.stdin.close()
        try:
            async with asyncio.timeout(0.5):
                await process.wait()
        except TimeoutError:
            with contextlib.suppress(ProcessLookupError):
                process.kill()
            await process.wait()
        if self._reader is not None:
            self._reader.cancel()
            await asyncio.gather(self._reader, return_exceptions=True)
        self._let_go()

    async def ask(self, order: Mapping[str, Any]) -> dict[str, Any]:
        """What its process answers. Raises NoReplay."""
        if self.failed is not None or self._process is None:
            raise NoReplay(self.failed or "This replay is over.")
        n = next(self._asked)
        answer: asyncio.Future[dict[str, Any]] = asyncio.get_running_loop().create_future()
        self._waiting[n] = answer
        self._order({**order, "n": n})
        try:
            async with asyncio.timeout(ANSWERS_WITHIN_S):
                return await answer
        except TimeoutError:
            raise NoReplay("The replay did not answer in time.") from None
        finally:
            self._waiting.pop(n, None)

    def watch_scan(self, is_wanted: bool) -> None:
        if self.failed is None:
            self._order({"kind": "scan", "wanted": is_wanted})

    def pass_gaps(self, is_wanted: bool) -> None:
        """Whether playing passes over long gaps: two recordings side by side keep their pace."""
        if self.failed is None:
            self._order({"kind": "pass_gaps", "wanted": is_wanted})

    @property
    def silent_s(self) -> float:
        """Seconds since the last message of its process."""
        return self._now() - self._last_message_s

    def source_facts(self) -> dict[str, str]:
        """The catalog's data of the recording, for a page elsewhere."""
        assert self._source is not None
        return {"vehicle": self._source.vehicle, "title": self._source.title}

    def newest_parts(self, have: Mapping[str, int]) -> list[tuple[str, bytes]]:
        """Its newest frames, of each kind where its number is another than the one in `have`."""
        found: list[tuple[str, bytes]] = []
        if self.numbers["state"] != have["state"] and self._position is not None:
            found += [("state", self._state)] if self._state else []
            found.append(("position", orjson.dumps(self._position)))
        if self.numbers["scan"] != have["scan"]:
            found.append(("scan", self.scan))
        if self.numbers["timeline"] != have["timeline"]:
            found.append(("timeline", self.timeline))
        return found

    def compose(self, server: ServerState, live: LiveSummary | None) -> str:
        """The state a page gets: what was recorded, beside what is live now."""
        envelope: ReplayEnvelope = {"server": server, "replay": self._shown(), "live": live}
        head = orjson.dumps(envelope)
        return (head[:-1] + b"," + self._state[1:]).decode()

    def compose_beside(self) -> str:
        """The state of a recording that is shown beside another one."""
        head = orjson.dumps({"kind": "beside", "replay": self._shown(), "notes": self._notes})
        return (head[:-1] + b',"state":' + self._state + b"}").decode()

    def _shown(self) -> ReplayState:
        assert self._position is not None  # `open` waits for it
        assert self._source is not None
        silent_s = self.silent_s
        return {
            **self._position,
            "id": self.recording,
            "vehicle": self._source.vehicle,
            "title": self._source.title,
            "token": self.token,
            "hangs_s": round(silent_s, 1) if silent_s > HUNG_S else None,
        }

    def _order(self, order: Mapping[str, Any]) -> None:
        process = self._process
        if process is not None and process.stdin is not None and not process.stdin.is_closing():
            process.stdin.write(orjson.dumps(order) + b"\n")

    async def _read(self, process: asyncio.subprocess.Process) -> None:
        assert process.stdout is not None
        try:
            while True:
                number, length = HEAD.unpack(await process.stdout.readexactly(HEAD.size))
                if length > MOST_BYTES:
                    raise ValueError(f"a record of {length} bytes")
                self._take(KINDS[number], await process.stdout.readexactly(length))
        except (asyncio.IncompleteReadError, ConnectionError, ValueError, IndexError) as error:
            if self._process is not None and self.failed is None:
                log.warning("replay ended: recording=%s error=%r", self.recording, error)
                self._fail(ENDED)

    def _take(self, kind: str, payload: bytes) -> None:
        self._last_message_s = self._now()
        match kind:
            case "state":
                self._state = payload
                return  # its position follows
            case "position":
                self._position = orjson.loads(payload)
                self.numbers["state"] += 1
                if self._state:
                    self._ready.set()
                self._on_new("state")
            case "scan":
                self.scan = payload
                if payload:  # before the first scan there is nothing to offer
                    self.numbers["scan"] += 1
                    self._on_new("scan")
            case "timeline":
                self.timeline = payload
                self._notes = orjson.loads(payload)["notes"]
                self.numbers["timeline"] += 1
                self._on_new("timeline")
            case "reply":
                body = orjson.loads(payload)
                waiting = self._waiting.get(body["n"])
                if waiting is not None and not waiting.done():
                    waiting.set_result(body["answer"])
            case "failed":
                self._fail(str(orjson.loads(payload)["reason"]))

    def _fail(self, why: str) -> None:
        self.failed = why
        self._ready.set()
        self._let_go()
        self._on_new("failed")

    def _let_go(self) -> None:
        for waiting in self._waiting.values():
            if not waiting.done():
                waiting.set_exception(NoReplay(self.failed or "This replay is over."))


class ReplayManager:
    """Opens replays and holds them by their tokens. `find` may read the disk; None: there is no such recording."""

    def __init__(
        self, find: Callable[[str], ReplaySource | None], *, now: Callable[[], float], most: int | None = None
    ) -> None:
        """`most` replays at once; None: as many as this machine can run."""
        self._find = find
        self._now = now
        self._most = most
        self._clients: dict[str, ReplayClient] = {}

    @property
    def count(self) -> int:
        return len(self._clients)

    async def open(
        self,
        recording: str,
        opening: Mapping[str, Any],
        *,
        on_new: Callable[[str], None],
        instead: ReplayClient | None = None,
    ) -> ReplayClient:
        """A replay that is ready to be shown. `instead`: an open one that is closed then, and takes no further place.
        Raises NoReplay."""
        most = MOST_REPLAYS if self._most is None else self._most
        replaced = {one.instead.token for one in self._clients.values() if one.instead is not None}
        others = self._clients.keys() - replaced - ({instead.token} if instead is not None else set())
        if len(others) >= most:
            raise NoReplay(f"{most} replays are open already: close one first.")
        client = self._made(recording, opening, on_new)
        client.instead = instead
        self._clients[client.token] = client
        try:
            await self._begin(client, opening)
        except BaseException:
            await self.close(client)
            raise
        client.instead = None
        return client

    def _made(self, recording: str, _opening: Mapping[str, Any], on_new: Callable[[str], None]) -> ReplayClient:
        return ReplayClient(recording, now=self._now, on_new=on_new)

    async def _begin(self, client: ReplayClient, opening: Mapping[str, Any]) -> None:
        """Raises NoReplay."""
        await client.open(await asyncio.to_thread(self._find, client.recording), opening)

    def holds(self, token: str) -> bool:
        """Whether this replay is open."""
        return token in self._clients

    async def close(self, client: ReplayClient) -> None:
        self._clients.pop(client.token, None)
        await client.close()

    async def close_all(self) -> None:
        await asyncio.gather(*(self.close(client) for client in list(self._clients.values())))

    def by_token(self, token: str) -> ReplayClient:
        """Raises NoReplay."""
        client = self._clients.get(token)
        if client is None:
            raise NoReplay("This replay is over.")
        return client


def summary(state: LiveState) -> LiveSummary:
    """The part of the live state that is shown during a replay."""
    session, link = state["session"], state["link"]
    found: LiveSummary = {
        "phase": session["phase"],
        "name": session["name"],
        "paused": session["paused"],
        "cut": link["cut"],
        "problem": link["problem"]["title"] if link["problem"] else None,
        "recording": state["recording"],
        "control": state["control"],
        "reach": state["reach"],
        "decelerate": state["decelerate"],
        "alarms": state["alarms"][:LIVE_ALARMS],
        "alarms_in_all": len(state["alarms"]),
    }
    if (challenge := state["server"].get("challenge")) is not None:
        found["challenge"] = challenge  # a page that replays may still order what is of the live car
    return found


def _seen(name: str) -> str:
    return "".join(letter if letter.isprintable() else "?" for letter in name[:60])
