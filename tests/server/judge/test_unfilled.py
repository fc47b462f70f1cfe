"""A speed that is exactly zero while the car moves is never filled: another topic is the speed, or none is."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from server.judge.sources.candidates import follow
from server.judge.sources.choice import Choice, choose
from server.judge.sources.evidence import Evidence
from tests.reports.cases import judged
from tests.server.judge.test_sources import FIX, ODOM, STAMPED, TWIST, chosen, odometry, stamped, twist
from tests.server.recording.bags import Drive, write_ros1

FLOAT = "std_msgs/msg/Float32"
ZERO: dict[str, Any] = {TWIST: twist(0.0), STAMPED: stamped(0.0), FLOAT: {"data": 0.0}, ODOM: odometry(0.0, 0.0)}


def fix(north_m: float, east_m: float = 0.0, variance_m2: float = 1.0) -> dict[str, Any]:
    return {
        "status": {"status": 0},
        "latitude": 48.0 + north_m / 111_200,
        "longitude": 11.0 + east_m / 111_200 / math.cos(math.radians(48)),
        "position_covariance": [variance_m2, *[0.0] * 8],
        "position_covariance_type": 2,
    }


def moving(kind: str, at_s: float, mps: float) -> Any:
    if kind == FIX:
        return fix(mps * at_s)
    if kind == ODOM:
        return odometry(mps * at_s, mps)
    return {TWIST: twist(mps), STAMPED: stamped(mps), FLOAT: {"data": mps}}[kind]


def choice_of(
    zero: tuple[str, str],
    other: tuple[str, str],
    *,
    mps: float = 5.0,
    seconds: float = 12.0,
    picked: dict[str, str] | None = None,
) -> Choice:
    """After a drive with one topic that is zero, and another one that moves."""
    topics = dict([zero, other])
    return choose(topics, picked, evidence=driven(topics, zero, other, mps=mps, seconds=seconds))


def driven(
    topics: dict[str, str], zero: tuple[str, str], other: tuple[str, str], *, mps: float, seconds: float
) -> Evidence:
    evidence = Evidence()
    follow(evidence, topics, {})
    for n in range(round(seconds * 10)):
        at_s = n / 10
        evidence.receive(other[0], moving(other[1], at_s, mps), at_s)
        evidence.receive(zero[0], ZERO[zero[1]], at_s + 0.01)
    return evidence


NAMES = [("/vel", TWIST), ("/vel", STAMPED), ("/vehicle/speed", FLOAT), ("/catvehicle/vel", TWIST), ("/speed", TWIST)]


@pytest.mark.parametrize("zero", NAMES)
@pytest.mark.parametrize("mps", [1.2, 15.0, -3.0])
def test_the_odometry_that_moves_is_the_speed(zero: tuple[str, str], mps: float) -> None:
    choice = choice_of(zero, ("/odom", ODOM), mps=mps)
    assert chosen(choice)["speed"] == "/odom"
    assert "is zero while /odom moves" in choice.reasons["speed"][zero[0]]


@pytest.mark.parametrize("zero", [*NAMES, ("/odom", ODOM)])
def test_alone_beside_a_receiver_it_stays_for_wheels_may_be_stuck_which_is_an_alarm(zero: tuple[str, str]) -> None:
    choice = choice_of(zero, ("/gps/fix", FIX))
    assert chosen(choice)["speed"] == zero[0]
    assert "is zero while /gps/fix moves" in choice.reasons["speed"][zero[0]]


@pytest.mark.parametrize("zero", NAMES)
def test_beside_poses_without_a_twist_there_is_no_speed(zero: tuple[str, str]) -> None:
    topics = dict([zero, ("/lio/odom", ODOM)])
    evidence = driven(topics, zero, ("/lio/odom", ODOM), mps=0.0, seconds=0.2)
    for n in range(100):
        evidence.receive("/lio/odom", odometry(n * 1.5, 0.0), 1.0 + n / 10)
        evidence.receive(zero[0], ZERO[zero[1]], 1.0 + n / 10)
    choice = choose(topics, evidence=evidence)
    assert [one.topic for one in choice.watched["speed"]] == [zero[0], "/lio/odom"], "they may yet be filled"
    assert choice.questions == ()
    assert choice.undecided["speed"] == f"{zero[0]}, /lio/odom have no speed: they are zero while the car moves"


def test_a_receiver_decides_between_two_that_are_zero_or_not() -> None:
    topics = {"/vel": TWIST, "/odom": ODOM, "/fix": FIX}
    evidence = driven(topics, ("/vel", TWIST), ("/fix", FIX), mps=5.0, seconds=12.0)
    assert chosen(choose(topics, evidence=evidence))["speed"] == "/odom"


@pytest.mark.parametrize("other", [("/twist", TWIST), ("/vehicle/twist", STAMPED), ("/speed", FLOAT)])
def test_a_number_or_a_twist_that_moves_is_the_speed(other: tuple[str, str]) -> None:
    assert chosen(choice_of(("/vel", TWIST), other))["speed"] == other[0]


def test_of_several_that_move_the_operator_is_asked() -> None:
    topics = {"/vel": TWIST, "/left/wheel_odom": ODOM, "/visual_odom": ODOM}
    evidence = driven(topics, ("/vel", TWIST), ("/visual_odom", ODOM), mps=5.0, seconds=6.0)
    for n in range(60):
        evidence.receive("/left/wheel_odom", odometry(n * 0.8, 8.0), n / 10)
    choice = choose(topics, evidence=evidence)
    assert "speed" not in choice.sources
    assert [one["words"] for one in choice.questions] == ["Two odometries: which is the car's speed?"]


@pytest.mark.parametrize(("mps", "seconds"), [(0.0, 60.0), (0.5, 20.0), (9.0, 1.0)])
def test_a_car_that_stands_creeps_or_just_began_shows_nothing(mps: float, seconds: float) -> None:
    assert chosen(choice_of(("/vel", TWIST), ("/odom", ODOM), mps=mps, seconds=seconds))["speed"] == "/vel"


def test_a_speed_that_is_filled_at_last_is_taken_again() -> None:
    topics = {"/vel": TWIST, "/odom": ODOM}
    evidence = driven(topics, ("/vel", TWIST), ("/odom", ODOM), mps=5.0, seconds=6.0)
    assert chosen(choose(topics, evidence=evidence))["speed"] == "/odom"
    assert evidence.receive("/vel", twist(0.1), 7.0), "it may decide otherwise"
    assert chosen(choose(topics, evidence=evidence))["speed"] == "/vel"


@pytest.mark.parametrize("sigma_m", [0.5, 2.5, 6.0])
@pytest.mark.parametrize("hz", [1, 10])
def test_a_receiver_that_wanders_at_standstill_proves_nothing(sigma_m: float, hz: int) -> None:
    """With noise from fix to fix, and a slow wander of minutes."""
    rng, topics, at = np.random.default_rng(7), {"/vel": TWIST, "/fix": FIX}, np.zeros(2)
    evidence = driven(topics, ("/vel", TWIST), ("/fix", FIX), mps=0.0, seconds=0.2)
    for n in range(150 * hz):
        at = at * (1 - 0.01 / hz) + rng.normal(0, sigma_m * math.sqrt(0.02 / hz), 2)
        shown = at + rng.normal(0, 0.3 * sigma_m, 2)
        evidence.receive("/fix", fix(shown[0], shown[1], sigma_m**2), n / hz)
        evidence.receive("/vel", twist(0.0), n / hz + 0.01)
    assert not evidence.of("/vel").is_twist_empty


def test_jumps_of_an_odometry_and_one_that_is_lost_prove_nothing() -> None:
    topics = {"/vel": TWIST, "/odom": ODOM}
    evidence = driven(topics, ("/vel", TWIST), ("/odom", ODOM), mps=0.0, seconds=0.2)
    for n in range(300):
        evidence.receive("/odom", odometry(20.0 * (n // 30), 0.0), n / 10)
        evidence.receive("/vel", twist(0.0), n / 10)
    assert not evidence.of("/vel").is_twist_empty
    for n in range(300):
        lost = odometry(3.0 * n, 0.0)
        lost["pose"]["covariance"] = [1e6] * 36
        evidence.receive("/odom", lost, 100.0 + n / 10)
        evidence.receive("/vel", twist(0.0), 100.0 + n / 10)
    assert not evidence.of("/vel").is_twist_empty


@pytest.mark.parametrize("second", ["agv2", "robot_b"])
def test_another_car_that_drives_shows_nothing_of_this_one(second: str) -> None:
    topics = {f"/{car}/{tail}": kind for car in ("agv1", second) for tail, kind in {"odom": ODOM, "fix": FIX}.items()}
    zero, other = ("/agv1/odom", ODOM), (f"/{second}/odom", ODOM)
    evidence = driven(topics, zero, other, mps=5.0, seconds=20.0)
    assert not evidence.of("/agv1/odom").is_twist_empty
    assert chosen(choose(topics, {"position": "/agv1/fix"}, evidence=evidence))["speed"] == "/agv1/odom"


def test_what_the_operator_chose_is_not_contradicted_by_what_may_be_a_command() -> None:
    zero = ("/vehicle/speed", FLOAT)
    choice = choice_of(zero, ("/twist", TWIST), picked={"speed": "/vehicle/speed"})
    assert chosen(choice)["speed"] == "/vehicle/speed"
    choice = choice_of(zero, ("/odom", ODOM), picked={"speed": "/vehicle/speed"})
    assert choice.undecided["speed"] == "/vehicle/speed has no speed: its value is zero while /odom moves"


def test_an_odometry_whose_pose_rests_is_not_contradicted_by_a_twist() -> None:
    assert (
        not driven({"/odom": ODOM, "/twist": TWIST}, ("/odom", ODOM), ("/twist", TWIST), mps=5.0, seconds=9.0)
        .of("/odom")
        .is_twist_empty
    )


@pytest.mark.parametrize("zero", NAMES[2:4])
def test_a_recording_is_judged_by_the_odometry(tmp_path: Path, zero: tuple[str, str]) -> None:
    rows: list[Any] = []
    for n in range(200):
        at_s = n / 10
        mps = 0.0 if at_s < 8.0 else 6.0
        rows.append((at_s, "/odom", ODOM, odometry(6.0 * max(0.0, at_s - 8.0), mps)))
        rows.append((at_s, *zero, ZERO[zero[1]]))
    report = judged(write_ros1(tmp_path / "vel.bag", Drive(messages=rows)))
    row = next(row for row in report.signals() if row.name == "speed")
    assert (row.topic, row.highest) == ("/odom", pytest.approx(6.0))
    assert "speed_sources" not in {one.alarm_id for one in report.run.episodes}
