"""The agents' side of many cars in one process: the product's own `NatsAgent` and connection for each, without a judge.

What each car states was recorded of one real agent, and is played round and round under the car's own name. So the
broker and the web nodes have the work of so many cars, and this machine has not that of so many judges. A list of cars
is sent at once when an alarm changes: each car's do once a minute; the recorded car's changed every few seconds.
"""

from __future__ import annotations

import asyncio
import contextlib
import random
import secrets
import time
from collections.abc import Mapping
from typing import Any

import nats
import orjson
from nats.errors import Error as NatsError

from server.app.process import uvloop_runner
from server.bus import nats_wire as wire
from server.bus.broker import Broker
from server.bus.bus import ALL, SUMMARY
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.bus.nats_agent import NatsAgent
from server.bus.nats_link import SPARES, BrokerLink
from tests.bench.orders import execute_orders, options

CONNECTS_WITHIN_S = 30.0
CHANGES_EVERY_S = 60.0  # of a car's alarms
FEWEST = 2  # frames of each kind on a tape


class Tape:
    """What a real agent stated, as a web node pulls it: when [s], which kind, and two texts.

    Of a state those before and after the car's name, of a summary the calm one and the one with an alarm.
    """

    def __init__(self) -> None:
        self.frames: list[tuple[float, str, str, str]] = []
        self.lasts_s = 0.0

    async def record(self, address: str, vehicle: str, for_s: float) -> None:
        client = await nats.connect(address)
        try:
            began_s = time.monotonic()
            await asyncio.gather(*(self._pull(client, vehicle, kind, began_s, for_s) for kind in ("state", SUMMARY)))
        finally:
            await client.close()
        self.lasts_s = for_s
        self.frames.sort(key=lambda frame: frame[0])
        for kind in ("state", SUMMARY):
            if sum(frame[1] == kind for frame in self.frames) < FEWEST:
                raise ValueError(f"the agent stated nothing of kind {kind} within {for_s:g} s")

    async def _pull(self, client: Any, vehicle: str, kind: str, began_s: float, for_s: float) -> None:
        have, run, name = 0, "", f'"vehicle":"{vehicle}"'
        while time.monotonic() < began_s + for_s:
            pull = wire.encode(wire.Pull(have=have, run=run))
            with contextlib.suppress(NatsError, TimeoutError):
                head, payload = wire.decode_frame(
                    (await client.request(wire.subject(vehicle, f"pull.{kind}"), pull)).data
                )
                if head.number and (have, run) != (head.number, head.run):
                    have, run = head.number, head.run
                    before, _, after = str(payload).partition(name)
                    if kind == SUMMARY:
                        before, after = (_with_waiting(before, waiting) for waiting in (0, 1))
                    self.frames.append((time.monotonic() - began_s, kind, before, after))


def _with_waiting(summary: str, waiting: int) -> str:
    """The summary with nothing but this number of unacknowledged alarms."""
    return orjson.dumps({**orjson.loads(summary), "worst": None, "attention": None, "waiting": waiting}).decode()


class OneCar:
    """One car that plays the tape."""

    def __init__(self, address: str, name: str, tape: Tape) -> None:
        self._name = name
        self._tape = tape
        self._bus = LocalBus(Journal(None), now=time.monotonic)
        self._bus.serve(name, self._answer)
        agent = NatsAgent(self._bus, run=secrets.token_hex(8), now=time.monotonic)
        self.link = BrokerLink(Broker(address=address), agent, name=name, spares=SPARES)

    async def drive(self) -> None:
        """Plays for ever, from a moment of its own."""
        loop = asyncio.get_running_loop()
        chance = random.Random(self._name)
        lap_began_s = loop.time() - chance.uniform(0.0, self._tape.lasts_s)
        begins_s = chance.uniform(0.0, CHANGES_EVERY_S)
        while True:
            for offset_s, kind, before, after in self._tape.frames:
                wait_s = lap_began_s + offset_s - loop.time()
                if wait_s < -1.0:
                    continue
                await asyncio.sleep(max(0.0, wait_s))
                if kind == SUMMARY:
                    is_changed = (loop.time() + begins_s) // CHANGES_EVERY_S % 2
                    self._bus.put(ALL, self._name, after if is_changed else before)
                else:
                    self._bus.put(self._name, kind, f'{before}"vehicle":"{self._name}"{after}')
            lap_began_s += self._tape.lasts_s

    @staticmethod
    async def _answer(_: Mapping[str, Any]) -> Mapping[str, Any]:
        return {"ok": True}


class ManyCars:
    """All cars of the process."""

    def __init__(self, address: str) -> None:
        self._address = address
        self._tape = Tape()
        self._cars: list[OneCar] = []
        self._driving: list[asyncio.Task[None]] = []

    async def record(self, vehicle: str, for_s: float) -> dict[str, float]:
        """The tape of a real agent; how many bytes a state and a summary have on it, and how many came a second."""
        await self._tape.record(self._address, vehicle, for_s)
        found: dict[str, float] = {}
        for kind in ("state", SUMMARY):
            sizes = [len(a) + len(b) * (kind == "state") for _, one, a, b in self._tape.frames if one == kind]
            found |= {f"{kind}_bytes": sum(sizes) / len(sizes), f"{kind}_hz": len(sizes) / for_s}
        return found

    async def grow(self, count: int) -> list[str]:
        """Have so many cars at the broker, at least; their names."""
        for k in range(len(self._cars), count):
            car = OneCar(self._address, f"car{k:03d}", self._tape)
            car.link.start()
            self._cars.append(car)
            self._driving.append(asyncio.create_task(car.drive()))
        async with asyncio.timeout(CONNECTS_WITHIN_S):
            while any(car.link.complaint for car in self._cars):
                await asyncio.sleep(0.05)
        return [f"car{k:03d}" for k in range(count)]

    async def stop(self) -> None:
        for task in self._driving:
            task.cancel()
        await asyncio.gather(*self._driving, *(car.link.stop() for car in self._cars), return_exceptions=True)


async def main(broker: str) -> None:
    cars = ManyCars(broker)
    try:
        await execute_orders({"record": cars.record, "grow": cars.grow}, {})
    finally:
        await cars.stop()


if __name__ == "__main__":
    with uvloop_runner() as runner:
        runner.run(main(**options()))
