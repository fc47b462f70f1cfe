"""Fuel: low, not low, not published, in a unit that says nothing."""

from __future__ import annotations

import pytest

from monitor.values import Level
from tests.monitor.checks.known import LINK, ask, known


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
    from dataclasses import replace

    finding = ask("fuel_low", known(link=replace(LINK, published=frozenset({"fuel"}))))
    assert finding.verdict == "unknown"
    assert finding.applies
