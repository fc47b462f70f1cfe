"""What a web node takes of an agent: what is of this car, at the node's own time; nothing else reaches a page."""

from __future__ import annotations

import asyncio
from typing import Any

import orjson
import pytest

from server.bus.bus import ALL, SUMMARY
from server.bus.nats_wire import Malformed
from server.web.remote_frames import LONGEST_SUMMARY, RemoteFrames, event
from tests.page.canned import live, slow
from tests.server.bus.broker import running_broker
from tests.server.bus.buses import event as logged
from tests.server.bus.buses import local_buses, node, numbers, offering, until

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


SERVER = live()["server"]
LOGGED: dict[str, Any] = {
    "n": 7, "at_ms": NOW_MS, "alarm": "hot", "change": "raised", "text": "Hot", "by": None, "settings_version": 1,
    "occurrence": 1, "title": "Hot", "priority": "critical", "measured": {"label": "Oil", "value": 3.0, "unit": "K"},
}  # fmt: skip


def state(**more: Any) -> str:
    return orjson.dumps(live() | {"vehicle": "ocelot", **more}).decode()


def test_a_state_gets_the_time_at_which_it_was_put_by_the_clock_of_the_node() -> None:
    sent = state(more=1, replay={"id": "x"}, server={**SERVER, "excess_ms": 9})
    found = orjson.loads(READ("ocelot", "state", sent, 0.25, 0.12))
    assert found["server"] == {**SERVER, "time_ms": NOW_MS - 250, "excess_ms": 120}
    assert found == orjson.loads(state(server=found["server"])), "what is not declared of a live state is left out"


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
        state(alarms=[None]),
        state(alarms={}),
        state(signals={}),
        state(server={**SERVER, "pages": "many"}),
        state(limits={"speed_limit.max_mps": None}),
        state(session=None),
        state(checks=[{"id": 1}]),
        orjson.dumps({name: value for name, value in live().items() if name != "link"} | {"vehicle": "ocelot"}),
        '{"kind": "state"}',
    ],
)
def test_what_is_no_state_of_this_car_is_refused(payload: str | bytes) -> None:
    with pytest.raises(Malformed):
        READ("ocelot", "state", payload, 0.0)


@pytest.mark.parametrize(
    "newer",
    [
        {"decelerate": slow("thinking")},
        {"session": {**live()["session"], "phase": "sleeping"}},
        {"mode": {**live()["mode"], "mode": "teleoperated"}},
    ],
)
def test_a_value_of_a_newer_agent_does_not_hide_its_state(newer: dict[str, Any]) -> None:
    found = orjson.loads(READ("ocelot", "state", state(**newer), 0.0))
    assert {name: found[name] for name in newer} == newer


def test_of_an_event_only_what_is_of_another_type_is_left_out() -> None:
    assert event(dict(LOGGED)) == LOGGED
    assert event(LOGGED | {"priority": "catastrophic", "more": [1]}) == LOGGED | {
        "priority": "catastrophic",
        "more": [1],
    }
    assert event({name: LOGGED[name] for name in ("n", "at_ms", "alarm", "change", "text")})["text"] == "Hot", (
        "an old log"
    )
    assert event(LOGGED | {"measured": 3, "occurrence": "one"}) == {
        name: value for name, value in LOGGED.items() if name not in ("measured", "occurrence")
    }
    assert "measured" not in event(LOGGED | {"measured": {"label": "Oil"}}), "also where a part of it is missing"
    unread = {"at_ms": 0, "alarm": None, "change": "unread", "text": "This event of the agent cannot be read."}
    assert event({"n": 7}) == {"n": 7, **unread}
    assert event(LOGGED | {name: {"x": 1} for name in unread}) == LOGGED | unread
    deep: Any = []
    for _ in range(400):
        deep = [deep]
    assert event({"n": 7, "text": deep}) == {"n": 7, **unread}
    deep = []
    for _ in range(215):  # one reads it, the other does not
        deep = [deep]
    assert event({"n": 7, "at_ms": 5, "text": "x", "why": deep})["n"] == 7


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
                assert page.trouble("margay") == "The agent of margay sends what this server cannot read."
                assert page.link_trouble("margay") is None, "its recordings can be fetched"
                assert page.trouble("ocelot") is None


async def unnumbered(*_: object, **__: object) -> list[dict[str, Any]]:
    return [{"text": "no number"}, logged("one", n=2), logged("no number", n="3")]


async def test_events_of_an_agent_are_read_too() -> None:
    async with running_broker() as broker, local_buses() as both:
        async with node(broker.address, both.clock, read_event=event) as page:
            async with offering(both.session, broker.address, "run-1", both.clock):
                await until(lambda: page.knows("ocelot"))
                both.session.append("ocelot", [logged("good"), logged("odd", title=3, causes={}), logged(text=None)])  # type: ignore[arg-type]
                await until(lambda: page.last_event("ocelot") == 3)
                for found in (page.recent_events("ocelot", 0) or [], await page.find_events("ocelot", limit=3)):
                    assert sorted(numbers(found)) == [1, 2, 3]
                    texts = {one["n"]: one["text"] for one in found}
                    assert texts == {1: "good", 2: "odd", 3: "This event of the agent cannot be read."}
                    assert not any("title" in one or "causes" in one for one in found)
                both.session.find_events = unnumbered  # type: ignore[method-assign]
                assert numbers(await page.find_events("ocelot", limit=3)) == [2]
