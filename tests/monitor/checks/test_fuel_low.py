"""Fuel: low, not low, not published, in a unit without a meaning."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from monitor.values import Level
from tests.monitor.checks.known import LINK, ask, known
from tests.monitor.drive import Drive


@pytest.mark.parametrize(
    ("percent", "was_active", "verdict"),
    [(50.0, False, "ok"), (10.0, False, "ok"), (9.9, False, "fault"), (11.9, True, "fault"), (12.0, True, "ok")],
)
def test_verdict(percent: float, was_active: bool, verdict: str) -> None:
    snapshot = known(fuel=Level(value=percent, unit="%"))
    assert ask("fuel_low", snapshot, was_active=was_active).verdict == verdict


def test_not_published_is_no_reason_for_worry() -> None:
    finding = ask("fuel_low", known())
    assert finding.verdict == "unknown"
    assert not finding.applies
    assert finding.brief == "not published"


def test_another_unit_is_not_judged() -> None:
    assert ask("fuel_low", known(fuel=Level(value=3.0, unit="l"))).verdict == "unknown"


def test_published_but_silent_is_unknown() -> None:
    finding = ask("fuel_low", known(link=replace(LINK, published=frozenset({"fuel"}))))
    assert finding.verdict == "unknown"
    assert finding.applies


@pytest.mark.parametrize("percent", [math.nan, math.inf, -math.inf], ids=str)
def test_a_level_that_is_no_number_is_no_alarm(percent: float) -> None:
    """Decoding refuses them; what comes through all the same is not taken for an empty tank, nor for a full one."""
    assert ask("fuel_low", known(fuel=Level(value=percent, unit="%"))).verdict == "unknown"


def test_it_is_reported_once() -> None:
    """fuel_low: the tank runs empty by a percent in ten seconds."""
    car = Drive({"speed": 20.0}).open()
    for second in range(100):
        car.send("fuel", Level(value=14.0 - 0.1 * second, unit="%")).to(float(second))
    assert car.announced == ["fuel_low"]
    assert 45.0 <= car.happened[0].at_s <= 47.0
