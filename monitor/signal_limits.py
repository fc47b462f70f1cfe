"""The thresholds of the signals: how often each is to come, and how much slower is too slow."""

from __future__ import annotations

from typing import Any

from pydantic import create_model

from monitor.check import EXPERT, Limits, threshold
from monitor.signals import SIGNALS

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
