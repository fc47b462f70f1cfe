"""Brake and accelerator together: both sides of the limit, the deadband, what is not known."""

from __future__ import annotations

import math

import pytest

from monitor.values import Effort
from tests.monitor.checks.known import ask, check_of, known

QUANTUM = 100 / 255


@pytest.mark.parametrize(
    ("brake", "accelerator", "was_active", "verdict"),
    [
        pytest.param(0.0, 0.0, False, "ok", id="nothing pressed"),
        pytest.param(22.0, 0.0, False, "ok", id="brake alone"),
        pytest.param(0.0, 22.0, False, "ok", id="accelerator alone"),
        pytest.param(22.0, 22.0, False, "fault", id="both"),
        pytest.param(2.0, 22.0, False, "ok", id="brake at the limit"),
        pytest.param(2.01, 22.0, False, "fault", id="brake just above"),
        pytest.param(22.0, 2.0, False, "ok", id="accelerator at the limit"),
        pytest.param(5 * QUANTUM, 5 * QUANTUM, False, "ok", id="five quanta are below 2 %"),
        pytest.param(3 * QUANTUM, 5 * QUANTUM, True, "fault", id="held by the deadband"),
        pytest.param(2 * QUANTUM, 22.0, True, "ok", id="cleared below the deadband"),
        pytest.param(math.nan, 22.0, False, "unknown", id="brake NaN"),
        pytest.param(22.0, math.nan, True, "unknown", id="accelerator NaN, while active"),
        pytest.param(math.inf, 22.0, False, "unknown", id="+Inf"),
        pytest.param(-math.inf, 22.0, False, "unknown", id="−Inf"),
        pytest.param(-5.0, 22.0, False, "ok", id="negative"),
        pytest.param(None, 22.0, False, "unknown", id="brake never came"),
        pytest.param(22.0, None, False, "unknown", id="accelerator never came"),
    ],
)
def test_verdict(brake: float | None, accelerator: float | None, was_active: bool, verdict: str) -> None:
    snapshot = known(
        brake=None if brake is None else Effort(percent=brake),
        accelerator=None if accelerator is None else Effort(percent=accelerator),
    )
    assert ask("pedals", snapshot, was_active=was_active).verdict == verdict


def test_stale_pedals_are_not_checked() -> None:
    snapshot = known(age_s=1.5, brake=Effort(percent=50.0), accelerator=Effort(percent=50.0))
    assert ask("pedals", snapshot).verdict == "unknown"


def test_the_text_names_both_and_the_alarm_is_the_reports_snackbar() -> None:
    finding = ask("pedals", known(brake=Effort(percent=31.0), accelerator=Effort(percent=12.0)))
    assert "31 %" in finding.text
    assert "12 %" in finding.text
    spec = check_of("pedals").alarm
    assert (spec.place, spec.priority, spec.on_delay_s, spec.off_delay_s) == ("snackbar", "warning", 0.3, 1.0)
