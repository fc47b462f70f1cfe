"""What shows that a car moves is more than the wander of a receiver, a jump or what happened in a pause."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from server.judge.sources.candidates import follow
from server.judge.sources.choice import choose
from server.judge.sources.evidence import Evidence
from tests.server.judge.test_sources import FIX, ODOM, TWIST, chosen, odometry, twist
from tests.server.judge.test_unfilled import FLOAT, ZERO, fix

GPS = "/odometry/gps"
SECONDS = 600


def following(topics: dict[str, str]) -> Evidence:
    evidence = Evidence()
    follow(evidence, topics, {})
    return evidence


def wander(hz: int, seed: int) -> Any:
    """Places of a receiver at rest, as rows of x and y [m]: a slow wander of 2.5 m, and noise of 0.75 m."""
    rng, at = np.random.default_rng(seed), np.zeros(2)
    for _ in range(SECONDS * hz):
        at = at * (1 - 0.02 / hz) + rng.normal(0, 2.5 * math.sqrt(0.04 / hz), 2)
        yield at + rng.normal(0, 0.75, 2)


def pose(x_m: float, y_m: float, mps: float = 0.0) -> dict[str, Any]:
    found = odometry(x_m, mps)
    found["pose"]["pose"]["position"]["y"] = y_m
    return found


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("hz", [1, 10])
@pytest.mark.parametrize("zero", [("/vel", TWIST), ("/vehicle/speed", FLOAT)])
def test_a_parked_car_keeps_its_speed_beside_an_odometry_of_its_receiver(
    zero: tuple[str, str], hz: int, seed: int
) -> None:
    topics = dict([zero, (GPS, ODOM)])
    evidence = following(topics)
    for n, (x_m, y_m) in enumerate(wander(hz, seed)):
        evidence.receive(GPS, pose(x_m, y_m), n / hz)
        evidence.receive(zero[0], ZERO[zero[1]], n / hz + 0.01)
    assert not evidence.of(zero[0]).is_twist_empty
    assert chosen(choose(topics, evidence=evidence))["speed"] == zero[0]


@pytest.mark.parametrize("seed", range(10))
@pytest.mark.parametrize("hz", [1, 10])
def test_a_parked_car_keeps_the_twist_of_an_odometry_that_fuses_its_receiver(hz: int, seed: int) -> None:
    """The wheels stand still, and the pose wanders."""
    evidence = following({"/odom": ODOM})
    for n, (x_m, y_m) in enumerate(wander(hz, seed)):
        evidence.receive("/odom", pose(x_m, y_m), n / hz)
    assert chosen(choose({"/odom": ODOM}, evidence=evidence))["speed"] == "/odom"


@pytest.mark.parametrize(("way_m", "is_refused"), [(14.0, False), (60.0, False), (200.0, True)])
def test_poses_without_a_twist_prove_as_little_as_positions_until_they_are_far(way_m: float, is_refused: bool) -> None:
    topics = {"/vel": TWIST, GPS: ODOM}
    evidence = following(topics)
    for n in range(101):
        evidence.receive(GPS, pose(way_m * n / 100, 0.0), n / 20)
        evidence.receive("/vel", twist(0.0), n / 20)
    choice = choose(topics, evidence=evidence)
    assert ("speed" in choice.refused) == is_refused
    assert evidence.of("/vel").is_twist_empty == (way_m > 15.0)
    if not is_refused:
        assert chosen(choice)["speed"] == "/vel"


def test_all_that_are_refused_stay_watched_however_many() -> None:
    topics = {f"/odom_{name}": ODOM for name in "abcdef"}
    evidence = following(topics)
    for n in range(60):
        for topic in topics:
            evidence.receive(topic, pose(0.4 * n, 0.0), n / 10)
    choice = choose(topics, evidence=evidence)
    assert "speed" in choice.refused
    assert {one.topic for one in choice.watched["speed"]} == set(topics)
    assert not any(one.carries for one in choice.watched["speed"])


@pytest.mark.parametrize("number", [math.nan, 0.0])
def test_poses_of_an_odometry_that_states_no_velocity_are_no_proof_as_slow_as_noise(number: float) -> None:
    topics = {"/vel": TWIST, GPS: ODOM}
    evidence = following(topics)
    for n in range(600):
        evidence.receive(GPS, pose(0.7 * n / 10, 0.0, number), n / 10)
        evidence.receive("/vel", twist(0.0), n / 10)
    assert not evidence.of("/vel").is_twist_empty


def test_poses_beside_a_twist_that_is_filled_are_proof() -> None:
    """A twist that lags behind, or in another unit."""
    evidence = following({"/vel": TWIST, "/odom": ODOM})
    for n in range(60):
        evidence.receive("/odom", pose(1.5 * n / 10, 0.0, 0.5), n / 10)
        evidence.receive("/vel", twist(0.0), n / 10)
    assert evidence.of("/vel").is_empty_by_odometry


# -- jumps and pauses --------------------------------------------------------------------------------------------------


def shown_by(kind: str, rows: list[tuple[float, float]]) -> bool:
    """Whether these places (when, way in m) prove a motion beside a twist that is zero."""
    evidence = following({"/vel": TWIST, "/other": kind})
    evidence.receive("/other", pose(0.0, 0.0, 0.5) if kind == ODOM else fix(0.0), rows[0][0] - 0.1)
    places = dict(rows)
    for n in range(round(rows[-1][0] * 10) + 1):
        at_s = round(n / 10, 1)
        if at_s in places:
            evidence.receive("/other", pose(places[at_s], 0.0, 0.5) if kind == ODOM else fix(places[at_s]), at_s)
        evidence.receive("/vel", twist(0.0), at_s)
    return evidence.of("/vel").is_twist_empty


@pytest.mark.parametrize("kind", [FIX, ODOM])
@pytest.mark.parametrize("pause_s", [1.0, 2.0, 2.5, 3.0])
def test_one_jump_is_no_motion_whatever_the_pause_before_it(kind: str, pause_s: float) -> None:
    before = [(round(n * pause_s, 1), 0.0) for n in range(8)]
    after = [(round(n * pause_s, 1), 40.0) for n in range(8, 16)]
    assert not shown_by(kind, before + after)


@pytest.mark.parametrize("kind", [FIX, ODOM])
def test_two_lost_fixes_and_a_jump_are_no_motion(kind: str) -> None:
    rows = [(float(n), 0.0 if n < 10 else 40.0) for n in range(20) if n not in (8, 9)]
    assert not shown_by(kind, rows)


@pytest.mark.parametrize("kind", [FIX, ODOM])
@pytest.mark.parametrize(("period_s", "is_shown"), [(0.2, True), (1.0, True), (2.5, False)])
def test_a_drive_is_shown_by_places_without_a_pause_alone(kind: str, period_s: float, is_shown: bool) -> None:
    assert (
        shown_by(kind, [(round(n * period_s, 1), 8.0 * n * period_s) for n in range(round(20 / period_s))]) == is_shown
    )


@pytest.mark.parametrize("kind", [FIX, ODOM])
def test_a_drive_is_shown_again_after_fixes_were_lost(kind: str) -> None:
    assert shown_by(kind, [(float(n), 8.0 * n) for n in range(20) if n not in (1, 2, 3, 5, 6)])
    assert not shown_by(kind, [(float(n), 8.0 * n) for n in range(20) if n % 3 == 0])


def test_two_speeds_with_a_pause_between_them_are_no_motion() -> None:
    evidence = following({"/vel": TWIST, "/speed": FLOAT})
    for n in range(26):
        if n in (0, 25):
            evidence.receive("/speed", {"data": 4.0}, n / 10)
        evidence.receive("/vel", twist(0.0), n / 10)
    assert not evidence.of("/vel").is_twist_empty
