"""Both sides of a bus in one test: a session's and a page's."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from typing import Any

from server.bus.bus import PageBus
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.bus.nats_agent import NatsAgent
from server.bus.nats_bus import NatsBus, Read, as_it_is
from server.bus.nats_link import processed
from tests.server.bus.broker import connected

SOON_S = 15.0  # on two busy cores
VEHICLES = ("ocelot", "margay")


class Clock:
    """A monotonic clock that can be put forward."""

    def __init__(self) -> None:
        self.ahead_s = 0.0

    def __call__(self) -> float:
        return asyncio.get_running_loop().time() + self.ahead_s


class Buses:
    """`session`: what sessions use; `page`: what pages use."""

    def __init__(self, session: LocalBus, page: PageBus, clock: Clock) -> None:
        self.session = session
        self.page = page
        self.clock = clock
        self.commands: list[Any] = []

    async def answer(self, command: Any) -> dict[str, Any]:
        """The session of each vehicle: it notes the command as an event, and waits where the command has a wait."""
        self.commands.append(command)
        await asyncio.sleep(command.get("takes_s", 0.0))
        if text := command.get("notes"):
            self.session.append(command["vehicle"], [event(text)])
        return {"ok": True, "got": command.get("what")}


def event(text: str = "x", **more: Any) -> dict[str, Any]:
    return {"at_ms": 1, "alarm": "hot", "change": "raised", "text": text, **more}


def numbers(events: list[dict[str, Any]]) -> list[int]:
    return [one["n"] for one in events]


async def until(found: Callable[[], Any], within_s: float = SOON_S) -> Any:
    """Waits until `found()` is something, and answers it."""
    async with asyncio.timeout(within_s):
        while not (answer := found()):
            await asyncio.sleep(0.005)
    return answer


@contextlib.asynccontextmanager
async def local_buses() -> AsyncIterator[Buses]:
    clock = Clock()
    bus = LocalBus(Journal(None), now=clock)
    both = Buses(bus, bus, clock)
    for vehicle in VEHICLES:
        bus.serve(vehicle, both.answer)
    yield both


@contextlib.asynccontextmanager
async def offering(bus: LocalBus, address: str, run: str, clock: Clock) -> AsyncIterator[NatsAgent]:
    """An agent that offers the vehicles of this bus."""
    async with connected(address) as client:
        agent = NatsAgent(bus, run=run, now=clock)
        await agent.start(client)
        await processed(client)
        try:
            yield agent
        finally:
            await agent.stop()


@contextlib.asynccontextmanager
async def node(address: str, clock: Clock, *, read: Read = as_it_is, **more: Any) -> AsyncIterator[NatsBus]:
    """The bus of a web node; `more` are parameters of it."""
    async with connected(address) as client:
        bus = NatsBus(now=clock, read=read, **more)
        await bus.start(client)
        await processed(client)
        try:
            yield bus
        finally:
            await bus.stop()


@contextlib.asynccontextmanager
async def nats_buses(agent_at: str, node_at: str) -> AsyncIterator[Buses]:
    """The node is there first, to receive the messages of an agent that starts."""
    async with local_buses() as both, node(node_at, both.clock) as page:
        async with offering(both.session, agent_at, "run-1", both.clock):
            await until(lambda: set(page.vehicles) == set(VEHICLES))
            both.page = page
            yield both
