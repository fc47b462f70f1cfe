"""Which beams measured something, and which is the nearest."""

from __future__ import annotations

import math

import numpy as np
import pytest

from monitor.values import LaserScan

INF, NAN = math.inf, math.nan


def scan(ranges_m: list[float], low_m: float = 0.5, high_m: float = 80.0, increment_rad: float = 0.1) -> LaserScan:
    return LaserScan(
        ranges_m=np.array(ranges_m, dtype=np.float32),
        angle_min_rad=-0.1,
        angle_max_rad=-0.1 + increment_rad * (len(ranges_m) - 1),
        angle_increment_rad=increment_rad,
        time_increment_s=0.0,
        scan_time_s=0.0,
        range_min_m=low_m,
        range_max_m=high_m,
        frame_id="laser",
    )


@pytest.mark.parametrize(
    ("ranges_m", "usable", "nearest_m", "bearing_rad"),
    [
        pytest.param([], 0, None, None, id="empty"),
        pytest.param([3.0], 1, 3.0, -0.1, id="one beam"),
        pytest.param([3.0, 2.0, 4.0], 3, 2.0, 0.0, id="the middle one"),
        pytest.param([NAN, INF, -INF], 0, None, None, id="nothing measured"),
        pytest.param([NAN, 0.4, 5.0, 80.1], 1, 5.0, 0.1, id="out of range on both sides"),
        pytest.param([0.5, 80.0], 2, 0.5, -0.1, id="the limits are in range"),
        pytest.param([0.0, 0.0], 0, None, None, id="zeros"),
    ],
)
def test_usable_and_nearest(
    ranges_m: list[float], usable: int, nearest_m: float | None, bearing_rad: float | None
) -> None:
    one = scan(ranges_m)
    assert (one.beams, one.usable, one.nearest_m) == (len(ranges_m), usable, nearest_m)
    if nearest_m is None:
        assert one.nearest is None
    else:
        assert one.nearest == (pytest.approx(nearest_m), pytest.approx(bearing_rad))


def test_a_limit_is_compared_in_the_precision_of_the_ranges() -> None:
    """0.1 as a 32-bit float is more than 0.1 and 5.6 is less: neither may fall out at its own limit."""
    assert scan([0.1, 5.6], low_m=0.1, high_m=5.6).usable == 2


@pytest.mark.parametrize(("low_m", "high_m"), [(NAN, 80.0), (0.5, NAN), (80.0, 0.5)])
def test_limits_that_make_no_sense_make_nothing_usable(low_m: float, high_m: float) -> None:
    assert scan([3.0], low_m, high_m).usable == 0


def test_an_open_end_admits_no_infinity() -> None:
    assert scan([3.0, INF], high_m=INF).usable == 1


def test_a_laser_that_sweeps_clockwise() -> None:
    assert scan([3.0, 2.0], increment_rad=-0.1).nearest == (2.0, pytest.approx(-0.2))
