"""From which moment the age of an order counts that was given by a state of an agent behind a radio."""

from __future__ import annotations

import asyncio
import random
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
RADIOS = {"fair": (0.08, 0.02, 0.02), "weak": (0.15, 0.05, 0.05), "bad": (0.3, 0.1, 0.1)}  # delay, jitter, loss


class Radio:
    """To an agent and back; what is lost is repeated after a second."""

    def __init__(self, name: str) -> None:
        self.delay_s, self.jitter_s, self.loss = RADIOS[name]
        self.chance = random.Random(38)

    async def passed(self) -> None:
        way_s = self.delay_s + self.chance.uniform(-self.jitter_s, self.jitter_s)
        await asyncio.sleep(way_s + (self.chance.random() < self.loss))

    async def request(self, _: str, body: bytes, timeout: float) -> Any:
        await self.passed()
        agent_s = asyncio.get_running_loop().time() + AHEAD_S
        number = int(agent_s / EVERY_S)
        head = wire.FrameHead(run="a", number=number, now_s=agent_s, age_s=agent_s - number * EVERY_S)
        await self.passed()
        return SimpleNamespace(data=wire.encode_frame(head, f"{number}"))


@pytest.mark.virtual_time
@pytest.mark.parametrize("radio", RADIOS)
async def test_an_order_counts_from_the_moment_at_which_its_state_was_made(radio: str) -> None:
    now = asyncio.get_running_loop().time
    stated: list[tuple[float, float]] = []  # age and what an order counts, both less the true age

    def read(vehicle: str, kind: str, payload: str | bytes, age_s: float, excess_s: float) -> str | bytes:
        true_s = now() + AHEAD_S - int(payload) * EVERY_S
        stated.append((age_s - true_s, age_s - excess_s - true_s))
        return payload

    bus = NatsBus(now=now, read=read)
    bus._questions.client = cast(Client, SimpleNamespace(request=Radio(radio).request, is_connected=True))
    here = SimpleNamespace(subject="veh.ocelot.here", data=orjson.dumps({"run": "a", "last": 0}))
    await bus._on_here(cast(Msg, here))
    bus.watch("ocelot", lambda _: None)
    await asyncio.sleep(60.0)
    await bus.stop()
    later = stated[len(stated) // 6 :]  # once a few least ways are known
    assert len(later) > 50
    assert min(age_s for age_s, _ in stated) >= 0.0, "no state is shown younger than it is"
    assert max(age_s for age_s, _ in later) >= RADIOS[radio][0] - RADIOS[radio][1], "by the way there at least"
    assert max(abs(counted_s) for _, counted_s in later) <= 0.02


def test_the_likely_difference_of_two_clocks_begins_anew_where_one_stood_still() -> None:
    likely = LikelyAhead()
    likely.answered(0.0, 1000.3, 1000.4, 0.5)  # 0.3 s there, 0.1 s back
    assert likely.when(1000.4) == pytest.approx(0.3)
    likely.answered(1.0, 1001.1, 1001.1, 1.4)  # 0.1 s there, 0.3 s back
    assert likely.when(1001.1) == pytest.approx(1.1, abs=0.001), "the least of both"
    likely.answered(31.0, 1031.5, 1031.5, 32.0)
    assert likely.when(1031.5) == pytest.approx(31.5, abs=0.001), "also 30 s later"
    for ahead_s in (1005.0, 995.0):
        likely.answered(40.0, 40.1 + ahead_s, 40.1 + ahead_s, 40.3)
        assert likely.when(40.1 + ahead_s) == pytest.approx(40.15, abs=0.001)
