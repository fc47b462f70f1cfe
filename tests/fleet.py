"""`make fleet`: a broker, five simulated cars with different faults, their agents and two web nodes on this machine.

    python -m tests.fleet [--ports 8001 8002] [--typed]

With --typed no fault begins by itself: each line that is typed begins one, as `lynx speeding 20`, and messages that a
busy machine sends late or rarely are no fault.
"""

from __future__ import annotations

import argparse
import asyncio
import contextlib
import signal
import sys
import tempfile
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path

from server.bus import broker_users
from tests.page.processes import UNHURRIED, Process, running, simulate
from tests.server.bus.broker import running_broker

# Each car, and what goes wrong with it, over and over: it is typed on its simulator's terminal.
CARS = {
    "ocelot": ("speeding 20", 60.0),
    "margay": ("silent-scan 15", 45.0),
    "serval": ("diagnostics-error 30", 90.0),
    "caracal": ("gps-jump 20", 70.0),
    "lynx": ("", 0.0),
}
NODES = ("room-1", "room-2")
TODAY = "2026-01-01"  # in a list that lasts as long as this run


Type = Callable[[str], Awaitable[None]]  # on the terminal of one car's simulator


async def main(ports: tuple[int, int], *, is_typed: bool) -> None:
    """`ports` of the nodes, 0: any that is free."""
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

            async def all_of(*commands: tuple[str, ...]) -> list[Process]:
                return await asyncio.gather(*(up.enter_async_context(running(*command)) for command in commands))

            if is_typed:  # nor is a busy machine one
                for name in CARS:
                    settings = folder / name / "settings"
                    settings.mkdir(parents=True)
                    (settings / f"{name}.toml").write_text(UNHURRIED)
            cars = dict(zip(CARS, await all_of(*(simulate() for _ in CARS)), strict=True))
            agents = await all_of(
                *(("agent", *options(name, 0), "--vehicle", f"{name}={cars[name].address}") for name in CARS)
            )
            for (name, (fault, _)), at_car in zip(CARS.items(), agents, strict=True):
                about = f"bridge {cars[name].address}  fault: {'as typed' if is_typed else fault or 'none'}"
                print(f"{name}: its own page at {at_car.address}/  {about}", flush=True)
            expected = [argument for name in CARS for argument in ("--expect", name)]
            named = tuple(zip(NODES, ports, strict=True))
            rooms = await all_of(*(("web", *options(name, port), *expected) for name, port in named))
            for name, room in zip(NODES, rooms, strict=True):
                print(f"Web node {name}: {room.address}/  all cars: {room.address}/fleet", flush=True)
            print("Press Ctrl-C to stop.", flush=True)
            if is_typed:
                await typed({name: car.type for name, car in cars.items()})
            else:
                await asyncio.gather(*(again(cars[name].type, *CARS[name]) for name in CARS if CARS[name][0]))


async def again(write: Type, fault: str, every_s: float) -> None:
    """Types the fault again and again."""
    while True:
        await write(fault)
        await asyncio.sleep(every_s)


async def typed(terminals: Mapping[str, Type]) -> None:
    """Passes each line of the standard input on to the car that it names, and goes on without an input."""
    lines = asyncio.StreamReader()
    await asyncio.get_running_loop().connect_read_pipe(lambda: asyncio.StreamReaderProtocol(lines), sys.stdin)
    while line := (await lines.readline()).decode():
        name, _, fault = line.strip().partition(" ")
        if name in terminals and fault:
            await terminals[name](fault)
        else:
            print(f"A line is CAR FAULT, such as “lynx speeding 20”; cars: {', '.join(terminals)}.", flush=True)
    await asyncio.get_running_loop().create_future()


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--ports", nargs=2, type=int, default=(8001, 8002), help="of the two web nodes; 0: any")
    parser.add_argument("--typed", action="store_true", help="begin only faults that are typed, as `lynx speeding 20`")
    given = parser.parse_args()
    with contextlib.suppress(KeyboardInterrupt, asyncio.CancelledError):
        asyncio.run(main(tuple(given.ports), is_typed=given.typed))
