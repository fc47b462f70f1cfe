"""Could the car never be reached?"""

from __future__ import annotations

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    Finding,
    Limits,
    Place,
    Priority,
    Scope,
    Sound,
    absent,
    fault,
    ok,
)
from monitor.snapshot import Snapshot


def find(snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
    link = snapshot.link
    if link.phase == "failed":
        parts = (link.problem_title or "The car cannot be reached.", link.problem_hint or "")
        return fault(" ".join(part for part in parts if part), brief="no answer", causes=("link",))
    if link.phase in ("monitoring", "lost"):
        return ok("The car was reached")
    return absent("Connecting", brief="connecting")


CHECKS = (
    Check(
        id="connect_failed",
        label="Connecting",
        tile="Link",
        order=120,
        checked_when="Checked when a connection was opened or has failed.",
        alarm=AlarmSpec(
            title="Connection failed",
            priority=Priority.WARNING,
            place=Place.DIALOG,
            sound=Sound.LOW,
            needs_ack=False,
            off_delay_s=1.0,
            actions=(Action.RECONNECT, Action.CHANGE_ADDRESS),
            advice="catgraph keeps trying.",
        ),
        limits=Limits,
        find=find,
        scope=Scope.LINK,
    ),
)
