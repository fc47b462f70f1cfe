"""Standing while watched: the report's case 8."""

from __future__ import annotations

import pytest

from monitor.shell_facts import LinkFacts
from monitor.state import State
from monitor.values import Twist
from tests.monitor.checks.known import ask


def driven(*spans: tuple[float, float]) -> State:
    """A state after spans of (seconds, m/s) at 20 Hz."""
    state, at_s = State(), 0.0
    state.link(LinkFacts(phase="monitoring", connected_s=0.0))
    for seconds, speed_mps in spans:
        for _ in range(round(seconds * 20)):
            at_s += 0.05
            state.receive("speed", Twist(speed_mps=speed_mps, yaw_rate_radps=None), at_s)
    return state


@pytest.mark.parametrize(
    ("spans", "verdict"),
    [
        pytest.param(((9.9, 0.0),), "ok", id="not yet 10 s"),
        pytest.param(((10.1, 0.0),), "fault", id="just over 10 s"),
        pytest.param(((20.0, 0.084),), "fault", id="wheel noise at rest is standing"),
        pytest.param(((20.0, 0.2),), "ok", id="creeping is not standing"),
        pytest.param(((20.0, 0.0), (1.0, 0.5)), "ok", id="moves again"),
        pytest.param(((20.0, 0.0), (1.0, 0.2)), "fault", id="a twitch below 0.3 m/s is no moving"),
        pytest.param(((5.0, 3.0), (10.2, 0.0)), "fault", id="stopped and stays"),
    ],
)
def test_verdict(spans: tuple[tuple[float, float], ...], verdict: str) -> None:
    now_s = sum(seconds for seconds, _ in spans)
    assert ask("not_moving", driven(*spans).snapshot(now_s)).verdict == verdict


def test_silence_is_not_standing() -> None:
    assert ask("not_moving", driven((20.0, 0.0)).snapshot(23.0)).verdict == "unknown"
