"""Transcripts of real bridges, played back to a client: answers by service and arguments, data as recorded."""

from __future__ import annotations

import asyncio
import base64
import contextlib
import json
from collections import defaultdict
from collections.abc import AsyncIterator
from dataclasses import dataclass, field
from functools import cached_property
from pathlib import Path
from typing import Any

from websockets.asyncio.server import ServerConnection, serve
from websockets.exceptions import ConnectionClosed

from tests.tree import RECORDINGS

FILES = sorted((RECORDINGS / "rosbridge").glob("ros?/*.jsonl"))
GAP_S = 0.0005  # between two frames that are played


def name_of(path: Path) -> str:
    return f"{path.parent.name}/{path.stem}"


@dataclass(frozen=True)
class Transcript:
    """One file: a conversation with one real bridge."""

    path: Path

    @cached_property
    def lines(self) -> list[dict[str, Any]]:
        return [json.loads(line) for line in self.path.read_text(encoding="utf-8").splitlines()]

    @property
    def topics(self) -> dict[str, str]:
        """Those of the car, also where the recorder published some of its own."""
        topics: dict[str, str] = self.lines[0].get("topics", {})
        if not any("/catvehicle/" in topic for topic in topics):
            topics = topics | Transcript(self.path.with_name("auth.jsonl")).topics
        return topics

    @property
    def version(self) -> int:
        return int(self.path.parent.name[-1])

    @cached_property
    def frames(self) -> list[str | bytes]:
        """All that the bridge sent by itself, on any connection, in order."""
        found = [
            line["text"] if "text" in line else base64.b64decode(line["b64"])
            for line in self.lines
            if line.get("dir") == "in"
        ]
        return [frame for frame in found if isinstance(frame, bytes) or '"service_response"' not in frame[:80]]

    @cached_property
    def answers(self) -> dict[str, list[dict[str, Any] | None]]:
        """Service and arguments → the bridge's answers, in order; None: it did not answer."""
        found: dict[str, list[dict[str, Any] | None]] = defaultdict(list)
        for number, line in enumerate(self.lines):
            if line.get("dir") != "out" or "text" not in line:
                continue
            with contextlib.suppress(ValueError, AttributeError):
                call = json.loads(line["text"])
                if call.get("op") == "call_service" and call.get("id") is not None:
                    if "send failed" in self.lines[number + 1].get("note", ""):
                        continue
                    answer, was_open = self._answer_to(call["id"], line.get("conn"), number)
                    if answer is not None or was_open:
                        found[key_of(call)].append(answer)
        return found

    def _answer_to(self, id: str, conn: str | None, number: int) -> tuple[dict[str, Any] | None, bool]:
        """The answer to a call; None, and whether the connection stayed open for long enough."""
        for line in self.lines[number + 1 :]:
            if line.get("conn") == conn and line.get("event") in ("open", "close"):
                return None, line["event"] == "close" and line["code"] == 1000
            if line.get("dir") == "in" and line.get("conn") == conn and "text" in line:
                with contextlib.suppress(ValueError):
                    answer = json.loads(line["text"])
                    if answer.get("op") == "service_response" and answer.get("id") == id:
                        return answer, True
        return None, True

    @cached_property
    def close(self) -> int | None:
        """The code with which the bridge closed by itself, the first time; None: it never did."""
        for number, line in enumerate(self.lines):
            if line.get("event") == "close" and line["code"] not in (1000, 3001):
                before = [one.get("note", "") for one in self.lines[max(0, number - 4) : number]]
                if not any("tcp abort" in note for note in before):
                    return int(line["code"])
        return None


def key_of(call: dict[str, Any]) -> str:
    return json.dumps([call.get("service"), call.get("args") or {}], sort_keys=True)


@dataclass
class Player:
    """Plays one transcript on every connection that subscribes to something."""

    transcript: Transcript
    closes: bool = True  # as recorded, the first time
    port: int = 0
    received: list[list[dict[str, Any]]] = field(default_factory=list)  # by connection
    played: int = 0  # how often all frames were sent
    closed: int = 0
    _asked: dict[str, int] = field(default_factory=lambda: defaultdict(int))

    async def serve(self, socket: ServerConnection) -> None:
        received: list[dict[str, Any]] = []
        self.received.append(received)
        playing: asyncio.Task[None] | None = None
        with contextlib.suppress(ConnectionClosed):
            async for text in socket:
                operation = json.loads(text)
                received.append(operation)
                if self.transcript.path.stem == "auth" and self.transcript.version == 1:
                    await self._hang_up(socket, 1005)
                    return
                if operation["op"] == "call_service":
                    answer = self._answer(operation)
                    if answer is not None:
                        await socket.send(json.dumps(answer | {"id": operation["id"]}))
                elif operation["op"] == "subscribe" and playing is None:
                    playing = asyncio.create_task(self._play(socket))
        if playing is not None:
            playing.cancel()
            await asyncio.gather(playing, return_exceptions=True)

    async def _play(self, socket: ServerConnection) -> None:
        for frame in self.transcript.frames:
            await socket.send(frame)
            await asyncio.sleep(GAP_S)
        self.played += 1
        if self.closes and self.transcript.close is not None and not self.closed:
            self.closed += 1
            await self._hang_up(socket, self.transcript.close)

    async def _hang_up(self, socket: ServerConnection, code: int) -> None:
        if code == 1006:
            socket.transport.abort()
        elif code == 1005:
            socket.transport.write(b"\x88\x00")  # a close frame without a code
            await asyncio.sleep(0.05)
            socket.transport.abort()
        else:
            await socket.close(code)

    def _answer(self, call: dict[str, Any]) -> dict[str, Any] | None:
        key, service = key_of(call), call["service"]
        recorded = self.transcript.answers.get(key)
        if recorded is not None:
            number = min(self._asked[key], len(recorded) - 1)
            self._asked[key] += 1
            if recorded[number] is not None or len(recorded) > 1:
                return recorded[number]
        same = [
            answer
            for other, answers in self.transcript.answers.items()
            for answer in answers
            if "/rosapi/" in other and answer is not None
        ]
        if same and not any(answer["result"] for answer in same):  # a bridge whose rosapi is gone
            return same[0] | {"service": service}
        values = self._usual(service, call["args"])
        result = values is not None
        payload = values if result else f"Service {service} does not exist"
        return {"op": "service_response", "service": service, "values": payload, "result": result}

    def _usual(self, service: str, arguments: dict[str, Any]) -> dict[str, Any] | None:
        topics = self.transcript.topics
        match service:
            case "/rosapi/topics":
                return {"topics": [*topics], "types": [*topics.values()]}
            case "/rosapi/get_time":
                names = ("secs", "nsecs") if self.transcript.version == 1 else ("sec", "nanosec")
                return {"time": dict.fromkeys(names, 5)}
            case "/rosapi/publishers":
                return {"publishers": ["/car"]}
            case "/rosapi/subscribers":
                return {"subscribers": ["/rosbridge_websocket"]}
            case "/rosapi/topic_type":
                return {"type": topics.get(arguments["topic"], "")}
        return None


@contextlib.asynccontextmanager
async def playing(path: Path, **options: Any) -> AsyncIterator[Player]:
    player = Player(Transcript(path), **options)
    settings: dict[str, Any] = {"ping_interval": None, "close_timeout": 0.1, "max_size": None, "compression": None}
    header = "AutobahnPython/22.7.1" if player.transcript.version == 1 else "TornadoServer/6.6.1"
    async with serve(player.serve, "127.0.0.1", 0, server_header=header, **settings) as server:
        player.port = next(iter(server.sockets)).getsockname()[1]
        yield player
        for socket in list(server.connections):
            socket.transport.abort()
