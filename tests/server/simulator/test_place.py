"""Metres to WGS84 and UTM, against other ways of reckoning the same."""

from __future__ import annotations

import csv
import math
from pathlib import Path

import pytest
from geographiclib.geodesic import Geodesic

from server.simulator.lap import LAT_DEG, LON_DEG, lat_lon_deg, metres_per_degree, utm12_m


@pytest.mark.parametrize(("east_m", "north_m"), [(0, 0), (125, 0), (0, -125), (88, 88), (-88, 60)])
def test_local_metres_agree_with_geodesics(east_m: float, north_m: float) -> None:
    lat_deg, lon_deg = lat_lon_deg(east_m, north_m)
    line = Geodesic.WGS84.Inverse(LAT_DEG, LON_DEG, lat_deg, lon_deg)
    azimuth = math.radians(line["azi1"])
    assert line["s12"] * math.sin(azimuth) == pytest.approx(east_m, abs=0.005)
    assert line["s12"] * math.cos(azimuth) == pytest.approx(north_m, abs=0.005)


def test_utm_on_the_central_meridian_is_the_scaled_length_of_the_meridian() -> None:
    for lat_deg in (1.0, 32.23, 80.0):
        easting_m, northing_m = utm12_m(lat_deg, -111.0)
        assert easting_m == pytest.approx(500_000.0, abs=1e-6)
        assert northing_m == pytest.approx(0.9996 * Geodesic.WGS84.Inverse(0, 0, lat_deg, 0)["s12"], abs=1e-3)


def test_utm_keeps_lengths_up_to_the_scale_of_its_place() -> None:
    """The projection is conformal: a short line has the same scale in all directions, 0.9996 (1 + x²/2R²) by the usual
    approximation, where x is the distance from the central meridian."""
    lat_deg, lon_deg = 32.23, -109.5
    begin = utm12_m(lat_deg, lon_deg)
    x_m = (begin[0] - 500_000.0) / 0.9996
    scale = 0.9996 * (1 + x_m**2 / (2 * 6_367_000.0**2))
    for azimuth_deg in (0, 37, 90, 200):
        there = Geodesic.WGS84.Direct(lat_deg, lon_deg, azimuth_deg, 100.0)
        assert math.dist(begin, utm12_m(there["lat2"], there["lon2"])) == pytest.approx(100 * scale, rel=2e-6)


def test_utm_agrees_with_the_real_cars_receiver(recordings: Path) -> None:
    folder = recordings / "catvehicle_2016-07-28_excerpt"
    with (folder / "gps_fix.head_tail.csv").open() as fixes, (folder / "utm_odom.head_tail.csv").open() as places:
        pairs = list(zip(csv.DictReader(fixes), csv.DictReader(places), strict=True))
    assert pairs
    for fix, place in pairs:
        easting_m, northing_m = utm12_m(float(fix["latitude"]), float(fix["longitude"]))
        # the excerpt has six decimals of a degree, and seven digits of the northing
        assert easting_m == pytest.approx(float(place["pose.pose.position.x"]), abs=0.11)
        assert northing_m == pytest.approx(float(place["pose.pose.position.y"]), abs=0.7)


def test_metres_per_degree_agree_with_geodesics() -> None:
    for lat_deg in (0.0, 32.23, -60.0):
        east_m, north_m = metres_per_degree(lat_deg)
        assert east_m * 0.001 == pytest.approx(Geodesic.WGS84.Inverse(lat_deg, 0, lat_deg, 0.001)["s12"], rel=1e-6)
        assert north_m * 0.001 == pytest.approx(
            Geodesic.WGS84.Inverse(lat_deg - 0.0005, 0, lat_deg + 0.0005, 0)["s12"], rel=1e-6
        )
