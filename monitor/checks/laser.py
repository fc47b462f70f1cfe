"""Can the laser see, and does its scan agree with itself?

A beam without a return is never free (28 to 69 % of a healthy laser's beams are such): only a corridor almost all of
whose beams are unusable is blindness. The expected count is computed for each message: a real SICK is interlaced. Many
drivers count one beam more or less in every scan; that is theirs, and a change of it is a fault.
"""

from __future__ import annotations

from functools import lru_cache

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    End,
    Finding,
    Limits,
    Place,
    Priority,
    Quantity,
    Sound,
    absent,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.corridor import Corridor
from monitor.instruments import ObstacleLimits
from monitor.obstacle_view import sweep_ahead
from monitor.scan import Mounting
from monitor.scan_shape import difference, habit_words
from monitor.snapshot import Snapshot

DEADBAND_PERCENT = 10.0  # three of the beams of the corridor: single ones come and go from scan to scan
SWEEP_SLACK = 1.1  # a sweep may take so much longer than the time between two scans


class BlindLimits(Limits):
    blind_percent: float = threshold(
        90.0,
        "Laser is blind above",
        unit="%",
        low=50.0,
        high=100.0,
        step=1.0,
        help="Of the beams in the corridor, those without a usable return.",
    )


def _laser_is_absent(snapshot: Snapshot) -> bool:
    return snapshot.get("scan") is None and not snapshot.link.offers("scan")


@lru_cache(maxsize=16)
def _straight_ahead(mounting: Mounting | None) -> Corridor:
    """That of the obstacle check with its default measures, so that a scan is evaluated once for both."""
    usual = ObstacleLimits()
    if mounting is None or mounting.x_m is None:
        place = {"laser_ahead_m": usual.laser_ahead_m, "laser_left_m": mounting.y_m if mounting is not None else 0.0}
    else:
        place = {"laser_ahead_m": mounting.x_m, "laser_left_m": mounting.y_m, "nose_ahead_m": 0.0}
    return Corridor(half_width_m=usual.half_width_m, wheelbase_m=usual.wheelbase_m, **place)


def ends(limits: BlindLimits) -> End:
    return End("below", limits.blind_percent - DEADBAND_PERCENT, "%")


def sees(snapshot: Snapshot, limits: BlindLimits, was_active: bool) -> Finding:
    if _laser_is_absent(snapshot):
        return absent("The laser is not published")
    scan = snapshot.need("scan")
    if scan.mounting is not None and scan.mounting.why_not is not None:
        return unknown(scan.mounting.why_not, short="mounting")
    sight = sweep_ahead(snapshot, scan, _straight_ahead(scan.mounting))
    limit = Quantity(label="At most", value=limits.blind_percent, unit="%")
    if sight.beams == 0:
        return fault("The scan has no beam ahead of the car", brief="no beam", limit=limit, causes=("scan",))
    percent = 100.0 * sight.blind / sight.beams
    measured = Quantity(label="Without a return", value=percent, unit="%")
    text = f"{percent:.0f} % of {sight.beams} beams ahead without a usable return"
    if percent > (ends(limits).value if was_active else limits.blind_percent):
        return fault(text, brief=f"{percent:.0f} % blind", measured=measured, limit=limit, causes=("scan",))
    return ok(text, measured=measured, limit=limit)


def agrees(snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
    """Beams = (angle_max − angle_min) / angle_increment + 1, or one off as the driver always counts; time per beam
    within the time of a scan."""
    if _laser_is_absent(snapshot):
        return absent("The laser is not published")
    scan = snapshot.need("scan")
    off = difference(scan)
    if off is None:
        if scan.beams > 1:
            return fault("The scan's angles contradict each other", brief="angles", causes=("angles",), level=2)
        return unknown("One beam or none: nothing to compare", short="1 beam")
    expected = scan.beams - off
    measured = Quantity(label="Beams", value=scan.beams, unit="")
    limit = Quantity(label="Expected", value=expected, unit="")
    text = f"{scan.beams} beams, {expected} expected"
    if abs(off) > 1:
        return fault(text, brief=f"{scan.beams} beams", measured=measured, limit=limit, causes=("beams",), level=2)
    sweep_s = (scan.beams - 1) * scan.time_increment_s
    if scan.scan_time_s > 0.0 and sweep_s > SWEEP_SLACK * scan.scan_time_s:
        took = f"{sweep_s * 1000:.0f} ms a sweep, {scan.scan_time_s * 1000:.0f} ms a scan"
        return fault(f"The scan's times contradict each other: {took}", brief="times", causes=("times",), level=1)
    usual = snapshot.scan_habit
    if off and usual is None:
        return unknown(f"{text}: how its driver counts is not yet known", short="waiting")
    if usual is not None and off not in usual:
        was = f"{text}; before {' or '.join(str(expected + one) for one in sorted(usual))}"
        return fault(was, brief=f"{scan.beams} beams", causes=("off by one",), level=1)
    return ok(f"{text}: {habit_words(usual)}" if off else text, measured=measured, limit=limit)


def _alarm(title: str, ended: str, advice: str, *, on_delay_s: float, actions: tuple[Action, ...]) -> AlarmSpec:
    return AlarmSpec(
        title=title,
        ended=ended,
        priority=Priority.WARNING,
        place=Place.SNACKBAR,
        sound=Sound.MEDIUM,
        needs_ack=True,
        on_delay_s=on_delay_s,
        off_delay_s=2.0,
        actions=actions,
        advice=advice,
    )


CHECKS = (
    Check(
        id="laser_blind",
        label="Laser",
        order=80,
        checked_when="Checked while the laser is published and fresh.",
        alarm=_alarm(
            "The laser cannot see",
            "The laser could not see",
            "Obstacles are not checked: watch ahead, and look for sun, dirt or a cover on the laser.",
            on_delay_s=1.0,
            actions=(Action.ACKNOWLEDGE,),  # it explains why obstacles are not checked: never hidden
        ),
        limits=BlindLimits,
        ends=ends,
        find=sees,  # at ticks only: it must hold for a second anyway, and 75 checks a second cost time
    ),
    Check(
        id="scan_shape",
        label="Scan shape",
        order=90,
        checked_when="Checked while the laser is fresh and has more than one beam.",
        alarm=_alarm(
            "The scan contradicts itself",
            "The scan contradicted itself",
            "Returns may be drawn and evaluated in the wrong place: check the laser's driver.",
            on_delay_s=0.5,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
        ),
        limits=Limits,
        find=agrees,
        needs=frozenset({"scan"}),
    ),
)
