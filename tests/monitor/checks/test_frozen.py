"""Signals whose messages never change: which may, which may not, and where it is unknown."""

from __future__ import annotations

import math
from dataclasses import replace

import pytest

from monitor.check import Finding, Verdict
from monitor.runner import Monitor
from monitor.shell_facts import LinkFacts
from monitor.signals import SIGNALS
from monitor.state import State
from monitor.values import (
    Acceleration,
    Bearing,
    Component,
    Diagnostics,
    Distance,
    Effort,
    GpsFix,
    Heading,
    Level,
    MotionCommand,
    Number,
    Odometry,
    Steering,
    Twist,
    Value,
)
from tests.monitor.checks.known import ask, check_of, known
from tests.monitor.drive import sweep

OK, FAULT, UNKNOWN = Verdict.OK, Verdict.FAULT, Verdict.UNKNOWN
BEAMS = [5.0 + 0.01 * beam for beam in range(60)]

RESTING: dict[str, Value] = dict.fromkeys(SIGNALS, Number(value=12.0)) | {
    "speed": Twist(speed_mps=4.0),
    "acceleration": Acceleration(acceleration_mps2=0.1),
    "brake": Effort(percent=0.0),
    "accelerator": Effort(percent=0.0),
    "steering": Steering(percent=-4.3),
    "distance": Distance(distance_m=6.1),
    "bearing": Bearing(bearing_rad=0.1),
    "position": GpsFix(lat_deg=32.0, lon_deg=-110.0),
    "odometry": Odometry(x_m=1.0, y_m=2.0),
    "heading": Heading(heading_deg=90.0),
    "scan": sweep(BEAMS),
    "diagnostics": Diagnostics(components=(Component(name="gps", level=0, message="OK"),)),
    "command": MotionCommand(speed_mps=4.0, tyre_angle_rad=None),
    "fuel": Level(value=50.0, unit="%"),
}


def noisy(value: Value, n: int) -> Value:
    match value:
        case Twist():
            return replace(value, speed_mps=value.speed_mps + 0.001 * n)
        case Acceleration():
            return replace(value, acceleration_mps2=value.acceleration_mps2 + 0.001 * n)
        case Heading():
            return replace(value, heading_deg=value.heading_deg + 0.001 * n)
    return value


class Ride:
    """Wheels at 20 Hz, and one signal with them."""

    def __init__(self, signal: str) -> None:
        self.signal, self.state, self.n = signal, State(), 0
        self.state.link(LinkFacts(phase="monitoring", connected_s=0.0))

    def go(self, seconds: float, value: Value, *, speed_mps: float = 4.0, stamp_s: float | None = None) -> Ride:
        for _ in range(round(seconds * 20)):
            self.n += 1
            if self.signal != "speed":
                self.state.receive("speed", Twist(speed_mps=speed_mps + 0.001 * (self.n % 7)), 0.05 * self.n)
            self.state.receive(self.signal, value, 0.05 * self.n, stamp_s)
        return self

    def vary(self, seconds: float, value: Value, *, every: int = 1) -> Ride:
        for _ in range(round(seconds * 20)):
            self.go(0.05, noisy(value, (self.n + 1) // every))
        return self

    def ask(self, **limits: float) -> Finding:
        return ask(f"signal_frozen.{self.signal}", self.state.snapshot(0.05 * self.n), **limits)


NUMBERS = [name for name, value in RESTING.items() if isinstance(value, Number)]
MAY_REST = ["brake", "accelerator", "steering", "distance", "bearing", "diagnostics", "command", "fuel", *NUMBERS]
BY_MOTION = ["position", "odometry", "scan"]
BY_NOISE = ["speed", "acceleration", "heading"]


def test_each_signal_is_of_one_kind() -> None:
    assert sorted(MAY_REST + BY_MOTION + BY_NOISE) == sorted(SIGNALS)


@pytest.mark.parametrize("signal", MAY_REST)
def test_what_may_rest_is_never_called_frozen_by_its_value(signal: str) -> None:
    found = Ride(signal).go(60.0, RESTING[signal]).ask()
    assert (found.verdict, found.applies) == (UNKNOWN, False)


@pytest.mark.parametrize("signal", SIGNALS)
def test_a_stamp_that_stands_freezes_any_signal_even_at_rest(signal: str) -> None:
    ride = Ride(signal).go(1.9, RESTING[signal], speed_mps=0.0, stamp_s=1e9)
    assert ride.ask().verdict is not FAULT
    found = ride.go(0.2, RESTING[signal], speed_mps=0.0, stamp_s=1e9).ask()
    assert found.verdict is FAULT
    assert "one stamp for 2." in found.text
    assert found.causes == (signal,)
    assert ride.go(0.05, RESTING[signal], speed_mps=0.0, stamp_s=1e9 + 1).ask().verdict is not FAULT


def test_three_slow_messages_with_one_stamp_are_not_yet_frozen() -> None:
    state = State()
    state.link(LinkFacts(phase="monitoring", connected_s=0.0))
    verdicts = []
    for second in range(5):
        state.receive("diagnostics", RESTING["diagnostics"], float(second), 1e9)
        verdicts.append(ask("signal_frozen.diagnostics", state.snapshot(float(second))).verdict)
    assert verdicts == [OK, OK, OK, FAULT, FAULT]


@pytest.mark.parametrize("signal", BY_MOTION)
@pytest.mark.parametrize(
    ("seconds", "speed_mps", "verdict"),
    [
        pytest.param(2.0, 4.0, OK, id="not yet 2 s"),
        pytest.param(2.1, 4.0, FAULT, id="2 s"),
        pytest.param(2.1, -4.0, FAULT, id="reversing"),
        pytest.param(5.0, 0.5, OK, id="2.5 m at a crawl"),
        pytest.param(6.5, 0.5, FAULT, id="3 m at a crawl"),
        pytest.param(60.0, 0.08, UNKNOWN, id="standing, with the wheels' noise"),
    ],
)
def test_what_cannot_rest_in_motion(signal: str, seconds: float, speed_mps: float, verdict: Verdict) -> None:
    assert Ride(signal).go(seconds, RESTING[signal], speed_mps=speed_mps).ask().verdict is verdict


def test_a_frozen_position_stays_so_when_the_car_stops_and_ends_with_the_first_new_one() -> None:
    ride = Ride("position").go(3.0, RESTING["position"]).go(10.0, RESTING["position"], speed_mps=0.0)
    assert ride.ask().verdict is FAULT
    assert ride.go(0.05, GpsFix(lat_deg=32.00001, lon_deg=-110.0), speed_mps=0.0).ask().verdict is OK


@pytest.mark.parametrize(
    ("place", "verdict"),
    [
        (GpsFix(lat_deg=10.0, lon_deg=180.0), FAULT),
        (GpsFix(lat_deg=10.0, lon_deg=-180.0), FAULT),
        (GpsFix(lat_deg=90.0, lon_deg=0.0), FAULT),
        (GpsFix(lat_deg=-90.0, lon_deg=12.0), FAULT),
        (GpsFix(lat_deg=0.0, lon_deg=0.0, status=-1), UNKNOWN),
        (GpsFix(lat_deg=math.nan, lon_deg=math.nan, status=-1), UNKNOWN),
    ],
    ids=["180° east", "180° west", "north pole", "south pole", "no fix", "no fix, NaN"],
)
def test_a_frozen_position_anywhere(place: GpsFix, verdict: Verdict) -> None:
    assert Ride("position").go(3.0, place).ask().verdict is verdict


@pytest.mark.parametrize(
    ("ranges", "verdict"),
    [
        (BEAMS, FAULT),
        (BEAMS[:20], FAULT),
        (BEAMS[:19], UNKNOWN),
        ([*BEAMS, math.nan, math.inf, -math.inf], FAULT),
        ([math.nan] * 60, UNKNOWN),
        ([math.inf] * 60, UNKNOWN),
        ([5.0], UNKNOWN),
        ([], UNKNOWN),
    ],
    ids=["returns", "just enough", "too few", "with NaN and ±Inf", "all NaN", "open field", "one beam", "empty"],
)
def test_frozen_scans(ranges: list[float], verdict: Verdict) -> None:
    assert Ride("scan").go(3.0, sweep(ranges)).ask().verdict is verdict


@pytest.mark.parametrize("signal", BY_NOISE)
def test_the_noise_of_a_lively_signal_is_missed(signal: str) -> None:
    ride = Ride(signal).vary(5.0, RESTING[signal])
    assert ride.ask().verdict is OK
    held = noisy(RESTING[signal], 500)
    assert ride.go(1.9, held).ask().verdict is OK
    found = ride.go(0.3, held).ask()
    assert found.verdict is FAULT
    assert "one value" in found.text
    assert ride.vary(0.05, RESTING[signal]).ask().verdict is OK


@pytest.mark.parametrize("signal", BY_NOISE)
def test_a_value_held_from_the_first_message_on_proves_nothing(signal: str) -> None:
    found = Ride(signal).go(30.0, RESTING[signal]).ask()
    assert (found.verdict, found.brief) == (UNKNOWN, "not checked: waiting")


@pytest.mark.parametrize("signal", BY_NOISE)
def test_a_coarse_signal_that_often_repeats_itself_proves_nothing(signal: str) -> None:
    """For example whole kilometres an hour."""
    found = Ride(signal).vary(20.0, RESTING[signal], every=4).go(5.0, noisy(RESTING[signal], 9_999)).ask()
    assert (found.verdict, found.applies) == (UNKNOWN, False)


def test_a_car_at_rest_reports_0_for_ever() -> None:
    ride = Ride("speed").vary(5.0, RESTING["speed"]).go(60.0, Twist(speed_mps=0.0))
    assert (ride.ask().verdict, ride.ask().brief) == (UNKNOWN, "not checked: stands")


def test_how_long_is_a_setting() -> None:
    ride = Ride("position").go(3.0, RESTING["position"])
    assert ride.ask(frozen_after_s=2.5).verdict is FAULT
    assert ride.ask(frozen_after_s=4.0).verdict is OK


@pytest.mark.parametrize("signal", SIGNALS)
def test_what_is_not_received_or_silent(signal: str) -> None:
    assert not ask(f"signal_frozen.{signal}", known()).applies
    silent = known(age_s=2.0, **{signal: RESTING[signal]})
    assert ask(f"signal_frozen.{signal}", silent).brief == "not checked: stale"


def test_without_the_speed_it_is_not_known_whether_a_value_may_rest() -> None:
    state = State()
    for n in range(100):
        state.receive("position", RESTING["position"], 0.1 * n)
    found = ask("signal_frozen.position", state.snapshot(9.9))
    assert (found.verdict, found.text) == (UNKNOWN, "Speed is not published")


def test_a_frozen_speed_explains_what_is_reckoned_from_it() -> None:
    for signal in BY_MOTION:
        assert "signal_frozen.speed" in check_of(f"signal_frozen.{signal}").alarm.inhibited_by
    assert "signal_frozen.speed" in check_of("no_response").alarm.inhibited_by


def test_it_is_reported_once_and_ends_two_seconds_after_the_signal_moves_again() -> None:
    monitor, ride, log = Monitor(), Ride("position"), []
    ride.state.link(LinkFacts(phase="monitoring", connected_s=0.0, published=frozenset({"position", "speed"})))
    for n in range(300):
        frozen = 60 <= n < 160
        ride.go(0.05, GpsFix(lat_deg=32.0 + 1e-6 * (60 if frozen else n), lon_deg=-110.0))
        if n % 2:
            log += [t for t in monitor.step(ride.state.snapshot(0.05 * ride.n)) if "frozen" in t.alarm_id]
    assert [(round(t.at_s, 1), t.change) for t in log] == [(5.1, "raised"), (10.1, "cleared")]
