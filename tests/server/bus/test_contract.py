"""What sessions and pages may rely on, of every bus alike."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Callable
from typing import Any

import pytest

from server.bus.bus import ALL, FRAME_LIVES_S, NotServed
from tests.server.bus.broker import running_broker
from tests.server.bus.buses import Buses, event, local_buses, nats_buses, numbers, until


@contextlib.asynccontextmanager
async def over_nats() -> AsyncIterator[Buses]:
    async with running_broker() as broker, nats_buses(broker.address, broker.address) as both:
        yield both


Opened = Callable[[], contextlib.AbstractAsyncContextManager[Buses]]
pytestmark = pytest.mark.parametrize(
    "opened", [pytest.param(local_buses, id="local"), pytest.param(over_nats, id="nats")]
)


async def test_a_page_gets_the_newest_frame_and_is_woken_by_it(opened: Opened) -> None:
    async with opened() as both:
        woken: list[str] = []
        assert both.page.newest("ocelot", "state") is None
        both.page.watch("ocelot", woken.append)
        await until(lambda: both.session.watched("ocelot"))
        both.session.put("ocelot", "state", "one")
        first = await until(lambda: both.page.newest("ocelot", "state"))
        assert (first.payload, woken) == ("one", ["state"])
        both.session.put("margay", "state", "other")
        both.session.put("ocelot", "state", "two")
        await until(lambda: both.page.newest("ocelot", "state").payload == "two")
        second = both.page.newest("ocelot", "state")
        assert second is not None
        assert second.number > first.number
        assert 0 <= both.clock() - second.put_s < FRAME_LIVES_S
        assert set(woken) == {"state"}


async def test_only_the_newest_frame_is_sent(opened: Opened) -> None:
    async with opened() as both:
        seen: list[str] = []

        def note(kind: str) -> None:
            frame = both.page.newest("ocelot", kind)
            assert frame is not None
            seen.append(str(frame.payload))

        both.page.watch("ocelot", note)
        await until(lambda: both.session.watched("ocelot"))
        for number in range(200):
            both.session.put("ocelot", "state", f"{number:03}")
            if number % 20 == 0:
                await asyncio.sleep(0)
        await until(lambda: seen and seen[-1] == "199")
        assert seen == sorted(set(seen)), "none twice, none older than the one before"


async def test_bytes_come_as_bytes(opened: Opened) -> None:
    async with opened() as both:
        both.page.want("ocelot", "scan", +1)
        await until(lambda: both.session.wanted("ocelot", "scan"))
        both.session.put("ocelot", "scan", b"\x00\xff\n\x01")
        assert (await until(lambda: both.page.newest("ocelot", "scan"))).payload == b"\x00\xff\n\x01"


@pytest.mark.field
async def test_a_frame_that_was_not_replaced_is_outdated(opened: Opened) -> None:
    async with opened() as both:
        both.page.watch("ocelot", lambda _: None)
        await until(lambda: both.session.watched("ocelot"))
        both.session.put("ocelot", "state", "one")
        await until(lambda: both.page.newest("ocelot", "state"))
        both.clock.ahead_s += FRAME_LIVES_S + 0.1
        assert both.page.newest("ocelot", "state") is None
        await asyncio.sleep(0.05)  # a bus that requests again does not get the same once more as new
        assert both.page.newest("ocelot", "state") is None


@pytest.mark.field
async def test_a_frame_is_as_old_as_what_it_holds(opened: Opened) -> None:
    """A process may be stopped between the moment that a frame is of and the moment at which it is put."""
    async with opened() as both:
        both.page.watch("ocelot", lambda _: None)
        await until(lambda: both.session.watched("ocelot"))
        both.session.put("ocelot", "state", "late", made_s=both.clock() - FRAME_LIVES_S - 0.1)
        await asyncio.sleep(0.05)
        assert both.page.newest("ocelot", "state") is None
        both.session.put("ocelot", "state", "new", made_s=both.clock() - 1.0)
        frame = await until(lambda: both.page.newest("ocelot", "state"))
        assert frame.payload == "new"
        assert 1.0 <= both.clock() - frame.put_s < FRAME_LIVES_S


async def test_a_session_knows_whether_anybody_looks(opened: Opened) -> None:
    async with opened() as both:
        assert not both.session.watched("ocelot")
        assert not both.session.wanted("ocelot", "scan")
        leave = both.page.watch("ocelot", lambda _: None)
        both.page.want("ocelot", "scan", +1)
        await until(lambda: both.session.watched("ocelot") and both.session.wanted("ocelot", "scan"))
        assert not both.session.watched("margay")
        leave()
        both.page.want("ocelot", "scan", -1)
        both.clock.ahead_s += 10.0
        await until(lambda: not both.session.watched("ocelot") and not both.session.wanted("ocelot", "scan"))


async def test_a_page_of_several_vehicles_sees_the_summary_of_each(opened: Opened) -> None:
    async with opened() as both:
        woken: list[str] = []
        both.page.watch(ALL, woken.append)
        await until(lambda: both.session.watched(ALL))
        for vehicle in ("ocelot", "margay"):
            both.session.put(ALL, vehicle, f"{vehicle} drives")
            assert (await until(lambda v=vehicle: both.page.newest(ALL, v))).payload == f"{vehicle} drives"  # type: ignore[misc]
        both.page.put(ALL, "cars", "all of them")
        assert (await until(lambda: both.page.newest(ALL, "cars"))).payload == "all of them"
        assert {"ocelot", "margay", "cars"} <= set(woken)
        assert set(both.page.vehicles) == {"ocelot", "margay"}


async def test_events_come_in_order_and_once(opened: Opened) -> None:
    async with opened() as both:
        came: list[int] = []

        def read(kind: str) -> None:
            if kind == "events":
                came.extend(numbers(both.page.recent_events("ocelot", came[-1] if came else 0, 1000) or []))

        both.page.watch("ocelot", read)
        for number in range(300):
            assert numbers(both.session.append("ocelot", [event(str(number)), event("b")])) == [
                2 * number + 1,
                2 * number + 2,
            ]
            if number % 50 == 0:
                await asyncio.sleep(0)
        await until(lambda: both.page.last_event("ocelot") == 600)
        assert both.page.last_event("margay") == 0
        assert numbers(await both.page.events_after("ocelot", 0, 1000)) == list(range(1, 601))
        assert numbers(await both.page.events_after("ocelot", 598)) == [599, 600]
        assert await both.page.events_after("ocelot", 600) == []
        assert came == sorted(set(came)), "none twice, none out of order"
        assert came[-1] == 600


async def test_events_are_found_by_what_they_say(opened: Opened) -> None:
    async with opened() as both:
        both.session.append("ocelot", [event(alarm="cold" if n % 3 == 0 else "hot", at_ms=n) for n in range(600)])
        found = await both.page.find_events("ocelot", alarm="cold", limit=150)
        assert numbers(found) == [3 * k + 1 for k in range(199, 49, -1)]
        assert numbers(await both.page.find_events("ocelot", since_ms=598)) == [600, 599]


async def test_a_request_is_answered_once_its_events_may_be_shown(opened: Opened) -> None:
    async with opened() as both:
        command = {"kind": "note", "vehicle": "ocelot", "notes": "done", "what": [1, "two", None]}
        assert await both.page.request("ocelot", command) == {"ok": True, "got": [1, "two", None]}
        assert both.page.last_event("ocelot") == 1
        assert [one["text"] for one in await both.page.events_after("ocelot", 0)] == ["done"]


@pytest.mark.parametrize(
    ("vehicle", "command", "why"),
    [("puma", {}, "no vehicle is named puma"), ("ocelot", {"takes_s": 60.0}, "ocelot did not answer within")],
)
async def test_who_is_not_there_or_too_slow_is_not_served(
    opened: Opened, vehicle: str, command: dict[str, Any], why: str
) -> None:
    async with opened() as both:
        with pytest.raises(NotServed, match=why):
            await both.page.request(vehicle, command, deadline_s=0.3)
