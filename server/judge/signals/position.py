"""Position on WGS84."""

from __future__ import annotations

import math
from typing import Any

from monitor.values import NO_FIX, GpsFix
from server.judge.message_fields import Rejected, finite, known, number
from server.judge.not_measured import AT_ZERO, NO_QUALITY, NO_VARIANCE, USELESS_ALTITUDE
from server.judge.topic import Topic


def nav_sat_fix(message: Any) -> GpsFix:
    """Position on WGS84. Raises Rejected for coordinates that are no place on Earth; without a fix they may be
    anything, and what is no place is NaN."""
    status = finite(message, "status", "status")
    if status != int(status) or not -128 <= status <= 127:  # an int8; beyond −1…2 drivers have their own
        raise Rejected("status.status is not a valid status")
    latitude, longitude, is_unset = _place(message, has_fix=status >= 0)
    kind = number(message, "position_covariance_type")
    spread = None if NO_QUALITY.holds(message) else _spread(message)
    has_altitude = not USELESS_ALTITUDE.holds(message)
    return GpsFix(
        lat_deg=latitude,
        lon_deg=(longitude + 180) % 360 - 180 if abs(longitude) > 180 else longitude,
        alt_m=known(number(message, "altitude")) if has_altitude else None,
        status=NO_FIX if is_unset else int(status),
        is_unset=is_unset,
        covariance_type=0 if NO_QUALITY.holds(message) else int(kind),
        sigma_m=None if spread is None else known(math.sqrt(spread[0] / 2 + spread[1] / 2)),
        covariance_m2=spread,
    )


def _place(message: Any, *, has_fix: bool) -> tuple[float, float, bool]:
    """Latitude and longitude, NaN without a place; and whether a fix is stated whose coordinates are not set."""
    latitude, longitude = number(message, "latitude"), number(message, "longitude")
    why_not = ""
    if math.isnan(latitude) or math.isnan(longitude):
        why_not = "latitude or longitude is not a number"
    elif abs(latitude) > 90 or abs(longitude) > 360:
        why_not = "latitude or longitude out of range"
    elif AT_ZERO.holds(message):
        return math.nan, math.nan, has_fix
    if why_not and has_fix:
        raise Rejected(why_not)
    return (math.nan, math.nan, False) if why_not else (latitude, longitude, False)


def _spread(message: Any) -> tuple[float, float, float] | None:
    """East, north and east-north [m²] of the ENU covariance (row-major); None where it is not to be trusted."""
    if NO_VARIANCE.holds(message):
        return None
    covariance = message["position_covariance"]
    east, north = (number({"variance": covariance[at]}, "variance") for at in (0, 4))
    try:
        both = number({"covariance": covariance[1]}, "covariance")
    except Rejected:
        both = 0.0
    # Some drivers fill in for the mixed term what no covariance can be: then the axes are taken alone.
    return east, north, both if abs(both) < math.sqrt(east) * math.sqrt(north) else 0.0


TOPICS = (
    Topic(
        signal="position",
        names=("/gps_fix", "/catvehicle/gps_fix", "/fix", "/gps/fix", "/navsat/fix"),
        types={"sensor_msgs/NavSatFix": nav_sat_fix},
        by_type=("sensor_msgs/NavSatFix",),
    ),
)
