"""A pause that somebody forgot: reported after some minutes, and then ever more seldom."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.check import Verdict
from monitor.runner import Monitor
from monitor.shell_facts import LinkFacts, Phase
from monitor.state import Snapshot, State
from tests.monitor.checks.known import LINK, ask

OK, FAULT = Verdict.OK, Verdict.FAULT


def paused(for_s: float | None, phase: Phase = "monitoring") -> Snapshot:
    since_s = None if for_s is None else 1000.0 - for_s
    return Snapshot(now_s=1000.0, link=replace(LINK, phase=phase), paused=for_s is not None, paused_since_s=since_s)


@pytest.mark.parametrize(
    ("for_s", "verdict", "level"),
    [
        (None, OK, 0),
        (0.0, OK, 0),
        (299.9, OK, 0),
        (300.0, FAULT, 1),
        (599.0, FAULT, 1),
        (600.0, FAULT, 2),
        (1200.0, FAULT, 3),
        (86_400.0, FAULT, 9),
        (-5.0, OK, 0),
    ],
    ids=str,
)
def test_verdict(for_s: float | None, verdict: Verdict, level: int) -> None:
    found = ask("paused_long", paused(for_s))
    assert (found.verdict, found.level) == (verdict, level)


@pytest.mark.parametrize("phase", ["monitoring", "lost", "failed"])
def test_it_is_reported_with_and_without_a_link_and_although_it_is_paused(phase: Phase) -> None:
    monitor = Monitor()
    announced = [t for t in monitor.step(paused(400.0, phase)) if t.announces and t.alarm_id == "paused_long"]
    assert [t.text for t in announced] == ["Monitoring paused for 7 min: no alarm is raised"]


def test_how_long_is_a_setting() -> None:
    assert ask("paused_long", paused(100.0), after_min=1.5).verdict is FAULT
    assert ask("paused_long", paused(100.0), after_min=2.0).verdict is OK


def test_a_forgotten_pause_is_reported_ever_more_seldom() -> None:
    """paused_long: after 5, 10, 20, 40 minutes, acknowledged or not, and resuming ends it without an announcement."""
    monitor, state, announced = Monitor(), State(), []
    state.link(LinkFacts(phase="monitoring", connected_s=0.0))
    state.snapshot(0.0)
    state.set_paused(True)
    for second in range(3000):
        for t in monitor.step(state.snapshot(float(second))):
            if t.alarm_id == "paused_long":
                announced.append((t.at_s / 60, t.change))
                monitor.acknowledge("paused_long", t.occurrence, "Ann", t.at_s)
    assert announced == [(5.0, "raised"), (10.0, "recaused"), (20.0, "recaused"), (40.0, "recaused")]
    state.set_paused(False)
    monitor.step(state.snapshot(3001.0))
    assert not monitor.alarms["paused_long"].is_standing


def test_a_pause_known_from_before_counts_from_then_and_a_new_one_from_anew() -> None:
    state = State()
    state.set_paused(True, since_s=40.0)
    assert state.snapshot(100.0).paused_since_s == 40.0
    state.set_paused(False)
    assert state.snapshot(101.0).paused_since_s is None
    state.set_paused(True)
    assert (state.snapshot(102.0).paused_since_s, state.snapshot(103.0).paused_since_s) == (102.0, 102.0)


def test_a_clock_that_goes_back_makes_the_pause_no_longer() -> None:
    state = State()
    state.set_paused(True)
    state.snapshot(1000.0)
    state.snapshot(1100.0)
    back = state.snapshot(50.0)
    assert back.paused_since_s is not None
    assert back.now_s - back.paused_since_s == 100.0
