"""Neighbouring versions of agents and nodes: a summary without newer fields is taken, and one with unknown ones too."""

from __future__ import annotations

from typing import Any

import orjson
import pytest

from server.bus.bus import ALL, SUMMARY
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.bus.nats_wire import Malformed
from server.web import page_writer
from server.web.cars_board import CarsBoard
from server.web.remote_frames import RemoteFrames
from tests.frames import check_frame
from tests.page.canned import alarm, live, slow

NOW_MS = 1_800_000_000_000
READ = RemoteFrames(lambda: NOW_MS)

# As an agent of before the attention queue stated it; it never changes.
OLDER = (
    '{"phase":"monitoring","paused":false,"link":{"cut":null,"bridge_age_s":0.02,"car_age_s":0.01,"trying_for_s":0.0,'
    '"connected_for_s":61.4},"worst":{"id":"speed_limit","occurrence":3,"title":"Speed limit exceeded","priority":'
    '"critical","state":"UNACKED","active":true,"raised_ms":1799999990000,"sound":"high"},"waiting":2,"speed":'
    '{"value_mps":12.6,"freshness":"fresh","age_s":0.031,"horizon_s":1.0},"holder":"Ann","page":"page-ann","recording":'
    '"recording","recording_for_s":60.2,"slow_down":"armed"}'
)
NEWER: dict[str, Any] = {
    **orjson.loads(OLDER),
    "time_ms": NOW_MS - 5_000_000,  # the clock of the car is slow
    "attention": {
        "since_ms": NOW_MS - 5_010_000,
        "assigned": {"name": "Ann", "page": "page-ann", "since_ms": NOW_MS - 5_009_000},
        "offered": {"by": "Ann", "name": "Ben", "page": "page-ben", "since_ms": NOW_MS - 5_008_000},
        "escalates_ms": NOW_MS - 4_980_000,
        "escalated_ms": None,
    },
    "place": {"lat_deg": 36.1, "lon_deg": -115.2, "heading_rad": None, "freshness": "fresh", "age_s": 0.1},
    "energy_percent": 71.0,
    "people": [{"page": "page-ann", "name": "Ann"}],
}


def listed(summary: str) -> dict[str, Any]:
    """The frame that a page gets of it is one of the protocol."""
    bus = LocalBus(Journal(None), now=lambda: 0.0)
    bus.put(ALL, "ocelot", summary)
    board = CarsBoard(bus, now=lambda: 0.0, wall_ms=lambda: NOW_MS)
    frame = {"kind": "cars", "time_ms": NOW_MS, "cars": [board._car("ocelot")]}
    text = orjson.dumps(frame).decode()
    check_frame(text)
    found: dict[str, Any] = orjson.loads(text)["cars"][0]["summary"]
    return found


def test_an_older_agent_is_understood() -> None:
    taken = str(READ("ocelot", SUMMARY, OLDER, 0.0))
    assert taken == OLDER
    assert "attention" not in listed(taken)


@pytest.mark.parametrize(("was", "now"), [("safe", "not_armed"), ("not_armed", "not_armed"), ("armed", "armed")])
def test_a_phase_of_an_older_agent_has_its_present_name(was: str, now: str) -> None:
    summary = orjson.dumps({**orjson.loads(OLDER), "slow_down": was})
    assert listed(str(READ("ocelot", SUMMARY, summary, 0.0)))["slow_down"] == now
    state = live() | {"vehicle": "ocelot", "decelerate": slow(was)}
    assert orjson.loads(READ("ocelot", "state", orjson.dumps(state), 0.0))["decelerate"]["state"] == now


def lacking(*path: Any) -> dict[str, Any]:
    """A state without one of its fields."""
    state = live() | {"vehicle": "ocelot", "suppressed": []}
    state["alarms"] = [alarm("speed_limit", "Speed above limit")]
    inside: Any = state
    for name in path[:-1]:
        inside = inside[name]
    del inside[path[-1]]
    return state


@pytest.mark.parametrize(
    "path", [("questions",), ("signals", "brake"), ("signals", "speed", "frame"), ("link", "since_ms")]
)
def test_a_state_of_an_older_agent_may_lack_newer_fields(path: tuple[str, ...]) -> None:
    taken = orjson.loads(READ("ocelot", "state", orjson.dumps(lacking(*path)), 0.0))
    assert taken["session"]["phase"] == "monitoring"


@pytest.mark.parametrize("path", [("alarms",), ("session",), ("alarms", 0, "title")])
def test_a_state_without_what_a_page_needs_is_refused(path: tuple[Any, ...]) -> None:
    with pytest.raises(Malformed, match=f"a wrong {path[0]}"):
        READ("ocelot", "state", orjson.dumps(lacking(*path)), 0.0)


def test_a_newer_agent_is_understood() -> None:
    unknown = {
        **NEWER,
        "worst": {**NEWER["worst"], "text": "12.6 m/s, limit 11.0 m/s", "more": 1},
        "attention": {**NEWER["attention"], "more": {"x": [1]}},
        "more": [{"deep": {}}],
    }
    taken = str(READ("ocelot", SUMMARY, orjson.dumps(unknown), 0.0))
    assert "more" not in taken
    assert listed(taken)["people"] == NEWER["people"]


def test_its_times_are_put_to_the_clock_of_the_node() -> None:
    found = orjson.loads(READ("ocelot", SUMMARY, orjson.dumps(NEWER), 0.25))
    by_ms = 5_000_000 - 250
    assert found["time_ms"] == NOW_MS - 250
    assert found["worst"]["raised_ms"] == NEWER["worst"]["raised_ms"] + by_ms
    item, before = found["attention"], NEWER["attention"]
    assert item["since_ms"] == before["since_ms"] + by_ms
    assert item["escalates_ms"] == before["escalates_ms"] + by_ms == NOW_MS - 250 + 20_000
    assert item["escalated_ms"] is None
    for one in ("assigned", "offered"):
        assert item[one]["since_ms"] == before[one]["since_ms"] + by_ms


@pytest.mark.parametrize(
    "broken",
    [
        {"attention": {"since_ms": 1}},
        {"attention": []},
        {"attention": {**NEWER["attention"], "since_ms": 1e300}},
        {"attention": {**NEWER["attention"], "assigned": {"name": 3}}},
        {"time_ms": 1e300},
        {"time_ms": "soon"},
        {"place": {"lat_deg": 1.0}},
        {"place": {**NEWER["place"], "freshness": "perhaps"}},
        {"energy_percent": "full"},
        {"people": [{"page": 1, "name": None}]},
        {"people": "everybody"},
        {"people": [{"page": "page", "name": "x" * 40}] * 100},
        {"waiting": 1e300},
        {"attention": {**NEWER["attention"], "since_ms": 2**64 - 1}},
    ],
)
def test_what_is_no_summary_is_refused(broken: dict[str, Any]) -> None:
    with pytest.raises(Malformed):
        READ("ocelot", SUMMARY, orjson.dumps(NEWER | broken), 0.0)


@pytest.mark.parametrize(("phase", "expected"), [("not_armed", "safe"), ("holding", "holding"), (None, None), ([], [])])
def test_an_older_page_gets_the_former_name_of_a_phase(phase: object, expected: object) -> None:
    """With a phase that it does not know it refuses to be loaded anew."""
    frame = {"kind": "state", "decelerate": {"state": phase, "why": None}}
    sent = orjson.loads(page_writer.former_state(orjson.dumps(frame).decode()))
    assert sent == {"kind": "state", "decelerate": {"state": expected, "why": None}}
