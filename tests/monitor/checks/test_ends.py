"""Where an alarm ends: the values that are declared, by which the checks judge while their alarm is active."""

from __future__ import annotations

from monitor.catalog import CHECKS

DECLARED = {
    "speed_limit": ("below", 10.5, "m/s"),
    "pedals": ("below", 1.0, "%"),
    "gps_fix": ("below", 9.0, "m"),
    "laser_blind": ("below", 80.0, "%"),
    "link_late": ("below", 0.7, "s"),
    "link_late_moving": ("below", 1.4, "s"),
    "recorder_behind": ("below", 1.0, "s"),
    "disk_nearly_full": ("above", 2.2, "GB"),
    "fuel_low": ("above", 12.0, "%"),
}


def test_where_each_alarm_ends() -> None:
    found = {check.id: check.ends(check.limits()) for check in CHECKS if check.ends is not None}
    assert {name: (end.side, round(end.value, 3), end.unit) for name, end in found.items()} == DECLARED
