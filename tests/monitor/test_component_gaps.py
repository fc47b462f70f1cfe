"""A time in which no report could be received is neither an interval of a component nor its silence."""

from __future__ import annotations

from collections.abc import Callable, Iterable

import pytest

from monitor.components import FORGOTTEN_AFTER_S, ONE_INTERVAL_S, SILENT_AFTER_S, TOPIC_SILENT_S, Components
from monitor.shell_facts import LinkFacts
from monitor.state import State
from monitor.values import Component, Diagnostics, Level

GAP_S = 1200.0


def report(*names: str) -> Diagnostics:
    return Diagnostics(components=tuple(Component(name=name, level=0, message="") for name in names))


def open_link(state: State, at_s: float) -> None:
    state.link(LinkFacts(phase="monitoring", since_s=at_s, connected_s=at_s))


def lose_link(state: State, at_s: float) -> None:
    state.link(LinkFacts(phase="lost", since_s=at_s))


def levels(state: State) -> dict[str, int]:
    reading = state.get("diagnostics")
    assert reading is not None
    return {one.name: one.level for one in reading.value.components}


def horizon_s(state: State) -> float:
    reading = state.get("diagnostics")
    assert reading is not None
    return reading.horizon_s


def outage(state: State) -> None:
    lose_link(state, 10.5)
    open_link(state, 10.5 + GAP_S)


def pause(state: State) -> None:
    state.set_paused(True, 10.5)
    state.receive("fuel", Level(value=50.0, unit="%"), 10.5 + GAP_S)  # or any other signal
    state.set_paused(False)


def stall(state: State) -> None:
    state.snapshot(10.5)


def skip(state: State) -> None:
    state.snapshot(10.5)
    state.snapshot(10.5 + GAP_S)


@pytest.mark.parametrize("gap", [outage, pause, stall, skip])
@pytest.mark.parametrize("period_s", [1.0, 0.5])
def test_a_gap_in_what_is_received_is_no_interval_and_no_silence(gap: Callable[[State], None], period_s: float) -> None:
    state = State()
    open_link(state, 0.0)
    for at_s in ticks(0.0, 10.0, period_s):
        state.receive("diagnostics", report("laser", "gps"), at_s)
    gap(state)
    again_s = 10.5 + GAP_S
    state.receive("diagnostics", report("laser"), again_s + 1.0)
    assert levels(state) == {"laser": 0, "gps": 0}
    assert horizon_s(state) == TOPIC_SILENT_S
    for at_s in ticks(again_s + 1.5, again_s + SILENT_AFTER_S + 2.0, 0.5):
        state.snapshot(at_s)
        state.receive("diagnostics", report("laser"), at_s)
    assert levels(state) == {"laser": 0, "gps": 3}
    for at_s in ticks(again_s + 7.5, again_s + SILENT_AFTER_S + 8.0, 0.5):
        state.snapshot(at_s)
        state.receive("diagnostics", report("wheel"), at_s)
    assert levels(state)["laser"] == 3


def ticks(from_s: float, until_s: float, period_s: float) -> Iterable[float]:
    return (from_s + number * period_s for number in range(round((until_s - from_s) / period_s) + 1))


def test_a_link_that_is_lost_again_and_again_does_not_hide_a_component_that_is_gone() -> None:
    state = State()
    open_link(state, 0.0)
    for at_s in (1.0, 2.0, 3.0, 4.0):
        state.receive("diagnostics", report("laser", "gps"), at_s)
    for at_s in (6.0, 9.0, 12.0):
        lose_link(state, at_s)
        open_link(state, at_s + 1.0)
        state.receive("diagnostics", report("gps"), at_s + 1.5)
    assert levels(state) == {"laser": 3, "gps": 0}


def test_glancing_at_a_state_changes_no_interval() -> None:
    state = State()
    for at_s in (0.0, 10.0, 20.0):
        state.receive("diagnostics", report("disk"), at_s)
    state.snapshot(20.0)
    state.glance(29.0)
    for at_s in ticks(20.5, 32.0, 0.5):
        state.snapshot(at_s)
    state.receive("diagnostics", report("disk"), 32.0)
    assert horizon_s(state) == 36.0


def test_a_report_after_the_component_was_forgotten_begins_anew() -> None:
    known = Components()
    for at_s in (0.0, 1.0, 2.0):
        known.merge(report("laser"), at_s)
    known.merge(report("laser"), 3.0 + FORGOTTEN_AFTER_S)
    known.merge(report("laser"), 4.0 + FORGOTTEN_AFTER_S)
    known.merge(report("laser"), 5.0 + FORGOTTEN_AFTER_S)
    assert known.horizon_s(5.0 + FORGOTTEN_AFTER_S) == TOPIC_SILENT_S


def test_the_first_interval_after_it_was_forgotten_is_held_to_the_least() -> None:
    known = Components()
    for at_s in (0.0, 1.0, GAP_S, GAP_S + 1.0):
        known.merge(report("laser"), at_s)
    assert known.horizon_s(GAP_S + 1.0) == ONE_INTERVAL_S
