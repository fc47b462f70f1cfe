"""An order under outages: no command arrives late, none twice, and the ramp goes on from the speed that is measured."""

from __future__ import annotations

import asyncio
import itertools
import random
import time
from typing import Any

import httpx
import pytest

from server.rosbridge_server.server import RosBridge
from tests.server.cars import driving
from tests.server.slowdown.conftest import field, simulated, watching
from tests.server.slowdown.deaf import one_way

TOPIC = "/catvehicle/cmd_vel"
LATE_S = 0.3
OUTAGES = [
    pytest.param(4, marks=pytest.mark.slow),
    pytest.param(50, marks=[pytest.mark.soak, pytest.mark.timeout(900)]),
]


@pytest.mark.field
@pytest.mark.parametrize("outages", OUTAGES)
async def test_no_command_arrives_late_and_none_twice(bridge: RosBridge, server: str, outages: int) -> None:
    """Of a stamped command the stamp tells when it was made. A bridge that freezes holds what had reached it already,
    and says it when it thaws: no sender can take that back. At most two commands an outage are under way so."""
    bridge.advertise(TOPIC, "geometry_msgs/TwistStamped")
    heard: list[tuple[float, float]] = []  # made and arrived, s since 1970

    def hear(topic: str, kind: str, said: dict[str, Any]) -> None:
        if topic == TOPIC:
            stamp = said["header"]["stamp"]
            heard.append((stamp["secs"] + stamp["nsecs"] / 1e9, time.time()))

    bridge.on_publish.append(hear)
    dice = random.Random(7)
    async with (
        driving(bridge, speed=lambda _: 5.0, steers=True),
        httpx.AsyncClient(base_url=server, timeout=10.0) as client,
    ):

        async def until(what: str, seconds: float = 20.0) -> None:
            ends_s = time.monotonic() + seconds
            while True:
                slow = (await client.get("/api/state")).json()["decelerate"]
                order = slow["order"] or {}
                if {
                    "safe": slow["state"] == "safe",
                    "sends": order.get("sending"),
                    "cut": order.get("sending") is False,
                }[what]:
                    return
                assert time.monotonic() < ends_s, slow
                await asyncio.sleep(0.02)

        await until("safe")
        assert (await client.post("/api/slow-down/arm")).is_success
        assert (await client.post("/api/slow-down/order")).is_success
        frozen: list[tuple[float, float]] = []
        for outage in range(outages):
            await until("sends")
            await asyncio.sleep(dice.uniform(0.2, 0.5))
            began_s = time.time()
            if outage % 2:
                bridge.freeze()
            else:
                await bridge.kill()
            await until("cut", 2.0)
            await asyncio.sleep(dice.uniform(0.1, 1.2))
            if outage % 2:
                bridge.thaw()
            else:
                await bridge.revive()
            frozen.append((began_s, time.time()))
        await until("sends")
    made = [stamp_s for stamp_s, _ in heard]
    assert len(made) == len(set(made))  # none twice
    assert made == sorted(made)  # and none overtaken
    late = [
        (stamp_s, at_s - stamp_s)
        for stamp_s, at_s in heard
        if at_s - stamp_s > LATE_S and not any(a - 0.05 <= stamp_s <= a + LATE_S + 0.15 for a, _ in frozen)
    ]
    assert late == []
    for began_s, ended_s in frozen:
        assert sum(began_s <= stamp_s <= ended_s for stamp_s in made) <= 2  # what was under way when it froze


@pytest.mark.field
@pytest.mark.slow
@pytest.mark.parametrize("fault", ["bridge-killed", "bridge-frozen"])
async def test_the_ramp_goes_on_from_the_speed_that_is_measured(fault: str) -> None:
    async with field() as car:
        await car.armed()
        assert (await car.post("order")).is_success
        await asyncio.sleep(0.4)
        car.service.start_scenario(fault, 1.2)
        await car.until(lambda state: not state["decelerate"]["order"]["sending"], 3.0)
        cut_s = time.monotonic()
        await car.until(lambda state: state["decelerate"]["order"]["sending"], 10.0)
        await asyncio.sleep(0.4)
        after = [speed for at_s, speed in car.speeds if at_s >= cut_s]
        first = next(index for index, (at_s, _, _) in enumerate(car.heard) if at_s >= cut_s)
        assert after[0] == pytest.approx(car.driven[first], abs=0.5)
        assert all(b < a + 0.05 for a, b in itertools.pairwise(after[1:]))


@pytest.mark.field
@pytest.mark.slow
async def test_a_bridge_that_talks_on_and_reads_no_command_is_doubted_and_dialled_anew() -> None:
    async with simulated() as (service, direct), one_way(int(direct.rpartition(":")[2])) as (way, address):
        async with watching(service, address) as car:
            await car.armed()
            assert (await car.post("order")).is_success
            await car.until(lambda state: state["decelerate"]["order"]["sending"])
            await asyncio.sleep(0.3)
            way.deafen()
            began_s = time.monotonic()
            await car.until(lambda state: not state["decelerate"]["order"]["sending"], 1.0)
            assert time.monotonic() - began_s < 0.6  # though the car's speed came all the time
            cut = [event["text"].split(".")[0] for event in await car.events() if event["step"] == "cut"]
            assert cut == ["No command is sent: the bridge does not answer"]
            before = len(car.speeds)
            await asyncio.sleep(1.0)
            assert len(car.speeds) == before
            way.listen()
            listens_s = time.monotonic()
            await car.until(lambda state: state["decelerate"]["order"]["sending"])
            await car.until(lambda _: len(car.speeds) > before)
            at_s, first_mps = car.speeds[before]
            assert at_s > listens_s
            assert first_mps == pytest.approx(car.driven[before], abs=0.5)  # made anew, none of those that were held up
