"""The last minute of a check: steps in order, nothing where it was not checked, bounded."""

from __future__ import annotations

import pytest

from monitor.check import Finding, Quantity, fault, ok, unknown
from monitor.trends import SPAN, STEP_S, CheckMinute


def measured(value: float, limit: float | None = 11.0) -> Finding:
    return ok(
        "OK",
        measured=Quantity(label="Speed", value=value, unit="m/s"),
        limit=None if limit is None else Quantity(label="Limit", value=limit, unit="m/s"),
    )


def noted(*findings: Finding, begin_s: float = 100.05) -> CheckMinute:
    minute = CheckMinute()
    for step, finding in enumerate(findings):
        minute.note({"speed": finding}, begin_s + step * STEP_S)
    return minute


def test_each_step_stands_in_its_place_and_what_was_not_checked_is_empty() -> None:
    course = noted(measured(1.0), measured(2.0, None), unknown("stale"), ok("OK"), measured(5.0, 9.0)).course("speed")
    assert course.values == (1.0, 2.0, None, None, 5.0)
    assert course.limits == (11.0, None, None, None, 9.0)


def test_within_a_step_only_the_first_look_counts() -> None:
    minute = noted(measured(1.0))
    minute.note({"speed": measured(7.0)}, 100.1)
    assert minute.course("speed").values == (1.0,)


def test_steps_without_a_look_are_empty() -> None:
    minute = noted(measured(1.0))
    minute.note({"speed": measured(4.0)}, 100.05 + 3 * STEP_S)
    assert minute.course("speed").values == (1.0, None, None, 4.0)


@pytest.mark.parametrize("at_s", [99.0, 100.05 + (SPAN + 1) * STEP_S])
def test_a_clock_that_goes_back_or_a_missed_minute_begins_anew(at_s: float) -> None:
    minute = noted(measured(1.0), measured(2.0))
    minute.note({"speed": measured(3.0)}, at_s)
    assert minute.course("speed").values == (3.0,)


def test_a_minute_and_no_more() -> None:
    course = noted(*(measured(float(n)) for n in range(SPAN + 7))).course("speed")
    assert (len(course.values), course.values[0], course.values[-1]) == (SPAN, 7.0, SPAN + 6.0)


def test_since_when_it_answers_so() -> None:
    minute = noted(measured(1.0), measured(2.0), fault("bad"), fault("worse"))
    assert minute.course("speed").since_s == pytest.approx(100.05 + 2 * STEP_S)
    assert minute.course("another").since_s is None
