"""kill -9 of the server in the middle of an order: what is left is the car's own dead-man, where it has one."""

from __future__ import annotations

import asyncio
from pathlib import Path

import httpx
import pytest

from tests.page.processes import Process
from tests.server.slowdown.conftest import Field, simulated

pytestmark = [pytest.mark.slow, pytest.mark.timeout(90)]


@pytest.mark.field
@pytest.mark.parametrize("has_stopper", [True, False])
async def test_after_a_kill_the_obstacle_stopper_brakes_and_a_bare_car_drives_on(
    tmp_path: Path, has_stopper: bool
) -> None:
    async with simulated(has_stopper=has_stopper) as (service, address):
        server = await Process("serve", "--port", "0", "--vehicle", address, "--data", str(tmp_path)).start()
        try:
            async with httpx.AsyncClient(base_url=server.address, timeout=10.0) as client:
                car = Field(service, client)
                await car.armed(5.0)
                assert (await car.post("order")).is_success
                await car.until(lambda state: state["decelerate"]["order"]["confirmed"])
                service.start_scenario("controller-silent", 60.0)  # nobody else commands from here on
        finally:
            await server.kill()
        ordered_mps = car.speeds[-1][1]
        assert ordered_mps > 1.5
        await asyncio.sleep(3.0)
        if has_stopper:
            assert service.car.motion.speed_mps == 0.0
        else:
            assert service.car.motion.speed_mps == pytest.approx(ordered_mps, abs=0.5)  # link loss does NOT slow it
