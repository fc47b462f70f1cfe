"""What a message's own definition declares as not measured or not valid: one table, by type and field.

The decoders ask its rows, `docs/signals.md` shows it.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from monitor.geo import is_at_zero
from monitor.values import NO_FIX, STATUS_UNSET
from server.judge.message_fields import NotMeasured, Rejected, number

HIGHEST_M = 100_000.0  # no car is higher; receivers have numbers of their own for "do not use", such as −2·10¹⁰

Holds = Callable[[Any], bool]


@dataclass(frozen=True, slots=True, kw_only=True)
class Rule:
    """One value of one field, and its meaning."""

    type: str  # ROS 1 spelling
    field: str
    value: str
    effect: str  # what is made of it
    source: str  # where that is defined
    holds: Holds  # whether a message of the type (of a header, for std_msgs/Header) has that value
    reason: str = ""  # of NotMeasured, where the signal as a whole is not measured

    def demand(self, message: Any) -> None:
        """Raises NotMeasured where the rule holds."""
        if self.holds(message):
            raise NotMeasured(self.reason)


def _first_is_minus_one(field: str) -> Holds:
    def holds(message: Any) -> bool:
        covariance = message.get(field) if isinstance(message, Mapping) else None
        if not isinstance(covariance, (list, tuple, np.ndarray)) or len(covariance) != 9:
            return False
        first = covariance[0]
        return isinstance(first, (int, float, np.integer, np.floating)) and bool(first == -1)

    return holds


def _is_nan(*path: str) -> Holds:
    """Null too: a bridge sends it for NaN."""

    def holds(message: Any) -> bool:
        try:
            return math.isnan(number(message, *path))
        except Rejected:
            return False

    return holds


def _status_is(status: int) -> Holds:
    def holds(message: Any) -> bool:
        return number(message, "status", "status") == status

    return holds


def _is_at_zero(message: Any) -> bool:
    return is_at_zero(number(message, "latitude"), number(message, "longitude"))


def _is_beyond(message: Any) -> bool:
    return abs(number(message, "altitude")) > HIGHEST_M


def _quality_is_unknown(message: Any) -> bool:
    return number(message, "position_covariance_type") not in (1, 2, 3)


def _has_no_variance(message: Any) -> bool:
    covariance = message.get("position_covariance")
    if not isinstance(covariance, (list, tuple, np.ndarray)) or len(covariance) != 9:
        return True
    try:
        return not all(number({"variance": covariance[at]}, "variance") > 0 for at in (0, 4))  # NaN is not above 0
    except Rejected:
        return True


def _is_absent(message: Any) -> bool:
    """`present` is false by default: a driver that fills in the percentage alone has a battery."""
    if not isinstance(message, Mapping) or message.get("present") is not False:
        return False
    try:
        share = number(message, "percentage")
    except Rejected:
        return False
    return share == 0 or math.isnan(share)


def _is_outside(message: Any) -> bool:
    """Whether any beam is outside the range of its laser; `monitor.scan.usable` distinguishes them beam by beam."""
    nearest, farthest = number(message, "range_min"), number(message, "range_max")
    return any(one is not None and (one < nearest or one > farthest) for one in message["ranges"])


def _is_no_number(message: Any) -> bool:
    return any(one is None or not math.isfinite(one) for one in message["ranges"])


def _stamp_is_zero(header: Any) -> bool:
    stamp = header["stamp"]
    return not any(stamp.get(name, 0) for name in ("secs", "nsecs", "sec", "nanosec"))


IMU, FIX, BATTERY, SCAN = (f"sensor_msgs/{name}" for name in ("Imu", "NavSatFix", "BatteryState", "LaserScan"))

NO_ACCELERATION = Rule(
    type=IMU,
    field="linear_acceleration_covariance",
    value="element 0 is −1",
    effect="acceleration is not measured; it is derived from the speed",
    source="sensor_msgs/Imu: element 0 of a covariance is −1 where the sensor has no estimate of the quantity",
    holds=_first_is_minus_one("linear_acceleration_covariance"),
    reason="not measured (linear_acceleration_covariance[0] is -1)",
)
NO_ORIENTATION = Rule(
    type=IMU,
    field="orientation_covariance",
    value="element 0 is −1",
    effect="heading is not measured; it is derived from odometry or course",
    source="sensor_msgs/Imu: as above",
    holds=_first_is_minus_one("orientation_covariance"),
    reason="not measured (orientation_covariance[0] is -1)",
)
UNKNOWN_STATUS = Rule(
    type=FIX,
    field="status.status",
    value="−2",
    effect="not known whether there is a fix: the position is not used, and exports count it as left out",
    source="sensor_msgs/NavSatStatus of ROS 2 (Kilted and later): the status is not set",
    holds=_status_is(STATUS_UNSET),
)
WITHOUT_FIX = Rule(
    type=FIX,
    field="status.status",
    value="−1",
    effect="no fix: the coordinates are not used, whatever they are, also outside ±90° and ±180°",
    source="sensor_msgs/NavSatStatus: −1 is no fix",
    holds=_status_is(NO_FIX),
)
AT_ZERO = Rule(
    type=FIX,
    field="latitude, longitude",
    value="both 0",
    effect="no fix, whatever the status: a message whose fields are not filled yet",
    source="default of both fields; status 0, a fix, is the default too",
    holds=_is_at_zero,
)
NO_ALTITUDE = Rule(
    type=FIX,
    field="altitude",
    value="NaN",
    effect="altitude is not known; the position is used",
    source="sensor_msgs/NavSatFix: a quiet NaN where no altitude is available",
    holds=_is_nan("altitude"),
)
USELESS_ALTITUDE = Rule(
    type=FIX,
    field="altitude",
    value="beyond ±100 km",
    effect="altitude is not known; the position is used",
    source='numbers for "do not use" of receivers, such as −2·10¹⁰',
    holds=_is_beyond,
)
NO_QUALITY = Rule(
    type=FIX,
    field="position_covariance_type",
    value="0, or none of 1, 2, 3",
    effect="quality is not known, whatever the covariance is",
    source="sensor_msgs/NavSatFix: 0 is COVARIANCE_TYPE_UNKNOWN",
    holds=_quality_is_unknown,
)
NO_VARIANCE = Rule(
    type=FIX,
    field="position_covariance",
    value="variance of east or north is 0, negative, NaN or infinite",
    effect="quality is not known, whatever the type is",
    source="a variance is positive; the real car marks zeros as known",
    holds=_has_no_variance,
)
NO_BATTERY = Rule(
    type=BATTERY,
    field="present",
    value="false, where percentage is 0 or NaN",
    effect="fuel is not measured",
    source="sensor_msgs/BatteryState: true where the battery is present; false is the default too",
    holds=_is_absent,
    reason="not measured (present is false)",
)
NO_PERCENTAGE = Rule(
    type=BATTERY,
    field="percentage",
    value="NaN",
    effect="fuel is not measured",
    source="sensor_msgs/BatteryState: NaN where it is not measured",
    holds=_is_nan("percentage"),
    reason="not measured (percentage is NaN)",
)
OUTSIDE = Rule(
    type=SCAN,
    field="ranges",
    value="below range_min or above range_max",
    effect="no return of this beam",
    source="sensor_msgs/LaserScan: such values are to be discarded",
    holds=_is_outside,
)
NO_RETURN = Rule(
    type=SCAN,
    field="ranges",
    value="NaN, +Inf or −Inf",
    effect="no return of this beam, which never means free",
    source="REP 117: invalid, nothing in range, too close",
    holds=_is_no_number,
)
NO_STAMP = Rule(
    type="std_msgs/Header",
    field="stamp",
    value="0",
    effect="no stamp: delay, clock and frozen stamps are not judged by it",
    source="default of the field; time 0 stands for a time that is not set, in rospy, roscpp and tf",
    holds=_stamp_is_zero,
)

RULES = (
    NO_ACCELERATION,
    NO_ORIENTATION,
    WITHOUT_FIX,
    UNKNOWN_STATUS,
    AT_ZERO,
    NO_ALTITUDE,
    USELESS_ALTITUDE,
    NO_QUALITY,
    NO_VARIANCE,
    NO_BATTERY,
    NO_PERCENTAGE,
    OUTSIDE,
    NO_RETURN,
    NO_STAMP,
)


def tables() -> str:
    """The rules as Markdown, a heading and a table for each type of message."""
    parts = []
    for kind in dict.fromkeys(rule.type for rule in RULES):
        rows = [f"| {r.field} | {r.value} | {r.effect} | {r.source} |" for r in RULES if r.type == kind]
        head = ("| field | value | meaning | source |", "|---|---|---|---|")
        parts.append("\n".join((f"### {kind}", "", *head, *rows)))
    return "\n\n".join(parts) + "\n"
