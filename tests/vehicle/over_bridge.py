"""The guard before a car behind our own rosbridge: the third thin shell, beside those for rospy and rclpy."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator, Callable
from typing import Any

import websockets
from websockets.asyncio.client import ClientConnection

from tests.vehicle.conftest import Command, Guard

STATE = "/ocu_guard/state"
CMD_VEL, CONTROLLER, OPERATOR = "/catvehicle/cmd_vel", "/catvehicle/cmd_vel_controller", "/ocu_guard/cmd_vel"
HEARTBEAT, RELEASE, VEL = "/ocu_guard/heartbeat", "/ocu_guard/release", "/catvehicle/vel"

TYPES = {
    CONTROLLER: "geometry_msgs/Twist",
    OPERATOR: "geometry_msgs/Twist",
    HEARTBEAT: "std_msgs/UInt32",
    RELEASE: "std_msgs/UInt32",
    VEL: "geometry_msgs/Twist",
}


def twist(speed_mps: float, angle_rad: float) -> dict[str, Any]:
    return {"linear": {"x": speed_mps, "y": 0.0, "z": 0.0}, "angular": {"x": 0.0, "y": 0.0, "z": angle_rad}}


class Client:
    """One client of the bridge."""

    def __init__(self, socket: ClientConnection) -> None:
        self._socket = socket

    async def advertise(self, topic: str, type: str) -> None:
        await self._send({"op": "advertise", "topic": topic, "type": type})

    async def publish(self, topic: str, message: dict[str, Any]) -> None:
        await self._send({"op": "publish", "topic": topic, "msg": message})

    async def subscribe(self, handlers: dict[str, Callable[[dict[str, Any]], Any]]) -> None:
        """Until it is cancelled."""
        for topic in handlers:
            await self._send({"op": "subscribe", "topic": topic, "type": TYPES[topic]})
        async for text in self._socket:
            message = json.loads(text)
            if message.get("op") == "publish":
                handlers[message["topic"]](message["msg"])

    async def _send(self, message: dict[str, Any]) -> None:
        await self._socket.send(json.dumps(message))


@contextlib.asynccontextmanager
async def client(port: int) -> AsyncIterator[Client]:
    async with websockets.connect(f"ws://127.0.0.1:{port}", max_queue=None) as socket:
        yield Client(socket)


@contextlib.asynccontextmanager
async def task(work: Any) -> AsyncIterator[asyncio.Task[None]]:
    running = asyncio.create_task(work)
    try:
        yield running
    finally:
        running.cancel()
        with contextlib.suppress(asyncio.CancelledError):
            await running


async def run_guard(port: int, guard: Guard) -> None:
    """The third thin shell, beside those for rospy and rclpy."""
    async with client(port) as bridge:
        await bridge.advertise(CMD_VEL, "geometry_msgs/Twist")
        await bridge.advertise(STATE, "std_msgs/String")
        waiting: asyncio.Queue[Command | None] = asyncio.Queue(100)

        def command(message: dict[str, Any]) -> tuple[float, float, float]:
            return time.monotonic(), message["linear"]["x"], message["angular"]["z"]

        async def tick() -> None:
            while True:
                for _ in range(4):
                    await asyncio.sleep(0.05)
                    waiting.put_nowait(guard.tick(time.monotonic()))
                await bridge.publish(STATE, {"data": json.dumps(guard.report(time.monotonic()))})

        async def speak() -> None:
            while True:
                newest = await waiting.get()
                if newest is not None:
                    await bridge.publish(CMD_VEL, twist(newest.speed_mps, newest.angle_rad))

        async with task(tick()), task(speak()):
            await bridge.subscribe(
                {
                    CONTROLLER: lambda message: waiting.put_nowait(guard.controller(*command(message))),
                    OPERATOR: lambda message: waiting.put_nowait(guard.operator(*command(message))),
                    HEARTBEAT: lambda message: guard.heartbeat(time.monotonic(), message["data"]),
                    RELEASE: lambda message: guard.release(time.monotonic(), message["data"]),
                    VEL: lambda message: guard.speed(time.monotonic(), message["linear"]["x"]),
                }
            )


async def run_controller(port: int) -> None:
    async with client(port) as bridge:
        await bridge.advertise(CONTROLLER, "geometry_msgs/Twist")
        while True:
            await bridge.publish(CONTROLLER, twist(6.0, 0.02))
            await asyncio.sleep(0.05)


async def run_operator(port: int) -> None:
    async with client(port) as bridge:
        await bridge.advertise(HEARTBEAT, "std_msgs/UInt32")
        count = 0
        while True:
            count += 1
            await bridge.publish(HEARTBEAT, {"data": count})
            await asyncio.sleep(0.2)
