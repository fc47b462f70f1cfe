"""The real drives as lists, for tests of what the judge makes of them."""

from __future__ import annotations

import csv
import math
from pathlib import Path

from monitor.values import GpsFix

DRIVE = "catvehicle_2016-06-01_csv"


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="", encoding="utf-8") as file:
        return list(csv.DictReader(file))


def wgs84_of_utm(east_m: float, north_m: float, zone: int) -> tuple[float, float]:
    """Latitude and longitude [deg] of northern UTM; J. P. Snyder, Map Projections, USGS PP 1395, p. 63."""
    a, e2, k0 = 6_378_137.0, 6.694_379_990_14e-3, 0.9996
    e1 = (1 - math.sqrt(1 - e2)) / (1 + math.sqrt(1 - e2))
    ep2 = e2 / (1 - e2)
    mu = north_m / k0 / (a * (1 - e2 / 4 - 3 * e2**2 / 64 - 5 * e2**3 / 256))
    phi = (
        mu
        + (3 * e1 / 2 - 27 * e1**3 / 32) * math.sin(2 * mu)
        + (21 * e1**2 / 16 - 55 * e1**4 / 32) * math.sin(4 * mu)
        + 151 * e1**3 / 96 * math.sin(6 * mu)
    )
    c, t = ep2 * math.cos(phi) ** 2, math.tan(phi) ** 2
    n = a / math.sqrt(1 - e2 * math.sin(phi) ** 2)
    r = a * (1 - e2) / (1 - e2 * math.sin(phi) ** 2) ** 1.5
    d = (east_m - 500_000.0) / (n * k0)
    lat = phi - n * math.tan(phi) / r * (d**2 / 2 - (5 + 3 * t + 10 * c - 4 * c**2 - 9 * ep2) * d**4 / 24)
    lon = (d - (1 + 2 * t + c) * d**3 / 6) / math.cos(phi)
    return math.degrees(lat), math.degrees(lon) + 6 * zone - 183


def drive_fixes(recordings: Path) -> list[tuple[float, GpsFix]]:
    """The positions of the real drive in Tucson: 560 at 10 Hz, as seconds of the recording's clock and fix."""
    fixes = []
    for row in rows(recordings / DRIVE / "gps_odom.csv"):
        lat_deg, lon_deg = wgs84_of_utm(float(row["pose.x"]), float(row["pose.y"]), 12)
        fixes.append((float(row["Time"]), GpsFix(lat_deg=lat_deg, lon_deg=lon_deg, alt_m=float(row["pose.z"]))))
    return fixes


def drive_speeds(recordings: Path) -> list[tuple[float, float]]:
    """The wheel speeds of the same drive: 1120 at 20 Hz, as seconds and m/s."""
    return [(float(row["Time"]), float(row["linear.x"])) for row in rows(recordings / DRIVE / "catvehicle-vel.csv")]


def commuter_fixes(recordings: Path) -> list[tuple[float, GpsFix]]:
    """A real car with a u-blox at 10 Hz, 172 s, 870 m, without its void rows."""
    fixes = []
    for row in rows(recordings / "gps" / "privpurge_2020-09-15_GPS_Messages.csv"):
        if row["Status"] == "A":
            fixes.append((float(row["Gpstime"]), GpsFix(lat_deg=float(row["Lat"]), lon_deg=float(row["Long"]))))
    return fixes
