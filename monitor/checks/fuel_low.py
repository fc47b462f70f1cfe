"""Is the fuel, or the charge, of the car running low?"""

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
    absent,
    beside,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.snapshot import Snapshot


class FuelLimits(Limits):
    low_percent: float = threshold(10.0, "Fuel low below", unit="%", low=1.0, high=60.0, step=1.0)
    deadband_percent: float = threshold(
        2.0,
        "Fuel deadband",
        unit="%",
        low=0.0,
        high=10.0,
        step=0.5,
        help="The alarm clears this far above, because fuel sloshes.",
        heading=EXPERT,
    )


def ends(limits: FuelLimits) -> End:
    return End("above", limits.low_percent + limits.deadband_percent, "%")


def find(snapshot: Snapshot, limits: FuelLimits, was_active: bool) -> Finding:
    reading = snapshot.get("fuel")
    if reading is None and not snapshot.link.offers("fuel"):
        return absent("Fuel is not published")
    level = snapshot.need("fuel")
    if level.unit != "%":
        return unknown(
            f"Fuel is reported in {level.unit or 'an unknown unit'}, not in percent of the tank", short="unit"
        )
    if not math.isfinite(level.value):
        return unknown("The fuel level is not a number", short="no data")
    below = ends(limits).value if was_active else limits.low_percent
    text = f"{beside(level.value, limits.low_percent, 0)} % left, low below {limits.low_percent:.0f} %"
    measured = Quantity(label="Fuel", value=level.value, unit="%")
    limit = Quantity(label="Low below", value=limits.low_percent, unit="%")
    if level.value >= below:
        return ok(text, measured=measured, limit=limit)
    return fault(text, brief=f"{level.value:.0f} %", measured=measured, limit=limit, causes=("fuel",))


CHECKS = (
    Check(
        id="fuel_low",
        label="Fuel",
        order=150,
        checked_when="Checked while Fuel is published in percent of the tank.",
        alarm=AlarmSpec(
            title="Fuel low",
            priority=Priority.ADVISORY,
            place=Place.LIST,
            sound=Sound.LOW,
            needs_ack=False,
            on_delay_s=5.0,  # one bend, while the fuel surface is tilted
            off_delay_s=10.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="Plan the way back.",
        ),
        limits=FuelLimits,
        find=find,
        ends=ends,
        needs=frozenset({"fuel"}),
    ),
)
