"""Does the operator's phone have a position, and if not, why?

Only an open page is expected to have one. A computer without a receiver raises no alarm, unless its permission was
denied or it was chosen as the phone in the car. A page that was closed, or was silent for a minute, no longer counts.
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
    Sound,
    absent,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.phone_text import name_of, why_text
from monitor.phones import FIX_LIVES_S
from monitor.snapshot import Snapshot


class MissingLimits(Limits):
    after_s: float = threshold(
        10.0, "Missing phone position is reported after", unit="s", low=2.0, high=300.0, step=1.0
    )


def find(snapshot: Snapshot, limits: MissingLimits, was_active: bool) -> Finding:
    view, now_s = snapshot.phone, snapshot.now_s
    if not view.is_there(now_s):
        return _none("No phone is sharing its position", was_active)
    if snapshot.get("position") is None and not snapshot.link.offers("position"):
        return _none("The car publishes no position to compare with", was_active)
    why = view.why_not(now_s)
    if why is None:
        radius_m = view.fix.accuracy_m if view.fix is not None else 0.0
        return ok(f"Position of the phone known to {radius_m:.0f} m")
    if not view.is_handheld and not view.is_chosen and why != "denied":
        return _none("This is not a phone: no position is expected", was_active)
    if why == "silent" and not view.was_usable and not view.is_chosen:
        return _none("No phone is sharing its position", was_active)  # nothing was lost with it
    reason_text, missing_s = why_text(why, view, now_s, name_of(view)), view.missing_s(now_s)
    if missing_s < limits.after_s and not was_active:
        return unknown(reason_text.sentence, short=reason_text.short)
    return fault(
        reason_text.sentence,
        brief=reason_text.brief,
        measured=Quantity(label="Missing for", value=missing_s, unit="s"),
        limit=Quantity(label="Reported after", value=limits.after_s, unit="s"),
        causes=("phone",),
    )


def _none(why: str, was_active: bool) -> Finding:
    return ok(why) if was_active else absent(why, brief="no phone")  # else the alarm would stand for ever


CHECKS = (
    Check(
        id="phone_missing",
        label="Phone position",
        tile="Phone–car",
        order=53,
        checked_when="Checked once a phone shares its position or is chosen as the one in the car.",
        alarm=AlarmSpec(
            title="Phone position missing",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.LOW,
            needs_ack=False,
            off_delay_s=FIX_LIVES_S + 1.0,  # longer than one fix lives: now and then one is not a position
            repeat_after_s=3600.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="Allow location access for this page and keep it open: otherwise the car's position is not checked.",
        ),
        limits=MissingLimits,
        find=find,
    ),
)
