"""Have all messages of the car stopped while the link is open?"""

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
    Sound,
    fault,
    ok,
    unknown,
)
from monitor.inhibition import GRACE_S
from monitor.snapshot import Snapshot
from monitor.staleness import BRIDGE_WITHIN_S, is_heard, silence


def find(snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
    found = silence(snapshot)
    if found is None:
        what = "No regular signal" if is_heard(snapshot) else "Nothing"
        return unknown(f"{what} received since connecting", short="no data")
    if not found.is_silent and not (was_active and found.falters):
        return ok(f"{found.fresh} of {found.regular} signals come")
    if not (found.is_bridge_proved or was_active or found.silent_s > BRIDGE_WITHIN_S):
        # Car or link? Wait for the bridge's next sign of life: a lost link has its own text.
        return unknown(f"No message for {found.silent_s:.1f} s, pinging the bridge", short="silent")
    if not found.is_silent:
        proof = "messages come with gaps"
    elif found.is_bridge_proved:
        proof = "the bridge answers, no signal of the car comes"
    else:
        proof = "neither car nor bridge answers"
    if snapshot.link.behind_title:
        proof = snapshot.link.behind_title
    return fault(
        f"No message for {found.silent_s:.1f} s: {proof}",
        brief=f"{found.silent_s:.0f} s",
        measured=Quantity(label="Silent for", value=found.silent_s, unit="s"),
        causes=("car",),
    )


CHECKS = (
    Check(
        id="car_silent",
        label="Car sends data",
        tile="Link",
        order=120,
        checked_when="Checked once the first message has come.",
        alarm=AlarmSpec(
            title="The car fell silent",
            ended="The car was silent",
            priority=Priority.CRITICAL,
            place=Place.DIALOG,
            sound=Sound.HIGH,
            needs_ack=True,
            off_delay_s=1.0,
            actions=(Action.ACKNOWLEDGE, Action.RECONNECT, Action.EXIT),
            advice="The car may still be moving: watch the car.",
            inhibited_by=("link_lost", "link_late", "link_late_moving"),
            grace_s=GRACE_S,
            place_after=Place.LIST,
        ),
        limits=Limits,
        find=find,
    ),
)
