"""`make fleet`: a broker, five simulated cars with different faults, their agents and two web nodes on this machine."""

from __future__ import annotations

import asyncio
import contextlib
import signal
import tempfile
from collections.abc import Awaitable, Callable
from pathlib import Path

from server.bus import broker_users
from tests.page.processes import running, simulate
from tests.server.bus.broker import running_broker

# Each car, and what goes wrong with it, over and over: it is typed on its simulator's terminal.
CARS = {
    "ocelot": ("speeding 20", 60.0),
    "margay": ("silent-scan 15", 45.0),
    "serval": ("diagnostics-error 30", 90.0),
    "caracal": ("gps-jump 20", 70.0),
    "lynx": ("", 0.0),
}
NODES = {"room-1": 8001, "room-2": 8002}
TODAY = "2026-01-01"  # in a list that lasts as long as this run


async def main() -> None:
    running_here = asyncio.current_task()
    assert running_here is not None
    asyncio.get_running_loop().add_signal_handler(signal.SIGTERM, running_here.cancel)
    with contextlib.ExitStack() as folders:
        folder = Path(folders.enter_context(tempfile.TemporaryDirectory(prefix="catgraph-fleet-")))
        users: list[tuple[str, broker_users.Kind]] = [(name, "agent") for name in CARS]
        users += [(name, "web") for name in NODES]
        for name, kind in users:
            (folder / f"{name}.key").write_text(broker_users.add(folder, name, kind, today=TODAY)[1])
        async with contextlib.AsyncExitStack() as up:
            broker = await up.enter_async_context(running_broker(include=folder / broker_users.CONF))
            print(f"Broker: {broker.address}", flush=True)

            def options(name: str, port: int) -> tuple[str, ...]:
                key = str(folder / f"{name}.key")
                data = str(folder / name)
                return ("--broker", broker.address, "--key", key, "--port", str(port), "--data", data)

            faults = []
            for name, (fault, every_s) in CARS.items():
                car = await up.enter_async_context(running(*simulate()))
                agent = ("agent", *options(name, 0), "--vehicle", f"{name}={car.address}")
                at_car = await up.enter_async_context(running(*agent))
                print(f"{name}: its own page at {at_car.address}/  fault: {fault or 'none'}", flush=True)
                if fault:
                    faults.append(again(car.type, fault, every_s))
            expected = [argument for name in CARS for argument in ("--expect", name)]
            for name, port in NODES.items():
                node = await up.enter_async_context(running("web", *options(name, port), *expected))
                print(f"Web node {name}: {node.address}/  all cars: {node.address}/fleet", flush=True)
            print("Press Ctrl-C to stop.", flush=True)
            await asyncio.gather(*faults)


async def again(write: Callable[[str], Awaitable[None]], fault: str, every_s: float) -> None:
    """Types the fault again and again."""
    while True:
        await write(fault)
        await asyncio.sleep(every_s)


if __name__ == "__main__":
    with contextlib.suppress(KeyboardInterrupt, asyncio.CancelledError):
        asyncio.run(main())
