"""The bench's car: twenty seconds of the simulated one, made beforehand and played round and round on a rosbridge.

So the process's load is the bridge's and not the simulation's. The seconds are of a part of the drive where no speed is
a probe's divided by 3.6: a server that sees such pairs again and again takes them for m/s and km/h of two publishers,
and judges the speed no more. Every speed message tells in `angular.x`, which the real car leaves at zero, when it was
published [s, CLOCK_MONOTONIC].
"""

from __future__ import annotations

import asyncio
import random
import time
from typing import Any

from server.app.process import uvloop_runner
from server.judge.message import Json
from server.rosbridge_server.server import RosBridge
from server.simulator.car import SimulatedCar
from server.simulator.messages import CMD_VEL, VEL
from tests.bench.orders import execute_orders, options

BEGINS_S = 11.0  # of the drive: 6.5 to 8 m/s from there on
TAPE_S = 20.0
CALM_MPS = 9.0  # all the tape stays below, and so clears the alarm
PROBES_MPS = tuple(12.0 + k / 10 for k in range(80))  # a probe's speed identifies it; then they begin again
SOON_S = 0.0005


class Car:
    """Publishes the tape, and probes between its messages."""

    def __init__(self, beams: int | None) -> None:
        drive = SimulatedCar(scan_beams=beams)
        self.tape: list[tuple[float, str, Json]] = []
        for step in drive.steps():
            at_s = drive.elapsed_s - BEGINS_S
            if at_s >= TAPE_S:
                break
            if at_s >= 0.0:
                self.tape += [(at_s, message.topic, message.message) for message in step.messages]
        self.bridge = RosBridge(node="/bench_car")
        for published in drive.published:
            self.bridge.advertise(published.topic, published.type)
        self.topics = [published.topic for published in drive.published]
        self.messages_per_s = len(self.tape) / TAPE_S
        self._calm = asyncio.Event()  # a calm speed was published since
        self._commanded: dict[str, list[tuple[int, float]]] = {}  # topic → when a command arrived [ns], and its speed
        self.bridge.on_publish.append(self._hear)

    async def drive(self) -> None:
        """Plays for ever, each message at its time."""
        loop = asyncio.get_running_loop()
        lap_began_s = loop.time()
        while True:
            for offset_s, topic, message in self.tape:
                wait_s = lap_began_s + offset_s - loop.time()
                if wait_s > SOON_S:
                    await asyncio.sleep(wait_s)
                if topic == VEL.topic:
                    self._publish_speed(min(message["linear"]["x"], CALM_MPS))
                    self._calm.set()
                else:
                    self.bridge.publish(topic, message)
            lap_began_s += TAPE_S

    async def probe(self, count: int, every_s: float) -> list[list[float]]:
        """Publishes speeds above the limit, at random moments; answers [speed in m/s, sent in ns] of each."""
        sent: list[list[float]] = []
        moments = random.Random(1)
        for k in range(count):
            await asyncio.sleep(every_s * moments.uniform(0.6, 1.4))
            await self._calm.wait()
            self._calm.clear()
            speed_mps = PROBES_MPS[k % len(PROBES_MPS)]
            sent.append([speed_mps, time.monotonic_ns()])
            self._publish_speed(speed_mps)
        return sent

    async def commanded(self, topic: str = CMD_VEL.topic) -> list[tuple[int, float]]:
        """The commands that arrived since the last call: when [ns, CLOCK_MONOTONIC], and their speed [m/s]."""
        return self._commanded.pop(topic, [])

    def _hear(self, topic: str, type: str, message: Json) -> None:
        self._commanded.setdefault(topic, []).append((time.monotonic_ns(), message["linear"]["x"]))

    async def counts(self) -> dict[str, int]:
        """What the bridge has sent and dropped so far."""
        return {"sent": self.bridge.sent, "dropped": self.bridge.dropped, "bytes": self.bridge.bytes_sent}

    def _publish_speed(self, speed_mps: float) -> None:
        message = {
            "linear": {"x": speed_mps, "y": 0.0, "z": 0.0},
            "angular": {"x": time.monotonic(), "y": 0.0, "z": 0.0},
        }
        self.bridge.publish(VEL.topic, message)


async def main(beams: int | None = None) -> None:
    car = Car(beams)
    port = await car.bridge.start()
    driving = asyncio.create_task(car.drive())
    hello: dict[str, Any] = {
        "url": f"ws://127.0.0.1:{port}",
        "topics": car.topics,
        "messages_per_s": car.messages_per_s,
    }
    try:
        await execute_orders({"probe": car.probe, "counts": car.counts, "commanded": car.commanded}, hello)
    finally:
        driving.cancel()
        await car.bridge.stop()


if __name__ == "__main__":
    with uvloop_runner() as runner:
        runner.run(main(**options()))
