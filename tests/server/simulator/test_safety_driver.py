"""The safety driver of the simulated car before the judge, in virtual time: found when it truly was, and no more."""

from __future__ import annotations

from typing import Any

import pytest

from monitor import catalog
from monitor.catalog import AllLimits
from monitor.driving_summary import DrivingSummary
from monitor.state import State
from server.simulator.car import SimulatedCar
from server.simulator.scenarios import planned
from tests.server.judged import judged

LIMITS = catalog.changed(AllLimits(), {"steering.tyre_rad_per_unit": -0.00536})
SECONDS = 24.0


def summary_of(scenario: str, *, seconds: float = SECONDS) -> DrivingSummary:
    found = DrivingSummary()

    def crew(state: State, now_s: float) -> None:
        found.step(state.glance(now_s), LIMITS)

    judged([planned(scenario)], seconds, crew=crew)
    return found


def truth_of(scenario: str) -> list[dict[str, Any]]:
    car = SimulatedCar(seed=1, plan=(planned(scenario),))
    for _ in car.steps():
        if car.elapsed_s > SECONDS:
            break
    truth: list[dict[str, Any]] = car.state()["truth"]["interventions"]
    return truth


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "kinds"),
    [("manual-takeover@8+8", ["to_manual"]), ("driver-brakes@8+3", ["brake"]), ("mode-flaps@8+8", [])],
    ids=["manual-takeover", "driver-brakes", "mode-flaps"],
)
def test_an_intervention_is_found_when_it_truly_was(scenario: str, kinds: list[str]) -> None:
    truth, found = truth_of(scenario), summary_of(scenario)
    assert [one["kind_of"] for one in truth] == kinds
    assert [one.kind_of for one in found.interventions] == kinds
    for true, one in zip(truth, found.interventions, strict=True):
        assert one.at_s == pytest.approx(true["at_s"], abs=0.2)
        assert one.speed_mps == pytest.approx(true["speed_mps"], abs=0.6)
        assert one.initiated_by == "driver"
        assert one.lat_deg is not None


@pytest.mark.slow
@pytest.mark.parametrize("scenario", ["controller-silent@8+8", "obstacle@8"], ids=str)
def test_what_the_car_does_by_itself_is_no_intervention(scenario: str) -> None:
    found = summary_of(scenario, seconds=28.0)
    assert found.interventions == []
    assert [change.mode for change in found.changes] == ["autonomous"]
