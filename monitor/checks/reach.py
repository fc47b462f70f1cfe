"""Can any operator hear an alarm while the car moves?

No operator is needed while the car stands. A reloaded page is silent for a moment, and its sound needs a tap again:
hence the delay.
"""

from __future__ import annotations

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    Finding,
    Limits,
    Place,
    Priority,
    Quantity,
    Scope,
    Sound,
    absent,
    fault,
    ok,
    unknown,
)
from monitor.motion import MOVES_ABOVE_MPS
from monitor.snapshot import Snapshot

RELOADED_S = 15.0  # a page is reloaded and touched again within this time


class ReachLimits(Limits):
    pass


def find(snapshot: Snapshot, limits: ReachLimits, was_active: bool) -> Finding:
    facts = snapshot.reach
    if facts is None:
        return absent("Alarm reach is not monitored here", brief="not monitored")
    measured = Quantity(label="Audible on", value=facts.can, unit="")
    if facts.can > 0:
        pages = f"operator page{'' if facts.of == 1 else 's'}"
        text = f"Alarms audible on {facts.can} of {facts.of} {pages}"
        return ok(text, measured=measured, ended="Alarms are audible again")
    why = f"none of {facts.of} ({facts.why})" if facts.of else "no operator's phone is connected"
    speed = snapshot.get("speed")
    if speed is None:
        return absent(f"Nobody can hear alarms: {why}; whether the car moves is unknown", brief="no speed")
    if not speed.is_fresh(snapshot.now_s):
        return unknown(f"Nobody can hear alarms: {why}; whether the car moves is unknown", short="no speed")
    if not moves(snapshot, was_active):
        text = f"Nobody can hear alarms: {why}; the car stands"
        return ok(text, measured=measured, ended="Nobody can hear alarms, car stands")
    text = f"The car moves at {abs(speed.value.speed_mps):.1f} m/s and nobody can hear alarms: {why}"
    return fault(text, brief="nobody", measured=measured, causes=("reach",))


def moves(snapshot: Snapshot, was_active: bool) -> bool:
    """Whether the wheels turn; once it is alarmed, until the car has come to rest for two seconds."""
    speed = snapshot.get("speed")
    if speed is None:
        return False
    fast = abs(speed.value.speed_mps) > MOVES_ABOVE_MPS
    return fast or (was_active and snapshot.standing_since_s is None)


CHECKS = (
    Check(
        id="reach",
        label="Alarm reach",
        order=126,
        checked_when="Checked of a live car, while Speed is fresh.",
        alarm=AlarmSpec(
            title="Nobody can hear alarms",
            ended="Nobody could hear alarms",
            priority=Priority.WARNING,
            place=Place.LIST,  # the strip shows it on every tab; a page without sound shows that itself
            sound=Sound.MEDIUM,
            needs_ack=True,  # a returning operator must see that nobody could hear alarms
            on_delay_s=RELOADED_S,
            off_delay_s=2.0,
            repeat_after_s=1800.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="Open this page on a phone, tap it once to allow sound, and keep it in the foreground.",
        ),
        limits=ReachLimits,
        find=find,
        scope=Scope.SERVER,
    ),
)
