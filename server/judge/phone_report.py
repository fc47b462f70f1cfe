"""The report of an operator's phone on the server's clock."""

from __future__ import annotations

import math

from monitor.phones import PhoneReport
from monitor.values import PhoneFix
from server.protocol import commands

AHEAD_S = 0.25  # by so much the server's time of day may be set back between two frames; more, and nothing is known


def phone_report(command: commands.Position, now_s: float, wall_ms: float, label: str = "") -> PhoneReport:
    """The report in a page's command, its moment on the clock of `now_s`.

    Three durations, each measured by one clock: the age of the fix when the page sent it (page), the time since the
    server sent the time that the page echoes (server), and how long the page held it (page). The difference of the last
    two is the round trip; the fix is assumed in its middle, plus or minus half.
    """
    fix = command.fix
    if fix is None:
        return PhoneReport(phone=command.phone, is_handheld=command.handheld, label=label, why=command.why)
    way_s = (wall_ms - fix.heard_ms) / 1000 - fix.held_s
    half_s = max(0.0, way_s) / 2 if way_s >= -AHEAD_S else math.inf
    return PhoneReport(
        phone=command.phone,
        is_handheld=command.handheld,
        label=label,
        fix=PhoneFix(
            lat_deg=fix.lat_deg,
            lon_deg=fix.lon_deg,
            accuracy_m=fix.accuracy_m,
            alt_m=fix.alt_m,
            speed_mps=fix.speed_mps,
            heading_deg=fix.heading_deg,
            at_ms=fix.at_ms,
        ),
        measured_s=now_s - fix.age_s - (half_s if math.isfinite(half_s) else 0.0),
        uncertain_s=half_s,
    )
