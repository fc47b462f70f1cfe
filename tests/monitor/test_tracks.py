"""The way driven and the track, on real drives and on receivers that stand."""

from __future__ import annotations

import itertools
import math
import random
from pathlib import Path

import pytest
from geographiclib.geodesic import Geodesic

from monitor.geo import offset_m, turn_deg
from monitor.tracks import POINTS, Track
from monitor.values import GpsFix
from tests.monitor.recorded import commuter_fixes, drive_fixes, drive_speeds

LAT_DEG, LON_DEG = 32.2300, -110.9500  # Tucson
NORTH_M, EAST_M = 110_892.0, 94_274.0  # metres a degree there
LAG_M = 3.0  # at 5 m/s: the smoothed place is half a second behind a moving car


def fix(east_m: float, north_m: float, **fields: float | None) -> GpsFix:
    return GpsFix(lat_deg=LAT_DEG + north_m / NORTH_M, lon_deg=LON_DEG + east_m / EAST_M, **fields)  # type: ignore[arg-type]


def test_the_real_drive_is_76_m_by_its_wheels_and_positions(recordings: Path) -> None:
    """Its end is 75.98 m from its beginning, and the wheels counted 75.97 m; single fixes add up to 77.9 m."""
    events = sorted(
        [(at_s, "fix", fix) for at_s, fix in drive_fixes(recordings)]
        + [(at_s, "speed", speed) for at_s, speed in drive_speeds(recordings)],  # type: ignore[list-item]
        key=lambda event: event[0],
    )
    track, speed_mps = Track(), 0.0
    for at_s, kind, value in events:
        if kind == "speed":
            speed_mps = float(value)  # type: ignore[arg-type]
        else:
            track.receive(value, at_s, speed_mps, abs(speed_mps) < 0.1)  # type: ignore[arg-type]
    assert track.distance_m == pytest.approx(76.0, abs=1.0)


def test_the_real_drive_by_its_positions_alone(recordings: Path) -> None:
    fixes = drive_fixes(recordings)
    track = Track()
    for at_s, one in fixes:
        track.receive(one, at_s, None, None)
    assert track.distance_m == pytest.approx(76.0, abs=1.5)
    assert 50 < len(track.points) < 80  # about one a metre
    first, last = track.points[0], track.points[-1]
    east_m, north_m = offset_m(first.lat_deg, first.lon_deg, last.lat_deg, last.lon_deg)
    assert (east_m, north_m) == (pytest.approx(76.0, abs=1.5), pytest.approx(-1.3, abs=1.5))


def test_the_real_car_stood_for_its_first_25_seconds(recordings: Path) -> None:
    fixes = drive_fixes(recordings)
    track = Track()
    for at_s, one in fixes:
        if at_s - fixes[0][0] < 25.0:
            track.receive(one, at_s, None, None)
    assert track.distance_m == 0.0
    assert len(track.points) == 1


def test_another_real_car_with_an_ordinary_receiver(recordings: Path) -> None:
    track = Track()
    for at_s, one in commuter_fixes(recordings):
        track.receive(one, at_s, None, None)
    assert track.distance_m == pytest.approx(870.0, rel=0.02)
    assert not any(point.is_jump for point in track.points)


@pytest.mark.parametrize("hz", [1.0, 10.0])
def test_a_parked_car_drives_nothing_however_its_receiver_drifts(hz: float) -> None:
    """An obstructed receiver wanders 19 m in a minute; the wheels know better."""
    drift, track = random.Random(3), Track()
    east_m = north_m = 0.0
    for n in range(round(300 * hz)):
        east_m += drift.gauss(0.0, 2.0 / math.sqrt(hz))
        north_m += drift.gauss(0.0, 2.0 / math.sqrt(hz))
        track.receive(fix(east_m, north_m), n / hz, 0.0, True)
    assert track.distance_m == 0.0
    assert track.course_deg is None


def test_a_parked_car_without_wheel_speed_under_open_sky() -> None:
    """Slow drift of about a metre; single fixes sum up to 100 m in these five minutes."""
    drift, track, summed_m = random.Random(4), Track(), 0.0
    east_m = north_m = 0.0
    for n in range(3000):
        step = (drift.gauss(0.0, 0.03) - east_m / 600, drift.gauss(0.0, 0.03) - north_m / 600)
        east_m, north_m = east_m + step[0], north_m + step[1]
        summed_m += math.hypot(*step)
        track.receive(fix(east_m, north_m), n / 10, None, None)
    assert summed_m > 100.0
    assert track.distance_m is not None
    assert track.distance_m < 1.0


@pytest.mark.parametrize("sigma_m", [None, 0.5, 2.0])
def test_noise_does_not_lengthen_a_straight_drive(sigma_m: float | None) -> None:
    noise, track = random.Random(5), Track()
    for n in range(1000):
        off = sigma_m or 0.2
        at = fix(0.5 * n + noise.gauss(0.0, off), noise.gauss(0.0, off), sigma_m=sigma_m)
        track.receive(at, n / 10, 5.0, False)
    assert track.distance_m == pytest.approx(500.0, rel=0.03)


def test_short_hops_add_up() -> None:
    """Twenty times 0.9 m with a halt between: no hop is as long as a chord."""
    track, at_s, east_m = Track(), 0.0, 0.0
    for _ in range(20):
        for speed_mps in [0.6] * 15 + [0.0] * 40:
            at_s += 0.1
            east_m += 0.1 * speed_mps
            track.receive(fix(east_m, 0.0), at_s, speed_mps, speed_mps == 0.0 and at_s % 5.5 > 3.5)
    assert track.distance_m == pytest.approx(18.0, rel=0.05)


def test_a_curve_keeps_its_length() -> None:
    track = Track()
    for n in range(1000):
        angle = 0.5 * n / 30.0  # radius 30 m at 5 m/s
        track.receive(fix(30 * math.sin(angle), 30 * math.cos(angle)), n / 10, 5.0, False)
    assert track.distance_m == pytest.approx(500.0, rel=0.01)


def test_the_way_never_shrinks() -> None:
    noise, track, before_m = random.Random(6), Track(), 0.0
    for n in range(600):
        moves = n // 100 % 2 == 1
        east_m = 3.0 * (n // 200 * 10 + (n % 100 / 10 if moves else 0))
        track.receive(fix(east_m + noise.gauss(0, 0.3), noise.gauss(0, 0.3)), n / 10, 3.0 * moves, not moves)
        assert track.distance_m is not None
        assert track.distance_m >= before_m
        before_m = track.distance_m


@pytest.mark.parametrize("speed_mps", [None, 5.0])
def test_a_leap_is_no_way_driven_and_breaks_the_line(speed_mps: float | None) -> None:
    """A receiver that finds itself elsewhere, or a recording that begins again."""
    track = Track()
    for n in range(100):
        track.receive(fix(0.5 * n, 0.0), n / 10, speed_mps, None)
    before_m = track.distance_m
    for n in range(100, 200):
        track.receive(fix(0.5 * (n - 100), 500.0), n / 10, speed_mps, None)
    assert before_m == pytest.approx(49.5, abs=LAG_M)
    assert track.distance_m == pytest.approx(2 * 49.5, abs=3 * LAG_M)
    assert [point.is_jump for point in track.points].count(True) == 1


def test_a_gap_in_the_positions_counts_as_the_straight_way() -> None:
    track = Track()
    for n in [*range(100), *range(400, 500)]:
        track.receive(fix(0.5 * n, 0.0), n / 10, 5.0, False)
    assert track.distance_m == pytest.approx(249.5, abs=LAG_M)
    (after,) = [point for point in track.points if point.is_after_gap]
    assert after.at_s == pytest.approx(40.0, abs=1.0)
    assert not any(point.is_jump for point in track.points)


def test_a_car_that_stood_for_long_has_no_gap_in_its_track() -> None:
    track = Track()
    for n in range(1000):
        moves = n < 100 or n >= 900
        track.receive(fix(0.5 * min(n, 100) + 0.5 * max(0, n - 900), 0.0), n / 10, 5.0 * moves, not moves)
    assert max(b.at_s - a.at_s for a, b in itertools.pairwise(track.points)) > 70.0
    assert not any(point.is_after_gap or point.is_jump for point in track.points)


def test_points_are_numbered_and_thinning_leaves_numbers_out() -> None:
    track = Track()
    for n in range(3 * POINTS):
        track.receive(fix(2.0 * (n % 400), 0.001 * n), n / 5, 10.0, False)
    numbers = [point.number for point in track.points]
    assert len(numbers) <= POINTS
    assert numbers == sorted(set(numbers))
    assert numbers[0] == 1
    assert numbers[-1] > POINTS


@pytest.mark.parametrize(
    "bad",
    [
        pytest.param(GpsFix(lat_deg=0.0, lon_deg=0.0, status=-1), id="no fix, though it has coordinates"),
        pytest.param(GpsFix(lat_deg=float("nan"), lon_deg=0.0), id="NaN"),
        pytest.param(GpsFix(lat_deg=0.0, lon_deg=float("inf")), id="infinite"),
    ],
)
def test_what_is_no_position_changes_nothing(bad: GpsFix) -> None:
    track = Track()
    track.receive(bad, 0.0, None, None)
    assert (track.distance_m, track.points) == (None, ())
    track.receive(fix(0.0, 0.0), 1.0, None, None)
    track.receive(bad, 1.1, None, None)
    assert (track.distance_m, len(track.points)) == (0.0, 1)


def test_the_course_over_ground() -> None:
    track = Track()
    for n in range(100):
        track.receive(fix(0.3 * n, -0.3 * n), n / 10, None, None)
    assert track.course_deg is not None
    assert turn_deg(track.course_deg, 135.0) == pytest.approx(0.0, abs=0.5)


@pytest.mark.parametrize(("speed_mps", "known"), [(0.45, False), (0.55, True)])
def test_no_course_below_half_a_metre_a_second(speed_mps: float, known: bool) -> None:
    track = Track()
    for n in range(100):
        track.receive(fix(speed_mps * n / 10, 0.0), n / 10, None, None)
    assert (track.course_deg is not None) == known


def test_a_long_drive_stays_bounded_and_true() -> None:
    """240 km to the north-east along a geodesic, across several planes."""
    track, line = Track(), Geodesic.WGS84.Line(LAT_DEG, LON_DEG, 45.0)
    for n in range(8000):
        there = line.Position(30.0 * n)
        track.receive(GpsFix(lat_deg=there["lat2"], lon_deg=there["lon2"]), float(n), 30.0, False)
    assert len(track.points) <= POINTS
    assert track.points[0].lon_deg == LON_DEG
    assert track.distance_m == pytest.approx(7999 * 30.0, rel=1e-3)
    assert sorted(point.at_s for point in track.points) == [point.at_s for point in track.points]


def test_north_is_where_the_car_is_not_where_it_began() -> None:
    """120 km east, then 60 km due north: by the meridian of its beginning that would be 0.3° off."""
    track = Track()
    for n in range(6000):
        there = fix(min(30.0 * n, 120_000.0), max(0.0, 30.0 * n - 120_000.0))
        track.receive(there, float(n), 30.0, False)
    assert track.course_deg is not None
    assert turn_deg(track.course_deg, 0.0) == pytest.approx(0.0, abs=0.1)


def test_across_the_180th_meridian() -> None:
    track = Track()
    for n in range(100):
        lon_deg = 179.9999 + 0.00001 * n
        track.receive(GpsFix(lat_deg=0.0, lon_deg=math.remainder(lon_deg, 360.0)), n / 10, 11.0, False)
    assert track.distance_m == pytest.approx(99 * 1.1132, abs=2 * LAG_M + 1.0)
    assert not any(point.is_jump for point in track.points)


def test_a_clock_that_goes_back_breaks_the_line_and_nothing_else() -> None:
    track = Track()
    for n in range(100):
        track.receive(fix(0.5 * n, 0.0), 1000 + n / 10, 5.0, False)
    for n in range(100, 200):
        track.receive(fix(0.5 * n, 0.0), n / 10, 5.0, False)
    assert track.distance_m == pytest.approx(99.5, abs=3 * LAG_M)
