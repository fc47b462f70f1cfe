"""Answers requests for what an agent keeps, which come from web nodes through a NATS broker, by an ASGI application."""

from __future__ import annotations

import asyncio
import contextlib
import logging
from collections.abc import Awaitable, Callable, MutableMapping
from typing import Any

from nats.aio.client import Client
from nats.aio.msg import Msg
from nats.aio.subscription import Subscription
from nats.errors import Error as NatsError

from server.bus import nats_http as http
from server.bus import nats_wire as wire
from server.system.supervision import Supervisor, cancel

log = logging.getLogger("catgraph.bus")

MOST = 32  # requests at once, of all nodes
MOST_OF_ONE = 12  # of one device or program
MOST_LARGE = 4  # of them with a photo in their body
MOST_TASKS = 300  # messages at once that wait for their answer; a flood is refused
CHECK_EVERY_S = 2.0

Scope = MutableMapping[str, Any]
Message = MutableMapping[str, Any]
App = Callable[[Scope, Callable[[], Awaitable[Message]], Callable[[Message], Awaitable[None]]], Awaitable[None]]


class Answering:
    """One request and what there is of its answer. `now`: a monotonic clock in seconds."""

    def __init__(self, begin: http.Begin, scope: Scope, *, now: Callable[[], float]) -> None:
        self.sender = begin.sender.id
        self.parts = begin.parts  # of the request's body
        self._scope = scope
        self._now = now
        self._parts: list[bytes | None] = [None] * begin.parts
        self._is_given = False  # the body was handed on
        self._status = 0
        self._headers: http.Headers = {}
        self._chunks: dict[int, bytes] = {}
        self._made = 0  # chunks
        self._have = 0  # chunks that the node has
        self._rest = bytearray()  # of the answer's body, not a chunk yet
        self._is_over = self._is_broken = False
        self._changed = asyncio.Event()
        self.task: asyncio.Task[None] | None = None
        self.requested_s = now()

    def take(self, n: int, payload: bytes) -> bool:
        """A part of the body came; answers whether the body is whole now for the first time."""
        self.requested_s = self._now()
        if n >= len(self._parts) or self._parts[n] is not None:
            return False
        self._parts[n] = payload
        return all(part is not None for part in self._parts)

    async def run(self, app: App) -> None:
        """Has the application answer."""
        try:
            await app(self._scope, self._receive, self._send)
        except Exception:
            log.exception("request of a node failed: path=%s", self._scope["path"])
        finally:
            self._is_broken = not self._is_over
            self._wake()

    async def chunk(self, n: int, have: int) -> tuple[http.Chunk, bytes]:
        """Chunk `n` once it is there, or what there is instead."""
        began_s = self.requested_s = self._now()
        self._have = max(self._have, min(have, self._made))
        for number in [number for number in self._chunks if number < self._have]:
            del self._chunks[number]
        self._wake()
        with contextlib.suppress(TimeoutError):
            async with asyncio.timeout(http.WAITS_S):
                while n not in self._chunks and not (self._is_over or self._is_broken):
                    await self._changed.wait()
        self.requested_s = self._now()
        waited_s = self.requested_s - began_s
        if n not in self._chunks:
            return http.Chunk(state="gone" if self._is_over or self._is_broken else "wait", waited_s=waited_s), b""
        state: Any = "last" if self._is_over and n == self._made - 1 else "more"
        head = http.Chunk(state=state, waited_s=waited_s)
        if n == 0:
            head = head.model_copy(update={"status": self._status, "headers": self._headers})
        return head, self._chunks[n]

    async def _receive(self) -> Message:
        if not self._is_given:
            self._is_given = True
            return {"type": "http.request", "body": b"".join(part or b"" for part in self._parts), "more_body": False}
        await asyncio.Event().wait()  # that nobody waits any more cancels all of it
        raise AssertionError

    async def _send(self, message: Message) -> None:
        if message["type"] == "http.response.start":
            self._status = message["status"]
            self._headers = {name.decode("latin-1"): value.decode("latin-1") for name, value in message["headers"]}
            return
        self._rest += message.get("body", b"")
        is_end = not message.get("more_body", False)
        while len(self._rest) > http.CHUNK:
            await self._put(bytes(self._rest[: http.CHUNK]))
            del self._rest[: http.CHUNK]
        if is_end:
            await self._put(bytes(self._rest), is_last=True)

    async def _put(self, payload: bytes, *, is_last: bool = False) -> None:
        """One more chunk; waits while the node has not pulled those before."""
        while self._made >= self._have + http.MOST_AHEAD:
            await self._changed.wait()
        self._chunks[self._made] = payload
        self._made += 1
        self._is_over = is_last
        self._wake()

    def _wake(self) -> None:
        self._changed.set()
        self._changed = asyncio.Event()


class HttpAgent:
    """A part of the link to the broker. `scope_of` makes the ASGI scope of a request, or raises Refused."""

    def __init__(
        self, vehicles: Callable[[], tuple[str, ...]], app: App, scope_of: Callable[[http.Begin], Scope], *,
        now: Callable[[], float],
    ) -> None:  # fmt: skip
        self._vehicles = vehicles
        self._app = app
        self._scope_of = scope_of
        self._now = now
        self._client: Client | None = None
        self._answering: dict[str, Answering] = {}
        self._tasks: set[asyncio.Task[None]] = set()
        self._supervisor: Supervisor | None = None
        self._subscriptions: list[Subscription] = []
        self.refused = 0  # what could not be read, or was too much

    def open(self) -> None:
        """Nothing: an agent does without a broker."""

    def close(self) -> None:
        """Nothing."""

    async def start(self, client: Client) -> None:
        if self._supervisor is None:
            self._supervisor = Supervisor("requests from the broker")
            self._supervisor.keep("give up", self._give_up_unasked)
        self._client = client
        self._subscriptions.clear()  # of the client before
        for vehicle in self._vehicles():
            subject = wire.subject(vehicle, "http.*")
            self._subscriptions.append(await client.subscribe(subject, cb=self._on_message))

    async def stop(self) -> None:
        with contextlib.suppress(NatsError, TimeoutError):  # without a broker nothing is routed to it
            for subscription in self._subscriptions:
                await subscription.unsubscribe()
        self._subscriptions.clear()
        if self._supervisor is not None:
            await self._supervisor.stop()
            self._supervisor = None
        await cancel(self._tasks)
        self._answering.clear()
        self._client = None

    def _spawn(self, work: Any) -> asyncio.Task[None]:
        task = asyncio.create_task(work)
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)
        return task

    async def _give_up_unasked(self) -> None:
        while True:
            await asyncio.sleep(CHECK_EVERY_S)
            now_s = self._now()
            for id in [id for id, one in self._answering.items() if now_s - one.requested_s > http.UNASKED_S]:
                self._drop(id)

    def _drop(self, id: str) -> None:
        answering = self._answering.pop(id, None)
        if answering is not None and answering.task is not None:
            answering.task.cancel()

    async def _on_message(self, message: Msg) -> None:
        what = message.subject.rsplit(".", 1)[1]
        if len(self._tasks) >= MOST_TASKS and what != "drop":  # which only makes room
            self.refused += 1
            return
        try:
            match what:
                case "begin":
                    begin, payload = http.unpack(http.Begin, message.data)
                    self._spawn(self._begin(message, begin, payload))
                case "body":
                    part, payload = http.unpack(http.Part, message.data)
                    self._spawn(self._body(message, part, payload))
                case "pull":
                    pull, _ = http.unpack(http.Pull, message.data)
                    self._spawn(self._pull(message, pull.id, pull.n, pull.have))
                case "drop":
                    self._drop(http.unpack(http.Drop, message.data)[0].id)
        except wire.Malformed as why:
            self.refused += 1
            log.warning("request not read: subject=%s why=%s", message.subject, why)

    async def _begin(self, message: Msg, begin: http.Begin, payload: bytes) -> None:
        if begin.id not in self._answering:
            try:
                self._check_room(begin)
                self._answering[begin.id] = Answering(begin, self._scope_of(begin), now=self._now)
            except http.Refused as why:
                self.refused += 1
                head = http.Chunk(state="refused", status=why.status, refused=str(why)[:500])
                return await self._respond(message, head)
        self._take(begin.id, 0, payload)
        return await self._pull(message, begin.id, 0, 0)

    def _check_room(self, begin: http.Begin) -> None:
        """Raises Refused."""
        mine = sum(one.sender == begin.sender.id for one in self._answering.values())
        large = sum(one.parts > http.FEW_PARTS for one in self._answering.values())
        is_one_too_many = begin.parts > http.FEW_PARTS and large >= MOST_LARGE
        if len(self._answering) >= MOST or mine >= MOST_OF_ONE or is_one_too_many:
            raise http.Refused(503, "The agent of the car has too many requests at once: try again in a moment.")

    async def _body(self, message: Msg, part: http.Part, payload: bytes) -> None:
        self._take(part.id, part.n, payload)
        await self._respond(message, http.Chunk(state="wait" if part.id in self._answering else "gone"))

    def _take(self, id: str, n: int, payload: bytes) -> None:
        answering = self._answering.get(id)
        if answering is not None and answering.take(n, payload):
            answering.task = self._spawn(answering.run(self._app))

    async def _pull(self, message: Msg, id: str, n: int, have: int) -> None:
        answering = self._answering.get(id)
        if answering is None:
            return await self._respond(message, http.Chunk(state="gone"))
        if answering.task is None:
            return await self._respond(message, http.Chunk(state="wait"))  # its body is under way
        return await self._respond(message, *await answering.chunk(n, have))

    async def _respond(self, message: Msg, head: http.Chunk, payload: bytes = b"") -> None:
        with contextlib.suppress(NatsError):
            if self._client is not None and self._client.is_connected and message.reply:
                data = http.pack(head, payload)
                if len(data) > http.LONGEST_MESSAGE:
                    data = http.pack(
                        http.Chunk(state="refused", status=502, refused="The answer has too long headers.")
                    )
                await message.respond(data)
