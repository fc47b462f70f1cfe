"""Fields that declare a value as not measured, value by value; and that the page of the signals has the same table."""

from __future__ import annotations

import copy
import math
from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from monitor.values import GpsFix
from server.judge import not_measured as table
from server.judge import signals
from server.judge.message_fields import NotMeasured, Rejected, stamp_s
from server.judge.not_measured import RULES, Rule, tables
from tests.server.judge.test_decoders import message
from tests.tree import PROJECT

NAN, INF = math.nan, math.inf
DO_NOT_USE = -2e10  # of Septentrio's receivers


def test_the_page_of_the_signals_shows_every_rule() -> None:
    page = (PROJECT / "docs" / "signals.md").read_text(encoding="utf-8")
    assert tables() in page


def imu(**others: Any) -> dict[str, Any]:
    return {**message("Imu.ros1"), **others}


def fix(**others: Any) -> dict[str, Any]:
    status = others.pop("status", 0)
    return {**message("NavSatFix.ros1"), "status": {"status": status, "service": 1}, **others}


def battery(**others: Any) -> dict[str, Any]:
    return {**message("BatteryState.ros2"), **others}


def scan(*ranges: Any) -> dict[str, Any]:
    return {**message("LaserScan.ros1"), "ranges": list(ranges)}


def without(found: dict[str, Any], name: str) -> dict[str, Any]:
    return {key: value for key, value in found.items() if key != name}


def place(lat: Any, lon: Any, **others: Any) -> dict[str, Any]:
    return fix(latitude=lat, longitude=lon, **others)


def covariance(first: Any, *, north: Any = 1.0) -> list[Any]:
    return [first, 0.0, 0.0, 0.0, north, 0.0, 0.0, 0.0, 1.0]


ACCELERATION, ORIENTATION = "linear_acceleration_covariance", "orientation_covariance"
HELD: dict[str, tuple[Rule, Any, bool]] = {
    "acceleration −1": (table.NO_ACCELERATION, imu(**{ACCELERATION: covariance(-1.0)}), True),
    "acceleration −1, whole": (table.NO_ACCELERATION, imu(**{ACCELERATION: covariance(-1)}), True),
    "acceleration −1, array": (table.NO_ACCELERATION, imu(**{ACCELERATION: np.array(covariance(-1.0))}), True),
    "acceleration −1 on all": (table.NO_ACCELERATION, imu(**{ACCELERATION: [-1.0] * 9}), True),
    "acceleration −1 later": (table.NO_ACCELERATION, imu(**{ACCELERATION: covariance(0.1, north=-1.0)}), False),
    "acceleration 0, unknown covariance": (table.NO_ACCELERATION, imu(**{ACCELERATION: [0.0] * 9}), False),
    "acceleration 0.01": (table.NO_ACCELERATION, imu(**{ACCELERATION: covariance(0.01)}), False),
    "acceleration −0.99": (table.NO_ACCELERATION, imu(**{ACCELERATION: covariance(-0.99)}), False),
    "acceleration NaN": (table.NO_ACCELERATION, imu(**{ACCELERATION: covariance(NAN)}), False),
    "acceleration null": (table.NO_ACCELERATION, imu(**{ACCELERATION: covariance(None)}), False),
    "acceleration text": (table.NO_ACCELERATION, imu(**{ACCELERATION: covariance("-1")}), False),
    "acceleration, no covariance": (table.NO_ACCELERATION, without(imu(), ACCELERATION), False),
    "acceleration, one number": (table.NO_ACCELERATION, imu(**{ACCELERATION: [-1.0]}), False),
    "acceleration, orientation −1": (table.NO_ACCELERATION, imu(**{ORIENTATION: covariance(-1.0)}), False),
    "orientation −1": (table.NO_ORIENTATION, imu(**{ORIENTATION: covariance(-1.0)}), True),
    "orientation 0, unknown covariance": (table.NO_ORIENTATION, imu(**{ORIENTATION: [0.0] * 9}), False),
    "orientation, acceleration −1": (table.NO_ORIENTATION, imu(**{ACCELERATION: covariance(-1.0)}), False),
    "status −1": (table.WITHOUT_FIX, fix(status=-1), True),
    "status 0": (table.WITHOUT_FIX, fix(status=0), False),
    "status −2": (table.UNKNOWN_STATUS, fix(status=-2), True),
    "status −1 is known": (table.UNKNOWN_STATUS, fix(status=-1), False),
    "0, 0": (table.AT_ZERO, place(0.0, 0.0), True),
    "0, −0": (table.AT_ZERO, place(0.0, -0.0), True),
    "0, 0 as whole numbers": (table.AT_ZERO, place(0, 0), True),
    "0, 0 as radians": (table.AT_ZERO, place(1e-15, -1e-12), True),
    "0, 0 augmented": (table.AT_ZERO, place(0.0, 0.0, status=2, altitude=17.2), True),
    "0, 0 known": (table.AT_ZERO, place(0.0, 0.0, position_covariance_type=3), True),
    "the equator": (table.AT_ZERO, place(0.0, 32.6), False),
    "Greenwich": (table.AT_ZERO, place(51.5, 0.0), False),
    "a metre from 0, 0": (table.AT_ZERO, place(1e-5, 0.0), False),
    "NaN": (table.AT_ZERO, place(NAN, NAN), False),
    "altitude NaN": (table.NO_ALTITUDE, fix(altitude=NAN), True),
    "altitude null": (table.NO_ALTITUDE, fix(altitude=None), True),
    "altitude 0": (table.NO_ALTITUDE, fix(altitude=0.0), False),
    "altitude do not use": (table.USELESS_ALTITUDE, fix(altitude=DO_NOT_USE), True),
    "altitude of the Dead Sea": (table.USELESS_ALTITUDE, fix(altitude=-430.0), False),
    "altitude of an aeroplane": (table.USELESS_ALTITUDE, fix(altitude=12_000.0), False),
    "covariance type 0": (table.NO_QUALITY, fix(position_covariance_type=0), True),
    "covariance type 1": (table.NO_QUALITY, fix(position_covariance_type=1), False),
    "covariance type 2": (table.NO_QUALITY, fix(position_covariance_type=2), False),
    "covariance type 3": (table.NO_QUALITY, fix(position_covariance_type=3), False),
    "covariance type 4": (table.NO_QUALITY, fix(position_covariance_type=4), True),
    "variance 0": (table.NO_VARIANCE, fix(position_covariance=covariance(0.0)), True),
    "variance −1": (table.NO_VARIANCE, fix(position_covariance=covariance(-1.0)), True),
    "variance NaN": (table.NO_VARIANCE, fix(position_covariance=covariance(NAN)), True),
    "variance of north 0": (table.NO_VARIANCE, fix(position_covariance=covariance(1.0, north=0.0)), True),
    "variance 1": (table.NO_VARIANCE, fix(position_covariance=covariance(1.0)), False),
    "no battery, 0": (table.NO_BATTERY, battery(present=False, percentage=0.0), True),
    "no battery, NaN": (table.NO_BATTERY, battery(present=False, percentage=NAN), True),
    "no battery, null": (table.NO_BATTERY, battery(present=False, percentage=None), True),
    "only the percentage": (table.NO_BATTERY, battery(present=False, percentage=0.03), False),
    "a battery": (table.NO_BATTERY, battery(present=True), False),
    "no field about a battery": (table.NO_BATTERY, without(battery(), "present"), False),
    "percentage NaN": (table.NO_PERCENTAGE, battery(percentage=NAN), True),
    "percentage null": (table.NO_PERCENTAGE, battery(percentage=None), True),
    "percentage 0": (table.NO_PERCENTAGE, battery(percentage=0.0), False),
    "no percentage": (table.NO_PERCENTAGE, without(battery(), "percentage"), False),
    "a range too short": (table.OUTSIDE, scan(0.05), True),
    "a range too long": (table.OUTSIDE, scan(82.0), True),
    "a range": (table.OUTSIDE, scan(5.0), False),
    "a range NaN": (table.NO_RETURN, scan(NAN), True),
    "a range +Inf": (table.NO_RETURN, scan(INF), True),
    "a range −Inf": (table.NO_RETURN, scan(-INF), True),
    "a range null": (table.NO_RETURN, scan(None), True),
    "a whole range": (table.NO_RETURN, scan(5.0), False),
    "stamp 0": (table.NO_STAMP, {"stamp": {"secs": 0, "nsecs": 0}}, True),
    "stamp 0 of ROS 2": (table.NO_STAMP, {"stamp": {"sec": 0, "nanosec": 0}}, True),
    "stamp of a simulation": (table.NO_STAMP, {"stamp": {"sec": 0, "nanosec": 50_000_000}}, False),
    "stamp": (table.NO_STAMP, {"stamp": {"secs": 1464818234, "nsecs": 0}}, False),
}


@pytest.mark.parametrize(("rule", "given_", "holds"), HELD.values(), ids=HELD)
def test_the_value_of_a_field_and_what_is_made_of_it(rule: Rule, given_: Any, holds: bool) -> None:
    assert rule.holds(copy.deepcopy(given_)) is holds
    assert EFFECTS[rule](given_) is holds


def test_each_rule_is_tried_with_a_value_of_either_kind() -> None:
    assert {(rule.field, holds) for rule, _, holds in HELD.values()} == {
        (rule.field, holds) for rule in RULES for holds in (True, False)
    }
    assert set(EFFECTS) == set(RULES)


def is_not_measured(read: Callable[[Any], Any]) -> Callable[[Any], bool]:
    def effect(given_: Any) -> bool:
        try:
            read(given_)
        except NotMeasured:
            return True
        except Rejected:
            pass
        return False

    return effect


def decoded(given_: Any) -> GpsFix | None:
    try:
        return signals.position.nav_sat_fix(given_)
    except Rejected:
        return None


def unusable_beam(given_: Any) -> bool:
    return signals.scan.laser_scan(given_).usable == 0


EFFECTS: dict[Rule, Callable[[Any], bool]] = {
    table.NO_ACCELERATION: is_not_measured(signals.acceleration.acceleration_of_imu),
    table.NO_ORIENTATION: is_not_measured(signals.heading.heading_of_imu),
    table.WITHOUT_FIX: lambda given_: (found := decoded(given_)) is not None and found.status == -1,
    table.UNKNOWN_STATUS: lambda given_: (found := decoded(given_)) is not None and found.status == -2,
    table.AT_ZERO: lambda given_: (found := decoded(given_)) is not None and found.is_unset and found.status == -1,
    table.NO_ALTITUDE: lambda given_: (found := decoded(given_)) is not None and found.alt_m is None,
    table.USELESS_ALTITUDE: lambda given_: (found := decoded(given_)) is not None and found.alt_m is None,
    table.NO_QUALITY: lambda given_: (found := decoded(given_)) is not None and found.sigma_m is None,
    table.NO_VARIANCE: lambda given_: (found := decoded(given_)) is not None and found.sigma_m is None,
    table.NO_BATTERY: is_not_measured(signals.fuel.battery),
    table.NO_PERCENTAGE: is_not_measured(signals.fuel.battery),
    table.OUTSIDE: unusable_beam,
    table.NO_RETURN: unusable_beam,
    table.NO_STAMP: lambda header: stamp_s({"header": header}) is None,
}


@pytest.mark.parametrize("status", [-1, -2])
@pytest.mark.parametrize(
    ("lat", "lon"),
    [(0.0, 0.0), (NAN, NAN), (None, None), (DO_NOT_USE, DO_NOT_USE), (1e300, 0.0), (91.0, 0.0), (48.2, 999.0)],
)
def test_without_a_fix_any_number_is_no_place(status: int, lat: Any, lon: Any) -> None:
    found = signals.position.nav_sat_fix(place(lat, lon, status=status, altitude=DO_NOT_USE))
    assert (found.status, found.is_unset, found.alt_m) == (status, False, None)
    assert math.isnan(found.lat_deg)
    assert math.isnan(found.lon_deg)


@pytest.mark.parametrize(("present", "percentage"), [(False, 0.0), (False, NAN), (True, NAN)])
def test_a_battery_that_is_not_measured_is_not_empty(present: bool, percentage: float) -> None:
    with pytest.raises(NotMeasured, match=r"^not measured \((present is false|percentage is NaN)\)$"):
        signals.fuel.battery(battery(present=present, percentage=percentage))
