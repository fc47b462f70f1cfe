"""Was the link to the car open, and is not any more?"""

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
    fault,
    ok,
    unknown,
)
from monitor.inhibition import GRACE_S
from monitor.snapshot import Snapshot


def find(snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
    link = snapshot.link
    if link.phase == "lost":
        lost_s = max(0.0, snapshot.now_s - link.since_s)
        return fault(
            link.problem_title or "The bridge stopped answering.",
            brief=f"{lost_s:.0f} s",
            measured=Quantity(label="Lost for", value=lost_s, unit="s"),
            causes=("link",),
        )
    if link.phase == "monitoring":
        return ok("The link is open")
    return unknown("Not connected", short="no link")


CHECKS = (
    Check(
        id="link_lost",
        label="Link open",
        tile="Link",
        order=120,
        checked_when="Checked while the bridge is connected, or was and got lost.",
        alarm=AlarmSpec(
            title="Connection lost",
            ended="Connection was lost, now back",
            priority=Priority.CRITICAL,
            place=Place.DIALOG,
            sound=Sound.HIGH,
            needs_ack=True,
            off_delay_s=1.0,
            actions=(Action.RECONNECT, Action.CHANGE_ADDRESS, Action.EXIT),
            advice="The car may still be moving: watch the car.",
            grace_s=GRACE_S,
            place_after=Place.LIST,  # the dialog closes by itself when the link is back
        ),
        limits=Limits,
        find=find,
        scope=Scope.LINK,
    ),
)
