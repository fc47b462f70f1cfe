"""Do messages come that cannot be used? One alarm for each signal, and one for all of them."""

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
from monitor.checks.car_silent import CROWD, FAST_HORIZON_S
from monitor.inhibition import GRACE_S
from monitor.signals import SIGNALS, Signal
from monitor.snapshot import Snapshot

AFTER_S = 1.0  # in a row: single odd messages are counted, not alarmed
AT_LEAST = 2


def find(signal: Signal, snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
    found = snapshot.unusable.get(signal.name)
    if found is None:
        text = f"{signal.label}: received values can be used"
        return ok(text) if was_active or snapshot.get(signal.name) is not None else absent(text)
    for_s = snapshot.now_s - found.since_s
    if not found.is_coming(snapshot.now_s):
        return unknown(f"{signal.label}: no message for {snapshot.now_s - found.at_s:.1f} s", short="silent")
    if found.is_declared:
        text = f"{signal.label}: {found.text}"
        return ok(text) if was_active else absent(text, brief="not measured")
    if not was_active and (for_s < AFTER_S or found.count < AT_LEAST):
        return unknown(f"{signal.label}: {found.text}", short="unusable")
    return fault(
        f"{signal.label}: {found.text}, {found.count} messages in {for_s:.1f} s",
        brief=signal.label if fits_tile(signal.label) else "",
        measured=Quantity(label="Without a usable value for", value=for_s, unit="s"),
        causes=(signal.name,),
    )


def find_all(snapshot: Snapshot, limits: Limits, was_active: bool) -> Finding:
    now_s, opened_s = snapshot.now_s, snapshot.link.opened_s
    useless = {
        name: one
        for name, one in snapshot.unusable.items()
        if not SIGNALS[name].event_like
        and not one.is_declared
        and one.is_coming(now_s)
        and one.horizon_s <= FAST_HORIZON_S
    }
    usable = [
        name
        for name, reading in snapshot.readings.items()
        if name not in snapshot.unusable
        and reading.derived_from is None
        and reading.horizon_s <= FAST_HORIZON_S
        and not SIGNALS[name].event_like
        and reading.is_coming(now_s)
        and (opened_s is None or reading.received_s >= opened_s)
    ]
    if not useless:
        return ok("Received values can be used")
    for_s = min(now_s - one.since_s for one in useless.values())
    text = f"{len(useless)} of {len(useless) + len(usable)} fast signals have no usable value"
    if usable or len(useless) < CROWD:
        return ok(text)
    if not was_active and for_s < AFTER_S:
        return unknown(text, short="unusable")
    name, newest = max(useless.items(), key=lambda item: item[1].at_s)
    return fault(
        f"No usable value for {for_s:.1f} s, although messages arrive. {SIGNALS[name].label}: {newest.text}",
        brief="no value",
        measured=Quantity(label="Without a usable value for", value=for_s, unit="s"),
        causes=("car",),
    )


def check(signal: Signal) -> Check[Limits]:
    return Check(
        id=f"signal_unusable.{signal.name}",
        label=f"{signal.label} usable",
        tile="Signals",
        order=100,
        checked_when="Checked once messages of the signal come.",
        alarm=AlarmSpec(
            title=f"{signal.label} unusable",
            ended=f"{signal.label} was unusable",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,
            off_delay_s=2.0,
            actions=(Action.ACKNOWLEDGE,),  # not to be shelved: it is why other checks do not judge
            advice="Messages arrive, but checks of this signal cannot run: inspect its sensor or driver.",
            inhibited_by=("car_unusable",),
            grace_s=GRACE_S,
        ),
        limits=Limits,
        find=partial(find, signal),
    )


CHECKS = (
    *(check(signal) for signal in SIGNALS.values()),
    Check(
        id="car_unusable",
        label="Car's values usable",
        tile="Link",
        order=120,
        checked_when="Checked once messages of the car come.",
        alarm=AlarmSpec(
            title="No usable values",
            ended="There were no usable values",
            priority=Priority.CRITICAL,
            place=Place.DIALOG,
            sound=Sound.HIGH,
            needs_ack=True,
            off_delay_s=1.0,
            actions=(Action.ACKNOWLEDGE, Action.EXIT),
            advice="Nothing is checked, and the car may still be moving: watch the car.",
            inhibited_by=("link_lost",),
            grace_s=GRACE_S,
            place_after=Place.LIST,
        ),
        limits=Limits,
        find=find_all,
    ),
)
