"""The guard before a car behind our own rosbridge: an operator who vanishes, and what the car does then."""

from __future__ import annotations

import asyncio
import contextlib
import json
import time
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest
import websockets
from ocu_guard.guard import Command, Guard
from websockets.asyncio.client import ClientConnection

from server.simulator.service import CarService

CMD_VEL, CONTROLLER, OPERATOR = "/catvehicle/cmd_vel", "/catvehicle/cmd_vel_controller", "/ocu_guard/cmd_vel"
HEARTBEAT, RELEASE, VEL = "/ocu_guard/heartbeat", "/ocu_guard/release", "/catvehicle/vel"


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

    async def hear(self, ears: dict[str, Callable[[dict[str, Any]], Any]]) -> None:
        """Until it is cancelled."""
        for topic in ears:
            await self._send({"op": "subscribe", "topic": topic})
        async for text in self._socket:
            said = json.loads(text)
            if said.get("op") == "publish":
                ears[said["topic"]](said["msg"])

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
        waiting: asyncio.Queue[Command | None] = asyncio.Queue(100)

        def command(message: dict[str, Any]) -> tuple[float, float, float]:
            return time.monotonic(), message["linear"]["x"], message["angular"]["z"]

        async def tick() -> None:
            while True:
                await asyncio.sleep(0.05)
                waiting.put_nowait(guard.tick(time.monotonic()))

        async def speak() -> None:
            while True:
                said = await waiting.get()
                if said is not None:
                    await bridge.publish(CMD_VEL, twist(said.speed_mps, said.angle_rad))

        async with task(tick()), task(speak()):
            await bridge.hear(
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
