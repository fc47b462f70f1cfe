"""Where on Earth the simulated lap lies: from its local metres to WGS84 and to UTM zone 12N."""

from __future__ import annotations

import math

LAT_DEG = 32.23  # Tucson, Arizona: the centre of the lap
LON_DEG = -110.95
ALT_M = 748.0  # above the ellipsoid

_A_M = 6378137.0  # WGS84: semi-major axis, flattening
_F = 1 / 298.257223563
_E2 = _F * (2 - _F)
_N = _F / (2 - _F)

# UTM (NGA.SIG.0012): scale on the central meridian, false easting, central meridian of zone 12
_K0 = 0.9996
_FALSE_EASTING_M = 500_000.0
_MERIDIAN_DEG = -111.0

# Krüger's series, third order in n (Karney 2011, equations 12 and 14): below 1 µm within the zone's 3°
_RECTIFYING_M = _A_M / (1 + _N) * (1 + _N**2 / 4)
_ALPHA = (
    _N / 2 - 2 * _N**2 / 3 + 5 * _N**3 / 16,
    13 * _N**2 / 48 - 3 * _N**3 / 5,
    61 * _N**3 / 240,
)


def metres_per_degree(lat_deg: float) -> tuple[float, float]:
    """Metres to a degree of longitude and of latitude on the WGS84 ellipsoid, from its two radii of curvature there."""
    sine = math.sin(math.radians(lat_deg))
    bend = 1 - _E2 * sine * sine
    east_m = _A_M / math.sqrt(bend) * math.cos(math.radians(lat_deg))
    north_m = _A_M * (1 - _E2) / bend**1.5
    return math.radians(east_m), math.radians(north_m)


_EAST_M, _NORTH_M = metres_per_degree(LAT_DEG)


def lat_lon_deg(east_m: float, north_m: float) -> tuple[float, float]:
    """Latitude and longitude of a point of the lap, given in metres east and north of its centre.

    A plane laid on the ellipsoid: within 150 m of the centre the error stays below 5 mm.
    """
    return LAT_DEG + north_m / _NORTH_M, LON_DEG + east_m / _EAST_M


def utm12_m(lat_deg: float, lon_deg: float) -> tuple[float, float]:
    """Easting and northing in UTM zone 12N, in metres, of a point of the northern hemisphere near that zone."""
    lat, lon = math.radians(lat_deg), math.radians(lon_deg - _MERIDIAN_DEG)
    e = math.sqrt(_E2)
    tau = math.tan(lat)
    sigma = math.sinh(e * math.atanh(e * tau / math.hypot(1, tau)))
    conformal = tau * math.hypot(1, sigma) - sigma * math.hypot(1, tau)
    xi = math.atan2(conformal, math.cos(lon))
    eta = math.asinh(math.sin(lon) / math.hypot(conformal, math.cos(lon)))
    x, y = eta, xi
    for order, alpha in enumerate(_ALPHA, start=1):
        x += alpha * math.cos(2 * order * xi) * math.sinh(2 * order * eta)
        y += alpha * math.sin(2 * order * xi) * math.cosh(2 * order * eta)
    return _FALSE_EASTING_M + _K0 * _RECTIFYING_M * x, _K0 * _RECTIFYING_M * y
