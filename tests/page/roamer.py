"""A car on a bridge of our own, placed by the test: it stands or drives as set, and publishes what it must."""

from __future__ import annotations

import asyncio
import contextlib
import math
import time
from collections.abc import AsyncIterator
from typing import Any

from monitor.geo import radii_m
from server.rosbridge_server.server import RosBridge
from tests.server.cars import twist

TICK_S = 0.05


class Roamer:
    """Publishes its speed 20 times and its position and heading 10 times a second."""

    def __init__(self, lat_deg: float, lon_deg: float) -> None:
        self.bridge = RosBridge(ros_version=1)
        self.address = ""
        self.lat_deg, self.lon_deg = lat_deg, lon_deg
        self.speed_mps = 0.0
        self.heading_deg: float | None = 90.0  # it drives where it points; None: it does not publish it
        self.status = 0
        self.covariance_m2: tuple[float, float, float] | None = (4.0, 9.0, 0.0)
        self.tells_position = True

    def place(self, east_m: float, north_m: float) -> dict[str, float]:
        """A place beside the car, as a browser gets it."""
        meridian_m, parallel_m = radii_m(self.lat_deg)
        return {
            "latitude": self.lat_deg + math.degrees(north_m / meridian_m),
            "longitude": math.remainder(self.lon_deg + math.degrees(east_m / parallel_m), 360.0),
        }

    def _drive(self, seconds: float) -> None:
        if self.speed_mps:
            way_m, course = (
                self.speed_mps * seconds,
                math.radians(90.0 if self.heading_deg is None else self.heading_deg),
            )
            there = self.place(way_m * math.sin(course), way_m * math.cos(course))
            self.lat_deg, self.lon_deg = there["latitude"], there["longitude"]

    def _fix(self, n: int) -> dict[str, Any]:
        east, north, both = self.covariance_m2 or (0.0, 0.0, 0.0)
        ns = time.time_ns()
        return {
            "header": {"seq": n, "stamp": {"secs": ns // 10**9, "nsecs": ns % 10**9}, "frame_id": "gps"},
            "status": {"status": self.status, "service": 1},
            # The last digit lives, as a receiver's does: a position that never changes would be called frozen.
            "latitude": self.lat_deg + (n % 3) * 1e-10, "longitude": self.lon_deg, "altitude": 748.0,
            "position_covariance": [east, both, 0, both, north, 0, 0, 0, 1.0],
            "position_covariance_type": 3 if self.covariance_m2 else 0,
        }  # fmt: skip

    async def _run(self) -> None:
        n, before_s = 0, time.monotonic()
        while True:
            now_s = time.monotonic()
            self._drive(now_s - before_s)
            before_s = now_s
            self.bridge.publish("/catvehicle/vel", twist(self.speed_mps))
            if n % 2 == 0:
                if self.tells_position:
                    self.bridge.publish("/gps_fix", self._fix(n))
                if self.heading_deg is not None:
                    self.bridge.publish("/catvehicle/heading", {"data": self.heading_deg})
            n += 1
            await asyncio.sleep(TICK_S)


@contextlib.asynccontextmanager
async def roaming(lat_deg: float = 32.2319, lon_deg: float = -110.9501, **more: Any) -> AsyncIterator[Roamer]:
    """The car for the length of the block; `more` are its fields to begin with."""
    car = Roamer(lat_deg, lon_deg)
    for name, value in more.items():
        setattr(car, name, value)
    car.address = f"ws://127.0.0.1:{await car.bridge.start('127.0.0.1', 0)}"
    for topic, kind in (
        ("/catvehicle/vel", "geometry_msgs/Twist"),
        ("/gps_fix", "sensor_msgs/NavSatFix"),
        ("/catvehicle/heading", "std_msgs/Float64"),
    ):
        car.bridge.advertise(topic, kind)
    task = asyncio.create_task(car._run())
    try:
        yield car
    finally:
        task.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await task
        await car.bridge.stop()
