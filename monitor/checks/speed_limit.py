"""Is the vehicle faster than the operator allows?"""

from __future__ import annotations

import math

from monitor.check import (
    EXPERT,
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
    beside,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.snapshot import Snapshot


class SpeedLimits(Limits):
    max_mps: float = threshold(11.0, "Speed limit", unit="m/s", low=0.5, high=40.0, step=0.1)
    deadband_mps: float = threshold(
        0.5,
        "Speed deadband",
        unit="m/s",
        low=0.0,
        high=5.0,
        step=0.1,
        help="The alarm clears this far below the limit.",
        heading=EXPERT,
    )


def ends(limits: SpeedLimits) -> End:
    """A deadband as wide as the limit would never end, so it takes at most half of it."""
    return End("below", max(limits.max_mps / 2, limits.max_mps - limits.deadband_mps), "m/s")


def find(snapshot: Snapshot, limits: SpeedLimits, was_active: bool) -> Finding:
    speed_mps = abs(snapshot.need("speed").speed_mps)  # reversing too fast is too fast
    if not math.isfinite(speed_mps):
        return unknown("Speed is not a number", short="no data")
    allowed_mps = ends(limits).value if was_active else limits.max_mps
    text = f"{beside(speed_mps, limits.max_mps)} m/s, limit {limits.max_mps:.1f} m/s"
    measured = Quantity(label="Speed", value=speed_mps, unit="m/s")
    limit = Quantity(label="Limit", value=limits.max_mps, unit="m/s")
    if speed_mps <= allowed_mps:
        return ok(text, measured=measured, limit=limit)
    return fault(text, brief=f"{speed_mps:.1f} m/s", measured=measured, limit=limit, causes=("speed",))


CHECKS = (
    Check(
        id="speed_limit",
        label="Speed",
        order=10,
        checked_when="Checked while Speed is fresh.",
        alarm=AlarmSpec(
            title="Speed above limit",
            priority=Priority.CRITICAL,
            place=Place.DIALOG,
            sound=Sound.HIGH,
            needs_ack=True,
            on_delay_s=0.3,
            off_delay_s=2.0,
            actions=(Action.ACKNOWLEDGE, Action.DECELERATE),
            advice="The safety driver must slow the car.",
        ),
        limits=SpeedLimits,
        find=find,
        ends=ends,
        needs=frozenset({"speed"}),
        immediate=True,
    ),
)
