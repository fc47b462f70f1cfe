"""After a restart: the alarms have the states that the log of transitions recorded."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.alarm import Alarm, AlarmState, Refused, Transition
from monitor.alarm_life import advance, end
from monitor.alarm_spec import AlarmSpec
from monitor.check import OK, Finding, Quantity, fault, unknown
from monitor.response import acknowledge, shelve
from monitor.restoring import MOST, numbered_on, restore
from monitor.runner import NOT_HERE, Monitor
from tests.monitor.test_alarm import SPEC
from tests.monitor.test_alarm_properties import DAY, SPECS, Judge, Tap, happen
from tests.monitor.test_runner import BAD, Script, at, check

PATIENT = replace(SPEC, on_delay_s=0.0, off_delay_s=1.0, needs_ack=True)
LIMIT = Quantity(label="Limit", value=11.0, unit="m/s")
TRIP = fault("12.6 m/s", causes=("a",))._replace(measured=Quantity(label="Speed", value=12.6, unit="m/s"), limit=LIMIT)


def lived(*findings: Finding, spec: AlarmSpec = PATIENT, each_s: float = 1.0) -> tuple[Alarm, list[Transition]]:
    """An alarm that saw these findings, one a second, and what was reported of it."""
    alarm, transitions = Alarm(id="hot", spec=spec), []
    for number, finding in enumerate(findings):
        alarm, happened = advance(alarm, finding, number * each_s)
        transitions += happened
    return alarm, transitions


def restored(transitions: list[Transition], spec: AlarmSpec = PATIENT) -> Alarm:
    return restore({"hot": Alarm(id="hot", spec=spec)}, transitions)["hot"]


def same(one: Alarm, other: Alarm) -> bool:
    """In everything that is reported to the operator."""
    return (
        (one.active, one.acknowledged, one.occurrence) == (other.active, other.acknowledged, other.occurrence)
        and one.shelved_until_s == other.shelved_until_s
        and (one.shelved_by if one.shelved_until_s else None) == (other.shelved_by if other.shelved_until_s else None)
        and (not one.is_standing or (one.suppressed_by, one.state) == (other.suppressed_by, other.state))
        and (not (one.acknowledged and one.active) or one.acknowledged_by == other.acknowledged_by)
        and (not one.is_standing or one.announced_s == other.announced_s)
    )


@given(SPECS, DAY, st.booleans())
def test_the_transitions_alone_say_where_an_alarm_stands(
    spec: AlarmSpec, day: list[tuple[float, Judge | Tap]], ends: bool
) -> None:
    alarm, now_s = Alarm(id="hot", spec=spec), 0.0
    transitions: list[Transition] = []
    for wait_s, event in day:
        now_s += wait_s
        try:
            alarm, happened = happen(alarm, event, now_s)
        except Refused:
            continue
        transitions += happened
        assert same(restored(transitions, spec), alarm)
    if ends:
        alarm, happened = end(alarm, now_s, "Monitoring ended")
        assert same(restored([*transitions, *happened], spec), alarm)
        assert not restored([*transitions, *happened], spec).is_standing


@given(SPECS, DAY, DAY)
def test_a_restart_in_the_middle_loses_nothing_and_repeats_no_number(
    spec: AlarmSpec, before: list[tuple[float, Judge | Tap]], after: list[tuple[float, Judge | Tap]]
) -> None:
    alarm, now_s = Alarm(id="hot", spec=spec), 0.0
    transitions: list[Transition] = []

    def live(alarm: Alarm, day: list[tuple[float, Judge | Tap]]) -> Alarm:
        nonlocal now_s
        for wait_s, event in day:
            now_s += wait_s
            try:
                alarm, happened = happen(alarm, event, now_s)
            except Refused:
                continue
            transitions.extend(happened)
        return alarm

    alarm = live(alarm, before)
    numbers = alarm.occurrence
    alarm = live(restored(transitions, spec), after)
    assert same(restored(transitions, spec), alarm)
    raises = [t.occurrence for t in transitions if t.change in ("raised", "recaused")]
    assert raises == sorted(set(raises)), "an occurrence was given twice"
    assert alarm.occurrence >= numbers
    standing = False
    for transition in transitions:  # raised and cleared take turns over the restart as without it
        if transition.change == "raised":
            assert not standing
            standing = True
        if transition.change == "cleared":
            assert standing
            standing = False


@given(SPECS, DAY, st.lists(st.just(unknown("no link")), min_size=1, max_size=20))
def test_unknown_after_a_restart_clears_nothing(
    spec: AlarmSpec, day: list[tuple[float, Judge | Tap]], blind: list[Finding]
) -> None:
    _, transitions = Alarm(id="hot", spec=spec), []
    alarm, now_s = Alarm(id="hot", spec=spec), 0.0
    for wait_s, event in day:
        now_s += wait_s
        try:
            alarm, happened = happen(alarm, event, now_s)
        except Refused:
            continue
        transitions += happened
    was = alarm = restored(transitions, spec)
    for _ in blind:
        now_s += 10.0
        alarm, happened = advance(alarm, unknown("no link"), now_s)
        assert not {t.change for t in happened} & {"raised", "cleared", "recaused", "acknowledged"}
    assert alarm.active == was.active
    assert alarm.acknowledged <= was.acknowledged  # the end of shelving may ask anew; nothing answers by itself


def test_an_unacknowledged_return_stays_until_somebody_acknowledges_it() -> None:
    live, transitions = lived(BAD, OK, OK, OK)
    assert live.state is AlarmState.RTN_UNACKED
    alarm = restored(transitions)
    assert alarm.state is AlarmState.RTN_UNACKED
    alarm, happened = acknowledge(alarm, alarm.occurrence, "Ann", 9.0)
    assert alarm.state is AlarmState.NORMAL
    assert restored([*transitions, *happened]).state is AlarmState.NORMAL


def test_an_acknowledged_alarm_whose_cause_is_still_there_is_not_announced_again() -> None:
    live, transitions = lived(TRIP, TRIP)
    live, happened = acknowledge(live, live.occurrence, "Ann", 2.0)
    alarm = restored([*transitions, *happened])
    assert (alarm.state, alarm.acknowledged_by) == (AlarmState.ACKED, "Ann")
    assert advance(alarm, TRIP, 60.0)[1] == ()
    worse = TRIP._replace(causes=("a", "b"))
    assert [t.change for t in advance(alarm, worse, 60.0)[1]] == ["recaused"]


def test_the_trip_comes_back_with_its_values() -> None:
    _, transitions = lived(TRIP, TRIP)
    alarm = restored(transitions)
    assert alarm.trip == TRIP
    assert alarm.finding is None  # what the check finds now is not known
    assert not alarm.condition


def test_a_late_acknowledgement_of_an_older_occurrence_is_refused_after_a_restart_too() -> None:
    live, transitions = lived(BAD, OK, OK, OK, BAD)
    assert live.occurrence == 2
    with pytest.raises(Refused):
        acknowledge(restored(transitions), 1, "Ann", 9.0)


def test_shelving_goes_on_for_its_remaining_time_and_its_end_announces() -> None:
    live, transitions = lived(BAD, BAD)
    live, happened = shelve(live, live.occurrence, 5.0, "Ann", 2.0, is_inhibitor=False)
    alarm = restored([*transitions, *happened])
    assert (alarm.state, alarm.shelved_by, alarm.shelved_until_s) == (AlarmState.SHELVED, "Ann", 302.0)
    alarm, happened_early = advance(alarm, BAD, 301.0)
    assert happened_early == ()
    _, happened = advance(alarm, BAD, 302.0)
    assert [(t.change, t.announces, t.occurrence) for t in happened] == [("unshelved", True, 2)]


def test_a_shelf_that_ran_out_during_the_outage_announces_at_the_first_look() -> None:
    live, transitions = lived(BAD, BAD)
    _, happened = shelve(live, live.occurrence, 1.0, "Ann", 2.0, is_inhibitor=False)
    _, happened = advance(restored([*transitions, *happened]), unknown("no link"), 500.0)
    assert [(t.change, t.announces) for t in happened] == [("unshelved", True)]


def test_the_end_of_monitoring_takes_an_alarm_off_the_shelf_in_the_log_too() -> None:
    """Shelved, cleared and acknowledged: it stands no more, but the log must not leave it on the shelf."""
    spec = replace(PATIENT, needs_ack=False)
    live, transitions = lived(BAD, BAD, spec=spec)
    live, happened = shelve(live, live.occurrence, 10.0, "Ann", 2.0, is_inhibitor=False)
    transitions += happened
    for now_s in (3.0, 4.0, 5.0):
        live, happened = advance(live, OK, now_s)
        transitions += happened
    assert (live.state, live.is_standing) == (AlarmState.SHELVED, False)
    assert same(restored(transitions, spec), live)
    _, happened = end(live, 6.0, "Monitoring ended")
    assert [t.change for t in happened] == ["unshelved"]
    assert restored([*transitions, *happened], spec).state is AlarmState.NORMAL


def test_numbering_on_brings_back_nothing_but_the_numbers() -> None:
    _, transitions = lived(BAD, OK, OK, OK, BAD)
    alarm = numbered_on({"hot": Alarm(id="hot", spec=PATIENT)}, transitions)["hot"]
    assert (alarm.occurrence, alarm.state) == (2, AlarmState.NORMAL)


def test_the_monitor_goes_on_from_its_past() -> None:
    first = Monitor([check("a", Script(BAD)), check("b", Script())])
    transitions = [*first.step(at(1.0)), *first.acknowledge("a", 1, "Ann", 1.5)]
    second = Monitor([check("a", script := Script(unknown("no link"))), check("b", Script())])
    second.restore([replace(t, at_s=t.at_s - 100.0) for t in transitions])
    assert [(a.id, a.state, a.acknowledged_by) for a in second.standing()] == [("a", AlarmState.ACKED, "Ann")]
    assert second.step(at(0.0)) == ()  # blind: it stands
    assert second.alarms["a"].active
    script.finding = OK
    assert [t.change for t in second.step(at(1.0))] == ["cleared"]


def test_an_inhibitor_that_stood_explains_nothing_until_it_is_seen_again() -> None:
    """Its condition is not known: it must not hide what is judged now."""
    inhibited = replace(SPEC, on_delay_s=0.0, off_delay_s=0.0, inhibited_by=("cause",))
    checks = [check("cause", Script(BAD)), check("effect", Script(BAD), alarm=inhibited)]
    first = Monitor(checks)
    transitions = first.step(at(0.0))
    assert [t.alarm_id for t in transitions] == ["cause"]
    second = Monitor([check("cause", Script(unknown("no link"))), check("effect", Script(BAD), alarm=inhibited)])
    second.restore(transitions)
    assert [t.alarm_id for t in second.step(at(1.0))] == ["effect"]
    assert second.alarms["cause"].active


def test_an_alarm_of_another_version_stands_until_it_is_acknowledged() -> None:
    """Its check does not exist here: nothing else can end it, and it never looks checked."""
    _, transitions = lived(TRIP)
    monitor = Monitor([check("cold", Script())])
    monitor.restore(transitions)
    monitor.step(at(1.0))
    [alarm] = monitor.standing()
    assert (alarm.id, alarm.state, alarm.trip) == ("hot", AlarmState.UNACKED, TRIP)
    assert alarm.finding == NOT_HERE
    monitor.acknowledge("hot", alarm.occurrence, "Ann", 2.0)
    assert monitor.standing() == []


def test_a_shelved_alarm_of_another_version_comes_back() -> None:
    alarm, transitions = lived(TRIP)
    _, shelved = shelve(alarm, alarm.occurrence, 5.0, "Ann", 1.0, is_inhibitor=False)
    monitor = Monitor([check("cold", Script())])
    monitor.restore([*transitions, *shelved])
    monitor.step(at(200.0))
    assert monitor.alarms["hot"].state is AlarmState.SHELVED
    found = monitor.step(at(400.0))
    assert [(one.change, one.announces) for one in found] == [("unshelved", True)]
    assert [one.change for one in monitor.end(401.0)] == ["cleared"]


def test_a_log_of_any_size_restores_a_bounded_number() -> None:
    [raised] = lived(TRIP)[1]
    assert len(restore({}, (replace(raised, alarm_id=f"a{n}") for n in range(2 * MOST)))) == MOST
