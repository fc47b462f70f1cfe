"""From which moment the age of an order counts that was given by a state of an agent behind a radio."""

from __future__ import annotations

import asyncio
import math
import random
from collections.abc import Callable
from dataclasses import dataclass
from types import SimpleNamespace
from typing import Any, cast

import orjson
import pytest
from nats.aio.client import Client
from nats.aio.msg import Msg

from server.bus import nats_wire as wire
from server.bus.nats_bus import NatsBus
from server.bus.nats_clock import LikelyAhead

EVERY_S = 0.1  # a state is made
AHEAD_S = 1000.0  # the agent's clock
CHANGED_AT_S = 20.0
AGAIN_AFTER_S = 12.0  # a slew of 0.36 s takes 4.3 s of it
RADIOS = {"fair": (0.08, 0.02, 0.02), "weak": (0.15, 0.05, 0.05), "bad": (0.3, 0.1, 0.1)}  # delay, jitter, loss


@dataclass(frozen=True)
class Change:
    """Of one clock, [s]: slewed by 8.3 % as chrony does, or stood still."""

    agent_slewed_s: float = 0.0
    agent_stood_s: float = 0.0
    node_stood_s: float = 0.0

    def agent_s(self, at_s: float) -> float:
        since_s = max(0.0, at_s - CHANGED_AT_S)
        slewed_s = math.copysign(min(0.083 * since_s, abs(self.agent_slewed_s)), self.agent_slewed_s)
        return slewed_s - min(since_s, self.agent_stood_s)

    def node_s(self, at_s: float) -> float:
        return -min(max(0.0, at_s - CHANGED_AT_S), self.node_stood_s)


CHANGES = {
    "slewed forwards": Change(agent_slewed_s=0.36),
    "slewed backwards": Change(agent_slewed_s=-0.36),
    "agent stood still": Change(agent_stood_s=0.35),
    "node stood still": Change(node_stood_s=0.35),
}


class Radio:
    """To an agent and back; what is lost is repeated after a second. `agent_s` is the agent's clock."""

    def __init__(self, name: str, agent_s: Callable[[], float]) -> None:
        self.delay_s, self.jitter_s, self.loss = RADIOS[name]
        self.agent_s = agent_s
        self.chance = random.Random(38)

    async def passed(self) -> None:
        delay_s = self.delay_s + self.chance.uniform(-self.jitter_s, self.jitter_s)
        await asyncio.sleep(delay_s + (self.chance.random() < self.loss))

    async def request(self, _: str, body: bytes, timeout: float) -> Any:
        await self.passed()
        agent_s = self.agent_s()
        number = int(agent_s / EVERY_S)
        head = wire.FrameHead(run="a", number=number, now_s=agent_s, age_s=agent_s - number * EVERY_S)
        await self.passed()
        return SimpleNamespace(data=wire.encode_frame(head, f"{number}"))


@dataclass(frozen=True)
class Stated:
    """Of one state: the true time since the first pull, and both ages less the true age [s]."""

    at_s: float
    shown_s: float
    counted_s: float  # by an order


async def stated_ages(radio: str, for_s: float, change: Change | None = None) -> list[Stated]:
    """Pull states over a radio for so long, while a clock is changed."""
    loop = asyncio.get_running_loop()
    began_s = loop.time()
    stated: list[Stated] = []

    def node_s() -> float:
        return loop.time() + (change.node_s(loop.time() - began_s) if change else 0.0)

    def agent_s() -> float:
        return loop.time() + AHEAD_S + (change.agent_s(loop.time() - began_s) if change else 0.0)

    def read(vehicle: str, kind: str, payload: str | bytes, age_s: float, excess_s: float) -> str | bytes:
        true_s = agent_s() - int(payload) * EVERY_S
        stated.append(Stated(loop.time() - began_s, age_s - true_s, age_s - excess_s - true_s))
        return payload

    bus = NatsBus(now=node_s, read=read)
    request = Radio(radio, agent_s).request
    bus._questions.client = cast(Client, SimpleNamespace(request=request, is_connected=True))
    here = SimpleNamespace(subject="veh.ocelot.here", data=orjson.dumps({"run": "a", "last": 0}))
    await bus._on_here(cast(Msg, here))
    bus.watch("ocelot", lambda _: None)
    await asyncio.sleep(for_s)
    await bus.stop()
    return stated


@pytest.mark.virtual_time
@pytest.mark.parametrize("radio", RADIOS)
async def test_an_order_counts_from_the_moment_at_which_its_state_was_made(radio: str) -> None:
    stated = await stated_ages(radio, 60.0)
    later = stated[len(stated) // 6 :]  # once a few least delays are known
    assert len(later) > 50
    assert min(one.shown_s for one in stated) >= 0.0, "no state is shown younger than it is"
    assert max(one.shown_s for one in later) >= RADIOS[radio][0] - RADIOS[radio][1], (
        "by the delay to the agent at least"
    )
    assert max(abs(one.counted_s) for one in later) <= 0.02


@pytest.mark.virtual_time
@pytest.mark.parametrize("change", CHANGES.values(), ids=CHANGES)
async def test_seconds_after_a_slew_or_a_pause_within_a_round_trip_an_order_counts_from_the_true_moment_again(
    change: Change,
) -> None:
    stated = await stated_ages("bad", CHANGED_AT_S + 30.0, change)
    later = [one.counted_s for one in stated if one.at_s >= CHANGED_AT_S + AGAIN_AFTER_S]
    assert len(later) > 50
    assert max(map(abs, later)) < 0.05


def test_the_likely_difference_of_two_clocks_begins_anew_where_one_stood_still() -> None:
    likely = LikelyAhead()
    likely.answered(0.0, 1000.3, 1000.4, 0.5)  # 0.3 s to the agent, 0.1 s back
    assert likely.when(1000.4) == pytest.approx(0.3)
    likely.answered(1.0, 1001.1, 1001.1, 1.4)  # 0.1 s to the agent, 0.3 s back
    assert likely.when(1001.1) == pytest.approx(1.1, abs=0.001), "the least of both"
    likely.answered(31.0, 1031.5, 1031.5, 32.0)
    assert likely.when(1031.5) == pytest.approx(31.5, abs=0.001), "also 30 s later"
    for ahead_s in (1005.0, 995.0):
        likely.answered(40.0, 40.1 + ahead_s, 40.1 + ahead_s, 40.3)
        assert likely.when(40.1 + ahead_s) == pytest.approx(40.15, abs=0.001)
