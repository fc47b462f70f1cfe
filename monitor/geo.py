"""Metres on the WGS84 ellipsoid around one place: east and north from degrees, and back."""

from __future__ import annotations

import math
from dataclasses import dataclass

_A_M = 6_378_137.0  # semi-major axis of WGS84
_E2 = 6.694_379_990_14e-3  # first eccentricity squared of WGS84

NEAR_ZERO_DEG = 1e-9  # a tenth of a millimetre: zero, converted from radians


def is_at_zero(lat_deg: float, lon_deg: float) -> bool:
    """Whether coordinates are both 0, as in a message whose fields are not filled yet."""
    return abs(lat_deg) <= NEAR_ZERO_DEG and abs(lon_deg) <= NEAR_ZERO_DEG


def radii_m(lat_deg: float) -> tuple[float, float]:
    """Radii of curvature [m] at a latitude: in the meridian M, and of the parallel N·cos φ.

    M = a(1−e²)/(1−e²sin²φ)^1.5 and N = a/√(1−e²sin²φ): Torge, Geodesy, 4.1.
    """
    phi = math.radians(lat_deg)
    w2 = 1.0 - _E2 * math.sin(phi) ** 2
    w = math.sqrt(w2)
    return _A_M * (1.0 - _E2) / (w2 * w), _A_M / w * math.cos(phi)


def offset_m(from_lat_deg: float, from_lon_deg: float, to_lat_deg: float, to_lon_deg: float) -> tuple[float, float]:
    """East and north [m] from one place to another, through the radii of curvature at the latitude half-way.

    Within 1 mm of the geodesic over 1 km and 1 m over 10 km up to 75° of latitude; right across the 180° meridian.
    """
    meridian_m, parallel_m = radii_m((from_lat_deg + to_lat_deg) / 2)
    east_deg = math.remainder(to_lon_deg - from_lon_deg, 360.0)
    return math.radians(east_deg) * parallel_m, math.radians(to_lat_deg - from_lat_deg) * meridian_m


def distance_m(from_lat_deg: float, from_lon_deg: float, to_lat_deg: float, to_lon_deg: float) -> float:
    """Distance [m] between two places some kilometres apart at most."""
    return math.hypot(*offset_m(from_lat_deg, from_lon_deg, to_lat_deg, to_lon_deg))


def course_deg(east: float, north: float) -> float:
    """Compass course of a displacement: 0 north, clockwise, 0 ≤ course < 360."""
    return math.degrees(math.atan2(east, north)) % 360.0


def heading_of_yaw_deg(yaw_rad: float) -> float:
    """Compass heading of a REP-103 yaw in an east-north frame: yaw 0 is east and grows counter-clockwise."""
    return (90.0 - math.degrees(yaw_rad)) % 360.0


def turn_deg(from_deg: float, to_deg: float) -> float:
    """The shorter way from one heading to another, −180 … 180, clockwise positive."""
    return math.remainder(to_deg - from_deg, 360.0)


@dataclass(frozen=True, slots=True)
class Plane:
    """East and north [m] about a fixed place; good for some ten kilometres around it."""

    lat_deg: float
    lon_deg: float

    def enu(self, lat_deg: float, lon_deg: float) -> tuple[float, float]:
        return offset_m(self.lat_deg, self.lon_deg, lat_deg, lon_deg)
