"""The guard before a car behind our own rosbridge: an operator who vanishes, and what the car does then."""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable

import pytest

from server.simulator.service import CarService
from tests.vehicle.conftest import Guard
from tests.vehicle.over_bridge import CMD_VEL, RELEASE, client, run_controller, run_guard, run_operator, task, twist

pytestmark = pytest.mark.field


async def until(true: Callable[[], bool], seconds: float) -> float:
    """How long it took [s]."""
    began_s = time.monotonic()
    while not true():
        assert time.monotonic() - began_s < seconds
        await asyncio.sleep(0.01)
    return time.monotonic() - began_s


@pytest.mark.slow
@pytest.mark.timeout(90)
async def test_an_operator_who_vanishes_is_a_car_that_slows() -> None:
    """The car has no obstacle stopper: in silence it would keep its speed, and its controller goes on commanding."""
    service = CarService(scenarios=["controller-silent@0+600"], has_stopper=False)
    port = await service.start()
    guard = Guard()
    car = service.car
    try:
        async with task(run_guard(port, guard)), task(run_controller(port)):
            async with task(run_operator(port)) as operator:
                await until(lambda: car.motion.speed_mps > 5.5, 20.0)
                assert guard.state(time.monotonic()) == "guarded"
                operator.cancel()
            took_s = await until(lambda: guard.state(time.monotonic()) == "slowing", 3.0)
            assert 0.7 < took_s < 1.6
            before_mps = car.motion.speed_mps
            await asyncio.sleep(1.5)
            assert before_mps - car.motion.speed_mps > 1.0  # the controller still orders 6 m/s
            await until(lambda: car.motion.speed_mps == 0.0, 8.0)

            async with task(run_operator(port)):
                await asyncio.sleep(1.0)
                assert car.motion.speed_mps == 0.0  # a heart alone releases nothing
                async with client(port) as bridge:
                    await bridge.advertise(RELEASE, "std_msgs/UInt32")
                    await bridge.publish(RELEASE, {"data": guard.hold})
                    await until(lambda: car.motion.speed_mps > 1.0, 5.0)
    finally:
        await service.stop()


@pytest.mark.slow
async def test_without_the_guard_the_loss_of_the_operator_slows_nothing() -> None:
    """What the guard is for: the same car, its controller straight on the command topic."""
    service = CarService(scenarios=["controller-silent@0+600"], has_stopper=False)
    port = await service.start()
    try:
        async with client(port) as bridge:
            await bridge.advertise(CMD_VEL, "geometry_msgs/Twist")
            await bridge.publish(CMD_VEL, twist(6.0, 0.0))
        await until(lambda: service.car.motion.speed_mps > 5.5, 20.0)
        await asyncio.sleep(2.0)
        assert service.car.motion.speed_mps > 5.5
    finally:
        await service.stop()
