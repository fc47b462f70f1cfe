"""Does a signal come slower than it should? One alarm for each signal, made from the table of signals."""

from __future__ import annotations

from functools import partial
from typing import Any

from pydantic import create_model

from monitor.check import (
    EXPERT,
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
    threshold,
    unknown,
)
from monitor.signals import SIGNALS, Signal
from monitor.snapshot import Snapshot

GROUP = "signals"
LEARN = 0.0


class SlowLimits(Limits):
    """What all signals share."""

    slow_below_percent: float = threshold(
        90.0,
        "Signal slow below",
        unit="%",
        low=10.0,
        high=100.0,
        step=1.0,
        help="Of the expected rate.",
        heading=EXPERT,
    )
    frozen_after_s: float = threshold(
        2.0,
        "Signal frozen after",
        unit="s",
        low=1.0,
        high=60.0,
        step=0.5,
        help="For messages that repeat one value while the car moves, or repeat one stamp.",
        heading=EXPERT,
    )


_rates: dict[str, Any] = {
    f"{signal.name}_hz": (
        float,
        threshold(
            LEARN,
            f"{signal.label}: expected rate",
            unit="Hz",
            low=0.0,
            high=1000.0,
            step=0.5,
            help="0: learn the car's own steady rate.",
            heading=EXPERT,
        ),
    )
    for signal in SIGNALS.values()
}

# One more field for each signal, so that a new row of SIGNALS brings its own.
SignalLimits = create_model("SignalLimits", __base__=SlowLimits, **_rates)


def set_hz(limits: SlowLimits, signal: str) -> float:
    """The rate the operator has set [Hz], 0 where it is to be learned."""
    return float(getattr(limits, f"{signal}_hz", LEARN))


def expected_rates(limits: Limits) -> dict[str, float]:
    """The rates the operator has set [Hz], out of all the limits, for `State.expect`."""
    signals = getattr(limits, GROUP, None)
    return {} if signals is None else {name: set_hz(signals, name) for name in SIGNALS if set_hz(signals, name) > 0.0}


DEADBAND_PERCENT = 3.0  # hysteresis for a rate at the limit


def find(signal: Signal, snapshot: Snapshot, limits: SlowLimits, was_active: bool) -> Finding:
    reading = snapshot.get(signal.name)
    if reading is None or reading.derived_from is not None:
        return absent(f"{signal.label}: no rate to measure")  # a signal never received has its own alarm
    if signal.event_like and set_hz(limits, signal.name) == 0.0:
        return absent(f"{signal.label} is published on events only", brief="no fixed rate")
    if signal.by_parts and set_hz(limits, signal.name) == 0.0:
        return absent(f"{signal.label}: each of its components has its own interval", brief="no fixed rate")
    if signal.name in snapshot.link.throttled:
        return absent(f"{signal.label}: throttled because the link is slow", brief="throttled")
    snapshot.need(signal.name)  # a stale signal has no rate
    rate = snapshot.rates.get(signal.name)
    if rate is None or rate.expected_hz is None or not rate.settled:
        if rate is not None and not rate.learning:
            return absent(f"{signal.label} has no steady rate", brief="no fixed rate")
        return unknown(f"{signal.label}: measuring its rate", short="waiting")
    if rate.measured_hz is None:
        return unknown(f"{signal.label}: measuring its rate", short="waiting")
    percent = min(100.0, limits.slow_below_percent + (DEADBAND_PERCENT if was_active else 0.0))
    text = f"{signal.label}: {rate.measured_hz:.1f} Hz, expected {rate.expected_hz:.1f} Hz"
    measured = Quantity(label="Rate", value=rate.measured_hz, unit="Hz")
    limit = Quantity(label="Expected", value=rate.expected_hz, unit="Hz")
    if rate.measured_hz >= rate.expected_hz * percent / 100.0:
        return ok(text, measured=measured, limit=limit)
    return fault(
        text,
        brief=_brief(signal, rate.measured_hz),
        measured=measured,
        limit=limit,
        causes=(signal.name,),
    )


def _brief(signal: Signal, hz: float) -> str:
    long = f"{signal.label} {hz:.0f} Hz"
    return long if fits_tile(long) else signal.label


def check(signal: Signal) -> Check[Limits]:
    return Check(
        id=f"signal_slow.{signal.name}",
        label=f"{signal.label} rate",
        tile="Rates",
        order=110,
        checked_when="Checked while the signal arrives and its rate is known.",
        group=GROUP,
        alarm=AlarmSpec(
            title=f"{signal.label} slower than expected",
            ended=f"{signal.label} was slower than expected",
            priority=Priority.WARNING,
            place=Place.SNACKBAR,
            sound=Sound.LOW,
            needs_ack=True,
            # As long as the window of the rate: no gap shorter than "silent" can hold it below the limit so long.
            on_delay_s=5.0,
            off_delay_s=2.0,
            repeat_after_s=600.0,
            actions=(Action.SHELVE, Action.ACKNOWLEDGE),
            advice="The car or the radio is busy; dependent values are delayed.",
            inhibited_by=(f"signal_stale.{signal.name}", "all_slow", "link_late", "link_late_moving"),
        ),
        limits=SignalLimits,
        find=partial(find, signal),
    )


CHECKS = tuple(check(signal) for signal in SIGNALS.values())
