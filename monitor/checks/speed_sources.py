"""Do two sources of the speed agree: the displayed one, the way of the position, other odometries?

Each source gives its mean over the last 3 s. How far apart they may be grows with the error that a receiver states,
and with the change of the speed, because one source may be later than another. A position that drifts at standstill is
the matter of `gps_drift`, one that leaps of `gps_jump`. What comes on the topic of the speed is no second source, but
for the poses of an odometry; nor is a speed that was never anything but 0, or a pose that never moved: its driver may
not fill it.
"""

from __future__ import annotations

from functools import lru_cache

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
from monitor.pace import WINDOW_S, Pace
from monitor.snapshot import Snapshot
from monitor.speeds import DRIFT_MPS, HALF, Shown, allowed_mps, others, own

NAMED = 3  # of those that disagree


class SourcesLimits(Limits):
    apart_mps: float = threshold(
        1.5,
        "Speeds apart",
        unit="m/s",
        low=0.5,
        high=DRIFT_MPS,
        step=0.5,
        help="Two sources of the speed may differ by this, or by the share below; more where a receiver states an "
        "error, or the speed changes.",
    )
    apart_percent: float = threshold(
        25.0, "Speeds apart, share", unit="%", low=10.0, high=100.0 * HALF, step=5.0, help="Of the higher speed."
    )


def agree(snapshot: Snapshot, limits: SourcesLimits, was_active: bool) -> Finding:
    if snapshot.get("speed") is None and "speed" not in snapshot.link.published:
        return absent("Speed is not published")
    found = others(snapshot)
    if not found:
        why = "Only one source shows the speed, so there is nothing to compare it with"
        return ok(why) if was_active else absent(why, brief="one source")
    snapshot.need("speed")
    shown = own(snapshot)
    speed = shown.pace
    if speed is None:
        return unknown(f"Waiting for {WINDOW_S:.0f} s of speeds", short="waiting")
    is_standing = snapshot.standing_since_s is not None
    return _compared(shown, speed, tuple(found), limits.apart_mps, limits.apart_percent, is_standing, was_active)


@lru_cache(maxsize=256)  # paces are renewed twice a second, and the check is made twenty times
def _compared(
    shown: Shown,
    speed: Pace,
    found: tuple[Shown, ...],
    apart_mps: float,
    apart_percent: float,
    is_standing: bool,
    was_active: bool,
) -> Finding:
    compared = [(one, one.pace) for one in found if one.pace is not None]
    why_not = [one for one in found if one.pace is None]
    if not compared:
        return unknown("; ".join(one.why_not for one in why_not), short=why_not[0].short)
    rows = [(one, pace, _allowed_mps(speed, pace, apart_mps, apart_percent, is_standing)) for one, pace in compared]
    share = 0.8 if was_active else 1.0
    apart = [row for row in rows if abs(row[1].mps - speed.mps) > share * row[2]]
    text = f"Speed {speed.mps:.1f} m/s{shown.by}, "
    if not apart:
        return ok(text + _listed([row[:2] for row in rows]) + "".join(f"; {one.why_not}" for one in why_not))
    apart.sort(key=lambda row: abs(row[1].mps - speed.mps) - row[2], reverse=True)
    worst = apart[0]
    return fault(
        f"{text}but {_listed([row[:2] for row in apart[:NAMED]])}",
        brief=f"{speed.mps:.0f} or {worst[1].mps:.0f} m/s",
        measured=Quantity(label="Difference", value=abs(worst[1].mps - speed.mps), unit="m/s"),
        limit=Quantity(label="Allowed", value=worst[2], unit="m/s"),
        causes=("speed",),
    )


def _allowed_mps(speed: Pace, other: Pace, apart_mps: float, apart_percent: float, is_standing: bool) -> float:
    """At standstill a place that moves slowly drifts, which is checked elsewhere."""
    drifts = is_standing and other.error_mps > 0.0
    least_mps = max(DRIFT_MPS, apart_mps) if drifts else apart_mps
    return allowed_mps(speed, other, least_mps=least_mps, share=apart_percent / 100.0)


def _listed(rows: list[tuple[Shown, Pace]]) -> str:
    return " and ".join(f"{pace.mps:.1f} m/s by {one.by}" for one, pace in rows)


CHECKS = (
    Check(
        id="speed_sources",
        label="Speeds agree",
        order=55,
        checked_when="Checked while Speed is fresh and a second source shows a speed: the position, or an odometry.",
        alarm=AlarmSpec(
            title="Sources of the speed disagree",
            ended="Sources of the speed disagreed",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,
            on_delay_s=3.0,
            off_delay_s=5.0,
            actions=(Action.ACKNOWLEDGE,),
            advice="Trust no check that goes by the speed until it is known which source is wrong.",
            inhibited_by=("gps_jump", "signal_frozen.speed"),
        ),
        limits=SourcesLimits,
        find=agree,
        needs=frozenset({"speed"}),
    ),
)
