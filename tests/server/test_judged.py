"""The simulated car before the judge: a fault raises its own alarm, once, in time; a healthy drive raises none."""

from __future__ import annotations

import pytest

from server.simulator.car import SimulatedCar
from server.simulator.scenarios import planned
from tests.server.judged import judged

FAULT_AT_S = 12.0

# Scenario, what it raises in this order, and how soon the first of them.
RAISES = [
    ("pedal-conflict", ["pedals"], 0.5),
    ("gps-jump", ["gps_jump"], 0.5),
    ("blind-laser", ["laser_blind"], 1.5),
    ("speeding", ["speed_limit"], 8.0),  # the car must gain speed first
    ("obstacle", ["obstacle"], 1.0),
    ("gps-drift", ["gps_drift", "not_moving"], 16.0),  # it stops first, and then stands
    ("stale-gps", ["signal_stale.position"], 1.5),
    ("silent-scan", ["signal_stale.scan"], 1.5),
    ("slow-rate", ["signal_slow.speed"], 8.0),
    ("diagnostics-error", ["diagnostics_error"], 1.5),
    ("all-silent", ["car_silent"], 1.5),
]
QUICK = 3  # of them in the ordinary run, the rest in the long one


@pytest.mark.parametrize(
    ("scenario", "alarms", "within_s"),
    [
        pytest.param(*row, id=row[0], marks=[pytest.mark.slow] if place < QUICK else [pytest.mark.soak])
        for place, row in enumerate(RAISES)
    ],
)
def test_a_fault_raises_its_own_alarm_once_and_in_time(scenario: str, alarms: list[str], within_s: float) -> None:
    raised = judged(SimulatedCar(seed=1, plan=[planned(f"{scenario}@{FAULT_AT_S:g}")]), 50.0 if alarms[1:] else 35.0)
    assert [one.alarm for one in raised] == alarms
    assert FAULT_AT_S <= raised[0].at_s <= FAULT_AT_S + within_s


@pytest.mark.parametrize(
    ("seed", "seconds"),
    [
        pytest.param(3, 60.0, marks=[pytest.mark.slow]),
        pytest.param(1, 600.0, marks=[pytest.mark.soak, pytest.mark.timeout(1200)]),
        pytest.param(2, 600.0, marks=[pytest.mark.soak, pytest.mark.timeout(1200)]),
    ],
)
def test_a_healthy_drive_raises_none(seed: int, seconds: float) -> None:
    assert judged(SimulatedCar(seed=seed), seconds) == []
