"""When a node requests frames of an agent."""

from __future__ import annotations

import asyncio
from types import SimpleNamespace
from typing import Any, cast

from nats.aio.client import Client
from nats.aio.msg import Msg

from server.bus import nats_wire as wire
from server.bus.nats_agent import NatsAgent
from server.bus.nats_bus import NatsBus
from server.bus.nats_pulls import MOST, Pulls
from server.bus.nats_questions import GONE_AFTER_S, Questions
from tests.server.bus.buses import Clock, local_buses, until


async def test_an_agent_that_answers_at_once_does_not_keep_the_node_busy() -> None:
    requests = 0

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        nonlocal requests
        requests += 1
        await asyncio.sleep(0)
        head = wire.FrameHead(run="a", number=requests if requests % 2 else 0, now_s=1.0)
        return SimpleNamespace(data=wire.encode_frame(head, "x"))

    now = asyncio.get_running_loop().time
    questions = Questions(now=now)
    questions.client = cast(Client, SimpleNamespace(request=request))
    pulls = Pulls(questions, lambda *_: None, lambda *_: None, now=now)
    pulls.look("ocelot", "state", True)
    began_s = now()
    await until(lambda: requests > 2 * MOST + 5)
    took_s = now() - began_s
    assert requests <= MOST * (took_s + 1) + 5
    assert took_s >= 1.9, "the third hundred is not requested before the third second"
    await pulls.stop()


async def test_what_was_requested_of_an_agent_that_was_gone_is_requested_anew_once_it_is_back() -> None:
    """Behind a gap no page waits until the lost request has ended."""
    requests: list[str] = []

    async def request(subject: str, body: bytes, timeout: float) -> Any:
        requests.append(subject)
        await asyncio.Event().wait()

    clock = Clock()
    bus = NatsBus(now=clock)
    bus._questions.client = cast(Client, SimpleNamespace(request=request, is_connected=True))

    async def come(vehicle: str) -> None:
        here = wire.encode(wire.Here(run="a", last=0, resumes=True))
        await bus._on_here(cast(Msg, SimpleNamespace(subject=wire.subject(vehicle, "here"), data=here)))
        await asyncio.sleep(0)

    for vehicle in ("ocelot", "margay"):
        await come(vehicle)
        bus.watch(vehicle, lambda _: None)
    await until(lambda: len(requests) == 2)
    clock.ahead_s += 1.0
    await come("ocelot")
    assert len(requests) == 2, "it was not gone"
    clock.ahead_s += GONE_AFTER_S + 0.1
    await come("ocelot")
    await until(lambda: len(requests) == 3)
    assert requests[2] == wire.subject("ocelot", "pull.state")
    await bus.stop()


async def test_an_agent_announces_itself_as_soon_as_the_broker_is_there_again() -> None:
    sent: list[str] = []

    async def publish(subject: str, body: bytes) -> None:
        sent.append(subject)

    client = SimpleNamespace(publish=publish, is_connected=False)
    clock = Clock()
    async with local_buses() as both:
        agent = NatsAgent(both.session, run="a", now=clock)
        agent._client, agent._published = cast(Client, client), {"ocelot": 0}
        announcing = asyncio.create_task(agent._be_here())
        await asyncio.sleep(0.02)
        began_s = clock()
        client.is_connected = True
        await until(lambda: sent)
        assert clock() - began_s < wire.HERE_EVERY_S / 2
        announcing.cancel()
