"""Does the car brake when it is commanded to?

Braking is commanded while the newest command is far below the measured speed; a real car follows its commands loosely,
so "far" is a setting. The response is the wheel speed, because an accelerometer senses slopes too. A command older than
a second does not count.
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
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.snapshot import Snapshot

COMMAND_HOLDS_S = 1.0


class ResponseLimits(Limits):
    margin_mps: float = threshold(
        1.5,
        "Braking commanded below speed by",
        unit="m/s",
        low=0.5,
        high=40.0,
        step=0.1,
        help="A command this far below the measured speed means braking; raise it if the car follows commands loosely.",
    )
    least_mps2: float = threshold(
        0.3, "Least braking response", unit="m/s²", low=0.1, high=3.0, step=0.1, help="Less counts as no response."
    )


def find(snapshot: Snapshot, limits: ResponseLimits, was_active: bool) -> Finding:
    command = snapshot.get("command")
    if command is None:
        return absent("No command received", brief="no command")
    speed_mps = snapshot.need("speed").speed_mps
    age_s = command.age_s(snapshot.now_s)
    if age_s > COMMAND_HOLDS_S:
        return unknown(f"No command for {age_s:.0f} s", short="no cmd")
    ordered_mps = command.value.speed_mps
    if ordered_mps is None or not math.isfinite(ordered_mps) or not math.isfinite(speed_mps):
        return unknown("The command has no speed", short="no cmd")
    ordered_mps = max(0.0, ordered_mps)  # a reverse command before standstill counts as zero
    if speed_mps - ordered_mps <= limits.margin_mps * (0.8 if was_active else 1.0):
        return ok(f"{ordered_mps:.1f} m/s ordered, {speed_mps:.1f} m/s driven: no braking commanded")
    slope_mps2 = snapshot.speed_slope_mps2
    if slope_mps2 is None:
        return unknown("Too few speed messages to tell whether the car slows down", short="waiting")
    braking_mps2 = max(0.0, -slope_mps2)
    text = f"{ordered_mps:.1f} m/s ordered, {speed_mps:.1f} m/s driven"
    measured = Quantity(label="Braking", value=braking_mps2, unit="m/s²")
    limit = Quantity(label="At least", value=limits.least_mps2, unit="m/s²")
    if braking_mps2 >= limits.least_mps2 * (1.2 if was_active else 1.0):
        return ok(f"{text}: the car slows by {braking_mps2:.1f} m/s²", measured=measured, limit=limit)
    return fault(
        f"{text}: braking is commanded, the car does not slow down",
        brief=f"{speed_mps:.1f} m/s",
        measured=measured,
        limit=limit,
        causes=("command",),
    )


CHECKS = (
    Check(
        id="no_response",
        label="Braking answers",
        tile="Response",
        order=25,
        checked_when="Checked while commands come on the car's topic and Speed is fresh.",
        alarm=AlarmSpec(
            title="Car ignores brake command",
            ended="Car ignored brake command",
            priority=Priority.CRITICAL,
            place=Place.DIALOG,
            sound=Sound.HIGH,
            needs_ack=True,
            on_delay_s=1.0,
            off_delay_s=1.0,
            actions=(Action.ACKNOWLEDGE, Action.DECELERATE),
            advice="The safety driver must brake.",
            inhibited_by=("signal_frozen.speed",),  # then deceleration is unknown
        ),
        limits=ResponseLimits,
        find=find,
        needs=frozenset({"command"}),
        immediate=True,
    ),
)
