"""Has something between the bridge and the car failed: rosapi, roscore, the bridge's node, what it passes on?"""

from __future__ import annotations

from monitor.check import (
    AlarmSpec,
    Check,
    Finding,
    Limits,
    Place,
    Priority,
    Scope,
    Sound,
    fault,
    ok,
    unknown,
)
from monitor.snapshot import Snapshot


def find(snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
    link = snapshot.link
    if link.phase != "monitoring":
        return unknown("Not connected", short="no link")
    if link.behind_title is None:
        return ok("No fault is known")
    text = " ".join(part for part in (link.behind_title, link.behind_hint) if part)
    return fault(text, brief=link.behind_mark or "fault", causes=("car",))


CHECKS = (
    Check(
        id="bridge_fault",
        label="Behind the bridge",
        tile="Link",
        order=120,
        checked_when="Checked while the bridge is connected.",
        alarm=AlarmSpec(
            title="Fault between bridge and car",
            ended="Fault between bridge and car ended",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,
            off_delay_s=2.0,
            advice="Messages may stop, and commands may not reach the car.",
            inhibited_by=("link_lost", "no_message", "car_silent"),
        ),
        limits=Limits,
        find=find,
        scope=Scope.LINK,
    ),
)
