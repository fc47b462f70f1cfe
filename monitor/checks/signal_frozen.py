"""Does a signal keep sending an unchanged value? One alarm per signal, from the table of signals.

Most values may stay constant: a brake at 0 %, an unused accelerator, a straight wheel, an estimator that repeats its
last object. So only values are judged that cannot stay constant while the car moves: a position, odometry, a scan with
returns; and speed, acceleration and heading, if the signal was seen to change with nearly every message. A stamp must
always advance.
"""

from __future__ import annotations

from functools import partial

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
    fits_tile,
    ok,
    unknown,
)
from monitor.checks.signal_slow import GROUP, SignalLimits, SlowLimits
from monitor.freeze_detection import Repeats
from monitor.motion import MOVES_ABOVE_MPS
from monitor.reading import Reading
from monitor.signals import SIGNALS, Signal
from monitor.snapshot import Snapshot
from monitor.values import GpsFix, LaserScan

BY_MOTION = frozenset({"position", "odometry", "scan"})
BY_NOISE = frozenset({"speed", "acceleration", "heading"})
LEAST_WAY_M = 3.0  # a position in whole metres, or of a receiver that holds it at a crawl, has changed by then
LEAST_REPEATS = 3  # drivers correct themselves by a second message with the same stamp
LIVELY = 0.8  # share of messages with a new value: 0.97 on the real car; below, a held value proves nothing
HOLDS = 0.5  # of the limits: a value that changes now and then clears only once it changes twice as often
RETURNS = 20  # a scan with fewer may see nothing but parts of the car itself


def find(signal: Signal, snapshot: Snapshot, limits: SlowLimits, was_active: bool) -> Finding:
    reading = snapshot.get(signal.name)
    if reading is None or reading.derived_from is not None:
        return absent(f"{signal.label}: no messages to compare", brief="no messages")
    snapshot.need(signal.name)  # while stale nothing comes that could be frozen
    repeats = reading.repeats
    if repeats is None:
        return absent(f"{signal.label} may stay constant, and its messages have no stamp", brief="may rest")
    share = HOLDS if was_active else 1.0
    if repeats.stamp_n >= LEAST_REPEATS and repeats.stamp_s >= share * limits.frozen_after_s:
        return _frozen(signal, "one stamp", repeats.stamp_s, limits)
    if signal.name in BY_MOTION | BY_NOISE:
        return _value(signal, reading, repeats, snapshot, limits, share)
    return ok(f"{signal.label}: its stamps advance")


def _value(
    signal: Signal, reading: Reading[object], repeats: Repeats, snapshot: Snapshot, limits: SlowLimits, share: float
) -> Finding:
    if repeats.value_n == 0:
        return ok(f"{signal.label}: its values change")
    held_s = repeats.value_s
    is_long = repeats.value_n >= LEAST_REPEATS and held_s >= share * limits.frozen_after_s
    if is_long:
        why_not = _why_not(signal, reading, repeats, share)
        return _frozen(signal, "one value", held_s, limits) if why_not is None else why_not
    if abs(snapshot.need("speed").speed_mps) > MOVES_ABOVE_MPS:
        return ok(f"{signal.label}: the same value for {held_s:.1f} s of driving")
    if reading.stamp_s is not None:
        return ok(f"{signal.label}: its stamps advance")
    return unknown(f"{signal.label}: the car stands, so a value may stay constant", short="stands")


def _why_not(signal: Signal, reading: Reading[object], repeats: Repeats, share: float) -> Finding | None:
    """Why a value that was held so long proves nothing, None where it does."""
    if signal.name in BY_NOISE:
        if repeats.liveliness is None:
            return unknown(f"{signal.label}: how often it changes is not yet known", short="waiting")
        if repeats.liveliness < LIVELY:
            return absent(f"{signal.label} often repeats a value, so a repeat proves nothing", brief="often repeats")
        return None
    if repeats.value_m < share * LEAST_WAY_M:
        return ok(f"{signal.label}: the same value for {repeats.value_m:.1f} m of driving")
    match reading.value:
        case GpsFix(status=status) if status < 0:
            return unknown("The receiver has no fix", short="no fix")
        case LaserScan() as scan if scan.usable < RETURNS:
            return unknown(f"{scan.usable} returns are too few to compare scans by", short="returns")
    return None


def _frozen(signal: Signal, what: str, held_s: float, limits: SlowLimits) -> Finding:
    brief = f"{signal.label} {held_s:.0f} s"
    return fault(
        f"{signal.label}: messages arrive, but with {what} for {held_s:.1f} s"
        + (" of driving" if what == "one value" else ""),
        brief=brief if fits_tile(brief) else signal.label,
        measured=Quantity(label="Unchanged for", value=held_s, unit="s"),
        limit=Quantity(label="Allowed", value=limits.frozen_after_s, unit="s"),
        causes=(signal.name,),
    )


def check(signal: Signal) -> Check[Limits]:
    # A frozen speed does not give the driven distance, by which the others are judged.
    explains = signal.name == "speed"
    return Check(
        id=f"signal_frozen.{signal.name}",
        label=f"{signal.label} changes",
        tile="Frozen",
        order=105,
        checked_when="Checked while the signal arrives and the car moves.",
        group=GROUP,
        alarm=AlarmSpec(
            title=f"{signal.label} frozen",
            ended=f"{signal.label} was frozen",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,
            off_delay_s=2.0,
            actions=(Action.ACKNOWLEDGE,) if explains else (Action.SHELVE, Action.ACKNOWLEDGE),
            advice="Messages arrive, but their content is old: do not trust the value.",
            inhibited_by=(
                f"signal_stale.{signal.name}",
                *(("signal_frozen.speed",) if signal.name in BY_MOTION else ()),
            ),
        ),
        limits=SignalLimits,
        find=partial(find, signal),
    )


CHECKS = tuple(check(signal) for signal in SIGNALS.values())
