"""What is forgotten of sources that are compared: with another unit, another link, and a clock that goes back."""

from __future__ import annotations

import pytest

from monitor.state import LinkFacts, State
from monitor.values import GpsFix, Twist

FIX = GpsFix(lat_deg=32.0, lon_deg=-110.0, alt_m=None, status=0, sigma_m=1.0)


def driven(state: State, until_s: float) -> State:
    """Ten speeds a second, and the fixes of a second receiver."""
    for tenth in range(round(until_s * 10)):
        state.receive("speed", Twist(speed_mps=5.0, yaw_rate_radps=None), tenth / 10)
        state.receive_other("position", "/gps/second", FIX, tenth / 10, None)
    return state


def opened(at_s: float) -> LinkFacts:
    return LinkFacts(phase="monitoring", since_s=at_s, connected_s=at_s)


def test_speeds_of_another_unit_make_no_pace() -> None:
    state = driven(State(), 6.0)
    pace = state.snapshot(6.0).compared.stated["speed"]
    assert pace is not None
    assert pace.mps == pytest.approx(5.0)
    state.forget("speed")
    assert "speed" not in state.snapshot(6.0).compared.stated
    assert len(state.snapshot(6.0).compared.of("position")) == 1


def test_over_another_link_further_sources_come_anew() -> None:
    state = State()
    state.link(opened(0.0))
    assert len(driven(state, 6.0).snapshot(6.0).compared.of("position")) == 1
    state.link(opened(7.0))
    assert state.snapshot(7.0).compared.of("position") == ()


def test_a_clock_that_goes_back_leaves_no_age_of_a_further_source() -> None:
    state = driven(State(), 6.0)
    assert len(state.snapshot(6.0).compared.of("position")) == 1
    assert state.snapshot(2.0).compared.of("position") == ()
