"""Does the position move while the car does not, or faster than the car?

Drift: at rest every one of the last three fixes is farther from where the car stopped than the receiver's own error
explains. Jump: between each of the last four fixes the position ran faster than the car, by more than noise.
"""

from __future__ import annotations

import math

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    Finding,
    Limits,
    Place,
    Priority,
    Quantity,
    Sound,
    absent,
    beside,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.gps_watch import FIXES
from monitor.motion import STANDS_BELOW_MPS
from monitor.snapshot import Snapshot
from monitor.speeds import is_in_dispute
from monitor.values import STATUS_UNSET

SIGMA_UNKNOWN_M = 2.5  # of a receiver without quality
DRIFT_SIGMAS = 4.3
DRIVES_OFF_MPS, DRIVES_OFF_M = 1.0, 10.0  # a position that starts as a car does: within so many metres it is faster


class DriftLimits(Limits):
    least_m: float = threshold(
        2.0,
        "GPS drift at standstill",
        unit="m",
        low=0.5,
        high=50.0,
        step=0.5,
        help="And at least 4.3 times the receiver's own error: obstructed receivers drift 19 m within a minute.",
    )


class JumpLimits(Limits):
    margin_mps: float = threshold(3.0, "GPS faster than the car by", unit="m/s", low=0.5, high=30.0, step=0.5)


def _why_not(snapshot: Snapshot) -> Finding | None:
    """Why positions cannot be judged against the wheels, None where they can."""
    if snapshot.get("position") is None and not snapshot.link.offers("position"):
        return absent("Position is not published")
    status = snapshot.need("position").status
    if status < 0:
        what = "does not report whether it has a fix" if status == STATUS_UNSET else "has no fix"
        return unknown(f"The receiver {what}", short="no fix")
    return None


def drifts(snapshot: Snapshot, limits: DriftLimits, was_active: bool) -> Finding:
    why_not = _why_not(snapshot)
    if why_not is not None:
        return why_not
    speed_mps = abs(snapshot.need("speed").speed_mps)
    watch = snapshot.gps
    if snapshot.standing_since_s is None:
        if was_active:
            return ok("The car moves: no drift at standstill")  # else it would stand until the next stop
        if speed_mps < STANDS_BELOW_MPS:
            return unknown("The car has just stopped", short="waiting")
        return unknown("The car moves", short="moving")
    if len(watch.drift_m) < FIXES or watch.anchored_s is None:
        return unknown("Taking the place where the car stopped", short="waiting")
    allowed_m = max(limits.least_m, DRIFT_SIGMAS * (SIGMA_UNKNOWN_M if watch.sigma_m is None else watch.sigma_m))
    drift_m, stood_s = watch.drift_m[-1], snapshot.now_s - watch.anchored_s
    text = f"{beside(drift_m, allowed_m)} m from where it stopped {stood_s:.0f} s ago; {allowed_m:.1f} m are allowed"
    measured = Quantity(label="Drift", value=drift_m, unit="m")
    limit = Quantity(label="Allowed", value=allowed_m, unit="m")
    if min(watch.drift_m) > allowed_m * (0.8 if was_active else 1.0):
        if not was_active and _drives_off(snapshot, drift_m - allowed_m, speed_mps):
            return unknown(f"{text}: whether position or speed is wrong is not known", short="disputed")
        return fault(text, brief=f"{drift_m:.1f} m", measured=measured, limit=limit, causes=("position",))
    return ok(text, measured=measured, limit=limit)


def _drives_off(snapshot: Snapshot, beyond_m: float, speed_mps: float) -> bool:
    """Whether the position moves as a car that starts, so that it may be the speed that is wrong."""
    watch = snapshot.gps
    if watch.net_mps is None or not watch.is_smooth:
        return False
    is_starting = watch.net_mps > DRIVES_OFF_MPS and beyond_m < DRIVES_OFF_M
    return is_starting or is_in_dispute(snapshot, watch.net_mps, speed_mps)


def jumps(snapshot: Snapshot, limits: JumpLimits, was_active: bool) -> Finding:
    why_not = _why_not(snapshot)
    if why_not is not None:
        return why_not
    speed_mps = abs(snapshot.need("speed").speed_mps)
    if not math.isfinite(speed_mps):
        return unknown("Speed is not a number", short="no data")
    watch = snapshot.gps
    if len(watch.over_ground_mps) < FIXES or watch.net_mps is None:
        return unknown("Waiting for positions", short="waiting")
    allowed_mps = speed_mps + limits.margin_mps
    slowest_mps = min(*watch.over_ground_mps, watch.net_mps)
    text = f"The position moves at {watch.net_mps:.1f} m/s, the car at {speed_mps:.1f} m/s"
    measured = Quantity(label="Position", value=watch.net_mps, unit="m/s")
    limit = Quantity(label="Allowed", value=allowed_mps, unit="m/s")
    if slowest_mps > speed_mps + limits.margin_mps * (0.8 if was_active else 1.0):
        if not was_active and is_in_dispute(snapshot, watch.net_mps, speed_mps):
            return unknown(f"{text}: which of them is wrong is not known", short="disputed")
        return fault(text, brief=f"{watch.net_mps:.0f} m/s", measured=measured, limit=limit, causes=("position",))
    return ok(text, measured=measured, limit=limit)


CHECKS = (
    Check(
        id="gps_drift",
        label="GPS drift",
        order=50,
        checked_when="Checked at standstill with a fix, once three positions have come since the car stopped.",
        alarm=AlarmSpec(
            title="GPS drift at standstill",
            priority=Priority.WARNING,
            place=Place.DIALOG,
            sound=Sound.MEDIUM,
            needs_ack=True,
            off_delay_s=5.0,
            actions=(Action.ACKNOWLEDGE,),
            advice="Do not trust the position: the car may leave its path when it starts.",
            inhibited_by=("gps_jump",),
            place_after=Place.LIST,
        ),
        limits=DriftLimits,
        find=drifts,
        needs=frozenset({"position"}),
    ),
    Check(
        id="gps_jump",
        label="GPS jump",
        tile="GPS drift",
        order=51,
        checked_when="Checked while Speed and Position are fresh and the receiver has a fix.",
        alarm=AlarmSpec(
            title="GPS runs away",
            ended="GPS ran away",
            priority=Priority.WARNING,
            place=Place.DIALOG,
            sound=Sound.MEDIUM,
            needs_ack=True,
            off_delay_s=5.0,
            actions=(Action.ACKNOWLEDGE,),
            advice="Do not trust the position: the car may leave its path.",
            place_after=Place.LIST,
        ),
        limits=JumpLimits,
        find=jumps,
        needs=frozenset({"position"}),
    ),
)
