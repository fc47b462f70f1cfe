"""Acceleration out of speed, and standing."""

from __future__ import annotations

import random

import pytest

from monitor.motion import Slope, Standstill


def test_a_steady_pull_is_its_slope() -> None:
    slope = Slope()
    found = [slope.add(0.05 * n, 0.1 * n) for n in range(40)]
    assert found[5] is None  # 0.25 s tell too little
    assert found[-1] == pytest.approx(2.0)


def test_jitter_of_the_way_hardly_shows() -> None:
    """20 Hz with messages up to 20 ms late, as on the real car's network."""
    noise, slope = random.Random(2), Slope()
    found = [slope.add(0.05 * n + 0.02 * noise.random(), 1.5 * 0.05 * n) for n in range(200)]
    settled = [value for value in found[20:] if value is not None]
    assert len(settled) == 180
    assert all(abs(value - 1.5) < 0.12 for value in settled)


def test_bunching_on_wifi_does_not_invent_emergency_braking() -> None:
    """Every 0.2 s four messages arrive at once."""
    slope = Slope()
    found = [slope.add(n // 4 * 0.2 + 0.0002 * (n % 4), 1.5 * 0.05 * n) for n in range(200)]
    settled = [value for value in found[20:] if value is not None]
    assert settled
    assert all(abs(value - 1.5) < 0.5 for value in settled)


def test_a_stall_of_half_a_second_and_its_burst() -> None:
    slope, found = Slope(), []
    for n in range(100):
        at_s = 0.05 * n
        found.append(slope.add(3.0 if 2.5 < at_s < 3.0 else at_s, 1.0 * at_s))
    settled = [value for value in found[20:] if value is not None]
    assert all(-0.5 < value < 2.0 for value in settled)


@pytest.mark.parametrize("hz", [2.0, 5.0, 10.0, 50.0])
def test_slower_and_faster_signals(hz: float) -> None:
    slope = Slope()
    found = [slope.add(n / hz, -3.0 * n / hz) for n in range(int(4 * hz))]
    assert found[-1] == pytest.approx(-3.0)


def test_one_message_a_second_still_tells() -> None:
    slope = Slope()
    assert [slope.add(float(n), 0.5 * n) for n in range(4)][-1] == pytest.approx(0.5)


def test_after_a_gap_it_begins_anew() -> None:
    slope = Slope()
    for n in range(20):
        slope.add(0.05 * n, 0.0)
    assert slope.add(20.0, 10.0) is None


def test_what_cannot_be_known_is_none() -> None:
    slope = Slope()
    assert [slope.add(1.0, float(n)) for n in range(9)] == [None] * 9  # one moment has no slope
    assert slope.add(1.1, float("nan")) is None
    assert slope.add(0.5, 1.0) is None  # the clock went back


def test_standing_needs_two_seconds_and_moving_needs_more_than_noise() -> None:
    still = Standstill()
    story = [
        (0.0, 0.084, None),  # the noise of the real car at rest
        (1.9, 0.0, None),
        (2.0, -0.05, True),
        (3.0, 0.2, True),  # neither
        (3.1, 0.301, False),
        (3.2, 0.2, False),
        (3.3, 0.05, False),
        (5.2, 0.05, False),
        (5.3, 0.09, True),
        (5.4, -1.0, False),  # reversing
    ]
    for at_s, speed_mps, expected in story:
        still.add(at_s, speed_mps)
        assert still.is_standing is expected, at_s


def test_standing_since_when() -> None:
    still = Standstill()
    for at_s, speed_mps in [(0.0, 3.0), (1.0, 0.0), (4.0, 0.0)]:
        still.add(at_s, speed_mps)
    assert still.since_s == 1.0


@pytest.mark.parametrize(("speed_mps", "standing"), [(0.099, True), (0.1, None), (0.3, None), (0.301, False)])
def test_the_boundaries_of_standing(speed_mps: float, standing: bool | None) -> None:
    still = Standstill()
    for at_s in (0.0, 1.0, 2.0, 3.0):
        still.add(at_s, speed_mps)
    assert still.is_standing is standing


def test_not_a_number_is_neither() -> None:
    still = Standstill()
    for at_s in (0.0, 1.0, 2.0, 3.0):
        still.add(at_s, float("nan"))
    assert still.is_standing is None


def test_standing_while_the_clock_goes_back() -> None:
    still = Standstill()
    for at_s in (100.0, 103.0, 1.0):
        still.add(at_s, 0.0)
    assert (still.is_standing, still.since_s) == (True, 1.0)


@pytest.mark.parametrize("by_s", [-3600.0, -5.0, -0.7, -0.3, 0.4, 1.5, 2.9, 3.5, 7200.0])
def test_a_clock_that_is_set_makes_no_spike_of_the_slope(by_s: float) -> None:
    """The car gains 1 m/s each second, and its stamps leap once."""
    slope = Slope()
    found = []
    for number in range(100):
        at_s = 100.0 + number / 20
        found.append(slope.add(at_s + (by_s if number >= 50 else 0.0), number / 20))
    known = [one for one in found if one is not None]
    assert len(known) > 60
    assert max(known) < 1.05
    assert min(known) > 0.0
    assert known[-1] == pytest.approx(1.0)
