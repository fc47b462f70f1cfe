"""Sources of the speed: cars whose wheels, receiver and odometries agree or not, through the state."""

from __future__ import annotations

import math
import random
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from monitor.catalog import CHECKS
from monitor.check import Finding
from monitor.compared import MOST_OTHERS, Compared
from monitor.freeze_detection import Repeats
from monitor.pace import Pace
from monitor.runner import Monitor
from monitor.shell_facts import LinkFacts
from monitor.state import State
from monitor.values import GpsFix, Odometry, Twist
from tests.monitor.checks.known import LINK, Row, ask, known
from tests.monitor.checks.test_gps import HERE, moved

CARRIERS = {"speed": "/vel", "position": "/fix", "odometry": "/odom"}
ID = "speed_sources"
# What compares them, and the alarms that explain one of these.
JUDGED = {ID, "gps_fix", "gps_drift", "gps_jump", "signal_frozen.speed", "signal_stale.speed", "car_silent"} | {
    "no_message",
    "link_late",
    "link_late_moving",
    "link_lost",
}


def facts(**carriers: str) -> LinkFacts:
    return replace(LINK, carriers=CARRIERS | carriers, published=frozenset(CARRIERS))


Way = Callable[[float], float]  # speed [m/s] by the time [s]


@dataclass
class Car:
    """A car on a straight road; what each source shows is a function of the time. None: it does not send."""

    truth: Way = lambda t: 10.0
    wheels: Way | None = lambda t: 10.0
    sigma_m: float | None = 0.3
    noise_m: float = 0.0
    fix_hz: int = 5
    status: Callable[[float], int] = lambda t: 0
    twist: Way | None = None  # of /odom
    poses: Way | None = None
    latency_s: float = 0.0  # of the receiver
    link: LinkFacts = field(default_factory=facts)
    seed: int = 1
    monitor: Monitor = field(default_factory=lambda: Monitor([check for check in CHECKS if check.id in JUDGED]))
    state: State = field(default_factory=State)
    now_s: float = 0.0
    announced: list[tuple[float, str, str]] = field(default_factory=list)
    verdicts: list[str] = field(default_factory=list)

    def go(self, seconds: float) -> Car:
        noise, way_m, pose_m, sent_m = random.Random(self.seed), 0.0, 0.0, [0.0] * 100
        for step in range(round(seconds * 20)):
            self.now_s = now_s = 100.0 + step / 20
            t = step / 20
            way_m += self.truth(t) / 20
            sent_m = [*sent_m[1:], way_m]
            self.state.link(self.link)
            if self.wheels is not None:
                mps = self.wheels(t)
                wheels = Twist(speed_mps=mps + noise.gauss(0.0, 0.01) if mps else 0.0)
                self.state.receive("speed", wheels, now_s, 1e9 + t)
            if step % (20 // self.fix_hz) == 0:
                self._fix(t, sent_m[-1 - round(self.latency_s * 20)], noise)
            if (self.twist is not None or self.poses is not None) and step % 2:
                pose_m += self.poses(t) / 10 if self.poses is not None else 0.0
                stated = self.twist(t) if self.twist is not None else None
                self.state.receive("odometry", Odometry(x_m=pose_m, y_m=0.0, speed_mps=stated), now_s, 1e9 + t)
            if step % 4 == 0:
                for one in self.monitor.step(self.state.snapshot(now_s)):
                    if one.announces and (one.alarm_id.startswith("gps_") or one.alarm_id == ID):
                        self.announced.append((t, one.alarm_id, one.text))
                self.verdicts.append(str(self.monitor.findings[ID].verdict))
        return self

    def _fix(self, t: float, way_m: float, noise: random.Random) -> None:
        status = self.status(t)
        east, north = (noise.gauss(0.0, self.noise_m) if self.noise_m else 0.0 for _ in "en")
        fix = replace(moved(HERE, way_m + east, north, self.sigma_m), status=status)
        self.state.receive("position", fix, self.now_s, 1e9 + t)

    @property
    def alarms(self) -> list[str]:
        return [id for _, id, _ in self.announced]

    @property
    def finding(self) -> Finding:
        return ask(ID, self.state.snapshot(self.now_s))


def trip(t: float, top: float = 15.0, mps2: float = 3.0) -> float:
    """Stands for 10 s, speeds up, drives, brakes from 30 s on, stands."""
    return max(0.0, min(top, mps2 * (t - 10.0), mps2 * (30.0 - t) + top))


PACED = known(speed=Twist(speed_mps=0.0), position=moved(HERE, 0.0, 0.0, 0.3), link=facts())


def paced(gps_mps: float, speed_mps: float = 0.0, **more: Any) -> Any:
    pace = Pace(mps=gps_mps, **{"error_mps": 0.4, **more})
    compared = Compared(stated={"speed": Pace(mps=speed_mps)}, made={"position": pace})
    return replace(PACED, compared=compared)


ANSWERS = {ID: Row(ok=paced(0.3), fault=paced(15.0), unknown=paced(15.0, error_mps=7.0))}


def test_the_sentence() -> None:
    found = ask(ID, paced(15.0))
    assert found.text == "Speed 0.0 m/s by /vel, but 15.0 m/s by GPS"
    assert found.brief == "FAULT 0 or 15 m/s"
    assert ask(ID, paced(5.1, 5.0)).text == "Speed 5.0 m/s by /vel, 5.1 m/s by GPS"


@pytest.mark.parametrize(
    ("speed_mps", "gps_mps", "verdict"),
    [
        (4.0, 5.89, "ok"),  # 1.5 m/s, and the error of 0.4
        (4.0, 5.91, "fault"),
        (5.91, 4.0, "fault"),
        (20.0, 27.2, "ok"),  # a quarter of the higher, and 0.4
        (20.0, 27.3, "fault"),
        (math.nan, 27.3, "ok"),  # no number is no contradiction; the state lets none in
    ],
)
def test_verdict(speed_mps: float, gps_mps: float, verdict: str) -> None:
    assert ask(ID, paced(gps_mps, speed_mps)).verdict == verdict


def test_limits_and_deadband() -> None:
    assert [ask(ID, paced(2.5, 1.0), apart_mps=least).verdict for least in (1.5, 1.0)] == ["ok", "fault"]
    assert ask(ID, paced(27.3, 20.0), apart_percent=30.0).verdict == "ok"
    assert ask(ID, paced(5.8, 4.0)).verdict == "ok"
    assert ask(ID, paced(5.8, 4.0), was_active=True).verdict == "fault"


def test_one_source_is_not_checked_and_reports_it() -> None:
    found = ask(ID, known(speed=Twist(speed_mps=3.0), link=facts()))
    assert (found.verdict, found.brief, found.applies) == ("unknown", "one source", False)
    assert ask(ID, known(speed=Twist(speed_mps=3.0), link=facts()), was_active=True).verdict == "ok"


@pytest.mark.parametrize(
    ("snapshot", "short"),
    [
        (paced(15.0, error_mps=5.1), "too poor"),
        (replace(paced(15.0), compared=Compared(stated={"speed": Pace(mps=0.0)})), "waiting"),
        (replace(paced(15.0), compared=Compared(made={"position": Pace(mps=0.0)})), "waiting"),
        (replace(paced(15.0), now_s=PACED.now_s + 2.0), "stale"),
        (replace(paced(15.0), link=facts(position="/vel")), ""),
    ],
)
def test_not_checked(snapshot: Any, short: str) -> None:
    found = ask(ID, snapshot)
    assert found.verdict == "unknown"
    assert found.brief == (f"not checked: {short}" if short else "one source")


def test_a_position_that_repeats_itself_is_left_to_frozen() -> None:
    snapshot = paced(0.0, 8.0)
    fix = replace(snapshot.readings["position"], repeats=Repeats(value_n=5, value_s=1.0, value_m=8.0))
    found = ask(ID, replace(snapshot, readings={**snapshot.readings, "position": fix}))
    assert (found.verdict, found.text) == ("unknown", "GPS repeats one value")


# -- drives -----------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "car",
    [
        Car(truth=trip, wheels=trip),
        Car(truth=trip, wheels=trip, fix_hz=1),
        Car(truth=trip, wheels=trip, latency_s=1.0),
        Car(truth=trip, wheels=trip, noise_m=0.3, seed=4),
        Car(truth=trip, wheels=trip, sigma_m=None, noise_m=1.0),
        Car(truth=trip, wheels=lambda t: 1.2 * trip(t)),  # another tyre
        Car(truth=lambda t: -trip(t), wheels=lambda t: -trip(t)),  # reversing
        Car(truth=lambda t: 3.0 * math.sin(t), wheels=lambda t: 3.0 * math.sin(t)),  # to and fro
        Car(truth=trip, wheels=trip, twist=lambda t: 0.0, poses=trip),  # a twist that nobody fills
        Car(truth=trip, wheels=trip, twist=trip, poses=lambda t: 0.0),  # a pose that nobody fills
        Car(truth=trip, wheels=trip, twist=lambda t: abs(trip(t)), poses=trip),
        Car(truth=trip, wheels=lambda t: 0.0 if 18.0 < t < 19.5 else trip(t)),  # locked wheels
    ],
)
def test_a_healthy_drive_raises_nothing(car: Car) -> None:
    car.go(45.0)
    assert ID not in car.alarms
    assert car.verdicts.count("ok") > 100


@pytest.mark.parametrize(
    ("car", "from_s", "within_s"),
    [
        (Car(truth=trip, wheels=lambda t: 0.0), 10.0, 9.0),  # dead from the start on
        (Car(truth=trip, wheels=lambda t: 0.0, fix_hz=10), 10.0, 9.0),
        (Car(truth=lambda t: trip(t, mps2=1.0), wheels=lambda t: 0.0), 10.0, 11.0),
        (Car(truth=trip, wheels=lambda t: trip(t) if t < 20.0 else 0.0), 20.0, 8.0),  # fail while driving
        (Car(truth=trip, wheels=lambda t: 3.6 * trip(t)), 10.0, 8.0),  # km/h
        (Car(truth=trip, wheels=lambda t: trip(t) / 3.6), 10.0, 8.0),
        (Car(truth=lambda t: 0.0, wheels=trip, noise_m=0.05), 10.0, 8.0),  # wheels that spin
        (Car(truth=trip, wheels=lambda t: 0.0, sigma_m=None), 10.0, 9.0),
    ],
)
def test_a_drive_whose_sources_disagree_is_one_alarm(car: Car, from_s: float, within_s: float) -> None:
    car.go(29.0)
    assert car.alarms == [ID]
    at_s, _, text = car.announced[0]
    assert from_s + 3.0 < at_s < from_s + within_s
    assert " m/s by /vel, but " in text
    assert text.endswith(" m/s by GPS")


def test_an_odometry_contradicts_without_gps() -> None:
    car = Car(truth=lambda t: 0.0, wheels=lambda t: 0.0, status=lambda t: -1, twist=lambda t: 4.0, poses=lambda t: 4.0)
    car.go(12.0)
    assert [id for id in car.alarms if id != "gps_fix"] == [ID]
    assert car.finding.text == "Speed 0.0 m/s by /vel, but 4.0 m/s by /odom and 4.0 m/s by the poses of /odom"
    alike = Car(truth=car.truth, wheels=car.wheels, status=car.status, twist=car.twist, poses=car.poses)
    alike.link = facts(odometry="/vel")  # its twist is no second source, its poses are
    assert ID in alike.go(12.0).alarms
    assert alike.finding.text == "Speed 0.0 m/s by /vel, but 4.0 m/s by the poses of /vel"


@pytest.mark.parametrize(
    ("twist_mps", "pose_mps", "is_raised"), [(0.0, 5.0, True), (5.0, 5.0, False), (5.0, 0.0, False)]
)
def test_an_odometry_that_is_the_only_source_is_compared_with_its_own_poses(
    twist_mps: float, pose_mps: float, is_raised: bool
) -> None:
    """A pose that never moved may be one that its driver does not fill."""
    car = Car(truth=lambda t: 0.0, wheels=lambda t: twist_mps, twist=lambda t: twist_mps, poses=lambda t: pose_mps)
    car.link = replace(LINK, carriers={"speed": "/odom", "odometry": "/odom"}, published=frozenset(CARRIERS))
    car.status = lambda t: -1
    assert (ID in car.go(12.0).alarms) is is_raised


def test_drift_at_standstill_is_no_dispute_of_speeds() -> None:
    car = Car(truth=lambda t: 2.3 if 12.0 < t < 20.0 else 0.0, wheels=lambda t: 0.0).go(25.0)
    assert car.alarms == ["gps_drift"]
    jump = Car(truth=lambda t: 23.0 if t > 12.0 else 0.0, wheels=lambda t: 0.0).go(25.0)
    assert jump.alarms == ["gps_jump"]


def test_a_slow_start_that_stays_slow_is_drift() -> None:
    """It moves off as a car does, and never as fast as the comparison needs."""
    car = Car(truth=lambda t: min(2.0, max(0.0, t - 12.0)), wheels=lambda t: 0.0).go(40.0)
    assert car.alarms == ["gps_drift"]


def test_in_a_tunnel_nothing_is_compared_and_after_it_again() -> None:
    car = Car(truth=trip, wheels=trip, status=lambda t: -1 if 17.0 < t < 25.0 else 0).go(45.0)
    assert car.alarms == ["gps_fix"]
    assert {"unknown"} == set(car.verdicts[int(18.0 * 5) : int(25.0 * 5)])
    assert {"ok"} == set(car.verdicts[int(29.0 * 5) :])


def test_a_poor_receiver_is_not_compared() -> None:
    car = Car(truth=trip, wheels=trip, sigma_m=5.0, noise_m=5.0).go(45.0)
    assert ID not in car.alarms
    assert set(car.verdicts) == {"unknown"}
    assert "GPS is too poor" in car.finding.text


@settings(max_examples=25, deadline=None)
@given(
    top=st.floats(0.0, 30.0),
    mps2=st.floats(0.5, 5.0),
    sigma_m=st.floats(0.05, 3.4),
    latency_s=st.floats(0.0, 0.5),
    fix_hz=st.sampled_from([1, 2, 5, 10]),
    seed=st.integers(0, 1000),
    sign=st.sampled_from([1.0, -1.0]),
)
def test_sources_that_agree_within_their_noise_never_alarm(
    top: float, mps2: float, sigma_m: float, latency_s: float, fix_hz: int, seed: int, sign: float
) -> None:
    car = Car(
        truth=lambda t: sign * trip(t, top, mps2),
        wheels=lambda t: sign * trip(t, top, mps2),
        sigma_m=sigma_m,
        noise_m=sigma_m,
        latency_s=latency_s,
        fix_hz=fix_hz,
        seed=seed,
    ).go(40.0)
    assert ID not in car.alarms
    assert "ok" in car.verdicts


@settings(max_examples=25, deadline=None)
@given(
    mps=st.floats(0.0, 20.0),
    beyond=st.floats(1.05, 3.0),
    sigma_m=st.floats(0.05, 3.0),
    fix_hz=st.sampled_from([1, 5, 10]),
    is_faster=st.booleans(),
)
def test_sources_that_disagree_by_more_than_the_limits_always_alarm(
    mps: float, beyond: float, sigma_m: float, fix_hz: int, is_faster: bool
) -> None:
    """Whichever is the faster one; whether it is called a jump of the position depends on how it began."""
    error_mps = 3.0 * math.sqrt(2.0) * sigma_m / 2.9
    other_mps = beyond * max((mps + error_mps) / 0.75, mps + error_mps + 3.0)
    wheels, truth = (other_mps, mps) if is_faster else (mps, other_mps)
    car = Car(truth=lambda t: truth, wheels=lambda t: wheels, sigma_m=sigma_m, fix_hz=fix_hz, noise_m=0.01).go(12.0)
    assert len(car.alarms) == 1
    assert is_faster is False or car.alarms == [ID]


# -- what is kept of other sources ------------------------------------------------------------------------------------


def other(state: State, topic: str, mps: float, at_s: float) -> None:
    state.receive_other("speed", topic, Twist(speed_mps=mps), at_s, None)


def test_others_are_kept_apart_and_bounded() -> None:
    state = State()
    state.link(facts())
    for n in range(20):
        other(state, f"/other{n}", float(n), 100.0 + n)
    snapshot = state.snapshot(120.0)
    assert [one.topic for one in snapshot.compared.of("speed")] == [f"/other{n}" for n in range(MOST_OTHERS)]
    assert snapshot.readings == {}
    assert snapshot.rates["speed"].measured_hz is None
    assert snapshot.heard_s is None
    other(state, "/other1", 7.0, 121.0)
    assert snapshot.compared.of("speed")[1].reading.value.speed_mps == 1.0  # a snapshot does not change
    assert state.snapshot(121.0).compared.of("speed")[1].reading.value.speed_mps == 7.0


def test_others_must_come_anew_after_another_opening_of_the_link() -> None:
    state = State()
    state.link(replace(facts(), since_s=1.0))
    other(state, "/twist", 1.0, 2.0)
    assert state.snapshot(2.0).compared.of("speed")
    state.link(replace(facts(), phase="lost"))
    assert state.snapshot(3.0).compared.of("speed")
    state.link(replace(facts(), since_s=5.0))
    assert not state.snapshot(5.0).compared.of("speed")


def test_another_odometry_and_a_receivers_velocity_are_compared() -> None:
    state, now_s = State(), 100.0
    odometry = Odometry(x_m=0.0, y_m=0.0)
    for step in range(200):
        now_s = 100.0 + step / 20
        state.link(replace(facts(), published=frozenset({"speed"})))
        state.receive("speed", Twist(speed_mps=0.0), now_s)
        other(state, "/gps/vel", 15.0 if step > 20 else 0.0, now_s)
        odometry = Odometry(x_m=step * 0.75, y_m=0.0, speed_mps=0.0)
        state.receive_other("odometry", "/lio", odometry, now_s, None)
        fix: GpsFix = moved(HERE, 0.0, step * 0.75, 0.3)
        state.receive_other("position", "/rear/fix", fix, now_s, None)
    found = ask(ID, state.snapshot(now_s))
    assert found.text == (
        "Speed 0.0 m/s by /vel, but 15.0 m/s by /gps/vel and 15.0 m/s by GPS /rear/fix"
        " and 15.0 m/s by the poses of /lio"
    )
    state.link(replace(facts(), carriers={"speed": "/gps/vel", "position": "/rear/fix", "odometry": "/lio"}))
    assert ask(ID, state.snapshot(now_s)).brief == "one source"  # what carries a signal now is not its other
    state.link(facts())
    for step in range(700):
        state.receive("speed", Twist(speed_mps=0.0), now_s + step / 20)
    silent = ask(ID, state.snapshot(now_s + 35.0))
    assert silent.verdict == "unknown"
    assert "/gps/vel is 35 s old" in silent.text


def test_a_speed_that_hovers_about_the_limit_is_reported_seldom() -> None:
    """1.5 m/s more than the position shows, and what its error may make, give or take."""
    car = Car(truth=lambda t: 4.0, wheels=lambda t: 5.94 + 0.1 * math.sin(t / 3.0), noise_m=0.05).go(60.0)
    assert car.alarms.count(ID) == 1
