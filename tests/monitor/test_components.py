"""Several nodes publish diagnostics: none hides another, silence turns stale, what is gone is forgotten."""

from __future__ import annotations

from monitor.components import MOST, Components
from monitor.values import Component, Diagnostics


def said(*rows: tuple[str, int]) -> Diagnostics:
    return Diagnostics(components=tuple(Component(name=name, level=level, message="") for name, level in rows))


def levels(diagnostics: Diagnostics) -> dict[str, int]:
    return {component.name: component.level for component in diagnostics.components}


def test_one_nodes_report_does_not_hide_anothers_error() -> None:
    known = Components()
    known.merge(said(("laser", 2)), 0.0)
    assert levels(known.merge(said(("gps", 0)), 0.5)) == {"laser": 2, "gps": 0}


def test_the_newest_word_counts() -> None:
    known = Components()
    known.merge(said(("laser", 2)), 0.0)
    assert levels(known.merge(said(("laser", 0)), 1.0)) == {"laser": 0}


def test_a_component_that_falls_silent_turns_stale_and_is_forgotten() -> None:
    known = Components()
    known.merge(said(("laser", 0), ("gps", 0)), 0.0)
    assert levels(known.merge(said(("gps", 0)), 5.0)) == {"laser": 0, "gps": 0}
    assert levels(known.merge(said(("gps", 0)), 5.1)) == {"laser": 3, "gps": 0}
    assert levels(known.merge(said(("gps", 0)), 61.0)) == {"gps": 0}


def test_a_slow_component_gets_three_of_its_periods() -> None:
    known = Components()
    for at_s in (0.0, 10.0):
        known.merge(said(("disk", 0)), at_s)
    assert levels(known.merge(said(("gps", 0)), 39.0))["disk"] == 0
    assert levels(known.merge(said(("gps", 0)), 41.0))["disk"] == 3


def test_endless_names_do_not_fill_the_memory() -> None:
    known = Components()
    for i in range(3 * MOST):
        merged = known.merge(said((f"part {i}", 0)), 0.0)
    assert len(merged.components) == MOST


def test_a_clock_that_goes_back_harms_nothing() -> None:
    known = Components()
    known.merge(said(("laser", 2)), 100.0)
    assert levels(known.merge(said(("gps", 0)), 50.0)) == {"gps": 0}
