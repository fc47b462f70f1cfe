"""Does the car stand although it is being watched?"""

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
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.snapshot import Snapshot


class NotMovingLimits(Limits):
    after_s: float = threshold(10.0, "Standing is reported after", unit="s", low=2.0, high=600.0, step=1.0)


def find(snapshot: Snapshot, limits: NotMovingLimits, was_active: bool) -> Finding:
    speed_mps = snapshot.need("speed").speed_mps
    if not math.isfinite(speed_mps):
        return unknown("Speed is not a number", short="no data")
    since_s = snapshot.standing_since_s
    if since_s is None:
        return ok(f"The car moves, {speed_mps:.1f} m/s")
    standing_s = max(0.0, snapshot.now_s - since_s)
    if standing_s < limits.after_s:
        return ok(f"The car stands for {standing_s:.0f} s")
    return fault(
        f"The car stands for {standing_s:.0f} s",
        brief=f"{standing_s:.0f} s",
        measured=Quantity(label="Standing for", value=standing_s, unit="s"),
        limit=Quantity(label="Reported after", value=limits.after_s, unit="s"),
        causes=("speed",),
    )


CHECKS = (
    Check(
        id="not_moving",
        label="Moving",
        order=115,
        checked_when="Checked while Speed is fresh.",
        alarm=AlarmSpec(
            title="The car is not moving",
            priority=Priority.ADVISORY,
            place=Place.SNACKBAR,
            sound=Sound.LOW,
            needs_ack=False,
            off_delay_s=1.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="If it should be moving, check its controllers.",
        ),
        limits=NotMovingLimits,
        find=find,
    ),
)
