"""Are most signals slower than expected at once? Then one alarm reports the common cause."""

from __future__ import annotations

from monitor.check import (
    Action,
    AlarmSpec,
    Check,
    Finding,
    Place,
    Priority,
    Quantity,
    Sound,
    absent,
    fault,
    ok,
)
from monitor.checks.signal_slow import GROUP, SignalLimits, SlowLimits, set_hz
from monitor.signals import SIGNALS
from monitor.snapshot import Snapshot

AT_LEAST = 3  # signals: fewer are judged each by itself
SHARE, SHARE_WHILE_ACTIVE = 0.5, 0.3
DEADBAND_PERCENT = 3.0  # hysteresis for rates at the limit


def find(snapshot: Snapshot, limits: SlowLimits, was_active: bool) -> Finding:
    shares = _shares(snapshot, limits)
    percent = min(100.0, limits.slow_below_percent + (DEADBAND_PERCENT if was_active else 0.0))
    judged, slow = len(shares), sum(share < percent / 100.0 for share in shares)
    if judged < AT_LEAST:
        return absent(_too_few(judged), brief="too few")
    text = f"{slow} of {judged} signals come slower than expected"
    needed = max(AT_LEAST, (SHARE_WHILE_ACTIVE if was_active else SHARE) * judged)
    if slow < needed:
        return ok(text)
    return fault(
        f"{text}, down to {100 * min(shares):.0f} %: bridge, radio or server overloaded",
        brief=f"{slow} of {judged}",
        measured=Quantity(label="Slow", value=slow, unit=""),
        limit=Quantity(label="Of", value=judged, unit=""),
        causes=("load",),
    )


def _too_few(judged: int) -> str:
    if judged == 0:
        return "No signal has a known rate"
    return f"Only {judged} signal{'s have' if judged > 1 else ' has'} a known rate, {AT_LEAST} are compared"


def _shares(snapshot: Snapshot, limits: SlowLimits) -> list[float]:
    """How much of its expected rate each signal keeps that has one; a silent signal has its own alarm."""
    readings = snapshot.readings
    return [
        rate.measured_hz / rate.expected_hz
        for name, rate in snapshot.rates.items()
        if rate.settled
        and rate.measured_hz
        and rate.expected_hz
        and name in readings
        and readings[name].derived_from is None
        and name not in snapshot.link.throttled
        and not ((SIGNALS[name].event_like or SIGNALS[name].by_parts) and set_hz(limits, name) == 0.0)
    ]


CHECKS = (
    Check(
        id="all_slow",
        label="All rates",
        tile="Rates",
        order=110,
        checked_when="Checked while enough signals with a known rate arrive.",
        group=GROUP,
        alarm=AlarmSpec(
            title="Most signals are slow",
            ended="Most signals were slow",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.MEDIUM,
            needs_ack=True,
            on_delay_s=5.0,  # the window of the rates, as for the single ones: a hiccup shorter than that is none
            off_delay_s=5.0,
            repeat_after_s=600.0,
            actions=(Action.ACKNOWLEDGE,),  # it explains the single rates: never hidden
            advice="Bridge, radio or server is overloaded: shown values are delayed.",
            inhibited_by=("car_silent", "no_message", "link_late", "link_late_moving"),
        ),
        limits=SignalLimits,
        find=find,
    ),
)
