"""The status of a page reaches the cars that it concerns, also where its own car is not served."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from types import SimpleNamespace
from typing import Any, cast

import pytest

from server.access.identity import LOCAL
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.protocol.rate_limit import Limits
from server.replay.view_source import ViewSource
from server.vehicle.outcomes import Outcomes
from server.web.fleet_socket import FleetCommands
from server.web.page_commands import PageCommands

pytestmark = pytest.mark.virtual_time


def page_of(
    bus: LocalBus,
    *,
    is_fleet: bool = False,
    send: Callable[[Any], None] = lambda _: None,
    complain: Callable[[str], None] = print,
) -> PageCommands | FleetCommands:
    """The commands of a page of the car ocelot, or of a page of all cars."""
    if is_fleet:
        return FleetCommands(bus, LOCAL, Limits(), now=lambda: 0.0, send=send, complain=complain)
    view = cast(ViewSource, SimpleNamespace(is_replaying=False))
    return PageCommands(
        bus, "ocelot", view, LOCAL, Limits(), now=lambda: 0.0, wall_ms=lambda: 0, send=send, complain=complain
    )


async def test_another_car_that_is_lost_does_not_hold_up_the_page() -> None:
    requested = asyncio.Event()

    async def lost(_: Mapping[str, Any]) -> Mapping[str, Any]:
        requested.set()
        await asyncio.sleep(60)
        return {"ok": True}

    async def own(_: Mapping[str, Any]) -> Mapping[str, Any]:
        return {"ok": True}

    bus = LocalBus(Journal(None), now=lambda: 0.0)
    bus.serve("ocelot", own)
    bus.serve("serval", lost)
    page = page_of(bus)
    page.begin({"kind": "hello"})
    async with asyncio.timeout(0.5):
        for _ in range(3):
            await page.present(
                {"kind": "present", "visible": True, "sound": "ready", "awake": "ready", "announces": ["serval"]}
            )
        await requested.wait()
        await page.close()


async def test_other_cars_are_announced_while_the_own_one_is_not_served() -> None:
    received: list[Mapping[str, Any]] = []

    async def serval(command: Mapping[str, Any]) -> Mapping[str, Any]:
        received.append(command)
        return {"ok": True}

    bus = LocalBus(Journal(None), now=lambda: 0.0)
    bus.serve("serval", serval)
    complaints: list[str] = []
    page = page_of(bus, complain=complaints.append)
    page.begin({"kind": "hello"})
    await page.present(
        {"kind": "present", "visible": True, "sound": "ready", "awake": "ready", "announces": ["serval"]}
    )
    await page.leave()
    assert [(one["kind"], one["leaves"]) for one in received] == [("announces", False), ("announces", True)]
    assert complaints == []


async def test_a_page_of_all_cars_is_not_counted_on_before_its_hello() -> None:
    reached: list[str] = []

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        reached.append(command["page"])
        return {"ok": True}

    bus = LocalBus(Journal(None), now=lambda: 0.0)
    bus.serve("ocelot", car)
    page = page_of(bus, is_fleet=True)
    present = {"kind": "present", "visible": True, "sound": "ready", "awake": "ready"}
    await page.present(present)
    page.begin({"kind": "hello", "page": "page-ann"})
    await page.present(present)
    await page.leave()
    assert set(reached) == {"page-ann"}


@pytest.mark.parametrize("is_fleet", [False, True])
async def test_before_its_hello_no_command_of_a_page_is_carried_out_and_no_outcome_is_given(is_fleet: bool) -> None:
    outcomes = Outcomes(lambda: 1000.0)
    outcomes._since_s = 0.0
    done: list[str] = []

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        if command["kind"] == "outcome":
            return outcomes.ask(command["page"], command["of"], command["ago_s"], 1000.0)

        async def carry_out(_: Mapping[str, Any]) -> Mapping[str, Any]:
            done.append(command["id"])
            return {"ok": True}

        return await outcomes.keep(command, carry_out)

    bus = LocalBus(Journal(None), now=lambda: 0.0)
    bus.serve("ocelot", car)
    replies: list[dict[str, Any]] = []

    hello = {"kind": "hello", "page": "page-ann"}
    acknowledge = {"kind": "acknowledge", "vehicle": "ocelot", "alarm": "speed_limit", "occurrence": 1}
    query = {"kind": "outcome", "id": "a-1?", "of": "a-1", "ago_s": 1.0, "vehicle": "ocelot"}

    async def answer(to: PageCommands | FleetCommands, message: dict[str, Any]) -> dict[str, Any]:
        await to.command(message)
        return next(one for one in reversed(replies) if one.get("id") == message["id"])

    before, after = (page_of(bus, is_fleet=is_fleet, send=replies.append) for _ in range(2))
    before.begin(hello)
    assert (await answer(before, {**acknowledge, "id": "a-1"}))["ok"] is True
    reply = await answer(after, query)
    assert (reply["ok"], reply.get("became")) == (False, None)
    assert (await answer(after, {**acknowledge, "id": "a-2"}))["ok"] is False
    after.begin(hello)
    assert (await answer(after, query))["became"] == "done"
    assert (await answer(after, {**acknowledge, "id": "a-3"}))["ok"] is True
    assert done == ["a-1", "a-3"]


@pytest.mark.parametrize("is_fleet", [False, True])
async def test_a_command_needs_an_id_that_fits_into_its_reply(is_fleet: bool) -> None:
    reached: list[object] = []

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        reached.append(command["id"])
        return {"ok": True}

    bus = LocalBus(Journal(None), now=lambda: 0.0)
    bus.serve("ocelot", car)
    complaints: list[str] = []
    page = page_of(bus, is_fleet=is_fleet, complain=complaints.append)
    page.begin({"kind": "hello"})
    for id in (None, 7, "x" * 81, "x" * 80):
        await page.command(
            {"kind": "acknowledge", "vehicle": "ocelot", "alarm": "speed_limit", "occurrence": 1, "id": id}
        )
    assert reached == ["x" * 80]
    assert complaints == ["A command needs an id of at most 80 characters."] * 3
