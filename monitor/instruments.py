"""Settings beside those of single checks: gauges, stopping distance, attention queue, uploads into the store."""

from __future__ import annotations

from monitor.check import EXPERT, Limits, threshold
from monitor.unseen import UnseenLimits

GAUGE, VEHICLE, FLEET, STORE, DRIVING = "Gauge", "Vehicle", "Fleet", "Store", "Driving mode"  # headings of Settings


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
        2.5,
        "Laser ahead of the rear axle",
        unit="m",
        low=-2.0,
        high=8.0,
        step=0.1,
        help="As long as it is at its default, the car's transforms count instead, where there are some.",
        heading=VEHICLE,
    )
    bumper_ahead_m: float = threshold(
        0.0,
        "Front bumper ahead of the rear axle",
        unit="m",
        low=0.0,
        high=15.0,
        step=0.05,
        help="Gaps are measured from here. 0: from the laser. With transforms, the rear axle is base_link.",
        heading=VEHICLE,
    )


class MountingLimits(Limits):
    """How the laser is mounted, beside its place ahead of the rear axle."""

    yaw_deg: float = threshold(
        0.0,
        "Laser turned to the left",
        unit="°",
        low=-180.0,
        high=180.0,
        step=0.5,
        help="Where its own zero points: 0 ahead, 90 left, 180 back. What is not at its default overrides the "
        "car's transforms.",
        heading=VEHICLE,
    )
    left_m: float = threshold(
        0.0, "Laser left of the centre line", unit="m", low=-3.0, high=3.0, step=0.05, heading=VEHICLE
    )
    upside_down: float = threshold(
        0.0,
        "Laser upside down",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="1: its angles count clockwise, seen from above.",
        heading=VEHICLE,
    )
    by_settings: float = threshold(
        0.0,
        "Laser mounted as set here",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="1: the settings count as they are, also those at their default, whatever the car's transforms say.",
        heading=VEHICLE,
    )


class AttentionLimits(Limits):
    """Of the item of a car that needs a person."""

    escalates_s: float = threshold(
        30.0,
        "Escalation of a critical alarm",
        unit="s",
        low=10.0,
        high=300.0,
        step=5.0,
        help="A car with a critical alarm that is unassigned for so long is escalated to the supervisor.",
        heading=FLEET,
    )
    unheard_s: float = threshold(
        10.0,
        "Unassigned without a page",
        unit="s",
        low=5.0,
        high=120.0,
        step=1.0,
        help="The car is unassigned again when the page of its person is silent for so long.",
        heading=FLEET,
    )


class StoreLimits(Limits):
    """What of a car's recordings is uploaded into the store, if the server has one."""

    whole_files: float = threshold(
        1.0,
        "Upload whole recordings",
        unit="of 3",
        low=0.0,
        high=3.0,
        step=1.0,
        help="0: never. 1: on request. 2: always. 3: in the depot. List, alarms and track are uploaded in any case.",
        heading=STORE,
    )
    clips: float = threshold(
        1.0,
        "Upload the minute around alarms",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="1: of critical alarms and warnings, at most 10 clips of a recording.",
        heading=STORE,
    )
    delete_stored: float = threshold(
        0.0,
        "Delete uploaded recordings on the car",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="1: a recording is deleted here, for good, once its copy was read back and is the same.",
        heading=STORE,
    )
    rate_mb_s: float = threshold(
        1.0,
        "Upload at most",
        unit="MB/s",
        low=0.05,
        high=1000.0,
        step=0.05,
        help="Also for reading back. What is live uses the same link.",
        heading=STORE,
    )
    depot_radius_m: float = threshold(
        0.0,
        "Radius of the depot",
        unit="m",
        low=0.0,
        high=5000.0,
        step=10.0,
        help="The car is in the depot when it stands within this circle. 0: no circle.",
        heading=STORE,
    )
    depot_lat_deg: float = threshold(
        0.0, "Latitude of the depot", unit="°", low=-90.0, high=90.0, step=0.0001, heading=STORE
    )
    depot_lon_deg: float = threshold(
        0.0, "Longitude of the depot", unit="°", low=-180.0, high=180.0, step=0.0001, heading=STORE
    )


class DrivingLimits(Limits):
    """Who drives, and what counts as an intervention."""

    by_rule: float = threshold(
        0.0,
        "Mode from the commands",
        unit="0/1",
        low=0.0,
        high=1.0,
        step=1.0,
        help="1: autonomous while commands come and the speed follows them. Only of a car without a mode topic.",
        heading=DRIVING,
    )
    autonomous_number: float = threshold(
        1.0,
        "Number that means autonomous",
        unit="of 255",
        low=0.0,
        high=255.0,
        step=1.0,
        help="Of a mode topic that is a plain number.",
        heading=DRIVING,
    )
    manual_number: float = threshold(
        0.0,
        "Number that means manual",
        unit="of 255",
        low=0.0,
        high=255.0,
        step=1.0,
        help="Every other number is unknown.",
        heading=DRIVING,
    )
    holds_s: float = threshold(
        0.0,
        "Mode counts for",
        unit="s",
        low=0.0,
        high=3600.0,
        step=1.0,
        help="Of a car that sends its mode only when it changes. 0: while messages come at their rate.",
        heading=DRIVING,
    )
    brake_percent: float = threshold(
        15.0,
        "Brake against the command",
        unit="%",
        low=1.0,
        high=100.0,
        step=1.0,
        help="More than this while no braking is commanded is an intervention.",
        heading=DRIVING,
    )
    steer_rad: float = threshold(
        0.15,
        "Steering against the command",
        unit="rad",
        low=0.02,
        high=1.0,
        step=0.01,
        help="Tyre angle so far from the commanded one is an intervention.",
        heading=DRIVING,
    )


# By the name of the group; a check that judges by one of them names the same class.
GROUPS: dict[str, type[Limits]] = {
    "steering": SteeringLimits,
    "attention": AttentionLimits,
    "store": StoreLimits,
    "driving": DrivingLimits,
    "unseen": UnseenLimits,
    "gauge": GaugeLimits,
    "obstacle": ObstacleLimits,
    "mounting": MountingLimits,
}


def stopping_m(speed_mps: float, limits: ObstacleLimits) -> float:
    """Distance to a stop [m]: reaction at full speed, then constant deceleration, v·t + v²/2a."""
    speed_mps = abs(speed_mps)
    return speed_mps * limits.reaction_s + speed_mps**2 / (2 * limits.deceleration_mps2)


def time_gap_s(distance_m: float, speed_mps: float) -> float | None:
    """Seconds until the car is where the object is now; None while standing, below 0.1 m/s: wheel speed is noisy."""
    return distance_m / speed_mps if speed_mps > 0.1 else None
