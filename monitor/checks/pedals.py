"""Are brake and accelerator pressed at the same time?"""

from __future__ import annotations

import math

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
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.snapshot import Snapshot

DEADBAND_PERCENT = 1.0  # a resting foot moves by more than one quantum of the car's values, 100/255


class PedalLimits(Limits):
    pressed_percent: float = threshold(
        2.0,
        "Pedal counts as pressed",
        unit="%",
        low=0.5,
        high=50.0,
        step=0.5,
        help="The pedals come in steps of 0.39 %: a limit of one step would chatter.",
    )


def ends(limits: PedalLimits) -> End:
    """Of the pedal that is pressed less."""
    return End("below", max(0.0, limits.pressed_percent - DEADBAND_PERCENT), "%")


def find(snapshot: Snapshot, limits: PedalLimits, was_active: bool) -> Finding:
    brake = snapshot.need("brake").percent
    accelerator = snapshot.need("accelerator").percent
    if not (math.isfinite(brake) and math.isfinite(accelerator)):
        return unknown("A pedal value is not a number", short="no data")
    pressed = ends(limits).value if was_active else limits.pressed_percent
    text = f"Brake {brake:.0f} %, accelerator {accelerator:.0f} %"
    measured = Quantity(label="Both at least", value=min(brake, accelerator), unit="%")
    limit = Quantity(label="Pressed above", value=limits.pressed_percent, unit="%")
    if brake > pressed and accelerator > pressed:
        return fault(
            text,
            brief=f"{brake:.0f}/{accelerator:.0f} %",
            measured=measured,
            limit=limit,
            causes=("brake", "accelerator"),
        )
    return ok(text, measured=measured, limit=limit)


CHECKS = (
    Check(
        id="pedals",
        label="Pedals",
        order=30,
        checked_when="Checked while Brake and Accelerator are fresh.",
        alarm=AlarmSpec(
            title="Brake and accelerator together",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,
            on_delay_s=0.3,
            off_delay_s=1.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="Two controllers may be commanding the car: be ready to take over.",
        ),
        limits=PedalLimits,
        find=find,
        ends=ends,
        needs=frozenset({"brake", "accelerator"}),
        immediate=True,
    ),
)
