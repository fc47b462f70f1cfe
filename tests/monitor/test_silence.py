"""Silence: no sound of one occurrence for 30 s, and nothing else of the alarm changes."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from monitor.alarm import Alarm, AlarmState, Refused, Transition
from monitor.alarm_life import advance
from monitor.alarm_spec import AlarmSpec, Place, Priority, Sound
from monitor.check import OK, Finding, fault
from monitor.response import SILENCE_S, acknowledge, shelve, silence
from monitor.restoring import restore

SPEC = AlarmSpec(
    title="Too hot", priority=Priority.WARNING, place=Place.SNACKBAR, sound=Sound.MEDIUM, needs_ack=True
)  # fmt: skip
BAD, WORSE, OTHER = fault("bad"), fault("worse", level=1), fault("other", causes=("b",))


def standing(at_s: float = 10.0) -> Alarm:
    return advance(Alarm(id="hot", spec=SPEC), BAD, at_s)[0]


def silenced() -> Alarm:
    return silence(standing(), 1, "Ann", 12.0)[0]


def test_a_silenced_alarm_stands_unacknowledged_and_shows_by_whom() -> None:
    alarm, (happened,) = silence(standing(), 1, "Ann", 12.0)
    assert (alarm.sound, alarm.state, alarm.occurrence) == (Sound.NONE, AlarmState.UNACKED, 1)
    assert (alarm.silenced_until_s, alarm.silenced_by) == (12.0 + SILENCE_S, "Ann")
    assert (happened.change, happened.by, happened.announces, happened.state) == (
        "silenced",
        "Ann",
        False,
        AlarmState.UNACKED,
    )


@pytest.mark.parametrize(
    ("finding", "at_s", "sound", "changes"),
    [
        (BAD, 41.9, Sound.NONE, []),
        (BAD, 42.0, Sound.MEDIUM, ["unsilenced"]),
        (WORSE, 13.0, Sound.MEDIUM, ["recaused"]),  # a worse one is another occurrence
        (OTHER, 13.0, Sound.MEDIUM, ["recaused"]),
        (OK, 13.0, Sound.NONE, ["cleared"]),
        (WORSE, 50.0, Sound.MEDIUM, ["unsilenced", "recaused"]),
    ],
)
def test_how_long_it_is_silent(finding: Finding, at_s: float, sound: Sound, changes: list[str]) -> None:
    alarm, happened = advance(silenced(), finding, at_s)
    assert (alarm.sound, [one.change for one in happened]) == (sound, changes)


def test_what_returned_and_comes_again_sounds_again() -> None:
    gone, _ = advance(silenced(), OK, 13.0)
    assert gone.silenced_until_s is None
    again, (happened,) = advance(gone, BAD, 14.0)
    assert (again.sound, happened.announces) == (Sound.MEDIUM, True)


def test_a_clock_that_goes_back_makes_it_no_longer() -> None:
    alarm, _ = advance(silenced(), BAD, 13.0)
    back, _ = advance(alarm, BAD, 3.0)
    assert advance(back, BAD, 31.9)[0].sound is Sound.NONE
    assert advance(back, BAD, 32.0)[0].sound is Sound.MEDIUM


def test_its_acknowledgement_ends_it_and_its_end_is_then_not_reported() -> None:
    alarm, _ = acknowledge(silenced(), 1, "Ben", 14.0)
    assert (alarm.silenced_until_s, alarm.silenced_by) == (None, None)
    assert advance(alarm, BAD, 43.0)[1] == ()


def test_what_is_taken_from_the_shelf_sounds() -> None:
    shelved, _ = shelve(silenced(), 1, 0.25, "Ben", 14.0, is_inhibitor=False)
    alarm, _ = advance(shelved, BAD, 29.0)
    assert (alarm.state, alarm.sound) == (AlarmState.UNACKED, Sound.MEDIUM)


@pytest.mark.parametrize(
    ("more", "occurrence", "reason"),
    [
        ({}, 2, "raised again meanwhile"),
        ({}, 0, "raised again meanwhile"),
        ({"acknowledged": True}, 1, "nothing sounds"),
        ({"active": False}, 1, "nothing sounds"),
        ({"shelved_until_s": 60.0}, 1, "nothing sounds"),
        ({"suppressed_by": ("link_lost",)}, 1, "nothing sounds"),
        ({"silenced_until_s": 20.0, "silenced_by": "Ben"}, 1, "already silenced by Ben"),
    ],
)
def test_silence_is_refused(more: dict[str, Any], occurrence: int, reason: str) -> None:
    with pytest.raises(Refused, match=reason):
        silence(replace(standing(), **more), occurrence, "Ann", 12.0)


def test_a_restart_sounds_again() -> None:
    fresh = Alarm(id="hot", spec=SPEC)
    alarm, raised = advance(fresh, BAD, 10.0)
    happened: tuple[Transition, ...] = (*raised, *silence(alarm, 1, "Ann", 12.0)[1])
    assert restore({"hot": fresh}, happened)["hot"].sound is Sound.MEDIUM
