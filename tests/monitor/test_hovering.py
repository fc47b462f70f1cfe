"""A signal that hovers at its limit: ten minutes of a sensor's own noise around a threshold are at most three alarms.

The short rounds show the same in a minute each; what is at its limit must alarm at least once, or nothing is tested.
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
from monitor.checks.slow_down import SlowDownLimits
from monitor.instruments import DrivingLimits, StoreLimits
from monitor.phones import PhoneReport
from monitor.runner import Monitor
from monitor.shell_facts import LinkFacts, RecorderFacts
from monitor.signals import SIGNALS
from monitor.state import State
from monitor.unseen import UnseenLimits
from monitor.values import (
    Bearing,
    Component,
    Diagnostics,
    Distance,
    Effort,
    GpsFix,
    Level,
    MotionCommand,
    PhoneFix,
    Twist,
    Value,
)
from tests.monitor.drive import Drive
from tests.monitor.test_corridor import sweep

AT_MOST = 3
QUANTUM = 100 / 255


@dataclass(frozen=True)
class Case:
    """One threshold: the signals that are published and their values at a moment, with a sensor's noise."""

    alarm: str
    hz: dict[str, float]
    say: Callable[[random.Random, float], dict[str, Value]]
    limits: dict[str, float]
    rates: Callable[[random.Random, float], dict[str, float]] | None = None
    begins_s: float = 0.0  # before that, `rest` is sent
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


def drift_of_a_good_receiver(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {"speed": Twist(speed_mps=0.0), "position": north(gauss(dice, 2.0, 0.05, now_s), 0.2)}


def stops_with_a_good_receiver(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {"speed": Twist(speed_mps=0.0), "position": north(dice.gauss(0.0, 0.02), 0.2)}


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


def hardly_brakes(dice: random.Random, now_s: float) -> dict[str, Value]:
    """From any speed, at 0.3 m/s², give or take 0.03; braking is ordered all the while."""
    speed_mps = 190.0 - 0.3 * now_s + 0.19 * swing(now_s) + dice.gauss(0.0, 0.012)
    return {"speed": Twist(speed_mps=speed_mps), "command": MotionCommand(speed_mps=0.0, tyre_angle_rad=None)}


def at_the_edge(dice: random.Random, now_s: float) -> dict[str, Value]:
    """What stands on the edge of the corridor, beside a standing car."""
    aside_m = gauss(dice, 1.2 + 0.3, 0.02, now_s)
    return {"speed": Twist(speed_mps=0.0), "scan": sweep([(4.0, aside_m, 0.3), (60.0, 0.0, 50.0)])}


def warm(dice: random.Random, now_s: float) -> dict[str, Value]:
    """A part of the car that reports its own limit, one second so, one second so."""
    level = int(dice.random() < 0.5)
    return {"diagnostics": Diagnostics(components=(Component(name="motor", level=level, message="hot"),))}


def hot(dice: random.Random, now_s: float) -> dict[str, Value]:
    level = 2 * int(dice.random() < 0.5)
    return {"diagnostics": Diagnostics(components=(Component(name="motor", level=level, message="hot"),))}


def creeps(dice: random.Random, now_s: float) -> dict[str, Value]:
    """The wheels' noise where standing begins."""
    return {"speed": Twist(speed_mps=abs(gauss(dice, 0.10, 0.02, now_s)))}


def usual(dice: random.Random, now_s: float) -> dict[str, Value]:
    return {}


CASES = {
    "speed": Case("speed_limit", {"speed": 20.0}, speed, {}),
    "pedals": Case("pedals", {"brake": 20.0, "accelerator": 20.0}, pedals, {}),
    "obstacle": Case("obstacle", {"speed": 20.0, "scan": 25.0}, obstacle, {}),
    "edge of the corridor": Case("obstacle", {"speed": 20.0, "scan": 25.0}, at_the_edge, {}),
    "nearest object": Case("obstacle_nearest", {"speed": 20.0, "distance": 30.0, "bearing": 30.0}, nearest, {}),
    "stopping distance": Case("obstacle_nearest", {"speed": 20.0, "distance": 30.0, "bearing": 30.0}, stopping, {}),
    "GPS drift": Case("gps_drift", {"speed": 20.0, "position": 10.0}, drift, {}, begins_s=8.0, rest=stops),
    "GPS drift, a good receiver": Case(
        "gps_drift",
        {"speed": 20.0, "position": 10.0},
        drift_of_a_good_receiver,
        {},
        begins_s=8.0,
        rest=stops_with_a_good_receiver,
    ),
    "GPS jump": Case("gps_jump", {"speed": 20.0, "position": 10.0}, runs_ahead, {}),
    "GPS error": Case("gps_fix", {"position": 10.0}, stated_error, {}),
    "blind laser": Case("laser_blind", {"scan": 25.0}, half_blind, {}),
    "fuel": Case("fuel_low", {"speed": 20.0, "fuel": 1.0}, sloshing, {}),
    "braking ordered": Case("no_response", {"speed": 20.0, "command": 20.0}, ordered, {}),
    "braking answers": Case("no_response", {"speed": 20.0, "command": 20.0}, hardly_brakes, {}),
    "a part that warns": Case("diagnostics_warn", {"speed": 20.0, "diagnostics": 1.0}, warm, {}),
    "a part that fails": Case("diagnostics_error", {"speed": 20.0, "diagnostics": 1.0}, hot, {}),
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

# Hovering that has a test of its own below, as its time matters and not its value.
BY_TIME = {
    "signal_stale": "gaps of a signal",
    "car_silent": "gaps of all signals",
    "signal_frozen": "a value that moves on now and then",
    "clock_offset": "a clock",
    "phone_car": "a phone apart",
    "phone_tracks": "a phone on its own way",
    "phone_missing": "a phone with a fix now and then",
    "link_late": "a link about as late as is allowed",
    "link_late_moving": "a link about as late as is allowed",
    "recorder_behind": "a disk about as slow as is allowed",
    "disk_nearly_full": "a disk about as full as is allowed",
}

# Checks without a limit that a noisy measurement could hover about, each with the reason.
WITHOUT = {
    "position_receiver": "a receiver has a fix or it has none, for three seconds",
    "position_sources": "both errors, with a deadband of a fifth: test_position_sources.py",
    "speed_sources": "means of 3 s, with a deadband of a fifth: test_speed_sources.py",
    "scan_shape": "whole beams",
    "gps_quality": "known or not",
    "signal_unusable": "a value can be used or it cannot",
    "car_unusable": "values can be used or they cannot",
    "connect_failed": "the link's own report",
    "bridge_fault": "the bridge's own report",
    "link_lost": "the link's own report",
    "no_message": "time only grows",
    "log_not_kept": "the disk's own report",
    "recording_stopped": "the recorder's own report",
    "paused_long": "time only grows",
    "reach": "somebody can hear alarms or nobody can; phones come and go more slowly than its delays",
    "clock_jump": "steps, reported for ten seconds each",
    "slow_down_unconfirmed": "a ramp is over within seconds, with a deadband of a fifth",
    "slow_down_hold_ended": "time only grows",
    "slow_down_rivals": "somebody else publishes or nobody does",
}

# Every threshold there is: what hovers about it, or why nothing can.
THRESHOLDS = {
    "speed_limit.max_mps": "speed",
    "speed_limit.deadband_mps": "speed",
    "obstacle.standoff_m": "obstacle",
    "obstacle.reaction_s": "stopping distance",
    "obstacle.deceleration_mps2": "stopping distance",
    "obstacle.deadband_m": "obstacle",
    "obstacle.half_width_m": "edge of the corridor",
    "no_response.margin_mps": "braking ordered",
    "no_response.least_mps2": "braking answers",
    "pedals.pressed_percent": "pedals",
    "gps_fix.worst_sigma_m": "GPS error",
    "gps_drift.least_m": "GPS drift, a good receiver",
    "gps_jump.margin_mps": "GPS jump",
    "phone_car.least_m": "a phone apart",
    "phone_car.least_correlation": "a phone on its own way",
    "phone_missing.after_s": "a phone with a fix now and then",
    "laser_blind.blind_percent": "blind laser",
    "signals.slow_below_percent": "rate",
    "signals.frozen_after_s": "a value that moves on now and then",
    "clock.late_s": "a clock",
    "clock.offset_s": "a clock",
    "fuel_low.low_percent": "fuel",
    "fuel_low.deadband_percent": "fuel",
    "link_late.late_s": "a link about as late as is allowed",
    "link_late.critical_s": "a link about as late as is allowed",
    "recording.behind_s": "a disk about as slow as is allowed",
    "recording.warn_gb": "a disk about as full as is allowed",
    **{f"signals.{name}_hz": "rate" for name in SIGNALS},
}
NO_LIMIT = {
    "speed_sources.apart_mps": "means of 3 s, with a deadband of a fifth: test_speed_sources.py",
    "speed_sources.apart_percent": "means of 3 s, with a deadband of a fifth: test_speed_sources.py",
    "position_sources.least_m": "places of a slow filter, with a deadband of a fifth: test_position_sources.py",
    "obstacle.time_to_collision_s": "a gap that closes is soon met or opens: it cannot hover",
    "obstacle.wheelbase_m": "a measure of the car",
    "obstacle.laser_ahead_m": "a measure of the car",
    "obstacle.bumper_ahead_m": "a measure of the car",
    "mounting.yaw_deg": "a measure of the car",
    "mounting.left_m": "a measure of the car",
    "mounting.upside_down": "a switch",
    "mounting.by_settings": "a switch",
    "steering.tyre_rad_per_unit": "a measure of the car",
    "gps_fix.strict": "a switch",
    "not_moving.after_s": "each stop is one of its own; the speed at which standing begins has its case",
    "clock.jump_s": "each step is one of its own",
    "paused_long.after_min": "time only grows",
    "recording.automatic": "a switch",
    "recording.all_topics": "a switch",
    "recording.bulky": "a switch",
    "recording.hold_s": "counted from a loss of the link, of which each is one of its own",
    "recording.quota_gb": "recording stops, and does not begin again by itself",
    "recording.min_free_gb": "recording stops, and does not begin again by itself",
    "slow_down.deceleration_mps2": "what is ordered; the proof has a deadband",
    "slow_down.longest_s": "time only grows",
    **{f"slow_down.{name}": "a switch" for name in SlowDownLimits.model_fields if name.startswith("on_")},
    **{f"store.{name}": "of copies in the store, not judged" for name in StoreLimits.model_fields},
    "attention.escalates_s": "of the attention queue, not judged",
    "attention.unheard_s": "of the attention queue, not judged",
    **{f"driving.{name}": "of who drives, which is no check" for name in DrivingLimits.model_fields},
    **{f"unseen.{name}": "shown beside values, not judged" for name in UnseenLimits.model_fields},
    "gauge.speed_max_mps": "drawn, not judged",
    "gauge.acceleration_max_mps2": "drawn, not judged",
}


def test_every_check_hovers_or_cannot() -> None:
    there = {check.id.partition(".")[0] for check in CHECKS}
    hovering = {case.alarm.partition(".")[0] for case in CASES.values()}
    assert hovering | BY_TIME.keys() | WITHOUT.keys() == there
    assert not (hovering | BY_TIME.keys()) & WITHOUT.keys()


def test_every_threshold_is_hovered_about_or_cannot_be() -> None:
    assert THRESHOLDS.keys() | NO_LIMIT.keys() == catalog.schema().keys()
    assert not THRESHOLDS.keys() & NO_LIMIT.keys()
    assert set(THRESHOLDS.values()) <= CASES.keys() | set(BY_TIME.values())


class Hover(Drive):
    """A car that sends the random values of a case."""

    def __init__(self, case: Case, seed: int = 1) -> None:
        super().__init__(case.hz, Monitor(limits=catalog.changed(AllLimits(), case.limits)))
        self.state.expect({name.partition(".")[2][:-3]: hz for name, hz in case.limits.items()})
        self.case, self.dice = case, random.Random(seed)

    def _value(self, name: str) -> Value:
        case, now_s = self.case, self.now_s
        if case.rates is not None:
            self.hz |= case.rates(self.dice, now_s)
        values = (case.rest if case.rest is not None and now_s < case.begins_s else case.say)(self.dice, now_s)
        return values.get(name) or super()._value(name)


def announced(case: Case, seconds: float) -> list[str]:
    """The announcements of the check; no other check may announce, but for those that its own case allows."""
    announcements = Hover(case).open().to(seconds).announced
    return [alarm for alarm in announcements if alarm == case.alarm]


@pytest.mark.parametrize(
    ("case", "seconds"),
    [
        pytest.param(case, seconds, id=f"{name}, {seconds:.0f} s", marks=marks)
        for name, case in CASES.items()
        for seconds, marks in ((60.0, ()), (600.0, (pytest.mark.soak,)))
    ],
)
def test_at_its_limit_a_signal_is_reported_at_most_three_times(case: Case, seconds: float) -> None:
    announcements = announced(case, seconds)
    assert 0 < len(announcements) <= AT_MOST


@pytest.mark.parametrize("seconds", [60.0, pytest.param(600.0, marks=pytest.mark.soak)])
@pytest.mark.parametrize("late", [False, True], ids=["offset", "late"])
def test_a_clock_about_its_limit(seconds: float, late: bool) -> None:
    """clock_offset: 5 s from the server's time, or messages 2 s later than usual, give or take a radio's jitter."""
    dice, monitor, state, announcements = random.Random(1), Monitor(), State(), []
    state.link(LinkFacts(phase="monitoring", connected_s=0.0, wall_zero_s=1.79e9, published=frozenset({"position"})))
    for n in range(round(10 * seconds)):
        now_s = n / 10
        behind_s = min(2.0, 0.1 * max(0.0, now_s - 6.0)) if late else 5.0
        behind_s += 0.1 * swing(now_s) + dice.expovariate(50.0)
        state.receive("position", north(0.01 * n), now_s, 1.79e9 + now_s - behind_s)
        announcements += [t.alarm_id for t in monitor.step(state.snapshot(now_s)) if t.announces]
    assert set(announcements) == {"clock_offset"}
    assert len(announcements) <= AT_MOST


LONG = pytest.mark.parametrize("seconds", [60.0, pytest.param(600.0, marks=pytest.mark.soak)])


@LONG
@pytest.mark.parametrize("alarm", ["recorder_behind", "disk_nearly_full"])
def test_a_disk_about_as_slow_or_as_full_as_is_allowed(alarm: str, seconds: float) -> None:
    """Others write on it and delete from it; a write waits for theirs."""
    dice, monitor, state, announcements = random.Random(1), Monitor(), State(), []
    state.link(LinkFacts(phase="monitoring", connected_s=0.0, last_message_s=0.0))
    for n in range(round(10 * seconds)):
        now_s = n / 10
        about = gauss(dice, 2.0, 0.05, now_s)
        is_slow = alarm == "recorder_behind"
        state.recorder(
            RecorderFacts(state="recording", behind_s=about if is_slow else 0.1, left_gb=90.0 if is_slow else about)
        )
        announcements += [t.alarm_id for t in monitor.step(state.snapshot(now_s)) if t.announces]
    assert 0 < announcements.count(alarm) <= AT_MOST, announcements


@LONG
@pytest.mark.world(n=6)
@pytest.mark.parametrize(("alarm", "late_s"), [("link_late", 1.0), ("link_late_moving", 2.0)])
def test_a_link_about_as_late_as_is_allowed(alarm: str, late_s: float, seconds: float) -> None:
    dice, monitor, state, announcements = random.Random(1), Monitor(), State(), []
    for n in range(round(10 * seconds)):
        now_s = n / 10
        about_s = gauss(dice, late_s, 0.05, now_s)
        state.link(LinkFacts(phase="monitoring", connected_s=0.0, last_message_s=now_s, late_s=about_s))
        state.receive("speed", Twist(speed_mps=4.0), now_s, None)
        announcements += [t.alarm_id for t in monitor.step(state.snapshot(now_s)) if t.announces]
    assert 0 < announcements.count(alarm) <= AT_MOST, announcements


SPOKEN = ("speed", "brake", "accelerator", "position")


def few(car: Drive, alarm: str) -> bool:
    """Reported, at most three times, and no other alarm beside it but for the rates that fall with the gaps."""
    announcements = [name for name in car.announced if not name.startswith(("signal_slow", "all_slow"))]
    return set(announcements) == {alarm} and len(announcements) <= AT_MOST


@LONG
@pytest.mark.parametrize(
    ("silent", "gap_s", "alarm"),
    [
        pytest.param(("brake",), 0.95, "signal_stale.brake", id="of a signal"),
        pytest.param(SPOKEN, 1.0, "car_silent", id="of all signals"),
        pytest.param(SPOKEN, 1.35, "car_silent", id="of all signals, longer"),
    ],
)
def test_gaps_about_as_long_as_is_allowed(silent: tuple[str, ...], gap_s: float, alarm: str, seconds: float) -> None:
    dice, car = random.Random(1), Drive(dict.fromkeys(SPOKEN, 20.0)).open().to(12.0)
    while car.now_s < 12.0 + seconds:
        car.silent = set(silent)
        car.to(car.now_s + gap_s * (1.0 + 0.05 * swing(car.now_s)) + abs(dice.gauss(0.0, 0.03)))
        car.silent = set()
        car.to(car.now_s + 0.12)
    assert few(car, alarm)


@LONG
@pytest.mark.parametrize("held_s", [2.0, 2.5, 4.0])
def test_a_position_that_moves_on_now_and_then(held_s: float, seconds: float) -> None:
    dice, car, fix, until_s = random.Random(1), Drive({"speed": 20.0, "position": 10.0}).open().to(10.0), None, 0.0
    car.silent = {"position"}  # it is sent by itself, below
    while car.now_s < 10.0 + seconds:
        if fix is None or car.now_s >= until_s:
            fix = north(4.0 * car.now_s)
            until_s = car.now_s + held_s + dice.gauss(0.0, 0.1)
        car.send("position", fix).to(car.now_s + 0.1)
    assert few(car, "signal_frozen.position")


def ride(car: Drive, phone: Callable[[float, GpsFix], PhoneFix | None], seconds: float, every_s: float = 1.0) -> Drive:
    """A phone in a car that reports as often; a receiver that reports its accuracy."""
    car.values["position"] = north(0.0, 1.0)
    while car.now_s < seconds:
        car.to(car.now_s + every_s)
        reading = car.state.get("position")
        fix = None if reading is None else phone(car.now_s, reading.value)
        if fix is not None:
            car.state.receive_phone(
                PhoneReport(phone="one", is_handheld=True, fix=fix, measured_s=car.now_s), car.now_s
            )
        elif (
            car.now_s - (car.state.snapshot(car.now_s).phone.received_s) >= 4.0
        ):  # a page reports more often than every 5 s
            car.state.receive_phone(PhoneReport(phone="one", is_handheld=True, why="unavailable"), car.now_s)
    return car


def east_of(place: GpsFix, metres: float) -> PhoneFix:
    return PhoneFix(lat_deg=place.lat_deg, lon_deg=place.lon_deg + metres / 94_400, accuracy_m=5.0)


@pytest.mark.parametrize("seconds", [120.0, pytest.param(600.0, marks=pytest.mark.soak)])
def test_a_phone_about_as_far_as_is_explained(seconds: float) -> None:
    dice, car = random.Random(1), Drive({"speed": 20.0, "position": 10.0}).open()
    ride(car, lambda now_s, place: east_of(place, gauss(dice, 13.9, 0.5, now_s)), seconds)
    assert few(car, "phone_car")


@pytest.mark.parametrize("seconds", [180.0, pytest.param(600.0, marks=pytest.mark.soak)])
def test_a_phone_that_goes_almost_its_own_way(seconds: float) -> None:
    """At a crawl the car's minute of track is hardly longer than the phone swings to and fro beside it."""
    limits = catalog.changed(AllLimits(), {"phone_car.least_correlation": 0.77})
    car = Drive({"speed": 20.0, "position": 10.0}, Monitor(limits=limits)).open()
    car.values["speed"] = Twist(speed_mps=0.62)

    def to_and_fro(now_s: float, place: GpsFix) -> PhoneFix:
        return east_of(place, (12.5 + 0.9 * swing(now_s, 150.0)) * math.sin(0.9 * now_s))

    ride(car, to_and_fro, seconds)
    assert few(car, "phone_tracks")


@LONG
def test_a_phone_with_a_fix_now_and_then(seconds: float) -> None:
    """One every ten seconds and a bit, between reports that it has none."""
    car, next_s = Drive({"speed": 20.0, "position": 10.0}).open(), 1.0

    def now_and_then(now_s: float, place: GpsFix) -> PhoneFix | None:
        nonlocal next_s
        if now_s < next_s:
            return None
        next_s = now_s + 10.5 + 0.5 * swing(now_s)
        return east_of(place, 1.0)

    ride(car, now_and_then, seconds, every_s=0.25)
    assert few(car, "phone_missing")
