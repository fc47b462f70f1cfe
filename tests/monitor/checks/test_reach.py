"""Whether anybody would hear an alarm while the car moves, and that a reload raises no alarm."""

from __future__ import annotations

import math
from dataclasses import replace
from typing import Any

import pytest

from monitor.check import Verdict
from monitor.runner import Monitor
from monitor.shell_facts import ReachFacts
from monitor.state import Snapshot
from monitor.values import Twist
from tests.monitor.checks.known import ask, check_of, known

OK, FAULT, UNKNOWN = Verdict.OK, Verdict.FAULT, Verdict.UNKNOWN
DEAF = ReachFacts(can=0, of=3, why="2 × sound off, no contact")
ALONE = ReachFacts()
AUDIBLE = ReachFacts(can=2, of=3, why="sound off")


def at(facts: ReachFacts | None, speed_mps: float | None = 4.2, **more: Any) -> Snapshot:
    speed = None if speed_mps is None else Twist(speed_mps=speed_mps)
    return replace(known(speed=speed), reach=facts, **more)


@pytest.mark.parametrize(
    ("facts", "speed_mps", "was_active", "verdict", "text"),
    [
        (AUDIBLE, 4.2, False, OK, "Alarms audible on 2 of 3 operator pages"),
        (AUDIBLE, None, False, OK, "Alarms audible on 2 of 3 operator pages"),
        (DEAF, 4.2, False, FAULT, "The car moves at 4.2 m/s and nobody can hear alarms: none of 3 (2 × sound off, no"),
        (DEAF, -1.0, False, FAULT, "moves at 1.0 m/s"),  # backwards
        (ALONE, 4.2, False, FAULT, "nobody can hear alarms: no operator's phone is connected"),
        (ALONE, 0.31, False, FAULT, "moves at 0.3 m/s"),
        (ALONE, 0.29, False, OK, "the car stands"),
        (ALONE, 0.0, True, FAULT, "moves at 0.0 m/s"),  # it has only just stopped
        (ALONE, math.nan, False, OK, "the car stands"),
        (ALONE, None, False, UNKNOWN, "whether the car moves is unknown"),
        (None, 4.2, False, UNKNOWN, "Alarm reach is not monitored here"),
        (None, 4.2, True, UNKNOWN, "not monitored here"),
    ],
)
def test_who_can_hear_alarms(
    facts: ReachFacts | None, speed_mps: float | None, was_active: bool, verdict: Verdict, text: str
) -> None:
    found = ask("reach", at(facts, speed_mps), was_active=was_active)
    assert found.verdict is verdict
    assert text in found.text


@pytest.mark.parametrize(
    ("facts", "ended"),
    [
        (AUDIBLE, "Alarms are audible again"),
        (ALONE, "Nobody can hear alarms, car stands"),  # it ended, and still nobody can
    ],
)
def test_an_ended_alarm_claims_only_what_is_true_now(facts: ReachFacts, ended: str) -> None:
    assert ask("reach", at(facts, 0.0, standing_since_s=97.0), was_active=True).ended == ended


def test_it_is_over_once_the_car_rests() -> None:
    assert ask("reach", at(ALONE, 0.0, standing_since_s=97.0), was_active=True).verdict is OK


def test_an_old_speed_proves_nothing_of_now() -> None:
    snapshot = replace(known(speed=Twist(speed_mps=4.2), age_s=1.1), reach=ALONE)
    found = ask("reach", snapshot)
    assert (found.verdict, found.brief) == (UNKNOWN, "not checked: no speed")


def raised(monitor: Monitor, facts: ReachFacts, seconds: float, begin_s: float) -> list[str]:
    changes: list[str] = []
    for tenth in range(round(seconds * 10)):
        now_s = begin_s + tenth / 10
        snapshot = replace(known(now_s=now_s, speed=Twist(speed_mps=4.2)), reach=facts)
        changes += [t.change for t in monitor.step(snapshot) if t.alarm_id == "reach"]
    return changes


def test_a_reload_and_a_tap_raise_nothing_and_15_s_of_silence_do() -> None:
    monitor = Monitor([check_of("reach")])
    assert raised(monitor, AUDIBLE, 2.0, 0.0) == []
    assert raised(monitor, DEAF, 14.5, 2.0) == []
    assert raised(monitor, AUDIBLE, 2.0, 16.5) == []
    assert raised(monitor, ALONE, 14.5, 18.5) == []
    assert raised(monitor, ALONE, 1.0, 33.0) == ["raised"]
    assert raised(monitor, AUDIBLE, 3.0, 34.0) == ["cleared"]
    assert monitor.alarms["reach"].state == "RTN_UNACKED"  # who comes back must know
