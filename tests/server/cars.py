"""Messages of a small car, and a car that publishes them on a bridge."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from typing import Any

import numpy as np

from server.rosbridge_server.server import RosBridge

ZERO = {"x": 0.0, "y": 0.0, "z": 0.0}


def twist(speed_mps: float) -> dict[str, Any]:
    return {"linear": {"x": speed_mps, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": 0.0}}


def scan(ranges: Any, *, range_min: float = 0.1, range_max: float = 81.0) -> dict[str, Any]:
    ranges = np.asarray(ranges, dtype=np.float32)
    return {
        "header": {"seq": 1, "stamp": {"secs": 1464818234, "nsecs": 0}, "frame_id": "laser"},
        "angle_min": -np.pi / 2,
        "angle_max": np.pi / 2,
        "angle_increment": np.pi / max(1, ranges.size - 1),
        "time_increment": 0.0,
        "scan_time": 0.0,
        "range_min": range_min,
        "range_max": range_max,
        "ranges": ranges,
        "intensities": [],
    }


@contextlib.asynccontextmanager
async def driving(
    bridge: RosBridge,
    *,
    speed: Callable[[int], float] = lambda n: 4.2,
    hz: float = 20.0,
    scans: bool = False,
    steers: bool = False,
    beams: int = 181,
) -> AsyncIterator[list[int]]:
    """A car that publishes its speed until the block ends; yields a list whose length counts messages.

    `scans`: and a scan. `steers`: and its steering, straight ahead, without which no slow-down can be armed.
    """
    sent: list[int] = []
    if steers:
        bridge.advertise("/catvehicle/steering", "geometry_msgs/Wrench")

    async def drive() -> None:
        while True:
            bridge.publish("/catvehicle/vel", twist(speed(len(sent))))
            if steers:
                bridge.publish("/catvehicle/steering", {"force": dict(ZERO), "torque": dict(ZERO)})
            if scans:
                bridge.publish("/scan", scan(np.full(beams, 5.0 + len(sent) % 10)))
            sent.append(1)
            await asyncio.sleep(1 / hz)

    task = asyncio.create_task(drive())
    try:
        yield sent
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
