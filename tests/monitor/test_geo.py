"""Metres on the ellipsoid, against the geodesics of GeographicLib."""

from __future__ import annotations

import math

import pytest
from geographiclib.geodesic import Geodesic

from monitor.geo import Plane, course_deg, distance_m, heading_of_yaw_deg, offset_m, turn_deg

PLACES = [(32.23, -110.95), (0.0, 0.0), (51.5, -0.1), (-33.9, 18.4), (70.0, 25.0), (60.0, 179.9999)]


@pytest.mark.parametrize(("lat_deg", "lon_deg"), PLACES)
@pytest.mark.parametrize("bearing_deg", [0.0, 37.0, 90.0, 180.0, 271.0])
@pytest.mark.parametrize(("length_m", "within_m"), [(0.05, 1e-6), (10.0, 1e-5), (1_000.0, 1e-3), (10_000.0, 1.0)])
def test_distance_agrees_with_the_geodesic(
    lat_deg: float, lon_deg: float, bearing_deg: float, length_m: float, within_m: float
) -> None:
    there = Geodesic.WGS84.Direct(lat_deg, lon_deg, bearing_deg, length_m)
    assert distance_m(lat_deg, lon_deg, there["lat2"], there["lon2"]) == pytest.approx(length_m, abs=within_m)


@pytest.mark.parametrize("bearing_deg", [0.0, 37.0, 90.0, 180.0, 271.0])
def test_course_agrees_with_the_geodesic(bearing_deg: float) -> None:
    there = Geodesic.WGS84.Direct(32.23, -110.95, bearing_deg, 100.0)
    east_m, north_m = offset_m(32.23, -110.95, there["lat2"], there["lon2"])
    assert turn_deg(course_deg(east_m, north_m), bearing_deg) == pytest.approx(0.0, abs=0.01)


def test_across_the_180th_meridian_the_way_is_short() -> None:
    east_m, north_m = offset_m(10.0, 179.9999, 10.0, -179.9999)
    assert (east_m, north_m) == (pytest.approx(21.93, abs=0.01), 0.0)
    assert Plane(10.0, -179.9999).enu(10.0, 179.9999)[0] == pytest.approx(-21.93, abs=0.01)


@pytest.mark.parametrize(
    ("yaw_rad", "heading_deg"),
    [(0.0, 90.0), (math.pi / 2, 0.0), (math.pi, 270.0), (-math.pi / 2, 180.0), (5 * math.pi / 2, 0.0)],
)
def test_yaw_zero_is_east_and_heading_zero_is_north(yaw_rad: float, heading_deg: float) -> None:
    assert turn_deg(heading_of_yaw_deg(yaw_rad), heading_deg) == pytest.approx(0.0, abs=1e-9)


@pytest.mark.parametrize(
    ("from_deg", "to_deg", "turn"), [(350.0, 10.0, 20.0), (10.0, 350.0, -20.0), (0.0, 90.0, 90.0), (5.0, 5.0, 0.0)]
)
def test_the_shorter_way_round(from_deg: float, to_deg: float, turn: float) -> None:
    assert turn_deg(from_deg, to_deg) == pytest.approx(turn)
