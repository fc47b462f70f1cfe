"""Diagnostics: each level at its own alarm, each component a cause, texts that stay short."""

from __future__ import annotations

import pytest

from monitor.values import Component, Diagnostics
from tests.monitor.checks.known import ask, check_of, known


def message_of(*rows: tuple[str, int]) -> Diagnostics:
    return Diagnostics(components=tuple(Component(name=name, level=level, message="why") for name, level in rows))


@pytest.mark.parametrize(
    ("levels", "error", "warn"),
    [
        ((), "ok", "ok"),
        ((0, 0), "ok", "ok"),
        ((0, 1), "ok", "fault"),
        ((0, 2), "fault", "ok"),
        ((3,), "fault", "ok"),
        ((1, 2, 3), "fault", "fault"),
    ],
    ids=str,
)
def test_verdict(levels: tuple[int, ...], error: str, warn: str) -> None:
    snapshot = known(diagnostics=message_of(*((f"part {i}", level) for i, level in enumerate(levels))))
    assert ask("diagnostics_error", snapshot).verdict == error
    assert ask("diagnostics_warn", snapshot).verdict == warn


def test_components_are_the_causes_and_the_worst_is_named_first() -> None:
    finding = ask("diagnostics_error", known(diagnostics=message_of(("laser", 3), ("gps", 2), ("wheel", 0))))
    assert finding.causes == ("gps", "laser")
    assert finding.text == "gps error: why; laser stale: why"


def test_many_components_are_counted() -> None:
    finding = ask("diagnostics_error", known(diagnostics=message_of(*((f"part {i}", 2) for i in range(200)))))
    assert finding.text.endswith("and 197 more")
    assert len(finding.text) < 500
    assert len(finding.brief) <= 20


def test_a_long_name_does_not_break_the_tile() -> None:
    finding = ask("diagnostics_error", known(diagnostics=message_of(("x" * 5000, 2))))
    assert len(finding.brief) <= 20
    assert len(finding.text) < 200


@pytest.mark.parametrize(
    ("reported", "text"),
    [
        ((None, None), "2 components report"),
        ((None, -600.0), "2 components report, 1 of them once, 600 s ago"),
        ((-600.0, -20.0, None), "3 components report, 2 of them once, up to 600 s ago"),
    ],
)
def test_a_level_that_was_reported_once_shows_how_old_it_is(reported: tuple[float | None, ...], text: str) -> None:
    components = tuple(
        Component(name=str(i), level=0, message="", once_s=None if since_s is None else 100.0 + since_s)
        for i, since_s in enumerate(reported)
    )
    finding = ask("diagnostics_error", known(100.0, diagnostics=Diagnostics(components=components)))
    assert (finding.verdict, finding.text) == ("ok", text)


def test_not_published_and_silent() -> None:
    assert not ask("diagnostics_error", known()).applies
    assert ask("diagnostics_error", known(age_s=2.0, diagnostics=message_of(("gps", 2)))).verdict == "unknown"


def test_errors_interrupt_and_warnings_only_stand_in_the_list() -> None:
    assert check_of("diagnostics_error").alarm.place == "snackbar"
    assert check_of("diagnostics_warn").alarm.place == "list"
