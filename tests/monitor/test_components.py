"""Several nodes publish diagnostics: none hides another, silence turns stale, what is gone is forgotten."""

from __future__ import annotations

import pytest

from monitor.components import FORGOTTEN_UNKNOWN_S, MOST, ONE_INTERVAL_S, SELDOM_S, TOPIC_SILENT_S, Components
from monitor.state import State
from monitor.values import Component, Diagnostics


def message_of(*rows: tuple[str, int]) -> Diagnostics:
    return Diagnostics(components=tuple(Component(name=name, level=level, message="") for name, level in rows))


def levels(diagnostics: Diagnostics) -> dict[str, int]:
    return {component.name: component.level for component in diagnostics.components}


def test_one_nodes_report_does_not_hide_anothers_error() -> None:
    known = Components()
    known.merge(message_of(("laser", 2)), 0.0)
    assert levels(known.merge(message_of(("gps", 0)), 0.5)) == {"laser": 2, "gps": 0}


def test_the_newest_report_counts() -> None:
    known = Components()
    known.merge(message_of(("laser", 2)), 0.0)
    assert levels(known.merge(message_of(("laser", 0)), 1.0)) == {"laser": 0}


def test_a_component_that_falls_silent_turns_stale_and_is_forgotten() -> None:
    known = Components()
    for at_s in (-2.0, -1.0, 0.0):
        known.merge(message_of(("laser", 0), ("gps", 0)), at_s)
    assert levels(known.merge(message_of(("gps", 0)), 5.0)) == {"laser": 0, "gps": 0}
    assert levels(known.merge(message_of(("gps", 0)), 5.1)) == {"laser": 3, "gps": 0}
    assert levels(known.merge(message_of(("gps", 0)), 61.0)) == {"gps": 0}


@pytest.mark.parametrize("period_s", [10.0, 30.0, 120.0])
def test_a_slow_component_gets_three_of_its_intervals(period_s: float) -> None:
    known = Components()
    for number in range(4):
        known.merge(message_of(("disk", 0)), number * period_s)
    assert levels(known.merge(message_of(("gps", 0)), 5.9 * period_s))["disk"] == 0
    assert levels(known.merge(message_of(("gps", 0)), 6.1 * period_s))["disk"] == 3
    assert levels(known.merge(message_of(("gps", 0)), 8.9 * period_s))["disk"] == 3


def test_reports_out_of_turn_do_not_make_an_interval() -> None:
    known = Components()
    for at_s in (0.0, 0.1, 30.0, 32.0, 60.0, 60.5):
        assert levels(known.merge(message_of(("disk", 0)), at_s)) == {"disk": 0}
    assert levels(known.merge(message_of(("gps", 0)), 90.0))["disk"] == 0
    assert levels(known.merge(message_of(("gps", 0)), 160.0))["disk"] == 3


def test_what_reported_once_is_not_held_to_an_interval_and_two_reports_are_hardly_one() -> None:
    known = Components()
    known.merge(message_of(("light", 0), ("start", 0)), 0.0)
    known.merge(message_of(("start", 0)), 1.0)
    assert levels(known.merge(message_of(("gps", 0)), 1.0 + ONE_INTERVAL_S)) == {"light": 0, "start": 0, "gps": 0}
    assert levels(known.merge(message_of(("gps", 0)), 2.0 + ONE_INTERVAL_S)) == {"light": 0, "start": 3, "gps": 0}
    assert levels(known.merge(message_of(("gps", 0)), FORGOTTEN_UNKNOWN_S)) == {"light": 0, "gps": 0}
    assert levels(known.merge(message_of(("gps", 0)), FORGOTTEN_UNKNOWN_S + 1.0)) == {"gps": 0}


def test_a_component_whose_interval_is_not_known_shows_when_it_reported() -> None:
    known = Components()
    known.merge(message_of(("light", 0), ("gps", 0)), 3.0)
    found = {one.name: one.once_s for one in known.merge(message_of(("gps", 0)), 4.0).components}
    assert found == {"light": 3.0, "gps": None}
    found = {one.name: one.once_s for one in known.merge(message_of(("light", 1)), 1200.0).components}
    assert found == {"light": None}


def test_the_silence_of_all_is_explained_by_the_one_that_reports_most_often() -> None:
    known = Components()
    assert known.horizon_s(0.0) == SELDOM_S
    for at_s in (0.0, 30.0, 60.0):
        known.merge(message_of(("disk", 0)), at_s)
    assert known.horizon_s(60.0) == 90.0
    for at_s in (61.0, 62.0, 63.0):
        known.merge(message_of(("ekf", 0)), at_s)
    assert known.horizon_s(63.0) == TOPIC_SILENT_S
    assert known.horizon_s(80.0) == 90.0  # the frequent one has fallen silent itself


def test_a_new_component_takes_the_place_of_the_one_that_was_silent_longest() -> None:
    known = Components()
    for i in range(MOST):
        known.merge(message_of((f"part {i}", 0)), float(i) / MOST)
    known.merge(message_of(("part 0", 0)), 2.0)
    found = levels(known.merge(message_of(("brake", 2)), 3.0))
    assert found["brake"] == 2
    assert "part 0" in found
    assert "part 1" not in found


def test_endless_names_do_not_fill_the_memory() -> None:
    known = Components()
    for i in range(3):
        merged = known.merge(message_of(*((f"part {i} {j}", 0) for j in range(MOST))), float(i))
    assert len(merged.components) == MOST
    assert {component.name[:6] for component in merged.components} == {"part 2"}


def test_a_clock_that_goes_back_harms_nothing() -> None:
    known = Components()
    known.merge(message_of(("laser", 2)), 100.0)
    assert levels(known.merge(message_of(("gps", 0)), 50.0)) == {"gps": 0}


@pytest.mark.parametrize("period_s", [1.0, 30.0, 120.0])
def test_between_two_reports_the_value_does_not_age(period_s: float) -> None:
    state = State()
    for number in range(40):  # two components, so that the topic as a whole has no steady rate
        state.receive("diagnostics", message_of(("disk", 0)), number * period_s)
        state.receive("diagnostics", message_of(("fan", 0)), (number + 0.2) * period_s)
    reading = state.get("diagnostics")
    assert reading is not None
    assert reading.freshness(39.95 * period_s) == "fresh"
    assert reading.freshness(39.2 * period_s + max(10.1, 3.1 * period_s)) == "stale"


def test_a_first_report_whose_interval_is_not_known_ages_soon() -> None:
    state = State()
    state.receive("diagnostics", message_of(("disk", 0)), 0.0)
    reading = state.get("diagnostics")
    assert reading is not None
    assert reading.freshness(3.1) == reading.freshness(SELDOM_S - 1.0) == "ageing"
    assert reading.freshness(SELDOM_S + 1.0) == "stale"


def test_diagnostics_that_came_each_second_age_after_three() -> None:
    state = State()
    for number in range(6):
        state.receive("diagnostics", message_of(("ekf", 0), *([("disk", 0)] if number % 5 == 0 else [])), float(number))
    reading = state.get("diagnostics")
    assert reading is not None
    assert [reading.freshness(5.0 + age_s) for age_s in (2.9, 3.1, 9.9, 10.1)] == ["fresh", "ageing", "ageing", "stale"]


def test_the_operators_rate_counts_for_diagnostics_too() -> None:
    state = State({"diagnostics": 2.0})
    for number in range(6):
        state.receive("diagnostics", message_of(("disk", 0)), number * 30.0)
    reading = state.get("diagnostics")
    assert reading is not None
    assert (reading.horizon_s, reading.period_s) == (5.0, 0.5)
