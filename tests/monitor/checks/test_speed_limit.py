"""Faster than the operator allows: the report's case 17."""

from __future__ import annotations

import math

import pytest

from monitor.check import Verdict
from monitor.values import Twist
from tests.monitor.checks.known import ask, known

OK, FAULT, UNKNOWN = Verdict.OK, Verdict.FAULT, Verdict.UNKNOWN


@pytest.mark.parametrize(
    ("speed_mps", "was_active", "verdict"),
    [
        pytest.param(0.0, False, OK, id="standing"),
        pytest.param(11.0, False, OK, id="at the limit"),
        pytest.param(11.001, False, FAULT, id="just above"),
        pytest.param(-11.001, False, FAULT, id="reversing too fast is too fast"),
        pytest.param(-11.0, False, OK, id="reversing at the limit"),
        pytest.param(10.501, True, FAULT, id="within the deadband while active"),
        pytest.param(10.5, True, OK, id="below the deadband"),
        pytest.param(10.501, False, OK, id="the deadband is for clearing only"),
        pytest.param(1e9, False, FAULT, id="absurd"),
        pytest.param(math.nan, False, UNKNOWN, id="NaN"),
        pytest.param(math.nan, True, UNKNOWN, id="NaN while active"),
        pytest.param(math.inf, False, UNKNOWN, id="infinite"),
    ],
)
def test_verdict(speed_mps: float, was_active: bool, verdict: Verdict) -> None:
    found = ask("speed_limit", known(speed=Twist(speed_mps=speed_mps)), was_active=was_active)
    assert found.verdict is verdict


@pytest.mark.parametrize(("age_s", "verdict"), [(1.0, FAULT), (1.01, UNKNOWN)])
def test_an_old_speed_is_not_judged(age_s: float, verdict: Verdict) -> None:
    assert ask("speed_limit", known(age_s=age_s, speed=Twist(speed_mps=20.0))).verdict is verdict


def test_no_speed_is_not_judged() -> None:
    found = ask("speed_limit", known())
    assert (found.verdict, found.text) == (UNKNOWN, "Speed is not published")


@pytest.mark.parametrize(("speed_mps", "verdict"), [(0.26, FAULT), (0.25, OK)])
def test_a_deadband_as_wide_as_the_limit_still_clears(speed_mps: float, verdict: Verdict) -> None:
    snapshot = known(speed=Twist(speed_mps=speed_mps))
    assert ask("speed_limit", snapshot, was_active=True, max_mps=0.5, deadband_mps=5.0).verdict is verdict


def test_what_the_operator_reads() -> None:
    found = ask("speed_limit", known(speed=Twist(speed_mps=12.6)))
    assert (found.text, found.brief) == ("12.6 m/s, limit 11.0 m/s", "FAULT 12.6 m/s")
    assert found.measured is not None
    assert found.limit is not None
    assert (found.measured.label, found.measured.value, found.limit.value) == ("Speed", 12.6, 11.0)


def test_the_tile_has_room_for_any_speed() -> None:
    assert ask("speed_limit", known(speed=Twist(speed_mps=1e9))).brief == "FAULT"
