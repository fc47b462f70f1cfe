"""Every signal of a vehicle, declared once: what it is called, its unit and how often it is expected."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True, slots=True, kw_only=True)
class Charted:
    """The one number of a value that is more than one."""

    field: str
    label: str
    unit: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Signal:
    """One thing known of the vehicle."""

    name: str
    label: str  # as the operator reads it, sentence case
    unit: str  # of the headline; "" where it has none
    expected_hz: (
        float | None
    )  # a default: the rate of the CATVehicle. A car's own steady rate takes its place; None: learned
    headline: str | None  # the field (or property) with the headline number of the value
    optional: bool  # not published is normal and not reported
    about: str  # a sentence for readers of its exported table
    trend: bool = False  # the last minute of its headline number is kept, for Home
    event_like: bool = False  # is published on events only: silence is no fault unless the operator sets a rate
    by_parts: bool = False  # several publishers, each with its own interval: no rate of all together is expected
    chart: Charted | None = None  # what is drawn over the drive where it is not the headline
    limit: str | None = None  # the threshold that is drawn beside it


def _declare(*signals: Signal) -> dict[str, Signal]:
    return {signal.name: signal for signal in signals}


# Required is what the customer's report lists and shows; the rest is shown where a car has it.
SIGNALS: dict[str, Signal] = _declare(
    Signal(
        name="speed",
        label="Speed",
        unit="m/s",
        expected_hz=20.0,
        headline="speed_mps",
        optional=False,
        about="Speed of the car, forward positive.",
        trend=True,
        limit="speed_limit.max_mps",
    ),
    Signal(
        name="acceleration",
        label="Acceleration",
        unit="m/s²",
        expected_hz=None,
        headline="acceleration_mps2",
        optional=True,
        about="Longitudinal acceleration.",
        trend=True,
    ),
    Signal(
        name="brake",
        label="Brake",
        unit="%",
        expected_hz=20.0,
        headline="percent",
        optional=False,
        about="Position of the brake pedal.",
        trend=True,
    ),
    Signal(
        name="accelerator",
        label="Accelerator",
        unit="%",
        expected_hz=20.0,
        headline="percent",
        optional=False,
        about="Position of the accelerator pedal.",
        trend=True,
    ),
    Signal(
        name="steering",
        label="Steering",
        unit="%",
        expected_hz=20.0,
        headline="percent",
        optional=False,
        about="Position of the steering, negative = left.",
        trend=True,
    ),
    Signal(
        name="distance",
        label="Nearest object",
        unit="m",
        expected_hz=75.0,
        headline="distance_m",
        optional=False,
        about=("Distance to the nearest object ahead, by the car's estimator. Empty: nothing in range, or unknown."),
        trend=True,
        limit="obstacle.standoff_m",
    ),
    Signal(
        name="bearing",
        label="Bearing",
        unit="rad",
        expected_hz=75.0,
        headline="bearing_rad",
        optional=False,
        about="Bearing of the nearest object: counter-clockwise, 0 = ahead.",
    ),
    Signal(
        name="position",
        label="Position",
        unit="",
        expected_hz=10.0,
        headline=None,
        optional=False,
        about=(
            "Position on the WGS84 ellipsoid. Status -1 = no fix. Sigma is the horizontal one-sigma error where the "
            "receiver states a trustworthy one."
        ),
        chart=Charted(field="alt_m", label="Altitude", unit="m"),
    ),
    Signal(
        name="odometry",
        label="Odometry",
        unit="m/s",
        expected_hz=10.0,
        headline=None,
        optional=True,
        about="Pose in the frame named, speed in the body frame.",
        chart=Charted(field="speed_mps", label="Odometry", unit="m/s"),
    ),
    Signal(
        name="heading",
        label="Heading",
        unit="°",
        expected_hz=None,
        headline="heading_deg",
        optional=True,
        about="Compass heading, 0 = north, clockwise.",
    ),
    # 10, 30 and 75 Hz are all common, so no default can be right: learned.
    Signal(
        name="scan",
        label="Laser",
        unit="m",
        expected_hz=None,
        headline="nearest_m",
        optional=False,
        about="Laser: one row a scan, with its nearest usable return. The ranges are in the MCAP and the bag.",
    ),
    Signal(
        name="diagnostics",
        label="Diagnostics",
        unit="",
        expected_hz=1.0,
        headline="worst",
        optional=False,
        by_parts=True,
        about="The car's own diagnostics, one row a component. Level 0 OK, 1 WARN, 2 ERROR, 3 STALE.",
    ),
    Signal(
        name="command",
        label="Command",
        unit="m/s",
        expected_hz=None,
        headline="speed_mps",
        optional=True,
        event_like=True,
        about="The command to the car.",
    ),
    Signal(
        name="fuel",
        label="Fuel",
        unit="",
        expected_hz=None,
        headline=None,
        optional=True,
        event_like=True,
        about="Remaining fuel or charge.",
        chart=Charted(field="value", label="Fuel", unit=""),
    ),
    Signal(
        name="mode",
        label="Driving mode",
        unit="",
        expected_hz=None,
        headline=None,
        optional=True,
        event_like=True,
        about="Who drives, as the car reports it: autonomous, manual or unknown.",
    ),
)

# The field of each signal's value that is drawn over the drive.
CHARTED: dict[str, str] = {
    name: field
    for name, signal in SIGNALS.items()
    if (field := signal.chart.field if signal.chart is not None else signal.headline) is not None
}
