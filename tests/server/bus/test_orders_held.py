"""Orders that were held up on their way through the broker: none acts late, and each sender gets the reason."""

from __future__ import annotations

import asyncio
import contextlib
import os
import random
import signal
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from typing import Any, Literal, get_args

import pytest

from server.bus.bus import NotServed
from server.bus.nats_agent import NatsAgent
from tests.page.radio import Radio
from tests.server.bus.broker import connected, running_broker
from tests.server.bus.buses import SOON_S, VEHICLES, Buses, local_buses, node, until

Place = Literal["broker", "the node's radio", "the agent's radio", "agent"]
PLACES: tuple[Place, ...] = get_args(Place)
WITHIN_S = 0.5
AT_ONCE = 50  # an agent takes 64 requests at once


class Way:
    """From a node to an agent, with one place where it can be held up."""

    def __init__(
        self,
        both: Buses,
        hold: Callable[[], None],
        let_go: Callable[[], None],
        is_there: Callable[[], bool],
        late: Sequence[tuple[int, str]],
    ) -> None:
        self.both = both
        self.hold = hold
        self.let_go = let_go
        self.is_there = is_there  # the orders are where they are held
        self.late = late  # what the agent reported as late: its number, and why


@contextlib.asynccontextmanager
async def way(place: Place) -> AsyncIterator[Way]:
    open_, waiting = asyncio.Event(), 0
    open_.set()
    late: list[tuple[int, str]] = []

    async def admit(vehicle: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        nonlocal waiting
        waiting += 1
        await open_.wait()
        waiting -= 1
        return message

    async with running_broker() as broker, local_buses() as both:
        near, far = Radio(broker.port), Radio(broker.port)
        async with near.on_air() as node_at, far.on_air() as agent_at, node(nats(node_at), both.clock) as page:
            both.page = page
            async with connected(nats(agent_at)) as client:
                agent = NatsAgent(
                    both.session, run="run-1", now=both.clock, admit=admit,
                    on_late=lambda _, command, why: command["what"] < 0 or late.append((command["what"], why)),
                )  # fmt: skip
                await agent.start(client)
                await until(lambda: set(page.vehicles) == set(VEHICLES))
                match place:
                    case "broker":
                        hold, let_go = (lambda: freeze(broker.pid)), (lambda: os.kill(broker.pid, signal.SIGCONT))
                    case "agent":
                        hold, let_go = open_.clear, open_.set
                    case _:
                        radio = near if "node" in place else far
                        hold, let_go = radio.cut, radio.mend
                try:
                    yield Way(both, hold, let_go, lambda: place != "agent" or waiting == AT_ONCE, late)
                finally:
                    let_go()
                    await agent.stop()


def freeze(pid: int) -> None:
    """Stops all its threads: from now on nothing is carried."""
    os.kill(pid, signal.SIGSTOP)
    os.waitid(os.P_PID, pid, os.WSTOPPED)


def nats(address: str) -> str:
    return address.replace("http", "nats")


async def given(both: Buses, number: int) -> NotServed | Mapping[str, Any]:
    """The sender's answer."""
    try:
        return await both.page.request("ocelot", {"what": number}, deadline_s=30.0, comes_within_s=WITHIN_S)
    except NotServed as why:
        return why


async def served(both: Buses) -> None:
    """The agent is connected, and takes an order."""
    async with asyncio.timeout(SOON_S):
        while await given(both, -1) != {"ok": True, "got": -1}:
            await asyncio.sleep(0.05)


@pytest.mark.parametrize("place", PLACES)
async def test_an_order_that_was_held_up_is_not_carried_out_and_its_sender_is_notified(place: Place) -> None:
    await hold_up(place, (0.51, 10.0))


@pytest.mark.field
@pytest.mark.parametrize("place", PLACES)
async def test_of_a_thousand_orders_none_acts_late(place: Place) -> None:
    chance = random.Random(38)
    await hold_up(place, [chance.uniform(WITHIN_S, 10.0) for _ in range(1000 // AT_ONCE // len(PLACES))])


async def hold_up(place: Place, holds_s: Sequence[float]) -> None:
    """Holds up orders for so long by the clock of both sides, and before each hold gives one that comes in time."""
    async with way(place) as held:
        both = held.both
        for n, hold_s in enumerate(holds_s):
            await served(both)
            held.hold()
            under_way = [asyncio.create_task(given(both, number)) for number in range(AT_ONCE)]
            await asyncio.sleep(0.05)
            await until(held.is_there)
            both.clock.ahead_s += hold_s
            held.let_go()
            answers = await asyncio.gather(*under_way)
            for one in answers:
                assert isinstance(one, NotServed), one
                assert str(one) == "the command reached ocelot too late and was not carried out"
                assert (one.outcome, one.cut) == ("not_delivered", None), "its agent answers"
            assert {one["what"] for one in both.commands} == {-1}
            assert sorted(number for number, _ in held.late) == sorted([*range(AT_ONCE)] * (n + 1))
            assert all("after its deadline" in why for _, why in held.late)


@pytest.mark.field
@pytest.mark.parametrize("place", PLACES)
async def test_an_order_that_was_held_up_for_less_is_carried_out(place: Place) -> None:
    async with way(place) as held:
        both = held.both
        await served(both)
        held.hold()
        under_way = asyncio.create_task(given(both, 1))
        await asyncio.sleep(0.05)
        held.let_go()
        assert await under_way == {"ok": True, "got": 1}
