"""A process: the simulated car behind a guard and a controller that goes on ordering 6 m/s.

It writes a file, whose lines are JSON: `at_ms`, and `speed_mps` with the guard's `state`, or `operator_mps`, which
is a command of the server.
"""

from __future__ import annotations

import asyncio
import json
import sys
import time
from collections.abc import Mapping
from pathlib import Path
from typing import Any, TextIO

from server.simulator.service import CarService
from tests.vehicle.conftest import Guard
from tests.vehicle.over_bridge import OPERATOR, run_controller, run_guard, task

EVERY_S = 0.05


async def drive(file: TextIO) -> None:
    silent = [f"controller-silent@{3600 * n}+3600" for n in range(8)]
    service = CarService(scenarios=silent, has_stopper=False)  # only through the guard is it driven
    guard = Guard()

    def note(**fields: Any) -> None:
        file.write(json.dumps({"at_ms": time.time() * 1000, **fields}) + "\n")
        file.flush()

    def hear(topic: str, _: str, message: Mapping[str, Any]) -> None:
        if topic == OPERATOR:
            note(operator_mps=message["linear"]["x"])

    service.bridge.on_publish.append(hear)
    port = await service.start()
    async with task(run_guard(port, guard)), task(run_controller(port)):
        print(f"ws://127.0.0.1:{port}", flush=True)
        while True:
            note(speed_mps=service.car.motion.speed_mps, state=guard.state(time.monotonic()))
            await asyncio.sleep(EVERY_S)


if __name__ == "__main__":
    with Path(sys.argv[1]).open("a") as opened:
        asyncio.run(drive(opened))
