"""The corridor: straight and bent, what stands in it, what it cannot see."""

from __future__ import annotations

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from monitor.corridor import Corridor, along_and_aside, look
from monitor.scan import usable
from monitor.values import LaserScan

STRAIGHT = Corridor(half_width_m=1.2, wheelbase_m=2.62, laser_ahead_m=2.5)


def bent(tyre_angle_rad: float) -> Corridor:
    return Corridor(half_width_m=1.2, wheelbase_m=2.62, laser_ahead_m=2.5, tyre_angle_rad=tyre_angle_rad)


def sweep(
    things: list[tuple[float, float, float]], *, beams: int = 181, nothing: float = np.inf, turned: bool = False
) -> LaserScan:
    """A scan of ±90° that sees discs (x, y, radius) in the laser frame; `turned`: the increment is negative."""
    angles = np.linspace(-np.pi / 2, np.pi / 2, beams)
    if turned:
        angles = angles[::-1]
    ranges = np.full(beams, nothing, dtype=np.float32)
    for x, y, radius in things:
        distance, bearing = math.hypot(x, y), math.atan2(y, x)
        seen = np.abs(angles - bearing) <= math.asin(radius / distance)
        ranges[seen] = np.minimum(ranges[seen], distance)
    return LaserScan(
        ranges_m=ranges,
        angle_min_rad=float(angles[0]),
        angle_max_rad=float(angles[-1]),
        angle_increment_rad=float(angles[1] - angles[0]),
        time_increment_s=0.0,
        scan_time_s=0.0,
        range_min_m=0.1,
        range_max_m=81.0,
        frame_id="laser",
    )


@pytest.mark.parametrize(
    ("things", "gap_m"),
    [
        pytest.param([], None, id="nothing"),
        pytest.param([(8.0, 0.0, 0.3)], 8.0, id="straight ahead"),
        pytest.param([(8.0, 1.0, 0.3)], 8.0, id="in the strip, left"),
        pytest.param([(8.0, -1.0, 0.3)], 8.0, id="in the strip, right"),
        pytest.param([(8.0, 2.0, 0.3)], None, id="beside the strip"),
        pytest.param([(8.0, 0.0, 0.3), (4.0, 0.5, 0.2)], 4.0, id="the nearer of two"),
        pytest.param([(4.0, 3.0, 0.5), (9.0, 0.0, 0.3)], 9.0, id="the nearer one stands aside"),
    ],
)
@pytest.mark.parametrize("turned", [False, True], ids=["left to right", "negative increment"])
def test_straight(things: list[tuple[float, float, float]], gap_m: float | None, turned: bool) -> None:
    sight = look(sweep(things, turned=turned), STRAIGHT, 5.0)
    if gap_m is None:
        assert sight.gap_m is None
    else:
        assert sight.gap_m == pytest.approx(gap_m, abs=0.2)
        assert sight.bearing_rad is not None


def test_one_stray_beam_is_no_obstacle() -> None:
    scan = sweep([])
    scan.ranges_m[90] = 3.0
    assert look(scan, STRAIGHT, 5.0).gap_m is None
    scan = sweep([])
    scan.ranges_m[90:92] = 3.0
    assert look(scan, STRAIGHT, 5.0).gap_m == pytest.approx(3.0, abs=0.05)


def test_steering_bends_the_corridor_left_for_a_positive_angle() -> None:
    """Ten metres on a radius of 26 m: a disc on the bent path is in the way, one straight ahead is not; mirrored
    too."""
    on_the_way = [(9.0, 2.6, 0.3)]
    for turn in (1, -1):
        thing = [(x, y * turn, r) for x, y, r in on_the_way]
        assert look(sweep(thing), bent(0.1 * turn), 5.0).gap_m == pytest.approx(9.5, abs=0.5)
        assert look(sweep(thing), STRAIGHT, 5.0).gap_m is None
        assert look(sweep(thing), bent(-0.1 * turn), 5.0).gap_m is None
        assert look(sweep([(15.0, 0.0, 0.3)]), bent(0.1 * turn), 5.0).gap_m is None


@pytest.mark.parametrize("angle_rad", [0.0006, -0.0006])
def test_the_bent_corridor_becomes_the_straight_one(angle_rad: float) -> None:
    x, y = np.array([2.0, 5.0, 10.0, 10.0]), np.array([0.0, 1.0, -1.5, 1.1])
    along, aside = along_and_aside(x, y, bent(angle_rad))
    straight_along, straight_aside = along_and_aside(x, y, STRAIGHT)
    assert np.allclose(along, straight_along, atol=0.02)
    assert np.allclose(aside, straight_aside, atol=0.06)


def test_a_beam_without_a_return_is_blind_and_never_free() -> None:
    sight = look(sweep([], nothing=np.nan), STRAIGHT, 5.0)
    assert sight.beams == pytest.approx(28, abs=3)
    assert sight.blind == sight.beams
    assert look(sweep([(10.0, 0.0, 9.0)]), STRAIGHT, 5.0).blind == 0


@pytest.mark.parametrize("n", [0, 1, 2])
def test_hardly_any_beam(n: int) -> None:
    scan = LaserScan(
        ranges_m=np.full(n, 3.0, dtype=np.float32),
        angle_min_rad=0.0,
        angle_max_rad=0.01 * max(0, n - 1),
        angle_increment_rad=0.01,
        time_increment_s=0.0,
        scan_time_s=0.0,
        range_min_m=0.1,
        range_max_m=81.0,
        frame_id="laser",
    )
    assert look(scan, STRAIGHT, 5.0).gap_m == (pytest.approx(3.0, abs=0.01) if n == 2 else None)


def test_what_is_nearer_than_range_min_or_behind_is_nothing() -> None:
    scan = sweep([(0.05, 0.0, 0.04)])
    assert look(scan, STRAIGHT, 5.0).gap_m is None
    behind = LaserScan(
        ranges_m=np.full(10, 3.0, dtype=np.float32),
        angle_min_rad=math.pi - 0.05,
        angle_max_rad=math.pi + 0.04,
        angle_increment_rad=0.01,
        time_increment_s=0.0,
        scan_time_s=0.0,
        range_min_m=0.1,
        range_max_m=81.0,
        frame_id="rear",
    )
    assert look(behind, STRAIGHT, 5.0).gap_m is None


def reckoned(scan: LaserScan, corridor: Corridor) -> float | None:
    """The gap point by point, as the model has it."""
    good = usable(scan.ranges_m, scan.range_min_m, scan.range_max_m)
    angles = scan.angle_min_rad + scan.angle_increment_rad * np.arange(scan.beams)
    ranges = np.where(good, scan.ranges_m, 0.0).astype(np.float64)
    along, aside = along_and_aside(ranges * np.cos(angles), ranges * np.sin(angles), corridor)
    inside = good & (aside <= 0) & (along > 0) & (np.cos(angles) > 0)
    gaps = [max(along[i], along[i + 1]) for i in range(scan.beams - 1) if inside[i] and inside[i + 1]]
    return min(gaps, default=None)


@given(
    seed=st.integers(0, 10_000),
    angle_rad=st.one_of(st.floats(-0.6, 0.6), st.sampled_from([0.0, 1e-4, 6e-4, 0.6])),
    half_width_m=st.floats(0.5, 3.0),
    wheelbase_m=st.floats(0.5, 8.0),
    ahead_m=st.floats(-2.0, 8.0),
    turned=st.booleans(),
)
def test_every_beam_is_taken_as_the_model_has_it(
    seed: int, angle_rad: float, half_width_m: float, wheelbase_m: float, ahead_m: float, turned: bool
) -> None:
    random = np.random.default_rng(seed)
    scan = sweep([], beams=int(random.integers(1, 300)) + 1, turned=turned)
    scan.ranges_m[:] = random.uniform(0, 12, scan.beams)
    scan.ranges_m[random.uniform(size=scan.beams) < 0.2] = random.choice([np.nan, np.inf, -np.inf, 0.05, 99.0])
    corridor = Corridor(
        half_width_m=half_width_m, wheelbase_m=wheelbase_m, laser_ahead_m=ahead_m, tyre_angle_rad=angle_rad
    )
    found, expected = look(scan, corridor, 5.0).gap_m, reckoned(scan, corridor)
    assert found == (expected if expected is None else pytest.approx(expected, abs=1e-4))


def test_beams_without_a_return_are_nothing_in_the_way() -> None:
    scan = sweep([], beams=3)  # the middle one straight ahead
    scan.ranges_m[:] = [3.0, np.inf, 0.5]
    assert look(scan, STRAIGHT, 5.0).gap_m is None
