"""Settings that the page draws by: the ends of the gauges, and of the obstacle checks the stopping distance."""

from __future__ import annotations

from monitor.check import EXPERT, Limits, threshold

GAUGE, VEHICLE = "Gauge", "Vehicle"  # headings of Settings


class GaugeLimits(Limits):
    speed_max_mps: float = threshold(15.0, "Speed at 180°", unit="m/s", low=1.0, high=60.0, step=1.0, heading=GAUGE)
    acceleration_max_mps2: float = threshold(
        3.0, "Acceleration at 180°", unit="m/s²", low=0.5, high=15.0, step=0.5, heading=GAUGE
    )


class SteeringLimits(Limits):
    tyre_rad_per_unit: float = threshold(
        0.0,
        "Tyre angle per unit of steering",
        unit="rad",
        low=-2.0,
        high=2.0,
        step=0.00001,
        help="Angle of the front tyres, positive to the left, for one unit of the steering signal: percent, or radians "
        "of the tyre or of the steering wheel. 0: not known; then no slow-down, and a straight corridor.",
        heading=VEHICLE,
    )


class ObstacleLimits(Limits):
    """Shared by the two obstacle checks and by the page's bars."""

    standoff_m: float = threshold(
        5.0, "Obstacle distance", unit="m", low=0.5, high=50.0, step=0.5, help="Nearer than this is too near."
    )
    reaction_s: float = threshold(
        1.0, "Reaction time", unit="s", low=0.0, high=5.0, step=0.1, help="Until the car starts to brake."
    )
    deceleration_mps2: float = threshold(
        3.0,
        "Braking deceleration",
        unit="m/s²",
        low=0.5,
        high=9.0,
        step=0.1,
        help="Deceleration that the brakes provide.",
    )
    time_to_collision_s: float = threshold(
        2.0, "Time to collision", unit="s", low=0.5, high=10.0, step=0.1, help="Sooner than this is too soon."
    )
    deadband_m: float = threshold(
        0.5,
        "Obstacle deadband",
        unit="m",
        low=0.0,
        high=5.0,
        step=0.1,
        help="The alarm clears this much farther away.",
        heading=EXPERT,
    )
    half_width_m: float = threshold(
        1.2,
        "Corridor half-width",
        unit="m",
        low=0.5,
        high=3.0,
        step=0.1,
        help="Objects farther aside are ignored.",
        heading=VEHICLE,
    )
    wheelbase_m: float = threshold(2.62, "Wheelbase", unit="m", low=0.5, high=8.0, step=0.01, heading=VEHICLE)
    laser_ahead_m: float = threshold(
        2.5, "Laser ahead of the rear axle", unit="m", low=-2.0, high=8.0, step=0.1, heading=VEHICLE
    )


# By the name of the group; a check that judges by one of them names the same class.
GROUPS: dict[str, type[Limits]] = {"steering": SteeringLimits, "gauge": GaugeLimits, "obstacle": ObstacleLimits}


def stopping_m(speed_mps: float, limits: ObstacleLimits) -> float:
    """Distance to a stop [m]: reaction at full speed, then constant deceleration, v·t + v²/2a."""
    speed_mps = abs(speed_mps)
    return speed_mps * limits.reaction_s + speed_mps**2 / (2 * limits.deceleration_mps2)


def time_gap_s(distance_m: float, speed_mps: float) -> float | None:
    """Seconds until the car is where the object is now; None while standing, below 0.1 m/s: wheel speed is noisy."""
    return distance_m / speed_mps if speed_mps > 0.1 else None
