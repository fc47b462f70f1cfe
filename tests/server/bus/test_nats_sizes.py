"""What is larger than one message of the broker: it is cut, or refused by name, and harms nothing else."""

from __future__ import annotations

import contextlib
import time
from collections.abc import AsyncIterator
from pathlib import Path

import orjson
import pytest

from server.bus import nats_http as http
from server.bus import nats_wire as wire
from server.bus.broker import Broker as Address
from server.bus.bus import NotServed
from server.bus.nats_bus import NatsBus
from server.bus.nats_link import BrokerLink
from server.system import log_context
from tests.server.bus.broker import Broker, running_broker
from tests.server.bus.buses import Buses, event, local_buses, nats_buses, node, numbers, offering, until

LARGE = "x" * 1_100_000
SMALL = 200_000  # bytes that a broker takes
LONG = "y" * 20_000  # of these, a portion is larger than a message of the broker


@contextlib.asynccontextmanager
async def through_broker() -> AsyncIterator[tuple[str, Buses]]:
    async with running_broker() as broker, nats_buses(broker.address, broker.address) as both:
        yield broker.address, both


@contextlib.asynccontextmanager
async def taking(folder: Path, size: int) -> AsyncIterator[Broker]:
    """A broker that takes messages of so many bytes."""
    conf = folder / "small.conf"
    conf.write_text(f"max_payload: {size}\n")
    async with running_broker(include=conf) as broker:
        yield broker


def test_as_many_events_as_fit_into_a_message() -> None:
    events = [event(LONG, n=n) for n in range(1, wire.PORTION + 1)]
    first = wire.fitting(events)
    assert 0 < len(first) < len(events)
    size = len(wire.encode(wire.Events(run="r" * 40, events=first)))
    assert wire.LARGEST - wire.HEAD - len(LONG) * 2 < size <= wire.LARGEST
    assert wire.fitting(events[:3]) == events[:3]
    short = {"n": 1, "at_ms": 1, "alarm": "hot", "change": "raised"}
    assert wire.fitting([event(LARGE, n=1), event(n=2)]) == [short, event(n=2)], "those behind it arrive"
    assert wire.fitting([]) == []


async def test_events_of_many_bytes_arrive_once_and_in_order() -> None:
    async with through_broker() as (_, both):
        both.session.append("ocelot", [event(LONG) for _ in range(wire.PORTION)])
        await until(lambda: both.page.last_event("ocelot") == wire.PORTION)
        recent = both.page.recent_events("ocelot", 0, wire.PORTION)
        assert recent is not None
        assert numbers(recent) == [*range(1, wire.PORTION + 1)]


async def test_events_of_many_bytes_are_read_from_an_agent_to_the_last() -> None:
    """By a node that was not there when they were published."""
    async with running_broker() as broker, local_buses() as both:
        both.session.append("ocelot", [event(LONG) for _ in range(wire.PORTION + 50)])
        async with (
            offering(both.session, broker.address, "run-1", both.clock),
            node(broker.address, both.clock) as page,
        ):
            await until(lambda: page.knows("ocelot"))
            found = await page.events_after("ocelot", 0, 200)
            assert numbers(found) == [*range(1, wire.PORTION + 51)]
            newest = await page.find_events("ocelot", limit=80)
            assert numbers(newest) == [*range(wire.PORTION + 50, wire.PORTION - 30, -1)]


async def test_a_command_that_is_too_large_is_not_sent_and_the_node_stays_connected() -> None:
    async with through_broker() as (_, both):
        with pytest.raises(NotServed, match="the request is too large for the broker") as why:
            await both.page.request("ocelot", {"what": "x" * (wire.LARGEST + 1)})
        assert why.value.outcome == "not_delivered"
        assert await both.page.request("margay", {"what": 1}) == {"ok": True, "got": 1}
        assert [one["what"] for one in both.commands] == [1]


async def test_an_answer_that_is_too_large_is_named_at_once_and_its_command_may_have_been_carried_out() -> None:
    async with running_broker() as broker, local_buses() as both:

        async def answer(command: object) -> dict[str, object]:
            both.commands.append(command)
            return {"ok": True, "more": LARGE}

        both.session.serve("serval", answer)
        async with (
            offering(both.session, broker.address, "run-1", both.clock),
            node(broker.address, both.clock) as page,
        ):
            await until(lambda: page.knows("serval"))
            with pytest.raises(NotServed, match=r"the answer of serval is too large for the broker \(1100 kB\)") as why:
                await page.request("serval", {"what": 1}, deadline_s=60.0)
            assert (why.value.outcome, len(both.commands)) == ("unknown", 1)


async def test_a_frame_that_is_too_large_is_left_out_and_the_next_one_comes(caplog: pytest.LogCaptureFixture) -> None:
    async with through_broker() as (_, both):
        both.page.watch("ocelot", lambda _: None)
        both.session.put("ocelot", "state", orjson.dumps({"x": LARGE}).decode())
        await until(lambda: "too_large_for_the_broker what=state frame vehicle=ocelot bytes=11" in caplog.text)
        reason = "The state frame of ocelot has 1100 kB, and the broker takes 900 kB: it is not sent to web nodes."
        await until(lambda: both.page.trouble("ocelot") == reason)
        both.session.put("ocelot", "state", "small")
        assert (await until(lambda: both.page.newest("ocelot", "state"))).payload == "small"
        assert both.page.trouble("ocelot") is None


async def test_a_broker_that_takes_less_gets_less_and_no_connection_ends(tmp_path: Path) -> None:
    async with taking(tmp_path, SMALL) as broker, local_buses() as both:
        both.session.append("ocelot", [event(LONG) for _ in range(30)])
        async with (
            offering(both.session, broker.address, "run-1", both.clock) as agent,
            node(broker.address, both.clock) as page,
        ):
            await until(lambda: page.knows("ocelot"))
            assert agent.unsent is None
            page.watch("ocelot", lambda _: None)
            both.session.put("ocelot", "state", "x" * SMALL)
            reason = "The state frame of ocelot has 200 kB, and the broker takes 199 kB: it is not sent to web nodes."
            await until(lambda: page.trouble("ocelot") == reason)
            assert agent.unsent == reason
            both.session.put("ocelot", "state", "small")
            await until(lambda: page.newest("ocelot", "state"))
            assert page.trouble("ocelot") is None

            found = await page.events_after("ocelot", 0, 100)
            assert numbers(found) == [*range(1, 31)]
            both.session.append("ocelot", [event("z" * SMALL), event("the last one")])
            await until(lambda: page.last_event("ocelot") == 32)
            cut, last = page.recent_events("ocelot", 30) or ({}, {})
            assert ("text" in cut, last["text"]) == (False, "the last one")

            with log_context.tracing("a-trace-of-eighty-letters".ljust(80, "x")):
                assert len((await page.request("ocelot", {"what": "x" * (SMALL - 600)}))["got"]) == SMALL - 600
                for size in (SMALL - 300, SMALL - 1, SMALL, SMALL + 1):
                    with pytest.raises(NotServed, match="the request is too large for the broker") as why:
                        await page.request("ocelot", {"what": "x" * size})
                    assert why.value.outcome == "not_delivered"
            assert page._questions.client is not None
            assert page._questions.client.stats["reconnects"] == 0
            both.clock.ahead_s += 100
            assert agent.unsent is None, "it was long ago"


async def test_a_broker_that_takes_too_little_is_not_used_and_named(tmp_path: Path) -> None:
    async with taking(tmp_path, wire.SMALLEST - 1) as broker:
        bus = NatsBus(now=time.monotonic)
        link = BrokerLink(Address(address=broker.address), bus, name="test")
        link.start()
        try:
            await until(lambda: "max_payload" in (link.complaint or ""))
            assert link.complaint == (
                f"The broker {broker.address} is not connected: "
                "it takes messages of 139 kB at most, and 140 kB are needed (max_payload)."
            )
        finally:
            await link.stop()


def test_what_parts_send_at_most_fits_the_smallest_broker() -> None:
    assert http.LONGEST_MESSAGE <= wire.largest(wire.SMALLEST)
