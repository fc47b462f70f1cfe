"""The status of a page reaches the cars that it concerns, also where its own car is not served."""

from __future__ import annotations

import asyncio
import contextlib
import itertools
from collections.abc import AsyncIterator, Callable, Mapping
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

PRESENT = {"kind": "present", "visible": True, "sound": "ready", "awake": "ready"}


def page_of(
    bus: LocalBus,
    *,
    is_fleet: bool = False,
    send: Callable[[Any], None] = lambda _: None,
    complain: Callable[[str], None] = print,
    now: Callable[[], float] = lambda: 0.0,
) -> PageCommands | FleetCommands:
    """The commands of a page of the car ocelot, or of a page of all cars."""
    if is_fleet:
        return FleetCommands(bus, LOCAL, Limits(), now=now, send=send, complain=complain)
    view = cast(ViewSource, SimpleNamespace(is_replaying=False))
    return PageCommands(bus, "ocelot", view, LOCAL, Limits(), now=now, wall_ms=lambda: 0, send=send, complain=complain)


@contextlib.asynccontextmanager
async def at_work(page: PageCommands | FleetCommands) -> AsyncIterator[None]:
    """What the page sends is carried out meanwhile."""
    work = asyncio.create_task(page.run())
    yield
    work.cancel()
    await asyncio.gather(work, return_exceptions=True)
    await page.close()


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
    async with asyncio.timeout(0.5), at_work(page):
        for _ in range(3):
            page.present({**PRESENT, "announces": ["serval"]})
            await page.finished()
        await requested.wait()


@pytest.mark.parametrize("is_fleet", [False, True])
async def test_a_command_waits_for_no_answer_to_a_status(is_fleet: bool) -> None:
    reached: list[tuple[float, object]] = []
    loop = asyncio.get_running_loop()

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        if command["kind"] in ("present", "announces"):
            await asyncio.sleep(60)
        reached.append((loop.time() - began_s, command["kind"]))
        return {"ok": True}

    bus = LocalBus(Journal(None), now=loop.time)
    bus.serve("ocelot", car)
    page = page_of(bus, is_fleet=is_fleet)
    page.begin({"kind": "hello"})
    began_s = loop.time()
    async with at_work(page):
        page.present(PRESENT)
        await page.add({"kind": "acknowledge", "vehicle": "ocelot", "alarm": "speed", "occurrence": 1, "id": "a-1"})
        await asyncio.sleep(0.1)
        assert [(round(at_s, 3), kind) for at_s, kind in reached] == [(0.0, "acknowledge")]


async def test_the_time_of_a_command_counts_from_when_it_came() -> None:
    reached: list[tuple[object, float, float, float]] = []
    loop = asyncio.get_running_loop()
    bus = LocalBus(Journal(None), now=loop.time)

    async def request(
        _: str, command: Mapping[str, Any], *, deadline_s: float, comes_within_s: float
    ) -> Mapping[str, Any]:
        reached.append((command["id"], command.get("pressed_ago_s", 0.0), deadline_s, round(comes_within_s, 3)))
        await asyncio.sleep(2.0)
        return {"ok": True}

    bus.request = request  # type: ignore[assignment, method-assign]
    page = page_of(bus, now=loop.time)
    page.begin({"kind": "hello"})
    async with at_work(page):
        await page.add({"kind": "pause", "id": "1"})
        await page.add({"kind": "acknowledge", "id": "2"})
        await page.add({"kind": "pause", "id": "3", "pressed_ago_s": 0.25})
        await page.add({"kind": "pause", "id": "4", "heard_ms": 5.0})
        await page.finished()
    assert reached == [("1", 0.0, 3.0, 0.5), ("2", 0.0, 3.0, 1.0), ("3", 4.25, 3.0, -3.5), ("4", 0.0, 3.0, -5.5)]


async def test_one_that_fails_ends_no_other() -> None:
    reached: list[object] = []

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        if command["kind"] == "pause":
            raise KeyError("a fault")
        await asyncio.sleep(0.5)
        reached.append(command["id"])
        return {"ok": True}

    bus = LocalBus(Journal(None), now=lambda: 0.0)
    bus.serve("ocelot", car)
    page = page_of(bus)
    page.begin({"kind": "hello"})
    async with at_work(page):
        for id, kind in (("1", "release"), ("2", "pause"), ("3", "slow_down"), ("4", "acknowledge")):
            await page.add({"kind": kind, "id": id, "alarm": "speed", "occurrence": 1})
        await page.finished()
        assert not page.are_unfinished
    assert sorted(reached, key=str) == ["1", "3", "4"]


async def test_what_slows_the_car_waits_for_nothing_else() -> None:
    reached: list[tuple[float, object]] = []
    loop = asyncio.get_running_loop()

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        reached.append((loop.time() - began_s, command["kind"]))
        await asyncio.sleep(0.2 if command["kind"] in ("release", "outcome") else 60)
        return {"ok": True}

    bus = LocalBus(Journal(None), now=loop.time)
    bus.serve("ocelot", car)
    page = page_of(bus, now=loop.time)
    page.begin({"kind": "hello"})
    began_s = loop.time()
    async with at_work(page):
        for number, kind in enumerate(("pause", "outcome", "position", "release", "slow_down")):
            await page.add({"kind": kind, "id": str(number)})
        await page.add({"kind": ["slow_down"], "id": "5"})
        await asyncio.sleep(1.0)
    assert [(round(at_s, 3), kind) for at_s, kind in reached] == [
        (0.0, "pause"), (0.0, "outcome"), (0.0, "release"),
        (0.2, "position"), (0.2, "slow_down"),  # after those of their lanes
    ]  # fmt: skip


async def test_an_order_to_slow_that_is_pressed_again_waits_for_no_answer_and_no_release_overtakes_it() -> None:
    reached: list[tuple[float, object]] = []
    loop = asyncio.get_running_loop()

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        reached.append((round(loop.time() - began_s, 3), command["id"]))
        await asyncio.sleep(0.4 if command["id"] == "slow_down 1" else 0.3)
        return {"ok": True}

    bus = LocalBus(Journal(None), now=loop.time)
    bus.serve("ocelot", car)
    page = page_of(bus, now=loop.time)
    page.begin({"kind": "hello"})
    began_s = loop.time()
    async with at_work(page):
        for n, kind in enumerate(("arm", "slow_down", "slow_down", "release", "slow_down")):
            await page.add({"kind": kind, "id": f"{kind} {n}"})
        await asyncio.sleep(0.5)
        await page.add({"kind": "slow_down", "id": "slow_down 5"})
        await page.finished()
    assert reached == [
        (0.0, "arm 0"), (0.3, "slow_down 1"), (0.3, "slow_down 2"), (0.7, "release 3"),
        (1.0, "slow_down 4"), (1.0, "slow_down 5"),
    ]  # fmt: skip


async def test_of_orders_to_slow_that_are_not_answered_few_are_under_way_and_a_release_waits_for_none() -> None:
    reached: list[tuple[float, str]] = []
    loop = asyncio.get_running_loop()

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        reached.append((round(loop.time() - began_s, 3), command["id"]))
        await asyncio.sleep(60.0 if command["id"] < "5" else 0.1)
        return {"ok": True}

    bus = LocalBus(Journal(None), now=loop.time)
    bus.serve("ocelot", car)
    page = page_of(bus, now=loop.time)
    page.begin({"kind": "hello"})
    began_s = loop.time()
    async with at_work(page):
        for id in range(5):
            await page.add({"kind": "slow_down", "id": str(id)})
        await asyncio.sleep(0.9)
        await page.add({"kind": "release", "id": "5"})
        await asyncio.sleep(0.5)
        await page.add({"kind": "release", "id": "6"})
        await asyncio.sleep(0.5)
    assert sorted(reached) == [
        (0.0, "0"), (0.0, "1"), (0.0, "2"),
        (1.0, "3"), (1.0, "4"), (1.0, "5"),  # of these the first two are refused by the car, as too late
        (1.4, "6"),
    ]  # fmt: skip


async def test_of_reports_that_wait_the_newest_of_an_id_is_passed_on_and_has_its_whole_time() -> None:
    reached: list[tuple[float, object, object]] = []
    loop = asyncio.get_running_loop()

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        reached.append((round(loop.time() - began_s, 3), command["id"], command["ago_s"]))
        await asyncio.sleep(60 if command["id"] == "1?" else 2.0)
        return {"ok": True}

    bus = LocalBus(Journal(None), now=loop.time)
    bus.serve("ocelot", car)
    replies: list[Any] = []
    page = page_of(bus, send=replies.append, now=loop.time)
    page.begin({"kind": "hello"})
    began_s = loop.time()
    async with at_work(page):
        for ago_s in (5.0, 6.0, 7.0):
            for of in ("1", "2"):
                await page.add({"kind": "outcome", "id": f"{of}?", "of": of, "ago_s": ago_s})
            await asyncio.sleep(0.5)
        await page.finished()
    assert reached == [(0.0, "1?", 5.0), (3.0, "2?", 7.0), (5.0, "1?", 7.0)]
    assert [one["id"] for one in replies if one.get("ok")] == ["2?"]


@pytest.mark.parametrize("trip_s", [0.1, 0.6, 1.0, 2.9])
async def test_the_status_of_a_page_is_as_often_passed_on_as_it_is_answered(trip_s: float) -> None:
    """Beside its position every second, and outcomes that are requested; the lease of control lasts 3 s."""
    statuses: list[float] = []
    loop = asyncio.get_running_loop()

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        if command["kind"] == "present":
            statuses.append(loop.time())
        await asyncio.sleep(trip_s)
        return {"ok": True}

    bus = LocalBus(Journal(None), now=loop.time)
    bus.serve("ocelot", car)
    page = page_of(bus, now=loop.time)
    page.begin({"kind": "hello"})
    async with at_work(page):
        for n in range(30):
            page.present(PRESENT)
            await page.add({"kind": "position", "id": "position", "phone": "Ann"})
            await page.add({"kind": "outcome", "id": f"{n % 3}?", "of": f"{n % 3}", "ago_s": 5.0})
            await asyncio.sleep(1.0)
        async with asyncio.timeout(6 * trip_s + 0.1):
            await page.finished()
    longest_s = max(after - before for before, after in itertools.pairwise(statuses))
    assert longest_s <= max(1.0, trip_s) + 0.001


async def test_a_command_to_one_car_waits_for_none_to_another() -> None:
    reached: list[tuple[float, object]] = []
    loop = asyncio.get_running_loop()

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        reached.append((loop.time() - began_s, command["id"]))
        await asyncio.sleep(60 if command["vehicle"] == "ocelot" else 0.5)
        return {"ok": True}

    bus = LocalBus(Journal(None), now=loop.time)
    bus.serve("ocelot", car)
    bus.serve("serval", car)
    page = page_of(bus, is_fleet=True, now=loop.time)
    page.begin({"kind": "hello"})
    began_s = loop.time()
    async with at_work(page):
        for vehicle, id in (("ocelot", "1"), ("serval", "2"), ("serval", "3")):
            await page.add({"kind": "take_item", "vehicle": vehicle, "id": id})
        await page.finished()
    assert [(round(at_s, 3), id) for at_s, id in reached] == [(0.0, "1"), (0.0, "2"), (0.5, "3")]


async def test_of_statuses_that_wait_the_newest_is_passed_on() -> None:
    reached: list[bool] = []
    answers = asyncio.Event()

    async def car(command: Mapping[str, Any]) -> Mapping[str, Any]:
        reached.append(command["visible"])
        await answers.wait()
        return {"ok": True}

    bus = LocalBus(Journal(None), now=lambda: 0.0)
    bus.serve("ocelot", car)
    page = page_of(bus)
    page.begin({"kind": "hello"})
    async with at_work(page):
        page.present(PRESENT)
        await asyncio.sleep(0.1)
        page.present(PRESENT)
        page.present({**PRESENT, "visible": False})
        answers.set()
        await page.finished()
    assert reached == [True, False]


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
    async with at_work(page):
        page.present({**PRESENT, "announces": ["serval"]})
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
    async with at_work(page):
        page.present(PRESENT)
        await page.finished()
        page.begin({"kind": "hello", "page": "page-ann"})
        page.present(PRESENT)
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
        await to.carry_out(message)
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
        await page.carry_out(
            {"kind": "acknowledge", "vehicle": "ocelot", "alarm": "speed_limit", "occurrence": 1, "id": id}
        )
    assert reached == ["x" * 80]
    assert complaints == ["A command needs an id of at most 80 characters."] * 3
