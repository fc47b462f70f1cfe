"""Do the positions of the operator's phone and of the car agree, and do both move together?

The gate tests whether the errors of both receivers explain the distance at the phone's time (chi-square, 99.9 %,
`agreement.gate_m`). The tracks of the last minute are correlated, both axes pooled (`agreement.correlate`); the result
is unknown if the car hardly moved.
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
    beside,
    fault,
    ok,
    threshold,
    unknown,
)
from monitor.checks.phone_missing import name_of, why_text
from monitor.motion import MOVES_ABOVE_MPS
from monitor.phones import FIX_LIVES_S
from monitor.snapshot import Snapshot

FAULTS = 3  # of the newest five comparisons
DEADBAND = 0.8  # it clears when they are nearer by a fifth
PAIRS = 20
SPAN_S = 30.0
SPREAD_SIGMAS = 3.0  # of the phone: a car that moved less has no track to compare


class AgreementLimits(Limits):
    least_m: float = threshold(
        10.0,
        "Phone and car: distance apart",
        unit="m",
        low=2.0,
        high=1000.0,
        step=1.0,
        help="And at least the combined error of both receivers: 9, 14, 25, 50 m for phones that state 3, 5, 10, "
        "20 m beside a good receiver in the car.",
    )
    least_correlation: float = threshold(
        0.7,
        "Correlation of the tracks",
        unit="r",
        low=0.0,
        high=0.95,
        step=0.05,
        help="A healthy pair that moves enough has more than 0.8.",
    )


def _why_not(snapshot: Snapshot, was_active: bool) -> Finding | None:
    """Why the phone cannot be compared with the car, None where it can."""
    if snapshot.get("position") is None and not snapshot.link.offers("position"):
        return absent("Position is not published")
    view, now_s = snapshot.phone, snapshot.now_s
    if not view.is_there(now_s):
        why = "No phone is sharing its position"
        return ok(why) if was_active else absent(why, brief="no phone")  # else the alarm would stand for ever
    if snapshot.need("position").status < 0:
        return unknown("The car's receiver has no fix", short="no fix")
    reason = view.why_not(now_s)
    if reason is not None:
        reason_text = why_text(reason, view, now_s, name_of(view))
        return unknown(reason_text.sentence, short=reason_text.short)
    return None


def agree(snapshot: Snapshot, limits: AgreementLimits, was_active: bool) -> Finding:
    why_not = _why_not(snapshot, was_active)
    if why_not is not None:
        return why_not
    view = snapshot.phone
    comparisons = view.comparisons
    if len(comparisons) < FAULTS:
        return unknown("Comparing phone and car", short="waiting")
    age_s = snapshot.now_s - comparisons[-1].at_s
    if age_s > FIX_LIVES_S:
        return unknown(f"Phone and car were last compared {age_s:.0f} s ago", short="stale")
    share = DEADBAND if was_active else 1.0
    apart = [one for one in comparisons if one.distance_m > share * max(one.gate_m, limits.least_m)]
    is_fault = len(apart) >= FAULTS
    newest = apart[-1] if is_fault else comparisons[-1]
    allowed_m = max(newest.gate_m, limits.least_m)
    text = (
        f"{name_of(view).replace('the', 'The', 1)} is {beside(newest.distance_m, allowed_m, 0)} m from the car; "
        f"up to {allowed_m:.0f} m is normal"
    )
    measured = Quantity(label="Distance apart", value=newest.distance_m, unit="m")
    limit = Quantity(label="Normal up to", value=allowed_m, unit="m")
    if is_fault:
        return fault(
            text, brief=f"{newest.distance_m:.0f} m", measured=measured, limit=limit, causes=("phone", "position")
        )
    return ok(text, measured=measured, limit=limit)


def move_as_one(snapshot: Snapshot, limits: AgreementLimits, was_active: bool) -> Finding:
    why_not = _why_not(snapshot, was_active)
    if why_not is not None:
        return why_not
    tracks = snapshot.phone.tracks
    if tracks is None or tracks.pairs < PAIRS or tracks.span_s < SPAN_S:
        pairs = 0 if tracks is None else tracks.pairs
        return unknown(
            f"Collecting both tracks: {pairs} positions of the last minute agree, {PAIRS} over {SPAN_S:.0f} s needed",
            short="waiting",
        )
    needed_m = SPREAD_SIGMAS * tracks.phone_sigma_m
    if tracks.car_spread_m <= needed_m:
        text = f"the car's track spreads {tracks.car_spread_m:.1f} m, with this phone {needed_m:.1f} m is needed"
        if _drives(snapshot):
            return unknown(f"{text[0].upper()}{text[1:]}", short="near")
        return unknown(f"Standing: {text}", short="standing")
    r = 0.0 if tracks.correlation is None else tracks.correlation  # a phone that never moved has no correlation
    least = limits.least_correlation
    text = f"The tracks correlate with {beside(r, least, 2)}; {least:.2f} is the least"
    measured = Quantity(label="Correlation", value=r, unit="r")
    limit = Quantity(label="At least", value=limits.least_correlation, unit="r")
    if r < limits.least_correlation + (0.05 if was_active else 0.0):
        return fault(text, brief=f"r {r:.2f}", measured=measured, limit=limit, causes=("phone", "position"))
    return ok(text, measured=measured, limit=limit)


def _drives(snapshot: Snapshot) -> bool:
    """Whether the car moves now, by the wheel speed."""
    speed = snapshot.get("speed")
    return (
        speed is not None
        and speed.is_fresh(snapshot.now_s)
        and snapshot.standing_since_s is None
        and abs(speed.value.speed_mps) > MOVES_ABOVE_MPS
    )


CHECKS = (
    Check(
        id="phone_car",
        label="Phone–car",
        order=52,
        checked_when="Checked while the car has a fix and a phone in it shares its position.",
        alarm=AlarmSpec(
            title="Phone and car disagree",
            ended="Phone and car disagreed",
            priority=Priority.WARNING,
            place=Place.DIALOG,
            sound=Sound.MEDIUM,
            needs_ack=True,
            on_delay_s=3.0,
            off_delay_s=5.0,
            actions=(Action.ACKNOWLEDGE,),
            advice="If the phone is in the car, do not trust the car's position.",
            inhibited_by=("gps_jump", "gps_drift"),
            place_after=Place.LIST,
        ),
        limits=AgreementLimits,
        find=agree,
    ),
    Check(
        id="phone_tracks",
        label="Tracks",
        order=54,
        checked_when="Checked while car and phone move, once the tracks of a minute are collected.",
        group="phone_car",
        alarm=AlarmSpec(
            title="Tracks do not correlate",
            priority=Priority.ADVISORY,
            place=Place.SNACKBAR,
            sound=Sound.LOW,
            needs_ack=False,
            on_delay_s=3.0,
            off_delay_s=5.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="The phone does not move with the car: check whether it is in the car.",
            inhibited_by=("phone_car",),
        ),
        limits=AgreementLimits,
        find=move_as_one,
    ),
)
