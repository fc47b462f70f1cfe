"""What a web node takes of an agent: what is of this car, at the node's own time; nothing else reaches a page."""

from __future__ import annotations

import asyncio
from typing import Any

import orjson
import pytest

from server.bus.bus import ALL, SUMMARY
from server.bus.nats_wire import Malformed
from server.web.remote_frames import LONGEST_SUMMARY, RemoteFrames
from tests.server.bus.broker import running_broker
from tests.server.bus.buses import local_buses, node, offering, until

NOW_MS = 1_800_000_000_000
READ = RemoteFrames(lambda: NOW_MS)
CAR: dict[str, Any] = {
    "phase": "monitoring",
    "paused": False,
    "link": {"cut": None, "bridge_age_s": 0.1, "car_age_s": 0.1, "trying_for_s": 0.0, "connected_for_s": 4.0},
    "worst": None,
    "waiting": 0,
    "speed": {"value_mps": 4.0, "freshness": "fresh", "age_s": 0.1, "horizon_s": 1.0},
    "holder": None,
    "page": None,
    "recording": "recording",
    "recording_for_s": 3.0,
    "slow_down": "not_armed",
}


def state(**more: Any) -> str:
    return orjson.dumps({"kind": "state", "vehicle": "ocelot", "server": {"time_ms": 5, "boot": "b"}, **more}).decode()


def test_a_state_gets_the_time_at_which_it_was_put_by_the_clock_of_the_node() -> None:
    found = orjson.loads(READ("ocelot", "state", state(more=1), 0.25))
    assert found["server"] == {"time_ms": NOW_MS - 250, "boot": "b"}
    assert found["more"] == 1


@pytest.mark.parametrize(
    "payload",
    [
        '{"kind": "state", "vehicle": "ocelot", "server": {"time_ms": 5}, "deep": ' + "[" * 500 + "]" * 500 + "}",
        "",
        "x",
        "[]",
        "3",
        b"\xff\xfe",
        state(vehicle="margay"),
        state(kind="hello"),
        state(server=3),
        '{"kind": "state"}',
    ],
)
def test_what_is_no_state_of_this_car_is_refused(payload: str | bytes) -> None:
    with pytest.raises(Malformed):
        READ("ocelot", "state", payload, 0.0)


def test_a_summary_is_read_whole() -> None:
    text = orjson.dumps(CAR).decode()
    assert READ("ocelot", SUMMARY, text, 0.0) == text
    assert READ("ocelot", SUMMARY, orjson.dumps(CAR | {"more": "x" * 100}), 0.0) == text, (
        "what is not declared is left out"
    )
    with pytest.raises(Malformed):
        READ("ocelot", SUMMARY, orjson.dumps(CAR | {"holder": "x" * LONGEST_SUMMARY}), 0.0)
    for broken in ("", "[]", "{}", orjson.dumps(CAR | {"speed": None}), orjson.dumps(CAR | {"waiting": "many"})):
        with pytest.raises(Malformed):
            READ("ocelot", SUMMARY, broken, 0.0)


def test_a_scan_is_bytes() -> None:
    assert READ("ocelot", "scan", b"\x01\x02", 0.0) == b"\x01\x02"
    with pytest.raises(Malformed):
        READ("ocelot", "scan", "text", 0.0)


async def test_an_agent_that_sends_anything_harms_no_other_car(caplog: pytest.LogCaptureFixture) -> None:
    async with running_broker() as broker, local_buses() as both:
        async with node(broker.address, both.clock, read=READ) as page:
            async with offering(both.session, broker.address, "run-1", both.clock):
                await until(lambda: len(page.vehicles) == 2)
                for vehicle in ("ocelot", "margay", ALL):
                    page.watch(vehicle, lambda _: None)
                await until(lambda: both.session.watched("ocelot") and both.session.watched(ALL))
                for junk in ("", "[]", state(vehicle="ocelot")):  # of margay, as its agent may send it
                    both.session.put("margay", "state", junk)
                    both.session.put(ALL, "margay", junk)
                    await until(lambda: "message not read: subject=veh.margay.pull.state" in caplog.text)
                    await asyncio.sleep(0.1)
                both.session.put("ocelot", "state", state())
                both.session.put(ALL, "ocelot", orjson.dumps(CAR).decode())
                await until(lambda: page.newest("ocelot", "state") and page.newest(ALL, "ocelot"))
                assert page.newest("margay", "state") is None
                assert page.newest(ALL, "margay") is None
