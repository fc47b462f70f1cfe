"""Every signal of a vehicle, declared once: what it is called, its unit and how often it is expected."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """One thing known of the vehicle."""

    name: str
    label: str  # as the operator reads it, sentence case
    unit: str  # of the headline; "" where it has none
    expected_hz: (
        float | None
    )  # a default: the rate of the CATVehicle. A car's own steady rate takes its place; None: learned
    headline: str | None  # the field (or property) of the value that stands for it in one number
    optional: bool  # not published is ordinary and not worth a word
    event_like: bool = False  # speaks when it has something to say: silence is no fault unless the operator sets a rate


def _declare(*signals: Signal) -> dict[str, Signal]:
    return {signal.name: signal for signal in signals}


# Required is what the customer's report lists and shows; the rest is shown where a car has it.
SIGNALS: dict[str, Signal] = _declare(
    Signal(name="speed", label="Speed", unit="m/s", expected_hz=20.0, headline="speed_mps", optional=False),
    Signal(
        name="acceleration",
        label="Acceleration",
        unit="m/s²",
        expected_hz=None,
        headline="acceleration_mps2",
        optional=True,
    ),
    Signal(name="brake", label="Brake", unit="%", expected_hz=20.0, headline="percent", optional=False),
    Signal(name="accelerator", label="Accelerator", unit="%", expected_hz=20.0, headline="percent", optional=False),
    Signal(name="steering", label="Steering", unit="%", expected_hz=20.0, headline="percent", optional=False),
    Signal(name="distance", label="Nearest object", unit="m", expected_hz=75.0, headline="distance_m", optional=False),
    Signal(name="bearing", label="Bearing", unit="rad", expected_hz=75.0, headline="bearing_rad", optional=False),
    Signal(name="position", label="Position", unit="", expected_hz=10.0, headline=None, optional=False),
    Signal(name="odometry", label="Odometry", unit="m/s", expected_hz=10.0, headline=None, optional=True),
    Signal(name="heading", label="Heading", unit="°", expected_hz=None, headline="heading_deg", optional=True),
    # 10, 30 and 75 Hz are all common, so no default can be right: learned.
    Signal(name="scan", label="Laser", unit="m", expected_hz=None, headline="nearest_m", optional=False),
    Signal(name="diagnostics", label="Diagnostics", unit="", expected_hz=1.0, headline="worst", optional=False),
    Signal(
        name="command",
        label="Command",
        unit="m/s",
        expected_hz=None,
        headline="speed_mps",
        optional=True,
        event_like=True,
    ),
    Signal(name="fuel", label="Fuel", unit="", expected_hz=None, headline=None, optional=True, event_like=True),
)
