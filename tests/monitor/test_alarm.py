"""The life of one alarm: sequences of findings, and the alarm's state after each."""

from __future__ import annotations

from dataclasses import dataclass, replace

import pytest

from monitor.alarm import Alarm, AlarmState, Refused, Transition
from monitor.alarm_life import advance, end
from monitor.alarm_spec import Action, AlarmSpec, Place, Priority, Sound
from monitor.check import OK, Finding, Quantity, fault, unknown
from monitor.response import acknowledge, shelve, unshelve

NORMAL, UNACKED, ACKED, RTN_UNACKED, SHELVED, SUPPRESSED, OUT_OF_SERVICE = AlarmState

SPEC = AlarmSpec(
    title="Too hot",
    priority=Priority.WARNING,
    place=Place.SNACKBAR,
    sound=Sound.MEDIUM,
    needs_ack=True,
    on_delay_s=1.0,
    off_delay_s=2.0,
    actions=(Action.SHELVE, Action.ACKNOWLEDGE),
)

BAD = fault("it is bad")
HUH = unknown("cannot tell")
A = fault("a is bad", causes=("a",))
A_AND_B = fault("a and b are bad", causes=("a", "b"))
WORSE = fault("it is worse", level=1)


@dataclass(frozen=True)
class Act:
    """Something that is done to the alarm, rather than found."""

    kind: str
    occurrence: int | None = None
    minutes: float = 15.0


ACK = Act("ack")
SHELVE = Act("shelve")
UNSHELVE = Act("unshelve")
Inhibited = tuple[str, Finding]
LINK = "link_lost"


def play(
    story: list[tuple[float, Finding | Act | Inhibited, AlarmState]], spec: AlarmSpec = SPEC
) -> tuple[Alarm, list[Transition]]:
    alarm, happened = Alarm(id="hot", spec=spec), []
    for number, (at_s, event, expected) in enumerate(story):
        match event:
            case Act(kind="ack"):
                alarm, transitions = acknowledge(alarm, event.occurrence or alarm.occurrence, "Ann", at_s)
            case Act(kind="shelve"):
                occurrence = event.occurrence or alarm.occurrence
                alarm, transitions = shelve(alarm, occurrence, event.minutes, "Ann", at_s, is_inhibitor=False)
            case Act():
                alarm, transitions = unshelve(alarm, "Ann", at_s)
            case (str() as by, Finding() as finding):
                alarm, transitions = advance(alarm, finding, at_s, (by,))
            case Finding() as finding:
                alarm, transitions = advance(alarm, finding, at_s)
        assert alarm.state is expected, f"step {number} at {at_s} s"
        happened += transitions
    return alarm, happened


STORIES: dict[str, list[tuple[float, Finding | Act | Inhibited, AlarmState]]] = {
    "short fault is filtered": [
        (0.0, BAD, NORMAL),
        (0.5, OK, NORMAL),
        (0.6, BAD, NORMAL),
        (1.5, BAD, NORMAL),
        (1.6, BAD, UNACKED),
    ],
    "clear, then acknowledge": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, OK, UNACKED),
        (4.0, OK, RTN_UNACKED),
        (5.0, ACK, NORMAL),
    ],
    "acknowledge, then clear": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (1.5, ACK, ACKED),
        (2.0, OK, ACKED),
        (3.9, OK, ACKED),
        (4.0, OK, NORMAL),
    ],
    "a fault within the off-delay starts it anew": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, OK, UNACKED),
        (3.5, BAD, UNACKED),
        (3.6, OK, UNACKED),
        (5.5, OK, UNACKED),
        (5.6, OK, RTN_UNACKED),
    ],
    "unknown never clears": [(0.0, BAD, NORMAL), (1.0, BAD, UNACKED), (9.0, HUH, UNACKED), (99.0, HUH, UNACKED)],
    "unknown never raises": [(0.0, BAD, NORMAL), (0.9, HUH, NORMAL), (99.0, HUH, NORMAL)],
    "unknown stops the count to raising, what was seen still counts": [
        (0.0, BAD, NORMAL),
        (0.6, BAD, NORMAL),
        (0.7, HUH, NORMAL),
        (50.0, BAD, NORMAL),
        (50.3, BAD, NORMAL),
        (50.5, BAD, UNACKED),
    ],
    "unknown starts the count to clearing anew": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, OK, UNACKED),
        (3.9, OK, UNACKED),
        (3.95, HUH, UNACKED),
        (4.0, OK, UNACKED),
        (5.9, OK, UNACKED),
        (6.0, OK, RTN_UNACKED),
    ],
    "comes back unseen": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, OK, UNACKED),
        (4.0, OK, RTN_UNACKED),
        (5.0, BAD, RTN_UNACKED),
        (6.0, BAD, UNACKED),
        (6.5, ACK, ACKED),
        (7.0, OK, ACKED),
        (9.0, OK, NORMAL),
    ],
    "a new cause re-alarms": [
        (0.0, A, NORMAL),
        (1.0, A, UNACKED),
        (1.5, ACK, ACKED),
        (1.6, A_AND_B, UNACKED),
    ],
    "a cause fewer does not": [
        (0.0, A_AND_B, NORMAL),
        (1.0, A_AND_B, UNACKED),
        (1.5, ACK, ACKED),
        (1.6, A, ACKED),
    ],
    "a cause that was away no longer than the off-delay is not new": [
        (0.0, A_AND_B, NORMAL),
        (1.0, A_AND_B, UNACKED),
        (1.5, ACK, ACKED),
        (2.0, A, ACKED),
        (4.0, A_AND_B, ACKED),
        (4.1, A, ACKED),
        (6.2, A_AND_B, UNACKED),
    ],
    "what could not be seen was not away": [
        (0.0, A_AND_B, NORMAL),
        (1.0, A_AND_B, UNACKED),
        (1.5, ACK, ACKED),
        (2.0, HUH, ACKED),
        (60.0, A_AND_B, ACKED),
    ],
    "worse re-alarms": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (1.5, ACK, ACKED),
        (1.6, WORSE, UNACKED),
        (1.7, ACK, ACKED),
        (1.8, BAD, ACKED),
    ],
    "shelving ends and re-announces": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, Act("shelve", minutes=1.0), SHELVED),
        (61.9, BAD, SHELVED),
        (62.0, BAD, UNACKED),
    ],
    "shelving an acknowledged alarm re-announces it too": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (1.1, ACK, ACKED),
        (2.0, Act("shelve", minutes=1.0), SHELVED),
        (62.0, BAD, UNACKED),
    ],
    "gone while on the shelf, unseen": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, Act("shelve", minutes=1.0), SHELVED),
        (3.0, OK, SHELVED),
        (5.0, OK, SHELVED),
        (62.0, OK, RTN_UNACKED),
    ],
    "taken off the shelf": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, SHELVE, SHELVED),
        (3.0, UNSHELVE, UNACKED),
    ],
    "the shelf ends in the dark": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, Act("shelve", minutes=1.0), SHELVED),
        (62.0, HUH, UNACKED),
    ],
    "explained away before it is raised": [
        (0.0, BAD, NORMAL),
        (0.9, (LINK, BAD), SUPPRESSED),
        (9.0, (LINK, BAD), SUPPRESSED),
        (10.0, BAD, NORMAL),
        (11.0, BAD, UNACKED),
    ],
    "known before, still there after: not announced again": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (1.5, ACK, ACKED),
        (2.0, (LINK, BAD), SUPPRESSED),
        (9.0, (LINK, HUH), SUPPRESSED),
        (12.0, BAD, ACKED),
    ],
    "unseen before, still unseen after": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, (LINK, OK), SUPPRESSED),
        (9.0, (LINK, OK), SUPPRESSED),
        (9.1, BAD, UNACKED),
    ],
    "never clears while suppressed, and at once after": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, (LINK, OK), SUPPRESSED),
        (9.0, (LINK, OK), SUPPRESSED),
        (9.1, OK, RTN_UNACKED),
    ],
    "suppressed and shelved are two flags": [
        (0.0, BAD, NORMAL),
        (1.0, BAD, UNACKED),
        (2.0, SHELVE, SHELVED),
        (3.0, (LINK, BAD), SUPPRESSED),
        (4.0, BAD, SHELVED),
    ],
    "a new cause is not announced while suppressed, but after": [
        (0.0, A, NORMAL),
        (1.0, A, UNACKED),
        (1.5, ACK, ACKED),
        (2.0, (LINK, A_AND_B), SUPPRESSED),
        (9.0, A_AND_B, UNACKED),
    ],
    "the clock goes back: delays stay what they are": [
        (1000.0, BAD, NORMAL),
        (1000.5, BAD, NORMAL),
        (10.0, BAD, NORMAL),
        (10.4, BAD, NORMAL),
        (10.5, BAD, UNACKED),
        (10.6, OK, UNACKED),
        (3.0, OK, UNACKED),
        (4.9, OK, UNACKED),
        (5.0, OK, RTN_UNACKED),
    ],
    "the clock goes back: so does the end of the shelf": [
        (1000.0, BAD, NORMAL),
        (1001.0, BAD, UNACKED),
        (1001.0, Act("shelve", minutes=1.0), SHELVED),
        (1011.0, BAD, SHELVED),
        (5.0, BAD, SHELVED),
        (54.9, BAD, SHELVED),
        (55.0, BAD, UNACKED),
    ],
}


@pytest.mark.parametrize("story", STORIES.values(), ids=STORIES.keys())
def test_story(story: list[tuple[float, Finding | Act | Inhibited, AlarmState]]) -> None:
    play(story)


NO_ACK = replace(SPEC, needs_ack=False, on_delay_s=0.0, off_delay_s=0.0)
LATCHING = replace(SPEC, latches=True, on_delay_s=0.0, off_delay_s=0.0)


def test_without_need_of_acknowledgement_it_goes_by_itself() -> None:
    play([(0.0, BAD, UNACKED), (0.1, OK, NORMAL), (0.2, BAD, UNACKED), (0.3, ACK, ACKED), (0.4, OK, NORMAL)], NO_ACK)


def test_a_latched_alarm_stays_active_until_acknowledged() -> None:
    alarm, happened = play([(0.0, BAD, UNACKED), (0.1, OK, UNACKED), (9.0, OK, UNACKED)], LATCHING)
    assert (alarm.active, alarm.latched) == (True, True)
    alarm, transitions = acknowledge(alarm, 1, "Ann", 9.5)
    assert alarm.state is NORMAL
    assert [t.change for t in (*happened, *transitions)] == ["raised", "acknowledged", "cleared"]


def test_a_latched_alarm_that_is_bad_again_is_no_longer_only_latched() -> None:
    alarm, _ = play([(0.0, BAD, UNACKED), (0.1, OK, UNACKED), (0.2, BAD, UNACKED), (0.3, ACK, ACKED)], LATCHING)
    assert alarm.active


def test_what_happened_is_reported_once_in_order() -> None:
    _, happened = play(
        [
            (0.0, A, NORMAL),
            (1.0, A, UNACKED),
            (1.2, A, UNACKED),
            (1.5, A_AND_B, UNACKED),
            (2.0, (LINK, HUH), SUPPRESSED),
            (3.0, (LINK, HUH), SUPPRESSED),
            (4.0, A_AND_B, UNACKED),
            (5.0, ACK, ACKED),
            (6.0, OK, ACKED),
            (8.0, OK, NORMAL),
        ]
    )
    assert [(t.at_s, t.change, t.occurrence, t.announces, t.by) for t in happened] == [
        (1.0, "raised", 1, True, None),
        (1.5, "recaused", 2, True, None),
        (2.0, "suppressed", 2, False, None),
        (4.0, "unsuppressed", 2, False, None),
        (5.0, "acknowledged", 2, False, "Ann"),
        (8.0, "cleared", 2, False, None),
    ]


def test_the_end_of_shelving_is_an_announcement_of_its_own() -> None:
    shelf = Act("shelve", minutes=1.0)
    alarm, happened = play([(0.0, BAD, NORMAL), (1.0, BAD, UNACKED), (2.0, shelf, SHELVED), (62.0, BAD, UNACKED)])
    assert [(t.change, t.occurrence, t.announces) for t in happened] == [
        ("raised", 1, True),
        ("shelved", 1, False),
        ("unshelved", 2, True),
    ]
    assert alarm.shelved_by is None


def test_a_shelf_that_ends_while_suppressed_is_not_announced() -> None:
    shelf = Act("shelve", minutes=1.0)
    _, happened = play(
        [(0.0, BAD, NORMAL), (1.0, BAD, UNACKED), (2.0, shelf, SHELVED), (62.0, (LINK, BAD), SUPPRESSED)]
    )
    assert [(t.change, t.announces) for t in happened[2:]] == [("suppressed", False), ("unshelved", False)]


def test_a_new_cause_is_announced_when_the_suppression_ends() -> None:
    _, happened = play(
        [
            (0.0, A, NORMAL),
            (1.0, A, UNACKED),
            (1.5, ACK, ACKED),
            (2.0, (LINK, A_AND_B), SUPPRESSED),
            (9.0, A_AND_B, UNACKED),
        ]
    )
    assert [(t.change, t.announces) for t in happened[2:]] == [
        ("suppressed", False),
        ("unsuppressed", False),
        ("recaused", True),
    ]


def test_nothing_is_announced_from_the_shelf() -> None:
    alarm, happened = play(
        [(0.0, A, NORMAL), (1.0, A, UNACKED), (2.0, SHELVE, SHELVED), (3.0, A_AND_B, SHELVED), (4.0, OK, SHELVED)]
    )
    assert [(t.change, t.announces) for t in happened] == [("raised", True), ("shelved", False), ("recaused", False)]
    assert alarm.sound is Sound.NONE


def test_a_late_tap_does_not_hide_a_newer_occurrence() -> None:
    alarm, _ = play([(0.0, A, NORMAL), (1.0, A, UNACKED), (1.5, A_AND_B, UNACKED)])
    with pytest.raises(Refused, match="raised again"):
        acknowledge(alarm, 1, "Ann", 2.0)
    with pytest.raises(Refused, match="raised again"):
        acknowledge(alarm, 3, "Ann", 2.0)
    assert acknowledge(alarm, 2, "Ann", 2.0)[0].state is ACKED


def test_acknowledging_what_needs_none_is_refused_with_the_reason() -> None:
    with pytest.raises(Refused, match="nothing to acknowledge"):
        acknowledge(Alarm(id="hot", spec=SPEC), 0, "Ann", 0.0)
    alarm, _ = play([(0.0, BAD, NORMAL), (1.0, BAD, UNACKED), (2.0, ACK, ACKED)])
    with pytest.raises(Refused, match="already acknowledged by Ann"):
        acknowledge(alarm, 1, "Bob", 3.0)


STANDING, _ = play([(0.0, BAD, NORMAL), (1.0, BAD, UNACKED)])


@pytest.mark.parametrize(
    ("alarm", "occurrence", "minutes", "by", "is_inhibitor", "reason"),
    [
        pytest.param(STANDING, 1, 15.1, "Ann", False, "at most 15 minutes", id="too long"),
        pytest.param(STANDING, 1, 0.0, "Ann", False, "at most 15 minutes", id="no time"),
        pytest.param(STANDING, 1, -1.0, "Ann", False, "at most 15 minutes", id="negative"),
        pytest.param(STANDING, 1, float("nan"), "Ann", False, "at most 15 minutes", id="NaN"),
        pytest.param(STANDING, 1, float("inf"), "Ann", False, "at most 15 minutes", id="for ever"),
        pytest.param(STANDING, 1, 5.0, "  ", False, "name", id="nobody"),
        pytest.param(STANDING, 2, 5.0, "Ann", False, "raised again", id="another occurrence"),
        pytest.param(STANDING, 1, 5.0, "Ann", True, "explains other alarms", id="inhibitor"),
        pytest.param(Alarm(id="hot", spec=SPEC), 0, 5.0, "Ann", False, "nothing to shelve", id="normal"),
        pytest.param(
            replace(STANDING, spec=replace(SPEC, priority=Priority.CRITICAL)),
            1,
            5.0,
            "Ann",
            False,
            "critical",
            id="critical",
        ),
    ],
)
def test_shelving_is_refused(
    alarm: Alarm, occurrence: int, minutes: float, by: str, is_inhibitor: bool, reason: str
) -> None:
    with pytest.raises(Refused, match=reason):
        shelve(alarm, occurrence, minutes, by, 2.0, is_inhibitor=is_inhibitor)


def test_shelving_for_the_longest_time() -> None:
    alarm, transitions = shelve(STANDING, 1, 15.0, "Ann", 2.0, is_inhibitor=False)
    assert (alarm.shelved_until_s, alarm.shelved_by) == (902.0, "Ann")
    assert [(t.change, t.by) for t in transitions] == [("shelved", "Ann")]


def test_what_is_not_shelved_cannot_be_taken_from_the_shelf() -> None:
    with pytest.raises(Refused, match="is not shelved"):
        unshelve(STANDING, "Ann", 2.0)


def test_trip_live_and_worst_are_kept_apart() -> None:
    def at(value: float) -> Finding:
        measured, limit = Quantity(label="v", value=value, unit="m"), Quantity(label="l", value=10.0, unit="m")
        return fault(f"{value}", measured=measured, limit=limit)

    alarm, _ = play([(0.0, at(11), NORMAL), (1.0, at(12), UNACKED), (2.0, at(15), UNACKED), (3.0, at(13), UNACKED)])
    assert [f.text for f in (alarm.trip, alarm.finding, alarm.worst) if f] == ["12", "13", "15"]


def test_where_it_shows_once_it_is_gone() -> None:
    spec = replace(NO_ACK, needs_ack=True, place=Place.DIALOG, place_after=Place.LIST)
    alarm, _ = play([(0.0, BAD, UNACKED)], spec)
    assert (alarm.place, alarm.sound) == (Place.DIALOG, Sound.MEDIUM)
    alarm, _ = play([(0.0, BAD, UNACKED), (1.0, OK, RTN_UNACKED)], spec)
    assert (alarm.place, alarm.sound) == (Place.LIST, Sound.NONE)


def test_an_alarm_out_of_service_announces_nothing() -> None:
    alarm = Alarm(id="hot", spec=NO_ACK, out_of_service=True)
    after, transitions = advance(alarm, BAD, 0.0)
    assert (after.state, transitions) == (OUT_OF_SERVICE, ())


def test_the_end_of_monitoring_clears_what_stands_and_keeps_counting() -> None:
    alarm, transitions = end(STANDING, 5.0, "Monitoring ended")
    assert (alarm.state, alarm.occurrence) == (NORMAL, 1)
    assert [(t.change, t.occurrence, t.text) for t in transitions] == [("cleared", 1, "Monitoring ended")]
    assert end(Alarm(id="hot", spec=SPEC), 5.0, "Monitoring ended")[1] == ()


def test_a_message_that_waited_a_moment_does_not_move_the_alarm_in_time() -> None:
    alarm, _ = play([(10.0, BAD, NORMAL), (11.0, BAD, UNACKED), (10.9, BAD, UNACKED), (11.1, BAD, UNACKED)])
    assert alarm.raised_s == 11.0
