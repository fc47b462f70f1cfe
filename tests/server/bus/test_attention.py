"""Items of cars through a real broker: two web nodes never see two holders, and a car whose agent is gone has none."""

from __future__ import annotations

import asyncio
import contextlib
import random
from collections.abc import AsyncIterator, Mapping
from typing import Any

import orjson

from monitor.alarm_spec import Priority
from server.access.identity import LOCAL
from server.bus.bus import ALL
from server.bus.nats_bus import NatsBus
from server.protocol.rate_limit import Limits
from server.web.cars_board import FLEET, CarsBoard
from server.web.fleet_log import FleetLog
from server.web.fleet_socket import FleetCommands
from server.web.remote_frames import RemoteFrames
from tests.server.bus.broker import running_broker
from tests.server.bus.buses import Clock, node, offering, until
from tests.server.vehicle.attended import ANN, BEN, SEEN, Attended

ROUNDS = 25
NOW_MS = 1_900_000_000_000


async def needing(clock: Clock, name: str = "ocelot") -> Attended:
    """A car with a critical alarm."""
    car = Attended(name, clock)
    car.faults = {Priority.CRITICAL}
    car.tick()
    await until(lambda: _ticked(car) and car.item)
    return car


def _ticked(car: Attended) -> bool:
    car.session._tick.run(car.session._now(), put=True)
    return True


@contextlib.asynccontextmanager
async def two_nodes() -> AsyncIterator[tuple[Clock, Attended, str, NatsBus, NatsBus]]:
    """One car that needs a person, its broker's address, and two nodes that know the car."""
    clock = Clock()
    async with running_broker() as broker, contextlib.AsyncExitStack() as open_parts:
        car = await needing(clock)
        rooms = [
            await open_parts.enter_async_context(node(broker.address, clock, read=RemoteFrames(lambda: NOW_MS)))
            for _ in range(2)
        ]
        await open_parts.enter_async_context(offering(car.bus, broker.address, "run-1", clock))
        for room in rooms:
            await until(lambda room=room: "ocelot" in room.vehicles)
        yield clock, car, broker.address, *rooms


async def test_of_two_who_take_at_once_one_has_it() -> None:
    async with two_nodes() as (_, car, _, north, south):
        for _ in range(ROUNDS):
            answers = await asyncio.gather(
                north.request("ocelot", {"kind": "take_item", **ANN}),
                south.request("ocelot", {"kind": "take_item", **BEN}),
            )
            assert sorted(answer["ok"] for answer in answers) == [False, True]
            winner, room, who = ("Ann", north, ANN) if answers[0]["ok"] else ("Ben", south, BEN)
            refused = next(answer for answer in answers if not answer["ok"])
            assert refused["reason"] == f"This car is assigned to {winner}: take it over, or ask."
            assert (await room.request("ocelot", {"kind": "release_item", **who}))["ok"]
        acts = [event["act"] for event in car.bus.past_events("ocelot", change="attention", limit=1000)]
        assert acts == ["released", "taken"] * ROUNDS


async def test_whatever_two_rooms_order_the_log_knows_one_holder() -> None:
    """Each event names who had it before; both nodes have the same log."""
    async with two_nodes() as (_, car, _, north, south):
        rng = random.Random(7)

        def acts() -> list[dict[str, Any]]:
            return car.bus.past_events("ocelot", change="attention", limit=1000)

        async def person(room: NatsBus, who: Mapping[str, Any], other: str) -> None:
            while len(acts()) < ROUNDS:  # most requests are refused
                kind = rng.choice(["take_item", "release_item", "offer_item", "answer_item", "withdraw_item"])
                more: dict[str, Any] = {
                    "take_item": {"over": rng.random() < 0.5},
                    "offer_item": {"to": other},
                    "answer_item": {"accept": rng.random() < 0.5},
                }.get(kind, {})
                await room.request("ocelot", {**SEEN, "kind": "announces", **who})
                await room.request("ocelot", {"kind": kind, **more, **who})

        await asyncio.gather(person(north, ANN, "page-b"), person(south, BEN, "page-a"))
        log = list(reversed(acts()))
        holder: str | None = None
        for event in log:
            match event["act"]:
                case "taken":
                    assert holder is None
                case "taken_over" | "accepted":
                    assert (event["before"], event["by"]) == (holder, event["holder"])
                case "released":
                    assert (event["before"], event["by"], event["holder"]) == (holder, holder, None)
                case _:
                    assert event["holder"] == holder
            holder = event["holder"]
        assert car.item is not None
        assert (car.item["assigned"] or {}).get("name") == holder
        for room in (north, south):
            await until(lambda room=room: room.last_event("ocelot") == car.bus.last_event("ocelot"))
            seen = [e for e in room.recent_events("ocelot", log[0]["n"] - 1, 1000) or [] if e["change"] == "attention"]
            assert seen == log


async def test_a_car_whose_agent_is_gone_cannot_be_taken() -> None:
    clock, replies = Clock(), list[Any]()
    async with running_broker() as broker, node(broker.address, clock) as room:
        page = FleetCommands(room, LOCAL, Limits(), now=clock, send=replies.append, complain=replies.append)
        page.begin({"kind": "hello", "page": "page-ann"})

        async def why() -> str:
            await page.carry_out({"kind": "take_item", "vehicle": "ocelot", "id": "1"})
            assert replies[-1]["ok"] is False
            return str(replies[-1]["reason"])

        assert await why() == "No car is named ocelot."
        car = await needing(clock)
        async with offering(car.bus, broker.address, "run-1", clock):
            await until(lambda: "ocelot" in room.vehicles)
        assert await why() == "Not delivered: the agent of ocelot is not connected to the broker."
        clock.ahead_s += 2.0
        assert await why() == "Not delivered: nothing comes from the agent of ocelot: it or the broker does not answer."
        car = await needing(clock, "margay")
        async with offering(car.bus, broker.address, "run-2", clock):
            await until(lambda: "margay" in room.vehicles)
            assert await why() == "Not delivered: the agent of ocelot does not answer."
            assert (await room.request("margay", {"kind": "take_item", **ANN}))["ok"]


async def test_a_page_of_all_cars_has_the_summary_of_the_only_car_and_no_states() -> None:
    async with two_nodes() as (clock, car, _, north, _):
        board = CarsBoard(north, now=clock, wall_ms=lambda: NOW_MS)

        def shown() -> dict[str, Any] | None:
            frame = north.newest(ALL, FLEET)
            found = {} if frame is None else orjson.loads(frame.payload)["cars"][0]
            summary: dict[str, Any] | None = _ticked(car) and found.get("summary")
            return summary

        end = board.watch_fleet(lambda _: None)
        summary = await until(shown)
        made_ms = summary["time_ms"]
        assert abs(made_ms - NOW_MS) < 3000, "by the clock of the node"
        assert 0 < summary["attention"]["escalates_ms"] - made_ms <= 30_000
        assert car.bus.watched("ocelot") == 0, "no states are pulled"
        await north.request("ocelot", {"kind": "take_item", **ANN})
        await until(lambda: ((shown() or {}).get("attention") or {}).get("assigned"))
        end()
        pulled = len(north._pulls._tasks)
        assert pulled == 0


async def test_what_happened_to_items_is_there_from_all_agents() -> None:
    async with two_nodes() as (clock, _, address, north, south):
        await north.request("ocelot", {"kind": "take_item", **ANN})
        log = FleetLog(south)
        woken: list[int] = []
        leave = log.watch(lambda: woken.append(1))

        def logged() -> list[tuple[str, str]]:
            return [(event["vehicle"], event["text"]) for event in log.after(0)[1]]

        await until(lambda: logged() == [("ocelot", "Assigned to Ann.")])
        await north.request("ocelot", {"kind": "release_item", **ANN})
        await until(lambda: logged()[1:] == [("ocelot", "Ann gave it back: unassigned.")])
        margay = await needing(clock, "margay")
        await margay.accepted(BEN, "take_item")
        async with offering(margay.bus, address, "run-2", clock):
            await until(lambda: logged()[2:] == [("margay", "Assigned to Ben.")])
            await south.request("margay", {"kind": "release_item", **BEN})
            await until(lambda: logged()[3:] == [("margay", "Ben gave it back: unassigned.")])
        assert len(woken) >= 4
        leave()
        assert log.after(0) == (0, [])
