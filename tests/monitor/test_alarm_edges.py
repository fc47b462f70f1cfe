"""The life of an alarm exactly at its limits, and each of its fields by itself."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from monitor.alarm import CLOCK_BACK_S, Alarm, Cause, Refused, Transition, rebased, transition
from monitor.alarm_life import advance, end
from monitor.alarm_spec import Action, AlarmSpec
from monitor.check import OK, Finding, Quantity, fault
from monitor.response import acknowledge, shelve, unshelve
from tests.monitor.test_alarm import (
    A_AND_B,
    ACK,
    ACKED,
    BAD,
    HUH,
    LATCHING,
    LINK,
    NO_ACK,
    NORMAL,
    OUT_OF_SERVICE,
    RTN_UNACKED,
    SHELVED,
    SPEC,
    STANDING,
    SUPPRESSED,
    UNACKED,
    WORSE,
    A,
    Act,
    play,
)

REST = Alarm(id="hot", spec=SPEC)
SLOWS = replace(SPEC, actions=(Action.SHELVE, Action.ACKNOWLEDGE, Action.DECELERATE))


@pytest.mark.parametrize(
    ("alarm", "actions"),
    [
        (REST, ()),
        (STANDING, (Action.SHELVE, Action.ACKNOWLEDGE)),
        (replace(STANDING, acknowledged=True), (Action.SHELVE,)),
        (replace(STANDING, active=False), (Action.SHELVE, Action.ACKNOWLEDGE)),
        (replace(STANDING, shelved_until_s=9.0), (Action.UNSHELVE,)),
        (replace(STANDING, spec=SLOWS), (Action.SHELVE, Action.ACKNOWLEDGE, Action.DECELERATE)),
        (replace(STANDING, spec=SLOWS, shelved_until_s=9.0), (Action.DECELERATE, Action.UNSHELVE)),
        (replace(STANDING, spec=replace(SPEC, actions=(Action.ACKNOWLEDGE,))), (Action.ACKNOWLEDGE,)),
    ],
)
def test_what_can_be_done_about_it(alarm: Alarm, actions: tuple[Action, ...]) -> None:
    assert alarm.actions == actions


@pytest.mark.parametrize(
    "field",
    [
        {"condition": True},
        {"active": True},
        {"acknowledged": False},
        {"suppressed_by": (LINK,)},
        {"shelved_until_s": 9.0},
    ],
    ids=str,
)
def test_any_one_of_these_is_no_rest(field: dict[str, Any]) -> None:
    assert REST.is_at_rest
    assert not replace(REST, **field).is_at_rest


def test_an_alarm_at_rest_stays_as_it_is_until_something_explains_it_away() -> None:
    assert advance(REST, OK, 5.0) == (REST, ())
    after, transitions = advance(REST, OK, 5.0, (LINK,))
    assert (after.state, transitions) == (SUPPRESSED, ())


def test_a_clock_that_goes_back_moves_every_time_and_a_late_message_none() -> None:
    times = {"raised_s": 7.0, "announced_s": 8.0, "cleared_s": 9.0, "shelved_until_s": 60.0, "at_s": 10.0}
    alarm = replace(STANDING, announced=(("a", 8.5),), **times)
    assert rebased(alarm, 10.0 - CLOCK_BACK_S) is alarm
    assert rebased(alarm, 9.0) == replace(
        alarm, announced=(("a", 7.5),), **{name: time_s - 1.0 for name, time_s in times.items()}
    )
    assert rebased(replace(REST, at_s=10.0), 9.0) == replace(REST, at_s=9.0)


def test_a_late_message_takes_nothing_from_what_was_counted() -> None:
    play([(10.0, BAD, NORMAL), (10.5, BAD, NORMAL), (10.2, BAD, NORMAL), (10.6, HUH, NORMAL), (20.0, BAD, NORMAL),
          (20.5, BAD, UNACKED)])  # fmt: skip


def test_a_transition_has_all_of_the_alarm() -> None:
    alarm = replace(STANDING, causes=(Cause(name="a"), Cause(name="b", absent_s=1.0)), suppressed_by=(LINK,))
    alarm = replace(alarm, shelved_until_s=60.0)
    assert transition(alarm, "recaused", 7.0) == Transition(
        alarm_id="hot",
        spec=alarm.spec,
        occurrence=1,
        change="recaused",
        at_s=7.0,
        text="",
        by=None,
        announces=False,
        state=SUPPRESSED,
        finding=BAD,
        causes=("a",),
        suppressed_by=(LINK,),
        shelved_until_s=60.0,
        worst=BAD,
    )
    made = transition(alarm, "shelved", 7.0, text="it is bad", by="Ann", announces=True)
    assert (made.text, made.by, made.announces) == ("it is bad", "Ann", True)


def test_a_refusal_carries_its_reason() -> None:
    assert (Refused("no").reason, str(Refused("no"))) == ("no", "no")


@pytest.mark.parametrize(
    ("alarm", "changes"),
    [(STANDING, ["cleared"]), (replace(REST, shelved_until_s=60.0), ["unshelved"]), (REST, [])],
)
def test_the_end_reports_when_and_why(alarm: Alarm, changes: list[str]) -> None:
    after, happened = end(alarm, 5.0, "Monitoring ended")
    assert [(t.change, t.at_s, t.text, t.state) for t in happened] == [
        (change, 5.0, "Monitoring ended", NORMAL) for change in changes
    ]
    assert after == replace(REST, occurrence=alarm.occurrence)
    assert end(replace(alarm, out_of_service=True), 5.0, "Monitoring ended")[0].state is OUT_OF_SERVICE


def test_each_degree_of_badness_is_a_cause_of_its_own() -> None:
    worst = fault("it is worst", level=2)
    alarm, _ = play([(0.0, WORSE, UNACKED), (1.0, ACK, ACKED), (2.0, worst, UNACKED)], LATCHING)
    assert [cause.name for cause in alarm.causes] == ["level 1", "level 2"]
    alarm, _ = play([(0.0, BAD, UNACKED)], LATCHING)
    assert alarm.causes == ()


def by(value: float, text: str) -> Finding:
    measured, limit = Quantity(label="v", value=value, unit="m"), Quantity(label="l", value=10.0, unit="m")
    return fault(text, measured=measured, limit=limit)


@pytest.mark.parametrize(
    ("first", "second", "worst"),
    [
        (by(12.0, "first"), by(12.5, "second"), "second"),
        (by(12.0, "first"), by(12.0, "second"), "first"),  # as bad is not worse
        (by(8.0, "first"), by(9.0, "second"), "first"),  # below a lower limit
        (by(9.0, "first"), by(8.0, "second"), "second"),
        (BAD, by(10.5, "second"), "second"),  # a number is better than none
        (by(10.0, "first"), BAD, "first"),
        (by(10.0, "first"), by(99.0, "half")._replace(measured=None), "first"),
        (by(10.0, "first"), by(99.0, "half")._replace(limit=None), "first"),
    ],
)
def test_the_worst_is_what_was_furthest_beyond_its_limit(first: Finding, second: Finding, worst: str) -> None:
    alarm, _ = play([(0.0, first, UNACKED), (1.0, second, UNACKED)], NO_ACK)
    assert alarm.worst
    assert alarm.worst.text == worst


def test_gone_on_the_shelf_its_end_is_reported_and_not_announced() -> None:
    minute = Act("shelve", minutes=1.0)
    story = [(0.0, BAD, NORMAL), (1.0, BAD, UNACKED), (2.0, minute, SHELVED), (3.0, OK, SHELVED), (5.0, OK, SHELVED)]
    _, happened = play([*story, (62.0, OK, RTN_UNACKED)])
    assert [(t.change, t.announces) for t in happened[1:]] == [
        ("shelved", False),
        ("cleared", False),
        ("unshelved", False),
    ]


REPEATS = replace(NO_ACK, repeat_after_s=600.0)


@pytest.mark.parametrize(
    ("again_s", "finding", "announces"),
    [
        (699.0, A, False),
        (700.0, A, True),
        (699.0, A_AND_B, True),  # one of them is new
        (699.0, BAD, True),  # a fault without a cause is known by nothing
    ],
)
def test_what_was_announced_is_not_repeated_until_its_time_is_over(
    again_s: float, finding: Finding, announces: bool
) -> None:
    alarm, _ = play([(100.0, A, UNACKED), (101.0, OK, NORMAL)], REPEATS)
    _, happened = advance(alarm, finding, again_s)
    assert [(t.change, t.announces) for t in happened] == [("raised", announces)]


@pytest.mark.parametrize("spec", [REPEATS, NO_ACK])
def test_causes_are_remembered_only_where_repeats_are_limited(spec: AlarmSpec) -> None:
    alarm, _ = play([(100.0, A, UNACKED), (150.0, A_AND_B, UNACKED)], spec)
    assert alarm.announced == ((("a", 150.0), ("b", 150.0)) if spec is REPEATS else ())


def test_an_acknowledgement_of_what_latched_ends_it_at_that_moment() -> None:
    alarm, _ = play([(0.0, A, UNACKED), (0.1, OK, UNACKED)], LATCHING)
    alarm, happened = acknowledge(alarm, 1, "Ann", 9.5)
    assert [(t.change, t.by, t.at_s, t.state) for t in happened] == [
        ("acknowledged", "Ann", 9.5, ACKED),
        ("cleared", None, 9.5, NORMAL),
    ]
    assert (alarm.active, alarm.latched, alarm.held_s, alarm.cleared_s, alarm.causes) == (False, False, 0.0, 9.5, ())
    assert alarm.acknowledged_by == "Ann"


def test_why_there_is_nothing_to_acknowledge() -> None:
    acked = replace(STANDING, acknowledged=True, acknowledged_by="Ann")
    for alarm, reason in [
        (acked, "Too hot: already acknowledged by Ann"),
        (replace(acked, acknowledged_by=None), "Too hot: already acknowledged"),
        (replace(acked, active=False), "Too hot: nothing to acknowledge"),
    ]:
        with pytest.raises(Refused) as refused:
            acknowledge(alarm, 1, "Bob", 3.0)
        assert refused.value.reason == reason


@pytest.mark.parametrize("minutes", [0.001, 15.0])
def test_the_shelf_lasts_as_long_as_requested(minutes: float) -> None:
    alarm, (made,) = shelve(STANDING, 1, minutes, "Ann", 100.0, is_inhibitor=False)
    assert alarm.shelved_until_s == 100.0 + 60.0 * minutes
    assert (made.text, made.by, made.at_s, made.announces) == ("it is bad", "Ann", 100.0, False)


@pytest.mark.parametrize(
    ("change", "occurrence", "acknowledged", "announces"),
    [
        ({}, 2, False, True),
        ({"acknowledged": True, "acknowledged_by": "Ann"}, 2, False, True),
        ({"suppressed_by": (LINK,)}, 2, False, False),
        ({"active": False}, 1, False, False),
        ({"active": False, "acknowledged": True}, 1, True, False),
    ],
)
def test_taken_off_the_shelf_it_is_announced_where_it_stands(
    change: dict[str, Any], occurrence: int, acknowledged: bool, announces: bool
) -> None:
    shelved = replace(STANDING, shelved_until_s=60.0, shelved_by="Ann", **change)
    alarm, (made,) = unshelve(shelved, "Bob", 9.0)
    assert (alarm.occurrence, alarm.acknowledged, made.announces) == (occurrence, acknowledged, announces)
    assert (alarm.shelved_until_s, alarm.shelved_by, made.by, made.at_s) == (None, None, "Bob", 9.0)
    assert alarm.announced_s == (9.0 if alarm.active else STANDING.announced_s)
    assert alarm.acknowledged_by is None


def test_a_response_to_what_was_never_judged_has_no_text() -> None:
    _, (made,) = acknowledge(replace(STANDING, finding=None), 1, "Ann", 3.0)
    assert made.text == ""
