"""Does the operator's phone have a position, and if not, why?

Only an open page is expected to have one. A computer without a receiver raises no alarm, unless its permission was
denied or it was chosen as the phone in the car. A page that was closed, or was silent for a minute, no longer counts.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import assert_never

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
from monitor.phones import FIX_LIVES_S, WORST_ACCURACY_M, PhoneView, Why
from monitor.snapshot import Snapshot


@dataclass(frozen=True, slots=True, kw_only=True)
class WhyText:
    """One reason: what is wrong (no full stop), and two short names for tiles: at most 8 and 14 letters."""

    sentence: str
    short: str
    brief: str


def name_of(view: PhoneView) -> str:
    """The phone as an alarm names it: every operator reads that, so "this phone" would be wrong."""
    return f"the phone ({view.label or 'one'}, of {view.count} phones)" if view.count > 1 else "the phone"


def why_text(why: Why, view: PhoneView, now_s: float, phone: str = "this phone") -> WhyText:
    """The reason as text. `phone` names the phone within the sentence: "this phone" beside the phone's own row."""
    match why:
        case "denied":
            return WhyText(sentence=f"Location permission denied on {phone}", short="denied", brief="permission")
        case "insecure":
            return WhyText(
                sentence=f"The page on {phone} was not opened over HTTPS, which a position needs",
                short="HTTPS",
                brief="needs HTTPS",
            )
        case "unavailable":
            return WhyText(sentence=f"No position found by {phone}", short="no fix", brief="no fix")
        case "timeout":
            return WhyText(
                sentence=f"No GPS fix on {phone} for {view.missing_s(now_s):.0f} s", short="no fix", brief="no fix"
            )
        case "hidden":
            return WhyText(
                sentence=f"No position while the page is in the background on {phone}",
                short="hidden",
                brief="background",
            )
        case "off":
            return WhyText(sentence=f"The page on {phone} was closed", short="left", brief="left")
        case "coarse":
            radius_m = view.fix.accuracy_m if view.fix is not None else 0.0
            return WhyText(
                sentence=f"Position of {phone} is accurate to {radius_m:.0f} m only; "
                f"{WORST_ACCURACY_M:.0f} m is needed",
                short="coarse",
                brief=f"±{radius_m:.0f} m",
            )
        case "old":
            return WhyText(
                sentence=f"The newest fix of {phone} is {now_s - view.measured_s:.0f} s old", short="old", brief="old"
            )
        case "late":
            return WhyText(
                sentence=f"Positions of {phone} arrive too late over the radio", short="late", brief="comes late"
            )
        case "silent":
            return WhyText(
                sentence=f"No position from {phone} for {now_s - view.received_s:.0f} s",
                short="silent",
                brief="silent",
            )
        case _:
            assert_never(why)


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
