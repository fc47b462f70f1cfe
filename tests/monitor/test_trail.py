"""Where the car was at a moment between its positions."""

from __future__ import annotations

import math

import pytest

from monitor.tracks import MOST_OF_TRAIL, SIGMA_UNKNOWN_M, TRAIL_GAP_S, TRAIL_KEPT_S, Trail
from monitor.values import GpsFix

M_NORTH = 1 / 110_890.0


def fix(lat: float, lon: float = -110.95, **more: float) -> GpsFix:
    return GpsFix(lat_deg=lat, lon_deg=lon, **more)  # type: ignore[arg-type]


def northward(speed_mps: float = 10.0, *, hz: float = 10.0, seconds: float = 5.0, **more: float) -> Trail:
    trail = Trail()
    for i in range(round(seconds * hz) + 1):
        trail.add(fix(32.23 + speed_mps * i / hz * M_NORTH, **more), 100.0 + i / hz)
    return trail


@pytest.mark.parametrize("moment_s", [101.0, 101.04, 103.333, 105.0])
def test_between_two_positions_it_is_on_the_line(moment_s: float) -> None:
    place = northward().at(moment_s)
    assert place is not None
    assert place.lat_deg == pytest.approx(32.23 + 10.0 * (moment_s - 100.0) * M_NORTH, abs=1e-9)
    assert place.lon_deg == -110.95
    assert place.velocity_mps == pytest.approx((0.0, 10.0), abs=0.02)


@pytest.mark.parametrize("moment_s", [99.99, 105.01, -math.inf, math.inf])
def test_before_and_after_it_is_not_known(moment_s: float) -> None:
    assert northward().at(moment_s) is None


def test_without_positions_nothing_is_known() -> None:
    assert Trail().at(100.0) is None
    assert Trail().newest_s == -math.inf


@pytest.mark.parametrize(("gap_s", "known"), [(TRAIL_GAP_S, True), (TRAIL_GAP_S + 0.01, False)])
def test_in_a_gap_the_car_may_have_been_anywhere(gap_s: float, known: bool) -> None:
    trail = Trail()
    trail.add(fix(32.23), 100.0)
    trail.add(fix(32.24), 100.0 + gap_s)
    assert (trail.at(100.5) is not None) == known


@pytest.mark.parametrize(
    "bad",
    [
        GpsFix(lat_deg=32.0, lon_deg=0.0, status=-1),
        GpsFix(lat_deg=math.nan, lon_deg=0.0),
        GpsFix(lat_deg=32.0, lon_deg=math.inf),
    ],
    ids=["no fix", "NaN", "Inf"],
)
def test_without_a_fix_the_trail_ends(bad: GpsFix) -> None:
    trail = northward()
    trail.add(bad, 105.1)
    assert trail.at(104.0) is None
    trail.add(fix(32.23), 105.2)
    assert trail.at(105.15) is None


def test_a_clock_that_goes_back_begins_a_new_trail() -> None:
    trail = northward()
    trail.add(fix(32.5), 50.0)
    trail.add(fix(32.5), 50.1)
    assert trail.at(104.0) is None
    place = trail.at(50.05)
    assert place is not None
    assert place.lat_deg == 32.5


def test_it_is_bounded_in_time_and_number() -> None:
    assert northward(seconds=60.0).at(160.0 - TRAIL_KEPT_S - 0.5) is None
    assert northward(seconds=60.0).at(160.0 - TRAIL_KEPT_S + 0.5) is not None
    fast = northward(hz=1000.0, seconds=3.0)
    assert fast.at(103.0 - MOST_OF_TRAIL / 1000.0 - 0.1) is None


def test_the_worse_of_two_errors_counts_and_an_unknown_one_is_5_m() -> None:
    trail = Trail()
    trail.add(fix(32.23, sigma_m=0.5), 100.0)
    trail.add(fix(32.23, sigma_m=3.0), 100.1)
    trail.add(fix(32.23), 100.2)
    places = [trail.at(100.05), trail.at(100.15)]
    assert [place.sigma_m if place else None for place in places] == [3.0, SIGMA_UNKNOWN_M]


def test_a_trail_that_has_just_begun_has_no_velocity_of_noise() -> None:
    trail = Trail()
    trail.add(fix(32.23), 100.0)
    trail.add(fix(32.23 + 0.5 * M_NORTH), 100.1)  # the noise of one fix is no 5 m/s
    place = trail.at(100.1)
    assert place is not None
    assert place.velocity_mps == (0.0, 0.0)
    place = northward(seconds=0.6).at(100.6)
    assert place is not None
    assert place.velocity_mps == pytest.approx((0.0, 10.0), abs=0.02)


def test_across_the_180_meridian() -> None:
    trail = Trail()
    trail.add(fix(0.0, 179.9999), 100.0)
    trail.add(fix(0.0, -179.9999), 101.0)
    place = trail.at(100.75)
    assert place is not None
    assert place.lon_deg == pytest.approx(-179.99995, abs=1e-9)
    assert place.velocity_mps[0] == pytest.approx(22.26, abs=0.05)  # 0.0002° of the equator a second, not once round


def test_at_the_pole() -> None:
    trail = Trail()
    trail.add(fix(90.0, 0.0), 100.0)
    trail.add(fix(90.0, 120.0), 101.0)
    place = trail.at(101.0)
    assert place is not None
    assert math.hypot(*place.velocity_mps) < 0.01
