"""An order under outages: no command arrives late, none twice, and the ramp goes on from the speed that is measured."""

from __future__ import annotations

import asyncio
import itertools
import random
import time
from typing import Any

import pytest

from server.rosbridge_server.server import RosBridge
from tests.http import http_client
from tests.server.cars import driving
from tests.server.slowdown.conftest import field, simulated, watching
from tests.server.slowdown.deaf import one_way

TOPIC = "/catvehicle/cmd_vel"
LATE_S = 0.3
OUTAGES = [
    pytest.param(4, marks=pytest.mark.slow),
    pytest.param(50, marks=[pytest.mark.soak, pytest.mark.timeout(900)]),
]


class ReceivedCommands:
    """The stamped commands that a bridge receives under outages [s since 1970]. The stamp is the time of making a
    command. A frozen bridge keeps what it has received already and publishes it when it thaws: no sender can withdraw
    that. These are at most two commands an outage."""

    def __init__(self, bridge: RosBridge, server: str) -> None:
        bridge.advertise(TOPIC, "geometry_msgs/TwistStamped")
        bridge.on_publish.append(self._note)
        self._bridge = bridge
        self._server = server
        self.commands: list[tuple[float, float]] = []  # made and arrived
        self.outages: list[tuple[float, float]] = []  # began and ended

    def _note(self, topic: str, kind: str, message: dict[str, Any]) -> None:
        if topic == TOPIC:
            stamp = message["header"]["stamp"]
            self.commands.append((stamp["secs"] + stamp["nsecs"] / 1e9, time.time()))

    async def order_under(self, outages: int) -> None:
        """An order under so many outages, half of them freezes and half of them kills."""
        bridge, dice = self._bridge, random.Random(7)
        async with (
            driving(bridge, speed=lambda _: 5.0, steers=True),
            http_client(base_url=self._server) as client,
        ):

            async def until(what: str, seconds: float = 20.0) -> None:
                ends_s = time.monotonic() + seconds
                while True:
                    slow = (await client.get("/api/state")).json()["decelerate"]
                    order = slow["order"] or {}
                    if {
                        "not_armed": slow["state"] == "not_armed",
                        "sends": order.get("sending"),
                        "cut": order.get("sending") is False,
                    }[what]:
                        return
                    assert time.monotonic() < ends_s, slow
                    await asyncio.sleep(0.05)

            await until("not_armed")
            assert (await client.post("/api/slow-down/arm")).is_success
            assert (await client.post("/api/slow-down/order")).is_success
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
                self.outages.append((began_s, time.time()))
            await until("sends")

    def check(self, late_s: float) -> None:
        """None came later than so [s], none twice and none overtook another."""
        made = [stamp_s for stamp_s, _ in self.commands]
        assert len(made) == len(set(made))
        assert made == sorted(made)
        late = [
            (stamp_s, at_s - stamp_s)
            for stamp_s, at_s in self.commands
            if at_s - stamp_s > late_s and not any(a - 0.05 <= stamp_s <= a + LATE_S + 0.15 for a, _ in self.outages)
        ]
        assert late == []
        for began_s, ended_s in self.outages:
            assert sum(began_s <= stamp_s <= ended_s for stamp_s in made) <= 2  # under way when it froze


@pytest.mark.slow
@pytest.mark.virtual_time
async def test_no_command_arrives_late_and_none_twice(bridge: RosBridge, server: str) -> None:
    received = ReceivedCommands(bridge, server)
    await received.order_under(4)
    received.check(0.002)  # stamps are of whole milliseconds


@pytest.mark.field
@pytest.mark.parametrize("outages", OUTAGES)
async def test_no_command_arrives_late_and_none_twice_in_real_time(
    bridge: RosBridge, server: str, outages: int
) -> None:
    received = ReceivedCommands(bridge, server)
    await received.order_under(outages)
    received.check(LATE_S)


@pytest.mark.field
@pytest.mark.slow
async def test_it_keeps_its_rate_in_real_time() -> None:
    async with field() as car:
        await car.armed()
        await car.post("order")
        await asyncio.sleep(3.0)
        times = [at_s for at_s, _ in car.speeds]
        assert len(times) / (times[-1] - times[0]) == pytest.approx(20.0, rel=0.05)
        assert max(b - a for a, b in itertools.pairwise(times)) < 0.15


@pytest.mark.slow
@pytest.mark.virtual_time
@pytest.mark.parametrize("fault", ["bridge-killed", "bridge-frozen"])
async def test_the_ramp_goes_on_from_the_speed_that_is_measured(fault: str) -> None:
    async with field() as car:
        await car.armed()
        assert (await car.post("order")).is_success
        await asyncio.sleep(0.4)
        car.service.start_scenario(fault, 1.2)
        state = await car.until(lambda state: not state["decelerate"]["order"]["sending"], 3.0)
        cut_s = time.monotonic()
        assert state["decelerate"]["state"] == "ordered"
        await car.until(lambda state: state["decelerate"]["order"]["sending"], 10.0)
        await asyncio.sleep(0.4)
        after = [speed for at_s, speed in car.speeds if at_s >= cut_s]
        first = next(index for index, (at_s, _, _) in enumerate(car.published) if at_s >= cut_s)
        assert after[0] == pytest.approx(car.driven[first], abs=0.5)
        assert all(b < a for a, b in itertools.pairwise(after[1:]))
        await car.until_car(lambda: car.speed_mps == 0.0)
        assert [step for step in await car.steps() if step in ("cut", "resumed")] == ["cut", "resumed"]


@pytest.mark.slow
@pytest.mark.virtual_time
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
            await car.until_car(lambda: len(car.speeds) > before)
            at_s, first_mps = car.speeds[before]
            assert at_s > listens_s
            assert first_mps == pytest.approx(car.driven[before], abs=0.5)  # made anew, none of those that were held up
