"""Values and stamps that repeat themselves: counted only in motion, forgotten at a gap, equal to the last bit."""

from __future__ import annotations

import math
from collections.abc import Callable

import numpy as np
import pytest

from monitor.freeze_detection import KNOWN_AFTER, RepeatFollower, Repeats, Wheels
from monitor.values import Effort, GpsFix, Odometry, Twist, Value
from tests.monitor.drive import sweep


def follow(
    values: Callable[[int], Value],
    messages: int,
    *,
    speed_mps: float = 4.0,
    stamp: Callable[[int], float | None] = lambda _: None,
) -> Repeats | None:
    """What the last of so many messages at 20 Hz repeats, with the wheels at one speed."""
    follower, wheels, last = RepeatFollower(), Wheels(), None
    for n in range(messages):
        wheels.add(0.05 * n, speed_mps)
        last = follower.receive(values(n), stamp(n), 0.05 * n, wheels)
    return last


def test_a_value_that_changes_repeats_nothing() -> None:
    assert follow(lambda n: Twist(speed_mps=4.0 + 0.001 * n), 100) == Repeats()


def test_a_held_value_is_timed_by_the_motion_of_the_wheels() -> None:
    held = follow(lambda _: GpsFix(lat_deg=32.0, lon_deg=-110.0), 41)
    assert held is not None
    assert (held.value_n, held.stamp_n) == (40, 0)
    assert (held.value_s, held.value_m) == (pytest.approx(2.0), pytest.approx(8.0))


@pytest.mark.parametrize("speed_mps", [0.0, 0.3, math.nan], ids=["standing", "noise of the wheels", "NaN"])
def test_at_rest_no_time_is_counted(speed_mps: float) -> None:
    held = follow(lambda _: GpsFix(lat_deg=32.0, lon_deg=-110.0), 100, speed_mps=speed_mps)
    assert held is not None
    assert (held.value_n, held.value_s, held.value_m) == (99, 0.0, 0.0)


def test_reversing_is_motion_too() -> None:
    held = follow(lambda _: Odometry(x_m=0.0, y_m=0.0), 41, speed_mps=-4.0)
    assert held is not None
    assert held.value_m == pytest.approx(8.0)


def test_a_gap_of_the_speed_is_no_way_driven() -> None:
    wheels = Wheels()
    for at_s in (0.0, 10.0, 10.5, 9.0):
        wheels.add(at_s, 4.0)
    assert (wheels.moved_s, wheels.moved_m) == (0.5, 2.0)


@pytest.mark.parametrize(
    ("ranges", "repeats"),
    [
        ((5.0, 6.0), True),
        ((math.nan, math.inf, -math.inf), True),
        ((), True),
        ((5.0,), True),
    ],
    ids=["returns", "NaN and ±Inf are what they are", "empty", "one beam"],
)
def test_scans_are_compared_beam_by_beam(ranges: tuple[float, ...], repeats: bool) -> None:
    held = follow(lambda _: sweep(ranges), 10)
    assert held is not None
    assert (held.value_n == 9) is repeats


def test_one_beam_that_differs_in_its_last_bit_is_another_scan() -> None:
    def scan(n: int) -> Value:
        ranges = np.array([5.0, 6.0], dtype=np.float32)
        if n % 2:
            ranges[1] = np.nextafter(ranges[1], np.float32(9.0))
        return sweep(ranges.tolist())

    assert follow(scan, 10) == Repeats()


def test_a_pedal_without_a_stamp_is_not_followed_at_all() -> None:
    assert follow(lambda _: Effort(percent=0.0), 50) is None


def test_a_stamp_that_stands_is_timed_by_arrival_whatever_the_car_does() -> None:
    held = follow(lambda _: Effort(percent=0.0), 41, speed_mps=0.0, stamp=lambda _: 1e9)
    assert held == Repeats(stamp_n=40, stamp_s=2.0)
    assert follow(lambda _: Effort(percent=0.0), 41, stamp=lambda n: 1e9 + n) == Repeats()


def test_a_stamp_that_is_not_given_is_none_that_stands() -> None:
    held = follow(lambda _: GpsFix(lat_deg=32.0, lon_deg=-110.0), 41)
    assert held is not None
    assert held.stamp_s == 0.0


@pytest.mark.parametrize(
    ("every", "lively"), [(1, 1.0), (2, 0.5), (5, 0.2)], ids=["always new", "every other one", "every fifth"]
)
def test_liveliness_is_the_share_of_new_values_in_motion(every: int, lively: float) -> None:
    last = follow(lambda n: Twist(speed_mps=4.0 + 0.001 * min(n // every, 100 // every)), 130)
    assert last is not None
    assert last.liveliness == pytest.approx(lively, abs=0.05)


def test_before_two_seconds_of_motion_liveliness_is_not_known() -> None:
    def starts(n: int) -> Value:
        return Twist(speed_mps=4.0 + 0.001 * min(n, KNOWN_AFTER - 2))

    short = follow(starts, 60)
    assert short is not None
    assert short.liveliness is None
    standing = follow(lambda n: Twist(speed_mps=0.0001 * min(n, 90)), 100, speed_mps=0.0)
    assert standing is not None
    assert standing.liveliness is None


def test_a_stretch_that_was_frozen_does_not_make_a_signal_sluggish() -> None:
    def freezes(n: int) -> Value:
        return Twist(speed_mps=4.0 + 0.001 * (n if n < 200 else 200 if n < 400 else n if n < 600 else 600))

    last = follow(freezes, 650)
    assert last is not None
    assert last.liveliness is not None
    assert last.liveliness > 0.85


def test_after_a_gap_nothing_is_repeated() -> None:
    follower, wheels = RepeatFollower(), Wheels()
    fix = GpsFix(lat_deg=32.0, lon_deg=-110.0)
    follower.receive(fix, 5.0, 0.0, wheels)
    follower.restart()
    assert follower.receive(fix, 5.0, 60.0, wheels) == Repeats()
