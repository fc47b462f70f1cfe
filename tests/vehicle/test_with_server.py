"""The whole of it: the server slows a car through the guard, keeps its heart beating, and the guard outlives it."""

from __future__ import annotations

import asyncio
import time

import pytest

from tests.server.slowdown.conftest import simulated, watching
from tests.vehicle.conftest import Guard
from tests.vehicle.over_bridge import run_controller, run_guard, task

pytestmark = [pytest.mark.slow, pytest.mark.timeout(100), pytest.mark.field]
BARE = {"scenarios": ["controller-silent@0+600"], "has_stopper": False}  # only through the guard is it driven


def port_of(address: str) -> int:
    return int(address.rpartition(":")[2])


async def test_the_order_goes_through_the_guard_and_so_does_the_release() -> None:
    guard = Guard()
    async with simulated(**BARE) as (service, address):
        async with task(run_guard(port_of(address), guard)), task(run_controller(port_of(address))):
            async with watching(service, address) as car:
                state = await car.until(lambda s: (s["decelerate"]["guard"] or {}).get("state") == "guarded")
                assert state["decelerate"]["topic"] == "/ocu_guard/cmd_vel"
                await car.armed(4.0)
                assert (await car.post("order")).is_success
                state = await car.until(lambda s: (s["decelerate"]["guard"] or {}).get("state") == "operator")
                await car.until(lambda _: car.speed_mps == 0.0)  # the controller goes on ordering 6 m/s
                assert (await car.slow())["order"]["confirmed"]
                assert (await car.post("release", number=state["decelerate"]["order"]["number"])).is_success
                await car.until(lambda _: car.speed_mps > 2.0)
                assert (await car.slow())["guard"]["state"] == "guarded"


async def test_the_guard_slows_the_car_when_the_server_dies_and_not_when_monitoring_is_stopped() -> None:
    guard = Guard()
    async with simulated(**BARE) as (service, address):
        async with task(run_guard(port_of(address), guard)), task(run_controller(port_of(address))):
            async with watching(service, address) as car:
                await car.until(lambda s: (s["decelerate"]["guard"] or {}).get("state") == "guarded")
                await car.until(lambda _: car.speed_mps > 4.0)
                assert (await car.client.post("/api/disconnect")).is_success
                await asyncio.sleep(2.0)
                assert guard.state(time.monotonic()) == "unguarded"
                assert car.speed_mps > 4.0
                assert (await car.client.post("/api/connect", json={"address": address})).is_success
                await car.until(lambda s: (s["decelerate"]["guard"] or {}).get("state") == "guarded")
            await asyncio.sleep(2.0)  # the server is gone
            assert guard.state(time.monotonic()) in ("slowing", "holding")
            async with watching(service, address) as car:
                await car.until(lambda _: car.speed_mps == 0.0)
                state = await car.until(lambda s: (s["decelerate"]["guard"] or {}).get("state") == "holding")
                hold = state["decelerate"]["guard"]["hold"]
                assert (await car.post("release", number=hold)).is_success
                await car.until(lambda _: car.speed_mps > 1.0)


async def test_without_a_guard_the_page_is_informed() -> None:
    async with simulated() as (service, address), watching(service, address) as car:
        state = await car.until(lambda s: s["decelerate"]["state"] == "not_armed")
        assert state["decelerate"]["guard"] is None
