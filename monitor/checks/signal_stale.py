"""Has a signal of the car stopped coming? One alarm for each signal, made from the table of signals."""

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
from monitor.checks.car_silent import FALTERS_AT, is_heard, silence
from monitor.checks.signal_slow import GROUP, SignalLimits, SlowLimits, set_hz
from monitor.components import SELDOM_S
from monitor.inhibition import GRACE_S
from monitor.reading import Unusable
from monitor.signals import SIGNALS, Signal
from monitor.snapshot import Snapshot

NEVER_AFTER_S = 5.0  # as long as the whole car is given for its first message


def find(signal: Signal, snapshot: Snapshot, limits: SlowLimits, was_active: bool) -> Finding:
    if signal.name in snapshot.link.undecided:
        return unknown(f"{signal.label}: {snapshot.link.undecided[signal.name]}", short="not set")
    unusable = snapshot.unusable.get(signal.name)
    if unusable is not None and unusable.is_coming(snapshot.now_s):
        return ok(f"{signal.label}: messages arrive, {unusable.text}")
    reading = snapshot.get(signal.name)
    if reading is None or reading.derived_from is not None:
        return _never_came(signal, snapshot, limits) if unusable is None else _ended(signal, unusable, snapshot, limits)
    age_s = reading.silent_s(snapshot.now_s)
    if unusable is not None:
        age_s = min(age_s, snapshot.now_s - unusable.at_s)
    text = f"{signal.label}: newest message {age_s:.1f} s old"
    if _is_event_like(signal, limits):
        return ok(text)
    if reading.is_coming(snapshot.now_s) and not (was_active and age_s > FALTERS_AT * reading.horizon_s):
        return ok(text)
    if reading.received_s > snapshot.now_s:
        return unknown(f"{signal.label}: the clock went back", short="waiting")
    opened_s = snapshot.link.opened_s
    if opened_s is not None and reading.received_s < opened_s:
        # Nothing since the link returned: its time starts again.
        age_s = snapshot.now_s - opened_s
        if age_s <= max(reading.horizon_s, GRACE_S):
            return unknown(f"{signal.label}: waiting for its first message", short="waiting")
    if _car_is_quiet(snapshot):
        return unknown(f"{signal.label}: the whole car is silent", short="silent")
    return fault(
        f"{signal.label}: no message for {age_s:.1f} s",
        brief=_brief(signal, age_s),
        measured=Quantity(label="Silent for", value=age_s, unit="s"),
        limit=Quantity(label="Allowed", value=reading.horizon_s, unit="s"),
        causes=(signal.name,),
    )


def _never_came(signal: Signal, snapshot: Snapshot, limits: SlowLimits) -> Finding:
    is_wanted = _is_wanted(signal, limits)
    if signal.name not in snapshot.link.published:
        if is_wanted:
            return unknown(f"{signal.label} is not published", short="no data")
        return absent(f"{signal.label} is not published")
    if not is_wanted:
        return absent(f"{signal.label}: nothing received yet", brief="nothing received")
    opened_s = snapshot.link.opened_s
    if opened_s is None or snapshot.now_s - opened_s < NEVER_AFTER_S:
        return unknown(f"{signal.label}: waiting for its first message", short="waiting")
    if _car_is_quiet(snapshot):
        return unknown(f"{signal.label}: the whole car is silent", short="silent")
    waited_s = snapshot.now_s - opened_s
    text = f"{signal.label}: nothing received in {waited_s:.0f} s since connecting"
    if signal.by_parts and set_hz(limits, signal.name) == 0.0 and waited_s < SELDOM_S:
        return unknown(f"{text}; its interval is not known", short="no data")
    return fault(
        text,
        brief=signal.label,
        causes=(signal.name,),
    )


def _ended(signal: Signal, unusable: Unusable, snapshot: Snapshot, limits: SlowLimits) -> Finding:
    """Messages came, all of them without a value, and come no more."""
    age_s = snapshot.now_s - unusable.at_s
    text = f"{signal.label}: {unusable.text}, then no message for {age_s:.0f} s"
    if not _is_wanted(signal, limits):
        return absent(text, brief="silent")
    if _car_is_quiet(snapshot):
        return unknown(f"{signal.label}: the whole car is silent", short="silent")
    return fault(
        text,
        brief=_brief(signal, age_s),
        measured=Quantity(label="Silent for", value=age_s, unit="s"),
        limit=Quantity(label="Allowed", value=unusable.horizon_s, unit="s"),
        causes=(signal.name,),
    )


def _is_wanted(signal: Signal, limits: SlowLimits) -> bool:
    return not signal.optional or set_hz(limits, signal.name) > 0.0


def _car_is_quiet(snapshot: Snapshot) -> bool:
    found = silence(snapshot)
    return not is_heard(snapshot) if found is None else found.is_quiet


def _is_event_like(signal: Signal, limits: SlowLimits) -> bool:
    return signal.event_like and set_hz(limits, signal.name) == 0.0


def _brief(signal: Signal, age_s: float) -> str:
    long = f"{signal.label} {age_s:.0f} s"
    return long if fits_tile(long) else signal.label


def check(signal: Signal) -> Check[Limits]:
    return Check(
        id=f"signal_stale.{signal.name}",
        label=f"{signal.label} received",
        tile="Signals",
        order=100,
        checked_when="Checked once the signal has come.",
        group=GROUP,
        alarm=AlarmSpec(
            title=f"{signal.label} silent",
            ended=f"{signal.label} was silent",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,
            off_delay_s=2.0,
            actions=(Action.ACKNOWLEDGE,),  # not to be shelved: it is why other checks do not judge
            advice="What depends on it is not checked.",
            inhibited_by=("car_silent", "no_message", "link_late", "link_late_moving"),
            grace_s=GRACE_S,
        ),
        limits=SignalLimits,
        find=partial(find, signal),
    )


CHECKS = tuple(check(signal) for signal in SIGNALS.values())
