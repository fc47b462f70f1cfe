"""Obstacles by laser and by the estimator: distance, stopping distance, time to collision, and what is not known."""

from __future__ import annotations

from dataclasses import replace

import pytest

from monitor.check import Finding
from monitor.state import Reading, Snapshot
from monitor.values import Bearing, Distance, Steering, Twist
from tests.monitor.checks.known import LINK, ask, check_of, known
from tests.monitor.test_corridor import sweep


def seen(gap_m: float | None, speed_mps: float | None = 0.0, **more: object) -> Snapshot:
    things = [] if gap_m is None else [(gap_m, 0.0, 0.4)]
    speed = None if speed_mps is None else Twist(speed_mps=speed_mps, yaw_rate_radps=None)
    return known(scan=sweep([*things, (60.0, 0.0, 50.0)]), speed=speed, **more)


def estimated(gap_m: float | None, speed_mps: float | None = 0.0, **more: object) -> Snapshot:
    speed = None if speed_mps is None else Twist(speed_mps=speed_mps, yaw_rate_radps=None)
    return known(distance=Distance(distance_m=gap_m, none_in_range=gap_m is None), speed=speed, **more)


def before(snapshot: Snapshot, gap_m: float, age_s: float = 0.5) -> Snapshot:
    """The same with a sight of `age_s` before."""
    at_s = snapshot.now_s - age_s
    scan = Reading(value=sweep([(gap_m, 0.0, 0.4), (60.0, 0.0, 50.0)]), received_s=at_s, horizon_s=1.0)
    distance = Reading(value=Distance(distance_m=gap_m, none_in_range=False), received_s=at_s, horizon_s=1.0)
    return replace(snapshot, scan_before=scan, distance_before=distance)


CASES = [
    pytest.param(None, 0.0, False, "ok", id="nothing"),
    pytest.param(6.0, 0.0, False, "ok", id="standing, beyond the standoff"),
    pytest.param(5.1, 0.0, False, "ok", id="just beyond"),
    pytest.param(4.9, 0.0, False, "fault", id="just within"),
    pytest.param(5.3, 0.0, True, "fault", id="held by the deadband"),
    pytest.param(5.6, 0.0, True, "ok", id="cleared beyond the deadband"),
    pytest.param(14.0, 6.0, False, "ok", id="6 m/s stop in 12 m"),
    pytest.param(11.5, 6.0, False, "fault", id="within the stopping distance"),
    pytest.param(11.5, -6.0, False, "fault", id="reversing counts by its amount"),
    pytest.param(4.9, None, False, "fault", id="speed unknown: the standoff still holds"),
    pytest.param(8.0, None, False, "ok", id="speed unknown: beyond the standoff"),
]


@pytest.mark.parametrize(("gap_m", "speed_mps", "was_active", "verdict"), CASES)
@pytest.mark.parametrize(("id", "make"), [("obstacle", seen), ("obstacle_nearest", estimated)])
def test_verdict(id: str, make, gap_m: float | None, speed_mps: float | None, was_active: bool, verdict: str) -> None:
    # The time to collision has tests of its own.
    finding: Finding = ask(id, make(gap_m, speed_mps), was_active=was_active, time_to_collision_s=0.5)
    assert finding.verdict == verdict


@pytest.mark.parametrize(("id", "make"), [("obstacle", seen), ("obstacle_nearest", estimated)])
def test_time_to_collision(id: str, make) -> None:
    """5 m/s, 10 m ahead, standing obstacle: 2 s are just enough at 9.17 m of stopping distance, 9.6 m are too soon."""
    assert ask(id, before(make(10.5, 5.0), 13.0)).verdict == "ok"
    assert ask(id, before(make(9.6, 5.0), 12.1)).verdict == "fault"
    following = before(make(9.6, 5.0), 9.6)
    assert ask(id, following).verdict == "ok"  # the car ahead drives as fast: nothing closes
    comes = before(make(15.0, 5.0), 20.0)
    assert ask(id, comes).verdict == "fault"  # it comes towards us at 5 m/s: 10 m/s close 15 m in 1.5 s
    appeared = before(make(9.6, 5.0), 60.0)
    assert ask(id, appeared).verdict == "fault"  # another object than before: taken for standing


def test_no_object_of_the_estimator_is_nothing_in_the_way() -> None:
    assert ask("obstacle_nearest", estimated(None, 8.0)).verdict == "ok"


def test_a_blind_laser_shows_nothing_of_obstacles() -> None:
    assert ask("obstacle", known(scan=sweep([]), speed=Twist(speed_mps=0.0, yaw_rate_radps=None))).verdict == "unknown"


def test_steering_looks_round_the_bend() -> None:
    wall = (60.0, 0.0, 50.0)
    scan = sweep([(7.0, 1.9, 0.4), wall])
    straight = known(
        scan=scan, speed=Twist(speed_mps=4.5, yaw_rate_radps=None), steering=Steering(percent=0.0, tyre_rad=0.0)
    )
    left = known(
        scan=scan, speed=Twist(speed_mps=4.5, yaw_rate_radps=None), steering=Steering(percent=-20.0, tyre_rad=0.1072)
    )
    assert ask("obstacle", straight).verdict == "ok"
    assert ask("obstacle", left).verdict == "fault"


@pytest.mark.parametrize("id", ["obstacle", "obstacle_nearest"])
def test_what_is_not_published_does_not_apply_and_what_is_silent_is_unknown(id: str) -> None:
    signal = {"obstacle": "scan", "obstacle_nearest": "distance"}[id]
    assert not ask(id, known()).applies
    silent = ask(id, known(link=replace(LINK, published=frozenset({signal}))))
    assert (silent.verdict, silent.applies) == ("unknown", True)
    make = {"obstacle": seen, "obstacle_nearest": estimated}[id]
    assert ask(id, make(3.0, 0.0, age_s=1.5)).verdict == "unknown"


def test_the_text_states_what_where_and_against_what() -> None:
    snapshot = estimated(4.2, 0.0, bearing=Bearing(bearing_rad=-0.09))
    assert ask("obstacle_nearest", snapshot).text == "Obstacle 4.2 m ahead, 5° right, 5.0 m needed"


def test_the_alarm_is_the_reports_dialog() -> None:
    spec = check_of("obstacle").alarm
    assert (spec.place, spec.priority, spec.off_delay_s) == ("dialog", "critical", 1.0)
