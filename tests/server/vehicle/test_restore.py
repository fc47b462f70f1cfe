"""What a start reads in the log of the runs before: whole, odd, hostile, and with a clock that was set."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import orjson
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.alarm import Alarm, Refused, Transition
from monitor.alarm_spec import AlarmSpec
from monitor.check import Quantity, fault
from monitor.restoring import restore
from server.bus.journal import Journal
from server.bus.local import LocalBus
from server.protocol import serialize
from server.vehicle.restore import RestoredState, phone_chosen, recall
from tests.monitor.test_alarm import SPEC
from tests.monitor.test_alarm_properties import DAY, SPECS, Judge, Tap, happen
from tests.monitor.test_restoring import lived, same

WALL_MS = 1_790_000_000_000
LATCH = replace(SPEC, on_delay_s=0.0)


def bus() -> LocalBus:
    return LocalBus(Journal(None), now=lambda: 0.0)


def keep(one: LocalBus, transitions: list[Transition], *, clock_s: float = 0.0) -> None:
    """As a session writes them, whose clock read `clock_s` at WALL_MS."""
    for transition in transitions:
        at_ms = WALL_MS + round((transition.at_s - clock_s) * 1000)
        event = serialize.event(transition, at_ms, now_s=transition.at_s, settings_version=3)
        one.append("car", [orjson.loads(orjson.dumps(event))])


def note(one: LocalBus, change: str, at_ms: int = WALL_MS, **more: Any) -> None:
    one.append("car", [{"at_ms": at_ms, "alarm": None, "change": change, "text": "", "by": None, **more}])


def read(one: LocalBus, *, now_s: float = 0.0, after_s: float = 0.0) -> RestoredState:
    return recall(one, "car", now_s=now_s, wall_ms=WALL_MS + round(after_s * 1000))


@given(SPECS, DAY, st.sampled_from([0.0, 5.0, 1e6]))
def test_a_life_written_and_read_again_is_the_same(
    spec: AlarmSpec, day: list[tuple[float, Judge | Tap]], boot_s: float
) -> None:
    """Through JSON and a new monotonic clock that starts at `boot_s`, at the same time of day."""
    alarm, now_s, transitions = Alarm(id="hot", spec=spec), 0.0, []
    for wait_s, event in day:
        now_s += wait_s
        try:
            alarm, happened = happen(alarm, event, now_s)
        except Refused:
            continue
        transitions += list(happened)
    one = bus()
    keep(one, transitions)
    past = read(one, now_s=boot_s, after_s=now_s)
    again = restore({"hot": Alarm(id="hot", spec=spec)}, past.transitions)["hot"]
    shift_s = boot_s - now_s

    def moved(at_s: float | None) -> float | None:
        return None if at_s is None else round(at_s + shift_s, 2)

    assert same(
        replace(
            again, announced_s=moved(None), shelved_until_s=again.shelved_until_s and round(again.shelved_until_s, 2)
        ),
        replace(alarm, announced_s=moved(None), shelved_until_s=moved(alarm.shelved_until_s)),
    )
    if alarm.is_standing:
        assert again.announced_s == pytest.approx(moved(alarm.announced_s), abs=0.02)
        assert (again.trip is None) == (alarm.trip is None)


def test_the_values_at_the_trip_come_through_the_log() -> None:
    trip = fault("12.6 m/s", causes=("x",), level=2)._replace(
        measured=Quantity(label="Speed", value=12.6, unit="m/s"),
        limit=Quantity(label="Limit", value=11.0, unit="m/s"),
    )
    _, transitions = lived(trip, spec=LATCH)
    one = bus()
    keep(one, transitions)
    found = read(one).transitions[0].finding
    assert found is not None
    assert (found.measured, found.limit, found.causes, found.level) == (trip.measured, trip.limit, ("x",), 2)


@pytest.mark.parametrize(
    ("notes", "address", "paused"),
    [
        ([], None, False),
        ([("started", {"address": "ws://a"})], "ws://a", False),
        ([("started", {"address": "ws://a"}), ("stopped", {})], None, False),
        ([("started", {"address": "ws://a"}), ("paused", {})], "ws://a", True),
        ([("started", {"address": "ws://a"}), ("paused", {}), ("resumed", {})], "ws://a", False),
        ([("started", {"address": "ws://a"}), ("resumed", {}), ("paused", {}), ("lost", {})], "ws://a", True),
        ([("started", {"address": "ws://a"}), ("paused", {}), ("started", {"address": "ws://b"})], "ws://b", False),
        ([("paused", {}), ("stopped", {}), ("settings", {})], None, False),
        ([("started", {"address": 7})], None, False),
        ([("connected", {}), ("lost", {})], None, False),
    ],
)
def test_which_car_was_monitored_and_was_it_paused(
    notes: list[tuple[str, dict[str, Any]]], address: str | None, paused: bool
) -> None:
    one = bus()
    for change, more in notes:
        note(one, change, **more)
    past = read(one, now_s=50.0, after_s=20.0)
    assert (past.address, past.paused_s is not None) == (address, paused)
    if paused:
        assert past.paused_s == pytest.approx(30.0)


@pytest.mark.parametrize(
    ("changes", "reason"),
    [
        (["planned_stop"], "workshop"),
        (["planned_stop", "paused", "resumed"], "workshop"),
        (["planned_stop", "planned_stop_ended"], None),
        (["planned_stop", "planned_stop_ended", "planned_stop", "lost"], "workshop"),
        (["planned_stop", "stopped"], None),
        (["planned_stop", "started"], None),
        ([], None),
    ],
)
def test_which_planned_stop_was_in_force(changes: list[str], reason: str | None) -> None:
    one = bus()
    for change in ["started", *changes]:
        note(one, change, address="ws://a", reason="workshop", since_ms=WALL_MS - 60_000)
    past = read(one, now_s=50.0)
    assert (past.planned_stop and past.planned_stop.reason) == reason
    assert ("A planned stop was in force: in the workshop." in past.text()) is (reason is not None)
    if past.planned_stop is not None:
        assert past.planned_stop.since_s == pytest.approx(-10.0)


def test_which_phone_is_in_the_car_is_not_read_from_a_recording() -> None:
    one = bus()
    note(one, "ride", phone="a")
    assert phone_chosen(one, "car") == "a"
    note(one, "ride", phone="b", brought_from="car_20261128T080000Z")
    assert phone_chosen(one, "car") is None


def test_a_pause_that_outlasted_a_restart_is_counted_from_its_beginning() -> None:
    one = bus()
    note(one, "started", address="ws://a")
    note(one, "paused", since_ms=WALL_MS - 60_000)
    assert read(one, now_s=0.0).paused_s == pytest.approx(-60.0)


@pytest.mark.parametrize(
    ("outage_s", "left_s"),
    [
        (0.0, 300.0),
        (100.0, 200.0),
        (1000.0, -700.0),  # it ran out meanwhile
        (-86400.0, 900.0),  # the time of day was set back by a day: nobody may shelve for longer than 15 min
    ],
)
def test_a_shelf_goes_on_by_the_time_of_day(outage_s: float, left_s: float) -> None:
    transitions = [
        Transition(
            alarm_id="hot", spec=LATCH, occurrence=1, change="shelved", at_s=0.0, text="", by="Ann",
            shelved_until_s=300.0, state=lived(fault("bad"), spec=LATCH)[0].state,
        )
    ]  # fmt: skip
    one = bus()
    keep(one, transitions)
    assert read(one, now_s=7.0, after_s=outage_s).transitions[0].shelved_until_s == pytest.approx(7.0 + left_s)


def test_nothing_of_the_past_lies_in_the_future() -> None:
    _, transitions = lived(fault("bad"), spec=LATCH)
    one = bus()
    keep(one, transitions)
    assert read(one, now_s=7.0, after_s=-3600.0).transitions[0].at_s == 7.0


@pytest.mark.parametrize("event", [{"change": 7}, {"change": None}])
def test_what_has_no_change_is_passed_over(event: dict[str, Any]) -> None:
    one = bus()
    one.append("car", [{"at_ms": WALL_MS, "alarm": "hot", **event}])
    past = read(one)
    assert past.transitions == ()
    assert past.standing == {}


@pytest.mark.parametrize(
    "odd",
    [
        {"occurrence": "many"}, {"occurrence": None}, {"causes": "abc"}, {"causes": [1, "a"]}, {"measured": 7},
        {"measured": {"label": "x", "value": None, "unit": "m"}}, {"limit": []}, {"shelved_until_ms": "soon"},
        {"suppressed_by": {"a": 1}}, {"by": 3}, {"text": None}, {"announces": "yes"}, {"settings_version": "new"},
    ],
    ids=str,
)  # fmt: skip
def test_odd_parts_of_an_event_harm_nothing(odd: dict[str, Any]) -> None:
    one = bus()
    event = {"at_ms": WALL_MS, "alarm": "hot", "change": "raised", "state": "UNACKED", "occurrence": 4, "text": "bad"}
    one.append("car", [event | odd])
    past = read(one)
    alarm = restore({"hot": Alarm(id="hot", spec=LATCH)}, past.transitions)["hot"]
    assert alarm.active
    assert not alarm.acknowledged


def test_a_long_log_is_read_from_its_end() -> None:
    """Ten thousand events: only those since an alarm was last at rest are queried."""
    one = bus()
    rested = {"alarm": "hot", "change": "cleared", "state": "NORMAL", "text": "", "occurrence": 1}
    one.append("car", [{"at_ms": WALL_MS, **rested, "occurrence": n} for n in range(10_000)])
    one.append("car", [{"at_ms": WALL_MS, **rested, "occurrence": 10_000, "change": "raised", "state": "UNACKED"}])
    past = read(one, after_s=3600.0)
    assert [transition.occurrence for transition in past.transitions] == [9999, 10_000]
    assert past.recent == ()
