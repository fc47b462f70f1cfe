"""A signal that hovers at its limit: ten minutes of a sensor's own noise around a threshold are at most three alarms.

The short rounds show the same in a minute each; what is at its limit must be told at least once, or nothing is tried.
"""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import pytest

from monitor import catalog
from monitor.catalog import CHECKS, AllLimits
from monitor.link import LinkFacts
from monitor.runner import Monitor
from monitor.state import State
from monitor.values import Bearing, Distance, Effort, GpsFix, Level, MotionCommand, Twist, Value
from tests.monitor.drive import Drive
from tests.monitor.test_corridor import sweep

AT_MOST = 3
QUANTUM = 100 / 255


@dataclass(frozen=True)
class Case:
    """One threshold: the signals that are published and what they say at a moment, by the dice of a sensor."""

    alarm: str
    hz: dict[str, float]
    say: Callable[[random.Random, float], dict[str, Value]]
    limits: dict[str, float]
    rates: Callable[[random.Random, float], dict[str, float]] | None = None
    begins_s: float = 0.0  # before that, `rest` is said
    rest: Callable[[random.Random, float], dict[str, Value]] | None = None


def swing(now_s: float, period_s: float = 40.0) -> float:
    """The value itself wanders slowly about its limit, between −1 and 1."""
    return math.sin(2 * math.pi * now_s / period_s)


def gauss(dice: random.Random, middle: float, sigma: float, now_s: float) -> float:
    return dice.gauss(middle + 3 * sigma * swing(now_s), sigma)


def speed(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {"speed": Twist(speed_mps=gauss(dice, 11.0, 0.03, now_s))}


def pedals(dice: random.Random, now_s: float) -> dict[str, Value]:
    pressed = Effort(percent=QUANTUM * round(gauss(dice, 2.0, 0.2, now_s) / QUANTUM))
    return {"brake": pressed, "accelerator": Effort(percent=20.0)}


def obstacle(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {
        "speed": Twist(speed_mps=0.0),
        "scan": sweep([(gauss(dice, 5.0, 0.03, now_s), 0.0, 0.9), (60.0, 0.0, 50.0)]),
    }


def nearest(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {
        "speed": Twist(speed_mps=0.0),
        "distance": Distance(distance_m=gauss(dice, 5.0, 0.03, now_s)),
        "bearing": Bearing(bearing_rad=0.0),
    }


def stopping(dice: random.Random, now_s: float) -> dict[str, Value]:
    """Following at just the distance that the car needs to stop from 4 m/s."""
    return {
        "speed": Twist(speed_mps=dice.gauss(4.0, 0.012)),
        "distance": Distance(distance_m=gauss(dice, 4.0 + 16.0 / 6.0, 0.03, now_s)),
        "bearing": Bearing(bearing_rad=0.0),
    }


def north(metres: float, sigma_m: float | None = None) -> GpsFix:
    return GpsFix(lat_deg=32.0 + metres / 110_900, lon_deg=-110.0, covariance_type=2, sigma_m=sigma_m)


def stops(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {"speed": Twist(speed_mps=0.0), "position": north(dice.gauss(0.0, 0.05))}


def drift(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {"speed": Twist(speed_mps=0.0), "position": north(gauss(dice, 4.3 * 2.5, 0.2, now_s))}


def runs_ahead(dice: random.Random, now_s: float) -> dict[str, Value]:
    """The position makes 3 m/s more than the wheels, give or take."""
    return {"speed": Twist(speed_mps=5.0), "position": north(8.0 * now_s + 2.0 * swing(now_s) + dice.gauss(0.0, 0.01))}


def stated_error(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {"position": north(0.1 * now_s, gauss(dice, 10.0, 0.2, now_s))}


def half_blind(dice: random.Random, now_s: float) -> dict[str, Value]:
    scan = sweep([(60.0, 0.0, 50.0)])
    ahead = np.arange(76, 105)
    lost = dice.sample(range(ahead.size), min(ahead.size, max(0, round(gauss(dice, 0.9 * ahead.size, 0.7, now_s)))))
    scan.ranges_m[ahead[lost]] = np.nan
    return {"scan": scan}


def sloshing(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {"speed": Twist(speed_mps=4.0), "fuel": Level(value=gauss(dice, 10.0, 0.3, now_s), unit="%")}


def ordered(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {
        "speed": Twist(speed_mps=dice.gauss(5.0, 0.012)),
        "command": MotionCommand(speed_mps=gauss(dice, 3.5, 0.03, now_s), tyre_angle_rad=None),
    }


def creeps(dice: random.Random, now_s: float) -> dict[str, Value]:
    """The wheels' noise where standing begins."""
    return {"speed": Twist(speed_mps=abs(gauss(dice, 0.10, 0.02, now_s)))}


def usual(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {}


CASES = {
    "speed": Case("speed_limit", {"speed": 20.0}, speed, {}),
    "pedals": Case("pedals", {"brake": 20.0, "accelerator": 20.0}, pedals, {}),
    "obstacle": Case("obstacle", {"speed": 20.0, "scan": 25.0}, obstacle, {}),
    "nearest object": Case("obstacle_nearest", {"speed": 20.0, "distance": 30.0, "bearing": 30.0}, nearest, {}),
    "stopping distance": Case("obstacle_nearest", {"speed": 20.0, "distance": 30.0, "bearing": 30.0}, stopping, {}),
    "GPS drift": Case("gps_drift", {"speed": 20.0, "position": 10.0}, drift, {}, begins_s=8.0, rest=stops),
    "GPS jump": Case("gps_jump", {"speed": 20.0, "position": 10.0}, runs_ahead, {}),
    "GPS error": Case("gps_fix", {"position": 10.0}, stated_error, {}),
    "blind laser": Case("laser_blind", {"scan": 25.0}, half_blind, {}),
    "fuel": Case("fuel_low", {"speed": 20.0, "fuel": 1.0}, sloshing, {}),
    "braking ordered": Case("no_response", {"speed": 20.0, "command": 20.0}, ordered, {}),
    "standing": Case("not_moving", {"speed": 20.0}, creeps, {}),
    "rate": Case(
        "signal_slow.brake",
        {"speed": 20.0, "brake": 20.0},
        usual,
        {"signals.brake_hz": 20.0},
        rates=lambda dice, now_s: {"brake": gauss(dice, 18.0, 0.2, now_s)},
    ),
    "all rates": Case(
        "all_slow",
        dict.fromkeys(("speed", "brake", "accelerator", "steering"), 20.0),
        usual,
        {f"signals.{name}_hz": 20.0 for name in ("speed", "brake", "accelerator", "steering")},
        rates=lambda dice, now_s: dict.fromkeys(
            ("speed", "brake", "accelerator", "steering"), gauss(dice, 18.0, 0.2, now_s)
        ),
    ),
}

# Checks without a threshold that a noisy measurement could hover about, each with the reason.
WITHOUT = {
    "signal_stale": "a message comes or it does not",
    "signal_frozen": "a value is the same or it is not",
    "scan_shape": "whole beams",
    "gps_quality": "known or not",
    "diagnostics_error": "levels",
    "diagnostics_warn": "levels",
    "car_silent": "messages come or not",
    "connect_failed": "the link's own word",
    "link_lost": "the link's own word",
    "no_message": "messages come or not",
    "log_not_kept": "the disk's own word",
    "paused_long": "time only grows",
    "clock_jump": "steps, told for ten seconds each",
    "clock_offset": "tests/monitor/test_hovering.py::test_a_clock_about_its_limit",
    "phone_car": "tests/monitor/checks/test_phone.py",
    "phone_missing": "tests/monitor/checks/test_phone.py",
    "phone_tracks": "tests/monitor/checks/test_phone.py",
}


def test_every_check_hovers_or_cannot() -> None:
    there = {check.id.partition(".")[0] for check in CHECKS}
    hovering = {case.alarm.partition(".")[0] for case in CASES.values()}
    assert hovering | WITHOUT.keys() == there
    assert not hovering & WITHOUT.keys()


class Hover(Drive):
    """A car that says what the dice of a case give it."""

    def __init__(self, case: Case, seed: int = 1) -> None:
        super().__init__(case.hz, Monitor(limits=catalog.changed(AllLimits(), case.limits)))
        self.state.expect({name.partition(".")[2][:-3]: hz for name, hz in case.limits.items()})
        self.case, self.dice = case, random.Random(seed)

    def _value(self, name: str) -> Value:
        case, now_s = self.case, self.now_s
        if case.rates is not None:
            self.hz |= case.rates(self.dice, now_s)
        said = (case.rest if case.rest is not None and now_s < case.begins_s else case.say)(self.dice, now_s)
        return said.get(name) or super()._value(name)


def announced(case: Case, seconds: float) -> list[str]:
    """The announcements of the check; it is the only one that may speak, but for what its own case brings along."""
    told = Hover(case).open().to(seconds).announced
    return [alarm for alarm in told if alarm == case.alarm]


@pytest.mark.parametrize(
    ("case", "seconds"),
    [
        pytest.param(case, seconds, id=f"{name}, {seconds:.0f} s", marks=marks)
        for name, case in CASES.items()
        for seconds, marks in ((60.0, ()), (600.0, (pytest.mark.soak,)))
    ],
)
def test_at_its_limit_a_signal_is_told_at_most_three_times(case: Case, seconds: float) -> None:
    told = announced(case, seconds)
    assert 0 < len(told) <= AT_MOST


@pytest.mark.parametrize("seconds", [60.0, pytest.param(600.0, marks=pytest.mark.soak)])
@pytest.mark.parametrize("late", [False, True], ids=["offset", "late"])
def test_a_clock_about_its_limit(seconds: float, late: bool) -> None:
    """clock_offset: 5 s from the server's time, or messages 2 s later than usual, give or take a radio's jitter."""
    dice, monitor, state, told = random.Random(1), Monitor(), State(), []
    state.link(LinkFacts(phase="monitoring", connected_s=0.0, wall_zero_s=1.79e9, published=frozenset({"position"})))
    for n in range(round(10 * seconds)):
        now_s = n / 10
        behind_s = min(2.0, 0.1 * max(0.0, now_s - 6.0)) if late else 5.0
        behind_s += 0.1 * swing(now_s) + dice.expovariate(50.0)
        state.receive("position", north(0.01 * n), now_s, 1.79e9 + now_s - behind_s)
        told += [t.alarm_id for t in monitor.step(state.snapshot(now_s)) if t.announces]
    assert set(told) == {"clock_offset"}
    assert len(told) <= AT_MOST
