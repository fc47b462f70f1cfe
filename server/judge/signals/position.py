"""Position on WGS84."""

from __future__ import annotations

import math
from typing import Any

import numpy as np

from monitor.values import GpsFix
from server.judge.message_fields import Rejected, finite, known, number
from server.judge.topic import Topic


def nav_sat_fix(message: Any) -> GpsFix:
    """Position on WGS84. Raises Rejected for coordinates that are no place on Earth; without a fix they may be
    anything."""
    status = finite(message, "status", "status")
    if status != int(status) or not -128 <= status <= 127:  # an int8; beyond −1…2 drivers have their own
        raise Rejected("status.status is not a valid status")
    latitude, longitude = number(message, "latitude"), number(message, "longitude")
    if math.isnan(latitude) or math.isnan(longitude):
        if status >= 0:
            raise Rejected("latitude or longitude is not a number")
        latitude = longitude = math.nan
    elif abs(latitude) > 90 or abs(longitude) > 360:
        raise Rejected("latitude or longitude out of range")
    kind = number(message, "position_covariance_type")
    kind_is_known = kind in (1, 2, 3)
    spread = _spread(message.get("position_covariance")) if kind_is_known else None
    return GpsFix(
        lat_deg=latitude,
        lon_deg=(longitude + 180) % 360 - 180 if abs(longitude) > 180 else longitude,
        alt_m=known(number(message, "altitude")),
        status=int(status),
        covariance_type=int(kind) if kind_is_known else 0,
        sigma_m=None if spread is None else known(math.sqrt(spread[0] / 2 + spread[1] / 2)),
        covariance_m2=spread,
    )


def _spread(covariance: Any) -> tuple[float, float, float] | None:
    """East, north and east-north [m²] of the ENU covariance (row-major); None where it is not to be trusted."""
    if not isinstance(covariance, (list, tuple, np.ndarray)) or len(covariance) != 9:
        return None
    try:
        east, north = (number({"variance": covariance[at]}, "variance") for at in (0, 4))
    except Rejected:
        return None
    if not (0 < east < math.inf and 0 < north < math.inf):  # false for NaN
        return None
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
