"""Does the receiver have a fix, and does it report its quality?

Covariance is trusted only if its type is at least APPROXIMATED and its values are finite and above zero
(sensor_msgs/NavSatFix); the real car marks zeros as known. Rejecting unknown quality is a setting, off by
default, because it would always reject the real car.
"""

from __future__ import annotations

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
    beside,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.snapshot import Snapshot
from monitor.values import STATUS_UNSET


class FixLimits(Limits):
    worst_sigma_m: float = threshold(
        10.0, "GPS error at most", unit="m", low=0.5, high=100.0, step=0.5, help="One sigma, as the receiver states it."
    )
    strict: float = threshold(
        0.0,
        "Reject unknown GPS quality",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="1: a position of unknown quality counts as no position.",
    )


def ends(limits: FixLimits) -> End:
    return End("below", 0.9 * limits.worst_sigma_m, "m")


def has_fix(snapshot: Snapshot, limits: FixLimits, was_active: bool) -> Finding:
    if snapshot.get("position") is None and not snapshot.link.offers("position"):
        return absent("Position is not published")
    fix = snapshot.need("position")
    if fix.status == STATUS_UNSET:
        return fault("The receiver does not report whether it has a fix", brief="fix unset", causes=("position",))
    if fix.is_unset:
        text = "The receiver reports a fix with coordinates 0, 0: it has no position yet"
        return fault(text, brief="no place", causes=("position",))
    if fix.status < 0:
        return fault("The receiver has no fix; its coordinates are invalid", brief="no fix", causes=("position",))
    if fix.sigma_m is None:
        return ok("A fix of unknown quality")
    text = f"A fix with an error of {beside(fix.sigma_m, limits.worst_sigma_m)} m"
    measured = Quantity(label="Error", value=fix.sigma_m, unit="m")
    limit = Quantity(label="At most", value=limits.worst_sigma_m, unit="m")
    if fix.sigma_m > (ends(limits).value if was_active else limits.worst_sigma_m):
        return fault(text, brief=f"{fix.sigma_m:.0f} m", measured=measured, limit=limit, causes=("quality",))
    return ok(text, measured=measured, limit=limit)


def knows_its_quality(snapshot: Snapshot, limits: FixLimits, was_active: bool) -> Finding:
    if snapshot.get("position") is None and not snapshot.link.offers("position"):
        return absent("Position is not published")
    fix = snapshot.need("position")
    if fix.status >= 0 and fix.sigma_m is None:
        kind = (
            "no covariance"
            if fix.covariance_type == 0
            else f"a covariance of type {fix.covariance_type} without values"
        )
        why = f"The receiver does not report the quality of its position: {kind}"
        if limits.strict >= 1.0:
            return fault(f"{why}; rejected by the strict setting", brief="quality", causes=("position",))
        return unknown(why, short="quality")  # a healthy car of this kind would alarm for ever
    return ok("The receiver reports the quality of its position")


CHECKS = (
    Check(
        id="gps_fix",
        label="GPS fix",
        order=40,
        checked_when="Checked while Position is published and fresh.",
        alarm=AlarmSpec(
            title="GPS: no usable fix",
            ended="GPS had no usable fix",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,
            on_delay_s=3.0,
            off_delay_s=5.0,
            actions=(Action.ACKNOWLEDGE,),
            advice="Watch where the car is and where it goes.",
        ),
        limits=FixLimits,
        find=has_fix,
        ends=ends,
        needs=frozenset({"position"}),
    ),
    Check(
        id="gps_quality",
        label="GPS quality",
        order=41,
        checked_when="Checked while Position is fresh and its receiver reports a quality.",
        group="gps_fix",
        alarm=AlarmSpec(
            title="GPS quality unknown",
            ended="GPS quality was unknown",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.LOW,
            needs_ack=True,
            on_delay_s=3.0,
            off_delay_s=5.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="The strict setting rejects such a position: do not rely on it.",
            inhibited_by=("gps_fix",),
        ),
        limits=FixLimits,
        find=knows_its_quality,
        needs=frozenset({"position"}),
    ),
)
