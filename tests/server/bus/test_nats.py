"""What only a broker can do wrong: bytes that come late, an end on either side, and other clients on it."""

from __future__ import annotations

import asyncio
import contextlib
import sqlite3
from collections.abc import AsyncIterator, Mapping
from pathlib import Path
from typing import Any

import orjson
import pytest

from server.bus import journal
from server.bus import nats_wire as wire
from server.bus.bus import ALL, FRAME_LIVES_S, NotServed, PageBus
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.bus.log_runs import Resumed
from server.bus.nats_agent import NatsAgent
from server.bus.nats_link import processed
from server.web.cars_board import CarsBoard
from server.web.fleet_log import FleetLog
from tests.page.radio import Radio
from tests.server.bus.broker import Broker, connected, running_broker
from tests.server.bus.buses import Buses, Clock, event, local_buses, nats_buses, node, numbers, offering, until

LATE_S = 1.2


@contextlib.asynccontextmanager
async def over_radio() -> AsyncIterator[tuple[Broker, Radio, Buses]]:
    """The node is connected to the broker through a radio that can be cut."""
    async with running_broker() as broker:
        radio = Radio(broker.port)
        async with radio.on_air() as air, nats_buses(broker.address, air.replace("http", "nats")) as both:
            yield broker, radio, both


async def test_a_frame_that_hung_in_the_air_is_as_old_as_it_is() -> None:
    async with over_radio() as (_, radio, both):
        both.page.watch("ocelot", lambda _: None)
        await until(lambda: both.session.watched("ocelot"))
        put_s: dict[str, float] = {}
        younger: list[tuple[str, float]] = []

        def put(text: str) -> None:
            put_s[text] = both.clock()
            both.session.put("ocelot", "state", text)

        def note(_: str) -> None:
            frame = both.page.newest("ocelot", "state")
            if frame is not None:
                younger.append((str(frame.payload), frame.put_s - put_s[str(frame.payload)]))

        both.page.watch("ocelot", note)
        for number in range(8):
            put(f"before {number}")
            await asyncio.sleep(0.03)
        await until(lambda: younger and younger[-1][0].startswith("before"))
        radio.cut()
        for number in range(round(LATE_S / 0.1)):
            put(f"cut {number}")
            await asyncio.sleep(0.1)
        hung = len(younger)
        radio.mend()
        put("after")
        await until(lambda: younger[-1][0] == "after")
        assert all(by_s < 0.02 for _, by_s in younger), younger
        came_late = {text for text, _ in younger[hung:]}
        assert len(came_late) <= 2, f"at most the one that was under way, then the newest: {came_late}"


@pytest.mark.field
async def test_frames_that_hang_for_longer_than_they_live_are_never_shown() -> None:
    async with over_radio() as (_, radio, both):
        both.page.watch("ocelot", lambda _: None)
        await until(lambda: both.session.watched("ocelot"))
        radio.cut()
        both.session.put("ocelot", "state", "old")
        await asyncio.sleep(0.1)
        both.clock.ahead_s += FRAME_LIVES_S
        shown: list[object] = []
        both.page.watch("ocelot", lambda kind: shown.append(both.page.newest("ocelot", kind)))
        radio.mend()
        await until(lambda: shown)
        assert shown[0] is None


async def test_a_command_that_comes_late_is_not_carried_out() -> None:
    async with over_radio() as (_, radio, both):
        assert await both.page.request("ocelot", {"what": 1}) == {"ok": True, "got": 1}
        radio.cut()
        with pytest.raises(NotServed, match="the agent of ocelot did not answer within") as why:
            await both.page.request("ocelot", {"what": 2}, deadline_s=0.4)
        assert (why.value.outcome, why.value.cut) == ("unknown", "broker-agent"), "nobody here knows where it was lost"
        radio.mend()
        assert (await both.page.request("ocelot", {"what": 3}, deadline_s=10.0))["got"] == 3
        assert [one["what"] for one in both.commands] == [1, 3]


async def test_a_command_whose_time_ran_out_while_its_signature_was_judged_is_not_carried_out() -> None:
    async def slow(vehicle: str, message: Mapping[str, Any]) -> Mapping[str, Any]:
        both.clock.ahead_s += 5.0
        return message

    async with local_buses() as both:
        agent = NatsAgent(both.session, run="run-1", now=both.clock, admit=slow)
        ask = wire.Ask(do="command", command={"what": 1}, not_after_s=both.clock() + 3, run="run-1")
        with pytest.raises(NotServed, match="the command reached ocelot too late and was not carried out") as why:
            await agent._command("ocelot", ask)
        assert (why.value.outcome, both.commands) == ("not_delivered", [])


async def test_a_command_for_an_earlier_run_is_refused() -> None:
    async with running_broker() as broker, local_buses() as both, node(broker.address, both.clock) as page:
        async with offering(both.session, broker.address, "run-1", both.clock):
            await until(lambda: page.vehicles)
            assert (await page.request("ocelot", {"what": 1}))["got"] == 1
        async with connected(broker.address) as client, offering(both.session, broker.address, "run-2", both.clock):
            stale = wire.Ask(do="command", command={"what": 2}, not_after_s=both.clock() + 60, run="run-1")
            answer = wire.decode(
                wire.Answer, (await client.request(wire.subject("ocelot", "ask"), wire.encode(stale), timeout=5)).data
            )
            assert answer.refused == "ocelot has started again since the command was given"
            await until(lambda: page.run("ocelot") == "run-2")
            assert (await page.request("ocelot", {"what": 3}))["got"] == 3
        assert [one["what"] for one in both.commands] == [1, 3]


async def test_an_answer_waits_for_events_whose_publication_was_lost() -> None:
    async with running_broker() as broker, local_buses() as both, node(broker.address, both.clock) as page:
        both.session.watch_events = lambda *_: lambda: None  # type: ignore[method-assign]
        async with offering(both.session, broker.address, "run-1", both.clock):
            await until(lambda: page.vehicles)
            await page.request("ocelot", {"vehicle": "ocelot", "notes": "done"})
            assert [one["text"] for one in page.recent_events("ocelot", 0) or []] == ["done"]


async def test_without_its_agent_a_vehicle_is_not_served_and_stays_known() -> None:
    async with running_broker() as broker, local_buses() as both, node(broker.address, both.clock) as page:
        async with offering(both.session, broker.address, "run-1", both.clock):
            await until(lambda: page.vehicles)
        with pytest.raises(NotServed, match="ocelot is not connected to the broker") as why:
            await page.request("ocelot", {}, deadline_s=0.3)
        assert (why.value.outcome, why.value.cut) == ("not_delivered", "broker-agent")
        both.clock.ahead_s += 4.0
        with pytest.raises(NotServed, match="nothing came from the agent of ocelot for 4 s") as why:
            await page.request("ocelot", {})
        assert (why.value.outcome, why.value.cut) == ("not_delivered", "broker-agent")
        assert "ocelot" in page.vehicles


async def test_a_broker_that_is_killed_loses_and_doubles_no_event() -> None:
    async with running_broker() as broker, nats_buses(broker.address, broker.address) as both:
        came: list[int] = []

        def read(kind: str) -> None:
            if kind == "events":
                came.extend(numbers(both.page.recent_events("ocelot", came[-1] if came else 0, 1000) or []))

        both.page.watch("ocelot", read)
        for _ in range(3):
            both.session.append("ocelot", [event()])
            await broker.kill()
            both.session.append("ocelot", [event()] * 70)
            with pytest.raises(NotServed):
                await both.page.request("ocelot", {"what": "lost"}, deadline_s=0.3)
            await broker.start()
            both.session.append("ocelot", [event()])
            last = both.session.last_event("ocelot")
            await until(lambda n=last: both.page.last_event("ocelot") == n)  # type: ignore[misc]
            assert (await both.page.request("ocelot", {"what": "again"}, deadline_s=10.0))["got"] == "again"
        assert came == list(range(1, 3 * 72 + 1))
        both.session.put("ocelot", "state", "drives")
        await until(lambda: both.page.newest("ocelot", "state"))
        assert {one["what"] for one in both.commands} == {"again"}


async def test_events_arrive_behind_those_that_a_full_disk_has_lost(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(journal, "MAX_UNSAVED", 50)
    clock = Clock()
    bus = LocalBus(Journal(tmp_path / "events.sqlite"), now=clock)
    bus.serve("ocelot", lambda _: asyncio.sleep(0.0, {}))
    async with running_broker() as broker, node(broker.address, clock) as page:
        async with offering(bus, broker.address, "run-1", clock):
            bus.append("ocelot", [event()] * 5)
            await until(lambda: page.last_event("ocelot") == 5)
        with contextlib.closing(sqlite3.connect(tmp_path / "events.sqlite", isolation_level=None)) as other:
            other.execute("BEGIN IMMEDIATE")
            bus.append("ocelot", [event()] * 300)
            async with offering(bus, broker.address, "run-1", clock):
                await until(lambda: page.last_event("ocelot") == 305)
                assert numbers(await page.events_after("ocelot", 4, 400)) == [5, *range(256, 306)]
                bus.append("ocelot", [event()])
                await until(lambda: page.last_event("ocelot") == 306)


async def test_a_log_that_cannot_be_read_is_not_one_that_has_lost_events(tmp_path: Path) -> None:
    """A node that is behind waits for it: what it would skip is on the disk."""
    clock, kept = Clock(), Journal(tmp_path / "events.sqlite")
    bus = LocalBus(kept, now=clock)
    bus.serve("ocelot", lambda _: asyncio.sleep(0.0, {}))
    async with running_broker() as broker, node(broker.address, clock) as page:
        async with offering(bus, broker.address, "run-1", clock):
            bus.append("ocelot", [event()] * 5)
            await until(lambda: page.last_event("ocelot") == 5)
        bus.append("ocelot", [event()] * 300)
        assert kept._database is not None
        kept._database.set_progress_handler(lambda: 1, 1)  # SQLite's own way to interrupt what runs
        bus.append("ocelot", [event()])
        async with offering(bus, broker.address, "run-1", clock):
            with pytest.raises(NotServed, match="the alarm log of ocelot cannot be read"):
                await page._questions.ask("ocelot", wire.Ask(do="after", n=5))
            kept._database.set_progress_handler(None, 0)
            bus.append("ocelot", [event()])
            await until(lambda: page.last_event("ocelot") == 307)
            assert numbers(await page.events_after("ocelot", 5, 400)) == [*range(6, 308)]


@pytest.mark.parametrize("body", [b"", b"\xff\xfe", b"[]", b'{"run": 1}', b"{" * 200, b'{"events": [{"n": "x"}]}'])
async def test_nonsense_harms_neither_side(body: bytes) -> None:
    async with running_broker() as broker, nats_buses(broker.address, broker.address) as both:
        async with connected(broker.address) as stranger:
            for what in ("pull.state", "pull.nothing", "ask", "events", "here"):
                await stranger.publish(wire.subject("ocelot", what), body, reply="nowhere")
            await processed(stranger)
        both.session.append("ocelot", [event()])
        await until(lambda: both.page.last_event("ocelot") == 1)
        assert (await both.page.request("ocelot", {"what": 1}))["got"] == 1
        assert both.page.vehicles == ("margay", "ocelot")


@pytest.mark.field
async def test_a_flood_of_pulls_is_bounded() -> None:
    async with running_broker() as broker, nats_buses(broker.address, broker.address) as both:
        async with connected(broker.address) as stranger:
            pull = wire.encode(wire.Pull(have=0, run=""))
            for _ in range(2000):
                await stranger.publish(wire.subject("ocelot", "pull.state"), pull, reply="nowhere")
            await processed(stranger)
            assert (await both.page.request("ocelot", {"what": 1}, deadline_s=10.0))["got"] == 1


async def test_a_page_with_one_car_gets_the_next() -> None:
    clock, kinds = Clock(), list[str]()
    summary = '{"worst": null, "waiting": 0, "phase": "monitoring"}'

    async def answer(_: Mapping[str, Any]) -> dict[str, Any]:
        return {"ok": True}

    def named(page: PageBus) -> list[str]:
        frame = page.newest(ALL, "cars")
        return [] if frame is None else [car["name"] for car in orjson.loads(frame.payload)["cars"]]

    async with running_broker() as broker, node(broker.address, clock) as page, contextlib.AsyncExitStack() as agents:
        CarsBoard(page, now=clock, wall_ms=lambda: 0).watch(kinds.append)
        buses: dict[str, LocalBus] = {}
        for vehicle in ("ocelot", "margay"):
            bus = buses[vehicle] = LocalBus(Journal(None), now=clock)
            bus.serve(vehicle, answer)
            await agents.enter_async_context(offering(bus, broker.address, f"run of {vehicle}", clock))
            await until(lambda vehicle=vehicle: vehicle in page.vehicles)
            if vehicle == "ocelot":
                assert (await page.request(vehicle, {}))["ok"], "what was pulled would have been requested before"
                assert not bus.watched(ALL), "one car is no list, and its summary is of no use"
        for vehicle, bus in buses.items():
            await until(lambda bus=bus: bus.watched(ALL))
            bus.put(ALL, vehicle, summary)
            await until(lambda vehicle=vehicle: page.newest(ALL, vehicle))
        await until(lambda: "cars" in kinds)
        assert named(page) == ["margay", "ocelot"]


async def test_which_part_was_lost_is_known_for_each_command() -> None:
    async def slow(vehicle: str, command: Mapping[str, Any], **_: Any) -> Mapping[str, Any]:
        raise NotServed("ocelot did not answer within 3 s", outcome="unknown")

    async with running_broker() as broker, nats_buses(broker.address, broker.address) as both:
        both.session.request = slow  # type: ignore[method-assign,assignment]
        with pytest.raises(NotServed) as why:
            await both.page.request("ocelot", {"what": 1})
        assert why.value.outcome == "unknown", "as the agent states of its own session"
        await broker.kill()
        await until(lambda: both.page.trouble("ocelot"))
        both.clock.ahead_s = -1.0
        with pytest.raises(NotServed, match="the broker is not connected") as why:
            await both.page.request("ocelot", {"what": 2})
        assert (why.value.outcome, why.value.cut) == ("not_delivered", "server-broker")


async def test_an_agent_with_another_log_is_followed_in_it() -> None:
    """A copied card, whose log is longer: its numbers are no continuation of what the node has."""
    clock = Clock()

    async def answer(_: Mapping[str, Any]) -> dict[str, Any]:
        return {"ok": True}

    async with running_broker() as broker, node(broker.address, clock) as page:
        log = FleetLog(page)
        log.watch(lambda: None)
        for run, count in (("run-1", 3), ("run-2", 5)):
            bus = LocalBus(Journal(None, run=run), now=clock)
            bus.serve("ocelot", answer)
            async with offering(bus, broker.address, run, clock):
                await until(lambda run=run: page.run("ocelot") == run)
                bus.append("ocelot", [event(f"{run} {n}", change="attention") for n in range(count)])
                await until(lambda count=count: page.last_event("ocelot") == count)
                await until(lambda run=run, count=count: logged(log)[-1:] == [f"{run} {count - 1}"])
                if run == "run-2":
                    assert await page.resume("ocelot", "run-1", 3) == Resumed(common=0, after=0, new_after=0)
                    found = await page.events_after("ocelot", 0)
                    assert [one["text"] for one in found] == [f"run-2 {n}" for n in range(5)]
        assert logged(log) == [*(f"run-1 {n}" for n in range(3)), *(f"run-2 {n}" for n in range(5))]


def logged(log: FleetLog) -> list[str]:
    return [one["text"] for one in log.after(0)[1]]
