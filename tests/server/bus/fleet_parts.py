"""The parts between a page and a car as processes: a real broker, an agent and two nodes; and what can befall them."""

from __future__ import annotations

import asyncio
import contextlib
import sys
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import httpx
import orjson
import pytest

from server.bus import broker_users
from tests.http import http_client
from tests.page.processes import Process, running, simulate
from tests.server.bus.apart import Apart, apart
from tests.server.bus.broker import Broker, running_broker

NODES = ("room-1", "room-2")
FAULTS = ("broker", "room-1", "agent", "frozen agent", "swallowed")
FROZEN_S = 4.0  # longer than any request may take


class Part:
    """One process that can be killed and started again with the same data and port."""

    def __init__(self, *arguments: str, net: Apart | None = None) -> None:
        """`net`: the network that it is in; None: this one."""
        self.net = net
        self._within = () if net is None else net.within
        self._arguments = arguments
        self.process = Process(*arguments, within=self._within)

    async def again(self) -> None:
        await self.process.kill()
        port = self.process.address.rsplit(":", 1)[1]
        arguments = [port if one == "0" else one for one in self._arguments]
        self._arguments = tuple(arguments)
        self.process = Process(*arguments, within=self._within)
        await self.process.start()


@contextlib.asynccontextmanager
async def parts(
    folder: Path, *, guarded: Path | None = None, needs_network: bool = False
) -> AsyncIterator[tuple[Broker, dict[str, Part]]]:
    """`guarded`: the car has a guard, and this file has what became of it. `needs_network`: skips the test where none
    can be made, as it would prove nothing of a lost one."""
    car_of = (str(guarded),) if guarded else simulate()
    module = "tests.server.bus.guarded_car" if guarded else "server"
    users: list[tuple[str, broker_users.Kind]] = [("ocelot", "agent"), *((node, "web") for node in NODES)]
    for name, kind in users:
        (folder / f"{name}.key").write_text(broker_users.add(folder, name, kind, today="2026-11-25")[1])
    async with (
        apart() as net,
        running_broker(include=folder / broker_users.CONF, host=net.here if net else "127.0.0.1") as broker,
        running(*car_of, module=module, within=net.within if net else ()) as car,
    ):
        if net is None and needs_network:
            pytest.skip("no network of its own can be made here: Linux, as root")

        def part(command: str, name: str, *more: str, net: Apart | None = None) -> Part:
            key, data = str(folder / f"{name}.key"), str(folder / name)
            given = ("--broker", broker.address, "--key", key, "--port", "0", "--data", data, *more)
            return Part(command, *given, net=net)

        watches = ("--vehicle", f"ocelot={car.address}", "--no-require-signed")  # programs of the tests sign nothing
        made = {"agent": part("agent", "ocelot", *watches, net=net)}
        made |= {node: part("web", node, "--expect", "ocelot") for node in NODES}
        try:
            for one in made.values():
                await one.process.start()
            yield broker, made
        finally:
            for one in made.values():
                await one.process.kill()


async def break_once(fault: str, broker: Broker, made: dict[str, Part], swallow_s: float) -> None:
    match fault:
        case "swallowed" if (net := made["agent"].net) is None:
            print("not swallowed: no network of its own can be made here")
        case "swallowed":
            await net.swallow(swallow_s)
        case "broker":
            await broker.kill()
            await asyncio.sleep(0.5)
            await broker.start()
        case "frozen agent":
            made["agent"].process.freeze()
            await asyncio.sleep(FROZEN_S)
            made["agent"].process.thaw()
        case _:
            await made[fault].again()


async def settled(made: dict[str, Part]) -> None:
    """Both nodes have the car again."""
    async with asyncio.timeout(30):
        for node in NODES:
            async with http_client(base_url=made[node].process.address) as client:
                while True:
                    with contextlib.suppress(httpx.HTTPError, KeyError):
                        answer = await client.get("/api/state", params={"vehicle": "ocelot"})
                        if answer.status_code == 200 and answer.json()["session"]["phase"] == "monitoring":
                            break
                    await asyncio.sleep(0.1)


async def journal_of(agent: Part) -> list[dict[str, Any]]:
    address = f"{agent.process.address}/api/log.json"
    if agent.net is not None:
        program = f"import httpx; print(httpx.get({address!r}).text)"
        events = orjson.loads(await agent.net.read(sys.executable, "-c", program))
    else:
        async with http_client() as client:
            events = (await client.get(address)).json()
    return sorted(events, key=lambda event: event["n"])
