"""Requests what agents keep, from a web node through a NATS broker."""

from __future__ import annotations

import asyncio
import contextlib
import secrets
from collections import deque
from collections.abc import AsyncIterator, Callable
from dataclasses import dataclass, field

from nats.aio.client import Client
from nats.errors import Error as NatsError
from nats.errors import NoRespondersError

from server.bus import nats_http as http
from server.bus import nats_wire as wire
from server.bus.bus import NotServed

ANSWERS_WITHIN_S = 3.0  # one message; it waits at the agent for a second at most
RETRY_S = 0.3
SILENT_S = 8.0  # an agent that answers nothing for so long is given up
ABSENT_S = 2.0  # where the broker has no responder: an agent that restarts subscribes later
BEGINS_WITHIN_S = 180.0  # an export is made first
GOES_ON_WITHIN_S = 30.0  # between two chunks
TOO_MUCH = "this is more than a request may carry"
SLOW_S = 0.25  # a chunk that takes longer on its way leaves no room for frames: fewer are under way


class BrokeOff(Exception):
    """An answer that had begun does not go on; `str()` is one sentence."""


class Pace:
    """How many chunks of one agent may be under way, shared by the answers that it gives at once."""

    def __init__(self) -> None:
        self._ahead = 1.0
        self.answers = 0

    @property
    def ahead(self) -> int:
        """For one answer."""
        return max(1, int(self._ahead) // max(1, self.answers))

    def note(self, took_s: float) -> None:
        """A chunk took so long on its way there and back."""
        self._ahead = max(1.0, self._ahead / 2) if took_s > SLOW_S else min(http.MOST_AHEAD, self._ahead + 0.5)


@dataclass(kw_only=True)
class Answer:
    """`chunks` raises BrokeOff where the answer does not go on."""

    status: int
    headers: http.Headers = field(default_factory=dict)
    chunks: AsyncIterator[bytes]


class HttpNode:
    """A part of the link to the broker. `trouble`: why nothing comes from a vehicle's agent, as a sentence."""

    def __init__(self, trouble: Callable[[str], str | None], *, now: Callable[[], float]) -> None:
        self._trouble = trouble
        self._now = now
        self._client: Client | None = None
        self._paces: dict[str, Pace] = {}

    def open(self) -> None:
        """Nothing: requests are refused meanwhile."""

    def close(self) -> None:
        """Nothing."""

    async def start(self, client: Client) -> None:
        self._client = client

    async def stop(self) -> None:
        self._client = None

    @contextlib.asynccontextmanager
    async def call(self, vehicle: str, begin: http.Begin, body: bytes = b"") -> AsyncIterator[Answer]:
        """The agent's answer, for the length of the block. Raises NotServed, Refused."""
        parts = [body[at : at + http.CHUNK] for at in range(0, max(1, len(body)), http.CHUNK)]
        if len(parts) > http.MOST_PARTS:
            raise NotServed(TOO_MUCH)
        if (trouble := self._trouble(vehicle)) is not None:
            raise NotServed(trouble.rstrip("."))
        begin = begin.model_copy(update={"parts": len(parts)})
        one = _Request(self, vehicle, begin.id, self._paces.setdefault(vehicle, Pace()), now=self._now)
        try:
            head, payload = await one.begin(begin, parts)
            if head.state == "refused":
                raise http.Refused(head.status, head.refused or "The agent refused the request.")
            yield Answer(status=head.status, headers=head.headers, chunks=one.chunks(head, payload))
        finally:
            await self._publish(vehicle, http.Drop(id=begin.id))

    async def ask(self, vehicle: str, what: str, head: wire.Body, payload: bytes = b"") -> tuple[http.Chunk, bytes]:
        """One message and its answer. Raises the errors of the client, TimeoutError, Malformed and NotServed."""
        client = self._client
        if client is None or not client.is_connected:  # else it would wait in the client and come late
            raise TimeoutError
        if len(data := http.pack(head, payload)) > http.LONGEST_MESSAGE:
            raise NotServed(TOO_MUCH)
        message = await client.request(wire.subject(vehicle, f"http.{what}"), data, timeout=ANSWERS_WITHIN_S)
        return http.unpack(http.Chunk, message.data)

    async def _publish(self, vehicle: str, head: http.Drop) -> None:
        with contextlib.suppress(NatsError):
            if self._client is not None and self._client.is_connected:
                await self._client.publish(wire.subject(vehicle, "http.drop"), http.pack(head))


class _Request:
    """One request at one agent."""

    def __init__(self, node: HttpNode, vehicle: str, id: str, pace: Pace, *, now: Callable[[], float]) -> None:
        self._node = node
        self._vehicle = vehicle
        self._id = id
        self._pace = pace
        self._now = now
        self._have = 0

    async def begin(self, begin: http.Begin, parts: list[bytes]) -> tuple[http.Chunk, bytes]:
        """Chunk 0 of the answer. Raises NotServed."""
        head, payload = await self._patiently("begin", begin, parts[0])
        for n, part in enumerate(parts[1:], start=1):
            head, payload = await self._patiently("body", http.Part(id=self._id, n=n), part)
        due_s = self._now() + BEGINS_WITHIN_S
        while head.state == "wait":
            if self._now() > due_s:
                raise NotServed(f"the agent of {self._vehicle} has not begun to answer within {BEGINS_WITHIN_S:g} s")
            head, payload = await self._patiently("pull", http.Pull(id=self._id, n=0, have=0))
        if head.state == "gone":
            raise NotServed(f"the agent of {self._vehicle} does not go on with the request")
        self._have = 1
        return head, payload

    async def chunks(self, head: http.Chunk, payload: bytes) -> AsyncIterator[bytes]:
        """All chunks, in order, with as many pulls under way as the pace allows. Raises BrokeOff."""
        pulls: deque[asyncio.Task[tuple[http.Chunk, bytes]]] = deque()
        requested = 1
        self._pace.answers += 1
        try:
            while True:
                yield payload
                if head.state == "last":
                    return
                while len(pulls) < self._pace.ahead:
                    pulls.append(asyncio.create_task(self._pull(requested)))
                    requested += 1
                head, payload = await pulls.popleft()
                self._have += 1
        except NotServed as why:
            raise BrokeOff(f"{why}.") from None
        finally:
            self._pace.answers -= 1
            for pull in pulls:
                pull.cancel()
            await asyncio.gather(*pulls, return_exceptions=True)

    async def _pull(self, n: int) -> tuple[http.Chunk, bytes]:
        """Raises NotServed."""
        due_s = self._now() + GOES_ON_WITHIN_S
        while True:
            began_s = self._now()
            head, payload = await self._patiently("pull", http.Pull(id=self._id, n=n, have=self._have))
            if head.state in ("more", "last"):
                self._pace.note(self._now() - began_s - head.waited_s)
                return head, payload
            if head.state != "wait" or self._now() > due_s:
                raise NotServed(f"the answer of the agent of {self._vehicle} broke off")

    async def _patiently(self, what: str, head: wire.Body, payload: bytes = b"") -> tuple[http.Chunk, bytes]:
        """Sends the request again while no answer comes: each message may be sent twice. Raises NotServed."""
        began_s = self._now()
        while True:
            within_s = SILENT_S
            try:
                return await self._node.ask(self._vehicle, what, head, payload)
            except NoRespondersError:
                why, within_s = f"the agent of {self._vehicle} takes no such requests", ABSENT_S
            except wire.Malformed:
                why = f"the agent of {self._vehicle} answered what cannot be read"
            except (NatsError, TimeoutError):
                why = f"the agent of {self._vehicle} did not answer within {SILENT_S:g} s"
            if self._now() + RETRY_S > began_s + within_s:
                raise NotServed(why)
            await asyncio.sleep(RETRY_S)


def new_id() -> str:
    return secrets.token_hex(16)
