"""The states that an agent sends unasked behind a gap, and how old a node takes them to be."""

from __future__ import annotations

import asyncio
import base64
import random
from types import SimpleNamespace
from typing import Any, cast

import orjson
import pytest
from nats.aio.client import Client
from nats.aio.msg import Msg

from server.bus import nats_wire as wire
from server.bus.nats_agent import NatsAgent
from server.bus.nats_agent_frames import FIRST_EVERY_S, LOOKED_AT_S, MOST_FIRST, SentFrames
from server.bus.nats_bus import NatsBus
from server.bus.nats_clock import DRIFT, ROUNDING_S, SLEWS, AgentAhead, Steady
from tests.server.bus.broker import connected, running_broker
from tests.server.bus.buses import Clock, local_buses, node, offering, until

ONE_PACKET = 1448 - len("PUB veh.ocelot.here 1448\r\n\r\n")
STATE = random.Random(1).randbytes(8000).hex()


async def nothing(*_: Any, **__: Any) -> Any:
    return SimpleNamespace(unsubscribe=nothing)


class Air:
    """What an agent publishes by its connections."""

    def __init__(self) -> None:
        self.heres: list[wire.Here] = []
        self.client = cast(Client, SimpleNamespace(publish=self.publish, subscribe=nothing, flush=nothing,
                                                   is_connected=True, max_payload=1 << 20))  # fmt: skip

    async def publish(self, subject: str, data: bytes) -> None:
        if subject == "veh.ocelot.here":
            self.heres.append(wire.decode(wire.Here, data))


async def pull(agent: NatsAgent, **fields: Any) -> None:
    body = orjson.dumps({"run": "a", "inflates": True, "is_base": True, **fields})
    await agent._on_pull(cast(Msg, SimpleNamespace(subject="veh.ocelot.pull.state", data=body, reply="node")))
    await asyncio.sleep(0.01)


@pytest.mark.virtual_time
async def test_behind_a_gap_a_few_states_go_unasked() -> None:
    air = Air()
    async with local_buses() as both:
        agent = NatsAgent(both.session, run="a", now=both.clock)

        async def drive(lasts_s: float) -> list[wire.Here]:
            air.heres.clear()
            for _ in range(round(lasts_s / FIRST_EVERY_S)):
                both.session.put("ocelot", "state", f"{STATE}{both.clock()}")
                await asyncio.sleep(FIRST_EVERY_S)
            return [here for here in air.heres if here.state]

        await agent.start(air.client)
        assert await drive(2.0) == [], "nobody looks"
        both.session.put("ocelot", "state", f"{STATE}0")
        await pull(agent, have=0, run="", is_base=False)
        base = both.session.newest("ocelot", "state")
        assert base is not None
        await pull(agent, have=base.number)
        assert await drive(2.0) == []
        await asyncio.sleep(5.0)
        assert not both.session.watched("ocelot")
        await agent.start(air.client)
        await asyncio.sleep(0)
        assert both.session.watched("ocelot"), "else no state is made"
        sent = await drive(4.0)
        assert len(sent) == MOST_FIRST - 1, "none was made yet for the first one, and a hop that stalls finds no more"
        heads = [wire.decode_frame(_data(here), f"{STATE}0".encode())[0] for here in sent]
        assert [head.number for head in heads] == [*range(heads[0].number, heads[0].number + MOST_FIRST - 1)]
        assert all(0 <= head.age_s <= FIRST_EVERY_S + 1e-6 for head in heads), "each is the newest"
        assert max(len(wire.encode(here)) for here in sent) < 1000, "one packet"
        air.heres.clear()
        await agent.start(air.client)
        both.session.put("ocelot", "state", random.Random(2).randbytes(8000).hex())
        await asyncio.sleep(2.0)
        assert not any(here.state for here in air.heres), "one that is large is left to the pull"
        await agent.start(air.client)
        await asyncio.sleep(0)
        await pull(agent, have=heads[-1].number)
        assert len(await drive(4.0)) == MOST_FIRST - 1, (
            "also beside answers, which a lost packet holds up; the last one that was sent is one by which others are "
            "compressed"
        )
        await agent.stop()


@pytest.mark.virtual_time
async def test_first_states_go_by_others_in_turn_as_well() -> None:
    """A lost packet holds up by a round trip all that follows it in its connection."""
    air, idle = Air(), [Air(), Air()]
    async with local_buses() as both:
        agent = NatsAgent(both.session, run="a", now=both.clock)
        await agent.start(air.client)
        both.session.put("ocelot", "state", f"{STATE}0")
        await pull(agent, have=0, run="", is_base=False)
        await pull(agent, have=1)
        await asyncio.sleep(5.0)
        agent.beside = lambda: [one.client for one in idle]
        await agent.start(air.client)
        air.heres.clear()
        for n in range(MOST_FIRST + 5):
            await asyncio.sleep(FIRST_EVERY_S / 2)
            both.session.put("ocelot", "state", f"{STATE}{n}")
            await asyncio.sleep(FIRST_EVERY_S / 2)
        sent = [here for here in air.heres if here.state]
        assert len(sent) == MOST_FIRST - 1
        assert [here.state for here in idle[1].heres] == [here.state for here in sent[::2]]
        assert [here.state for here in idle[0].heres if here.state] == [here.state for here in sent[1::2]]
        assert all(here.is_copy for one in idle for here in one.heres)
        assert not any(here.is_copy for here in air.heres)
        await pull(agent, have=sent[-1].base + MOST_FIRST - 1)
        air.heres.clear()

        async def closed(*_: Any) -> None:
            raise RuntimeError("unable to perform operation; the handler is closed")

        agent.beside = lambda: [cast(Client, SimpleNamespace(publish=closed))]
        await agent.start(air.client)
        for n in range(MOST_FIRST + 5):
            both.session.put("ocelot", "state", f"{STATE}{n}")
            await asyncio.sleep(FIRST_EVERY_S)
        assert sum(here.state != "" for here in air.heres) >= MOST_FIRST - 1, "whatever another one raises"
        air.client.is_connected = False  # type: ignore[misc]
        agent.beside = lambda: [idle[0].client]
        idle[0].heres.clear()
        await agent.start(air.client)
        await asyncio.sleep(1.0)
        assert not idle[0].heres, "by one that is lost nothing can be requested: no page is to show it as live"
        await agent.stop()


@pytest.mark.virtual_time
async def test_none_goes_unasked_where_a_node_cannot_know_its_age_or_nobody_looked_for_long() -> None:
    slewed_s = 0.0
    async with local_buses() as both:
        frames = SentFrames(both.session, "a", both.clock, lambda: slewed_s)
        pull = wire.Pull(have=1, run="a", inflates=True, is_base=True)

        def sent(number: int) -> bool:
            both.session.put("ocelot", "state", f"{STATE}{number}")
            return frames.announcement("ocelot", 1, is_first=True).state != ""

        both.session.put("ocelot", "state", f"{STATE}1")
        frame = both.session.newest("ocelot", "state")
        frames.compressed("ocelot", "state", frames.encoded(both.clock(), frame), frame, pull)
        frames.note_pull("ocelot", "state", pull)
        both.clock.ahead_s += 30.0
        frames.begin_first()
        assert sent(2)
        slewed_s = 0.1
        assert not sent(3), "the clock was slewed since the last pull"
        slewed_s = 0.0
        assert sent(4)
        frames.note_pull("ocelot", "state", wire.Pull(have=0, run=""))
        assert sent(5), "what a node requests that has nothing ends them for no other one"
        both.clock.ahead_s += LOOKED_AT_S
        frames.begin_first()
        assert frames.first_due == []


@pytest.mark.virtual_time
async def test_pulls_of_a_node_that_come_together_are_answered_by_one_state_after_the_other() -> None:
    """Over a radio that held them up, all with the same one would be packets for nothing."""
    answers: list[tuple[str, int]] = []

    async def publish(subject: str, data: bytes) -> None:
        if subject.startswith("_INBOX"):
            answers.append((subject, wire.decode_frame(data)[0].number))

    async with local_buses() as both:
        agent = NatsAgent(both.session, run="a", now=both.clock)
        client = SimpleNamespace(
            publish=publish, subscribe=nothing, flush=nothing, is_connected=True, max_payload=1 << 20
        )
        await agent.start(cast(Client, client))
        both.session.put("ocelot", "state", "0")
        both.session.put("ocelot", "scan", "0")
        for kind, number in (("state", 3), ("scan", 2)):
            for reply in [f"_INBOX.a.{kind}{n}" for n in range(number)] + ["_INBOX.b.0"]:
                data = orjson.dumps({"have": 0, "run": ""})
                message = SimpleNamespace(subject=f"veh.ocelot.pull.{kind}", data=data, reply=reply)
                await agent._on_pull(cast(Msg, message))
        await asyncio.sleep(0.01)
        assert answers == [(f"_INBOX.{one}", 1) for one in ("a.state0", "b.0", "a.scan0", "a.scan1", "b.0")]
        for n in (1, 2):
            both.session.put("ocelot", "state", str(n))
            await asyncio.sleep(0.01)
        assert answers[5:] == [("_INBOX.a.state2", 2), ("_INBOX.a.state1", 3)], "the older one may be given up"
        await agent.stop()


async def test_the_announcement_with_a_state_is_one_packet_over_ethernet() -> None:
    """Two are lost nearly twice as often."""
    chance = random.Random(4)

    def state() -> str:
        def signal(n: int) -> dict[str, Any]:
            value = round(chance.gauss(0, 1), 4) if n % 3 == 0 else n
            return {"value": value, "age_s": round(chance.random(), 2) if n % 3 == 0 else 0.1, "state": "ok", "why": ""}

        return orjson.dumps({f"signal{n}": signal(n) for n in range(260)}).decode()

    async with local_buses() as both:
        frames = SentFrames(both.session, "a", both.clock, lambda: 0.0)
        pull = wire.Pull(have=1, run="a", inflates=True, is_base=True)
        both.session.put("ocelot", "state", state())
        frame = both.session.newest("ocelot", "state")
        frames.compressed("ocelot", "state", frames.encoded(both.clock(), frame), frame, pull)
        frames.note_pull("ocelot", "state", pull)
        frames.begin_first()
        both.session.put("ocelot", "state", state())
        here = frames.announcement("ocelot", 1, is_first=True)
        assert here.state
        assert len(wire.encode(here)) < ONE_PACKET


def _data(here: wire.Here) -> bytes:
    return base64.b64decode(here.state)


async def test_through_a_broker_they_come_without_a_pull() -> None:
    async with running_broker() as broker, local_buses() as both, connected(broker.address) as second:
        async with (
            node(broker.address, both.clock) as page,
            offering(both.session, broker.address, "a", both.clock) as agent,
        ):
            page.watch("ocelot", lambda _: None)
            for n in range(5):
                both.session.put("ocelot", "state", f"{STATE}{n}")
                await until(lambda n=n: _newest(page) == f"{STATE}{n}")
            agent._on_pull = nothing  # type: ignore[method-assign]
            await agent.start(second)
            both.session.put("ocelot", "state", "back")
            await until(lambda: _newest(page) == "back")


def _newest(page: NatsBus) -> str | bytes | None:
    frame = page.newest("ocelot", "state")
    return frame and frame.payload


class StillClock(Clock):
    """Shows what it was put to: a busy machine makes nothing older."""

    def __call__(self) -> float:
        return self.ahead_s


class Node:
    """A node that pulled frame 1 of run `a`, whose agent's clock is 1000 s ahead of its own."""

    def __init__(self) -> None:
        self.clock = StillClock()
        self.bus = NatsBus(now=self.clock)
        self.there_s = 0.25  # from node to agent
        self.answers = 1
        self.bus._questions.client = cast(Client, SimpleNamespace(request=self.request, is_connected=True))

    async def request(self, subject: str, body: bytes, timeout: float) -> Any:
        if not self.answers:
            await asyncio.Event().wait()
        self.answers -= 1
        self.clock.ahead_s += self.there_s
        head = wire.FrameHead(run="a", number=1, now_s=self.clock() + 1000.0)
        return SimpleNamespace(data=wire.encode_frame(head, f"{STATE}1"))

    async def here(self, *, run: str = "a", **more: Any) -> None:
        body = wire.encode(wire.Here(run=run, last=0, resumes=True, **more))
        await self.bus._on_here(cast(Msg, SimpleNamespace(subject="veh.ocelot.here", data=body)))

    async def unasked(self, number: int, *, late_s: float = 0.0, ahead_s: float = 1000.0, **more: Any) -> None:
        """A state that is 0.05 s old when it is sent, and comes `late_s` after that."""
        head = wire.FrameHead(run="a", number=number, now_s=self.clock() + ahead_s, age_s=0.05)
        data = wire.compressed(wire.encode_frame(head, f"{STATE}{number}"), f"{STATE}1".encode())
        self.clock.ahead_s += late_s
        await self.here(**{"state": base64.b64encode(data).decode(), "base": 1, **more})

    @property
    def age_s(self) -> float:
        frame = self.bus.newest("ocelot", "state")
        return float("inf") if frame is None else self.clock() - frame.put_s


async def test_an_unasked_state_is_never_shown_younger_than_it_is() -> None:
    at = Node()
    await at.here()
    at.bus.watch("ocelot", lambda _: None)
    await until(lambda: _newest(at.bus) == f"{STATE}1")
    at.clock.ahead_s += 30.0
    await at.unasked(2, late_s=0.6)
    assert _newest(at.bus) == f"{STATE}2"
    least_s = 0.65 + at.there_s
    most_s = least_s + SLEWS * at.there_s + 30.6 * DRIFT + ROUNDING_S
    assert at.age_s == pytest.approx(most_s), "with the way of the pull before the gap, and the drift"
    await at.unasked(1)
    assert _newest(at.bus) == f"{STATE}2", "it is an old one"
    await at.bus.stop()


async def test_an_unasked_state_is_not_shown_younger_where_the_clocks_drifted() -> None:
    at = Node()
    at.there_s = 0.0
    await at.here()
    at.bus.watch("ocelot", lambda _: None)
    await until(lambda: _newest(at.bus) == f"{STATE}1")
    at.clock.ahead_s += 30.0
    await at.unasked(2, ahead_s=1000.0 + 30 * DRIFT / 2)
    assert 0.05 <= at.age_s <= 0.05 + 30 * DRIFT + ROUNDING_S
    await at.bus.stop()


@pytest.mark.parametrize("more", [
    {"run": "b"}, {"base": 7}, {"base": 0}, {"state": "ü"}, {"state": "x"},
    {"state": base64.b64encode(b"x{}").decode()}, {"ahead_s": 1005.0},
])  # fmt: skip
async def test_an_unasked_state_is_left_out_where_it_cannot_be_read_or_its_age_is_not_known(
    more: dict[str, Any],
) -> None:
    at = Node()
    await at.here()
    at.bus.watch("ocelot", lambda _: None)
    await until(lambda: _newest(at.bus) == f"{STATE}1")
    await at.unasked(2, **more)
    assert _newest(at.bus) == f"{STATE}1"
    if "ahead_s" not in more and "run" not in more:
        await at.unasked(3)
        assert _newest(at.bus) == f"{STATE}3", "the next one is"
    assert at.bus._questions.refused == (more.get("base") is None and "state" in more)
    await at.bus.stop()


async def test_of_a_copy_only_its_state_counts() -> None:
    """It may come before the subscriptions, or late by a connection that was lost: no request finds the agent by it."""
    at = Node()
    await at.here(connection=1)
    at.bus.watch("ocelot", lambda _: None)
    await until(lambda: _newest(at.bus) == f"{STATE}1")
    at.clock.ahead_s += 30.0
    assert at.bus.link_trouble("ocelot")
    await at.unasked(2, connection=2, is_copy=True)
    assert _newest(at.bus) == f"{STATE}2"
    assert at.bus.link_trouble("ocelot")
    at.answers = 1
    await asyncio.sleep(0.01)
    assert at.answers == 1, "nothing is requested again"
    await at.here(connection=2)
    assert at.bus.link_trouble("ocelot") is None
    await until(lambda: at.answers == 0)
    await at.bus.stop()


async def test_of_a_late_announcement_by_an_earlier_connection_only_its_state_counts() -> None:
    """The system delivers it after the connection was lost; it is as old as it is."""
    at = Node()
    await at.here(connection=2)
    at.bus.watch("ocelot", lambda _: None)
    await until(lambda: _newest(at.bus) == f"{STATE}1")
    at.clock.ahead_s += 30.0
    at.answers = 1
    await at.unasked(2, connection=1, late_s=0.6)
    assert _newest(at.bus) == f"{STATE}2"
    assert at.age_s >= 0.65 + at.there_s
    assert at.bus.link_trouble("ocelot")
    await asyncio.sleep(0.01)
    assert at.answers == 1, "nothing is requested again"
    await at.bus.stop()


async def test_what_nobody_looks_at_is_not_taken() -> None:
    at = Node()
    await at.here()
    at.bus.watch("ocelot", lambda _: None)()
    await at.unasked(2)
    assert _newest(at.bus) is None
    await at.bus.stop()


def test_the_least_way_bounds_the_clock_until_slewing_makes_it_worthless_or_a_clock_stood_still() -> None:
    slewed_s = 0.0
    ahead = AgentAhead(Steady(lambda: slewed_s))
    assert ahead.earliest(1000.0, 0.0) == -float("inf")
    ahead.answered(0.0, 1000.3, 0.6)
    assert ahead.earliest(1000.6, 0.6) == pytest.approx(0.3 - 0.6 * SLEWS)
    ahead.answered(1.0, 1001.1, 1.6)
    assert ahead.earliest(1001.6, 1.6) == pytest.approx(1.5 - 0.6 * SLEWS), "the shorter way counts"
    ahead.answered(2.0, 1002.5, 2.6)
    assert ahead.earliest(1002.6, 2.6) == pytest.approx(2.5 - 1.6 * SLEWS), (
        "and what a clock may have been slewed since"
    )
    ahead.answered(3.0, 1003.1, 3.6)
    assert ahead.earliest(1033.6, 33.6) == pytest.approx(33.5 - 0.6 * SLEWS - 30 * DRIFT - ROUNDING_S)
    slewed_s = 0.1
    assert ahead.earliest(1033.6, 33.6) == -float("inf"), "a clock was slewed"
    slewed_s = 0.0
    ahead.received(1033.6, 33.6)
    assert ahead.earliest(1033.6, 33.6) > 33.0
    ahead.received(1038.0, 33.6)
    assert ahead.earliest(1033.6, 33.6) == -float("inf"), "this one stood still"
    ahead.answered(35.0, 1036.2, 35.6)
    assert ahead.earliest(1037.2, 36.6) > 35.5


@pytest.mark.parametrize("rate", [1.083, 0.917])
def test_a_clock_that_is_slewed_makes_no_state_younger(rate: float) -> None:
    """Over 0.25 to 0.5 s each way, with a state every 0.1 s."""
    chance = random.Random(38)
    ahead = AgentAhead(Steady(lambda: 0.0))
    for n in range(600):
        requested_s = n / 10
        reached_s = requested_s + chance.uniform(0.25, 0.5)
        now_s = reached_s + chance.uniform(0.25, 0.5)
        ahead.received(1000.0 + rate * reached_s, now_s)
        ahead.answered(requested_s, 1000.0 + rate * reached_s, now_s)
        assert ahead.earliest(1000.0 + rate * reached_s, now_s) <= reached_s
