"""An order goes on whatever else fails: the log, the recording, the state, a task. Arming ends with the operators."""

from __future__ import annotations

import asyncio
import itertools
from collections.abc import Mapping
from typing import Any

import pytest

from server.app.config import Config
from server.protocol import drive_commands
from server.protocol.rate_limit import Limits, Rate
from server.slowdown.order import DESERTED_S
from server.slowdown.sender import PERIOD_S
from server.system.supervision import Supervisor
from server.vehicle.vehicle import Vehicle
from tests.http import http_client
from tests.server.conftest import serving
from tests.server.slowdown.conftest import simulated
from tests.server.slowdown.rig import Rig
from tests.server.viewer import viewer

pytestmark = pytest.mark.world(n=13)


@pytest.mark.parametrize("fails", [(), ("log",), ("recording",), ("snapshot",), ("log", "recording", "snapshot")])
def test_what_fails_beside_it_neither_stops_nor_delays_it(fails: tuple[str, ...]) -> None:
    rig = Rig()
    rig.execute("arm")
    rig.fails = set(fails)
    rig.execute("slow_down")  # nothing is raised: it was executed, and that is the answer to the operator
    at_once = 0 if "snapshot" in fails else 1  # without a speed it waits for one, half a second after the link opened
    assert len(rig.link.speeds) == at_once or rig.link.speeds == [0.0]
    rig.pass_time(2.0)
    assert len(rig.link.speeds) >= 40
    assert rig.link.speeds[-1] < 6.0 - 1.4 * 1.9


@pytest.mark.virtual_time
async def test_after_a_stall_no_command_follows_at_once() -> None:
    """A command that is late by more than a period is sent, and the next one a period later."""
    rig = Rig()
    stalled_s = 0.0
    loop = asyncio.get_running_loop()
    rig.clock = lambda: loop.time() + stalled_s
    rig.now_s = rig.clock()
    rig.link.heard_s = float("inf")
    supervisor = Supervisor("test")
    supervisor.keep("slow-down", rig.slowing.sender.send_loop)
    sent_s: list[float] = []
    send = rig.link.send_now

    def note(message: Mapping[str, Any]) -> None:
        send(message)
        if message["op"] == "publish":
            sent_s.append(rig.clock())

    rig.link.send_now = note  # type: ignore[method-assign]
    try:
        rig.tick()
        rig.execute("arm")
        rig.execute("slow_down")
        for late_s in (0.08, 0.21, 0.34, 0.6):
            await asyncio.sleep(0.5)
            stalled_s += late_s
        await asyncio.sleep(0.5)
        assert len(sent_s) > 40
        assert min(b - a for a, b in itertools.pairwise(sent_s)) > PERIOD_S - 0.005
    finally:
        await supervisor.stop()


@pytest.mark.virtual_time
async def test_its_task_goes_on_after_a_cancellation_that_nobody_ordered() -> None:
    rig = Rig()
    rig.clock = asyncio.get_running_loop().time
    rig.now_s = rig.clock()
    rig.link.heard_s = float("inf")
    supervisor = Supervisor("test")
    supervisor.keep("slow-down", rig.slowing.sender.send_loop)
    try:
        rig.tick()
        rig.execute("arm")
        rig.execute("slow_down")
        for _ in range(3):
            sent = len(rig.link.speeds)
            async with asyncio.timeout(20):
                while len(rig.link.speeds) < sent + 3:
                    await asyncio.sleep(0.01)
            task = supervisor._kept["slow-down"].task
            assert task is not None
            task.cancel()
        assert len(rig.link.speeds) > 3
    finally:
        await supervisor.stop()


def test_armed_ends_ten_seconds_after_the_last_operators_page_has_gone() -> None:
    rig = Rig()
    rig.execute("arm")
    rig.slowing.watch_operators(rig.now_s)
    rig.now_s += DESERTED_S - 0.1
    rig.slowing.watch_operators(None)
    assert rig.slowing.frame()["state"] == "armed"
    rig.now_s += 0.2
    rig.slowing.watch_operators(None)
    assert rig.slowing.frame()["state"] == "not_armed"
    assert rig.notes[-1] == "disarmed: Slow-down disarmed: the last operator's page has been gone for 10 s."


def test_a_page_that_is_there_keeps_it_armed_and_an_order_is_not_ended_by_an_empty_room() -> None:
    rig = Rig()
    rig.execute("arm")
    for _ in range(40):
        rig.now_s += 1.0
        rig.slowing.watch_operators(rig.now_s)
    assert rig.slowing.frame()["state"] == "armed"
    rig.execute("slow_down")
    rig.now_s += 3 * DESERTED_S
    rig.slowing.watch_operators(None)
    order = rig.slowing.frame()["order"]
    assert order is not None
    rig.slowing.execute(drive_commands.Release(kind="release", number=order["number"]), by="Ann")
    rig.slowing.watch_operators(None)
    assert rig.slowing.frame()["state"] == "not_armed"


def test_armed_by_a_program_without_any_page_it_stays_armed_and_so_it_does_where_nobody_is_the_rule() -> None:
    rig = Rig()
    rig.execute("arm")
    rig.now_s += 100.0
    rig.slowing.watch_operators(None)
    assert rig.slowing.frame()["state"] == "armed"
    rig.slowing.watch_operators(rig.now_s)
    rig.slowing.limits = rig.slowing.limits.model_copy(update={"on_reach": 1.0})
    rig.now_s += 100.0
    rig.slowing.watch_operators(None)
    assert rig.slowing.frame()["state"] == "armed"  # the car is to be slowed because nobody is there


@pytest.mark.virtual_time
async def test_a_page_that_spent_its_commands_can_still_slow_the_car() -> None:
    """Over its socket, also beyond its allowance of messages; and over HTTP."""
    spent = Limits(
        commands=Rate(per_s=0.001, at_once=2),
        messages=Rate(per_s=0.001, at_once=40),
        local_requests=Rate(per_s=0.001, at_once=60),
    )
    async with simulated() as (_, address):
        config = Config(vehicles=(Vehicle(name="car", address=address),), limits=spent)
        async with serving(config) as base, viewer(base) as page, http_client(base_url=base) as http:
            page.takes = False
            async with asyncio.timeout(20):
                while (await http.post("/api/slow-down/arm")).status_code != 200:
                    await asyncio.sleep(0.5)
            for n in range(5):
                await page.send({"kind": "record", "on": True, "id": f"r{n}"})
            await page.until(lambda: any("Too many commands" in str(one.get("reason")) for one in page.other))
            for _ in range(60):
                await page.send({"kind": "have", "event": 0})
            await page.until(lambda: any("Too many messages" in str(one.get("reason")) for one in page.other))
            await page.send({"kind": "slow_down", "id": "s1"})
            await page.until(lambda: any(one.get("id") == "s1" for one in page.other))
            assert next(one for one in page.other if one.get("id") == "s1")["ok"]
            answers = [(await http.get("/api/health")).status_code for _ in range(70)]
            assert 429 in answers
            assert (await http.post("/api/slow-down/order")).status_code == 200
