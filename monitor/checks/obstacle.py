"""Is an obstacle ahead, by the laser in the corridor, or by the car's distance estimator?

Too near is: nearer than the allowed distance or the stopping distance, or a time to collision below the limit, at the
closing speed of the gap (SAE J2944: undefined while it does not close).
"""

from __future__ import annotations

import math

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    Finding,
    Place,
    Priority,
    Quantity,
    Sound,
    Verdict,
    absent,
    beside,
    fault,
    ok,
    unknown,
)
from monitor.instruments import ObstacleLimits, stopping_m
from monitor.obstacle_view import corridor_ahead, is_blind, look_ahead, sweep_ahead, tyre_angle_rad, why_unseen
from monitor.scan import within_half_turn
from monitor.snapshot import NotFresh, Snapshot

CLOSING_AT_LEAST_MPS = 0.3  # slower is noise of two distances
APPROACH_AT_MOST_MPS = 10.0  # nothing on a test site approaches faster
STEADY_WITHIN_M = 3.0  # a gap that shrank more than the car can drive in between is another object's


def by_laser(snapshot: Snapshot, limits: ObstacleLimits, was_active: bool) -> Finding:
    if snapshot.get("scan") is None and not snapshot.link.offers("scan"):
        return absent("The laser is not published")
    scan = snapshot.need("scan")
    speed_mps = _speed(snapshot)
    mounting = scan.mounting
    if mounting is not None and mounting.why_not is not None:
        return unknown(mounting.why_not, short="mounting")
    corridor = corridor_ahead(snapshot, limits, was_active=was_active)
    sight = sweep_ahead(snapshot, scan, corridor)
    why_not = why_unseen(scan, sight)
    if why_not is not None and (sight.gap_m is None or is_blind(sight)):
        return unknown(why_not, short="blind" if sight.beams else "no view")
    before = snapshot.scan_before
    closing_mps = None
    if sight.gap_m is not None and sight.gap_m < _soon_m(speed_mps, limits):
        gap_before_m = look_ahead(before.value, corridor).gap_m if before is not None else None
        span_s = snapshot.readings["scan"].received_s - before.received_s if before is not None else 0.0
        closing_mps = _closing(sight.gap_m, gap_before_m, span_s, speed_mps)
    found = _judge(sight.gap_m, sight.bearing_rad, speed_mps, closing_mps, limits, was_active, cause="scan")
    if why_not is not None and found.verdict is Verdict.OK:
        return unknown(why_not, short="no view")  # what is seen is far enough, and something nearer may be unseen
    if mounting is not None and mounting.reservation is not None:
        found = found._replace(text=f"{found.text} ({mounting.reservation})")
    if mounting is not None and mounting.gap_words is not None:
        found = found._replace(text=f"{found.text}; {mounting.gap_words}")
    if tyre_angle_rad(snapshot) is None:
        found = found._replace(text=f"{found.text}; steering unknown, checked straight ahead")
    return found


def by_estimator(snapshot: Snapshot, limits: ObstacleLimits, was_active: bool) -> Finding:
    if snapshot.get("distance") is None and not snapshot.link.offers("distance"):
        return absent("The nearest object is not published")
    distance = snapshot.need("distance")
    speed_mps = _speed(snapshot)
    if distance.distance_m is not None and not math.isfinite(distance.distance_m):
        return unknown("The distance is not a number", short="no data")
    if distance.distance_m is None:
        return _judge(None, None, speed_mps, None, limits, was_active, cause="distance")
    bearing = snapshot.get("bearing")
    bearing_rad = bearing.value.bearing_rad if bearing is not None and bearing.is_fresh(snapshot.now_s) else None
    before = snapshot.distance_before
    closing_mps = None
    span_s = snapshot.readings["distance"].received_s - before.received_s if before is not None else 0.0
    gap_before_m = before.value.distance_m if before is not None else None
    closing_mps = _closing(distance.distance_m, gap_before_m, span_s, speed_mps)
    return _judge(distance.distance_m, bearing_rad, speed_mps, closing_mps, limits, was_active, cause="distance")


def _speed(snapshot: Snapshot) -> float | None:
    """Own speed; None where it is not known, and then only the distance is judged."""
    try:
        speed_mps = snapshot.need("speed").speed_mps
    except NotFresh:
        return None
    return abs(speed_mps) if math.isfinite(speed_mps) else None


def _soon_m(speed_mps: float | None, limits: ObstacleLimits) -> float:
    """Nothing farther than this can be met within the time to collision."""
    return 1.25 * limits.time_to_collision_s * ((speed_mps or 0.0) + APPROACH_AT_MOST_MPS)


def _closing(gap_m: float, before_m: float | None, span_s: float, speed_mps: float | None) -> float | None:
    """Speed [m/s] at which the gap shrinks, from two sights; own speed where the earlier one is of something else."""
    if before_m is None or span_s <= 0.0 or before_m - gap_m > (speed_mps or 0.0) * span_s + STEADY_WITHIN_M:
        return speed_mps
    return (before_m - gap_m) / span_s


def _judge(
    gap_m: float | None,
    bearing_rad: float | None,
    speed_mps: float | None,
    closing_mps: float | None,
    limits: ObstacleLimits,
    was_active: bool,
    *,
    cause: str,
) -> Finding:
    needed_m = max(limits.standoff_m, stopping_m(speed_mps or 0.0, limits))
    limit = Quantity(label="Needed", value=needed_m, unit="m")
    if gap_m is None:
        return ok("Nothing in the way", limit=limit)
    measured = Quantity(label="Gap", value=gap_m, unit="m")
    where = "" if bearing_rad is None or abs(bearing_rad) < math.radians(2) else _side(bearing_rad)
    text = f"Obstacle {beside(gap_m, needed_m)} m ahead{where}, {needed_m:.1f} m needed"
    if gap_m < needed_m + (limits.deadband_m if was_active else 0.0):
        return fault(text, brief=f"{gap_m:.1f} m", measured=measured, limit=limit, causes=(cause,))
    if closing_mps is not None and closing_mps > CLOSING_AT_LEAST_MPS:
        collision_s = gap_m / closing_mps
        if collision_s < limits.time_to_collision_s * (1.25 if was_active else 1.0):
            return fault(
                f"{text}; collision in {collision_s:.1f} s, {limits.time_to_collision_s:.1f} s needed",
                brief=f"in {collision_s:.1f} s",
                measured=measured,
                limit=limit,
                causes=(cause,),
            )
    return ok(text, measured=measured, limit=limit)


def _side(bearing_rad: float) -> str:
    if not math.isfinite(bearing_rad):
        return ""
    bearing_rad = within_half_turn(bearing_rad)
    return f", {abs(math.degrees(bearing_rad)):.0f}° {'left' if bearing_rad > 0 else 'right'}"


def _alarm(title: str, inhibited_by: tuple[str, ...]) -> AlarmSpec:
    return AlarmSpec(
        title=title,
        priority=Priority.CRITICAL,
        place=Place.DIALOG,
        sound=Sound.HIGH,
        needs_ack=True,
        off_delay_s=1.0,
        actions=(Action.ACKNOWLEDGE, Action.DECELERATE),
        advice="The safety driver must brake or steer clear.",
        inhibited_by=inhibited_by,
    )


CHECKS = (
    Check(
        id="obstacle",
        label="Obstacle (laser)",
        tile="Obstacle",
        order=20,
        checked_when="Checked while the laser is fresh and sees into the corridor.",
        group="obstacle",
        alarm=_alarm("Obstacle ahead", ("laser_blind",)),
        limits=ObstacleLimits,
        find=by_laser,
        needs=frozenset({"scan"}),
        immediate=True,
    ),
    Check(
        id="obstacle_nearest",
        label="Obstacle (nearest object)",
        tile="Obstacle",
        order=21,
        checked_when="Checked while Nearest distance is published and fresh.",
        group="obstacle",
        # Both detect the same object: one that the laser announced is not announced again.
        alarm=_alarm("Object too near", ("obstacle",)),
        limits=ObstacleLimits,
        find=by_estimator,
        needs=frozenset({"distance"}),
        immediate=True,
    ),
)
