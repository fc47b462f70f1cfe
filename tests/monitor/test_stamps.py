"""Two clocks beside each other: jumps, drift, late bursts, odd stamps, replays at another pace."""

from __future__ import annotations

import random
from collections.abc import Callable

import pytest

from monitor.car_clock import ClockJump, StampFollower, merged

EPOCH_S = 1_469_722_837.0  # the car's clock when ours is 0


def run(
    stamp: Callable[[float], float],
    *,
    hz: float = 10.0,
    seconds: float = 60.0,
    late: Callable[[float], float] | None = None,
) -> tuple[list[tuple[float, float]], float]:
    """Jumps as (when, by), and the last change, of stamps as a function of true time; `late`: how long one is on its
    way."""
    follower, jumps, arrival_s = StampFollower(), [], 0.0
    for n in range(round(seconds * hz)):
        at_s = n / hz
        arrival_s = max(arrival_s, at_s + (0.0 if late is None else late(at_s)))
        jump_s = follower.receive(stamp(at_s), arrival_s)
        if jump_s is not None:
            jumps.append((round(arrival_s, 2), round(jump_s, 2)))
    assert follower.change_s is not None
    return jumps, follower.change_s


def steady(at_s: float) -> float:
    return EPOCH_S + at_s


def test_a_steady_clock_neither_jumps_nor_drifts() -> None:
    jumps, change_s = run(steady)
    assert jumps == []
    assert change_s == pytest.approx(0.0, abs=1e-6)


@pytest.mark.parametrize("by_s", [-3600.0, -30.0, -2.0, 1.0, 30.0, 1e9])
@pytest.mark.parametrize("hz", [1.0, 10.0, 75.0])
def test_a_step_between_two_steady_stretches_is_a_jump(by_s: float, hz: float) -> None:
    jumps, change_s = run(lambda at_s: steady(at_s) + (by_s if at_s >= 30.0 else 0.0), hz=hz)
    ((at_s, jump_s),) = jumps
    assert jump_s == pytest.approx(by_s, abs=0.05)
    assert 30.0 <= at_s <= 30.0 + 3.0 / hz  # the third message that agrees
    assert change_s == pytest.approx(0.0, abs=0.05)


def test_a_loop_of_a_recording_is_one_jump_each_time() -> None:
    jumps, _ = run(lambda at_s: EPOCH_S + at_s % 20.0)
    assert [jump_s for _, jump_s in jumps] == [-20.0, -20.0]


def test_a_step_too_small_to_be_one_is_none() -> None:
    assert run(lambda at_s: steady(at_s) + (0.4 if at_s >= 30.0 else 0.0))[0] == []


@pytest.mark.parametrize("odd", [0.0, 1.0, EPOCH_S - 3600.0, EPOCH_S + 3600.0, 9e10])
def test_single_odd_stamps_are_no_jump(odd: float) -> None:
    def with_odd(at_s: float) -> float:
        return odd if round(at_s * 10) in (150, 151, 300, 450) else steady(at_s)

    jumps, change_s = run(with_odd)
    assert jumps == []
    assert change_s == pytest.approx(0.0, abs=0.01)


def test_garbage_that_never_agrees_with_itself_is_no_jump() -> None:
    noise = random.Random(1)
    jumps, _ = run(lambda at_s: steady(at_s) if at_s < 20.0 or at_s > 20.8 else noise.uniform(0.0, 1e10))
    assert jumps == []


def test_two_writers_with_two_clocks_are_no_jumps() -> None:
    assert run(lambda at_s: steady(at_s) + (3.0 if round(at_s * 10) % 2 else 0.0))[0] == []


@pytest.mark.parametrize("gap_s", [0.5, 3.0, 20.0])
def test_a_burst_after_a_gap_of_the_radio_is_no_jump(gap_s: float) -> None:
    """All that waited comes at once, late and in order."""
    jumps, change_s = run(steady, late=lambda at_s: max(0.0, 30.0 + gap_s - at_s) if at_s >= 30.0 else 0.0)
    assert jumps == []
    assert change_s == pytest.approx(0.0, abs=0.05)


def test_the_first_messages_may_have_waited() -> None:
    assert run(steady, late=lambda at_s: max(0.0, 3.0 - at_s))[0] == []


def test_jitter_of_a_radio_is_neither() -> None:
    noise = random.Random(2)
    jumps, change_s = run(steady, late=lambda _: noise.expovariate(20.0))
    assert jumps == []
    assert abs(change_s) < 0.3


@pytest.mark.parametrize("pace", [0.5, 0.9, 1.1, 2.0, 10.0])
def test_another_pace_is_a_change_and_no_jump(pace: float) -> None:
    jumps, change_s = run(lambda at_s: EPOCH_S + pace * at_s)
    assert jumps == []
    assert change_s == pytest.approx((pace - 1.0) * 60.0, rel=0.15)


def test_a_queue_that_grows_is_a_change() -> None:
    _, change_s = run(steady, late=lambda at_s: 0.05 * at_s)
    assert change_s == pytest.approx(-3.0, abs=0.2)


def test_the_drift_of_two_good_clocks_is_followed() -> None:
    """100 ppm, an hour: a third of a second, which needs no alarm."""
    _, change_s = run(lambda at_s: EPOCH_S + 1.0001 * at_s, hz=1.0, seconds=3600.0)
    assert abs(change_s) < 0.01


def test_a_restart_makes_all_differences_new() -> None:
    follower = StampFollower()
    for n in range(100):
        follower.receive(steady(n / 10), n / 10)
    follower.restart()
    assert follower.change_s is None
    assert [follower.receive(steady(n / 10) - 500.0, 20.0 + n / 10) for n in range(100)] == [None] * 100
    assert follower.change_s == pytest.approx(0.0, abs=1e-6)


def test_one_jump_that_several_signals_show_is_one() -> None:
    first = merged(None, "scan", 10.0, -30.0)
    both = merged(first, "position", 10.2, -30.1)
    assert both == ClockJump(at_s=10.0, by_s=-30.0, signals=("scan", "position"))
    assert merged(both, "scan", 10.4, -30.0) == both
    assert merged(both, "scan", 15.0, -30.0) == ClockJump(at_s=15.0, by_s=-30.0, signals=("scan",))
    assert merged(both, "scan", 11.0, 30.0).signals == ("scan",)
    assert merged(both, "scan", 2.0, -30.0).at_s == 2.0
