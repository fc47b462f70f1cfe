"""Was the monitoring paused and forgotten? Reported after some minutes, and again each time these double."""

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
    Scope,
    Sound,
    fault,
    ok,
    threshold,
)
from monitor.snapshot import Snapshot


class PausedLimits(Limits):
    after_min: float = threshold(
        5.0,
        "Pause is reported after",
        unit="min",
        low=0.5,
        high=60.0,
        step=0.5,
        help="Then again after 2, 4 and 8 times as long.",
    )


def find(snapshot: Snapshot, limits: PausedLimits, was_active: bool) -> Finding:
    if not snapshot.paused or snapshot.paused_since_s is None:
        return ok("Monitoring is on")
    paused_s = max(0.0, snapshot.now_s - snapshot.paused_since_s)
    after_s = 60.0 * limits.after_min
    text = f"Monitoring paused for {paused_s / 60:.0f} min: no alarm is raised"
    if paused_s < after_s:
        return ok(text)
    return fault(
        text,
        brief=f"{paused_s / 60:.0f} min",
        measured=Quantity(label="Paused for", value=paused_s, unit="s"),
        limit=Quantity(label="Reported after", value=after_s, unit="s"),
        causes=("paused",),
        level=1 + math.floor(math.log2(paused_s / after_s)),
    )


CHECKS = (
    Check(
        id="paused_long",
        label="Monitoring",
        order=127,
        checked_when="Always checked.",
        alarm=AlarmSpec(
            title="Monitoring paused too long",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=False,  # resuming shows that it was seen
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="Press Resume: until then nothing is checked and no alarm is raised.",
        ),
        limits=PausedLimits,
        find=find,
        scope=Scope.SERVER,
    ),
)
