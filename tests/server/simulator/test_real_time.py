"""The simulated car in real time: its pace, and what it leaves of the event loop."""

from __future__ import annotations

import asyncio
import time

import pytest

from tests.server.simulator.conftest import bridge_client, running_car

pytestmark = pytest.mark.field


async def test_the_car_lives_as_fast_as_the_clock() -> None:
    async with running_car() as (service, port), bridge_client(port) as client:
        await client.subscribe("/catvehicle/vel")
        await client.next("/catvehicle/vel")
        began_s, driven_s, received = time.monotonic(), service.car.elapsed_s, 0
        while time.monotonic() < began_s + 2.0:
            await client.next("/catvehicle/vel")
            received += 1
        assert service.car.elapsed_s - driven_s == pytest.approx(2.0, abs=0.4)
        assert received == pytest.approx(40, rel=0.2)


async def test_others_on_the_loop_are_hardly_disturbed() -> None:
    """The car works in pieces of less than 2 ms; half of all wakings must not even notice."""
    async with running_car():
        late_ms = []
        for _ in range(300):
            began_s = time.perf_counter()
            await asyncio.sleep(0.003)
            late_ms.append((time.perf_counter() - began_s - 0.003) * 1e3)
        assert sorted(late_ms)[150] < 2.0
