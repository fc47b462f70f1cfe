"""The units that a signal may be published in, and what decides which one it is: declared once.

What is beyond the bounds of a signal is another unit, or noise, and is rejected. `docs/signals.md` shows the rules.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from monitor.values import Number
from server.judge.message_fields import Rejected, finite
from server.judge.topic import FLOATS, Decode

FULLEST_PERCENT = 10_000.0  # a hundred times all there is
FASTEST_MPS = 150.0  # beyond that a wheel sensor or a unit is broken, not the car fast
FASTEST_KMH = FASTEST_MPS * 3.6
TOO_FAST = "a speed beyond the range of a car"


def one_number(*path: str, minimum: float, maximum: float) -> Decode:
    """The decoder of a signal that is one number, at a path of fields; what is outside the bounds is rejected."""
    reason = f"{'.'.join(path)} is outside {minimum:g} to {maximum:g}"

    def decode(message: Any) -> Number:
        value = finite(message, *path)
        if not minimum <= value <= maximum:
            raise Rejected(reason)
        return Number(value=value)

    return decode


def plausible_speed(value: float, most: float = FASTEST_MPS) -> float:
    """A speed [m/s] as it is; raises Rejected where no car is as fast. `most`: of another unit."""
    if abs(value) > most:
        raise Rejected(TOO_FAST)
    return value


def plausible_percent(value: float) -> float:
    """A percentage as it is; raises Rejected where it can be none."""
    if abs(value) > FULLEST_PERCENT:
        raise Rejected("a percentage beyond the range of a pedal")
    return value


@dataclass(frozen=True, slots=True, kw_only=True)
class Unit:
    """One unit of a signal's headline number as a car may publish it."""

    name: str  # in settings and commands
    label: str  # as the operator reads it
    factor: float | None  # to the unit of `monitor.signals`; None: follows from the kind of car
    most: float  # a number beyond, of either sign, is not of this unit; noise is allowed for
    above: float = 0.0  # it is not offered while no number is beyond this
    converts: bool = True  # False: nothing that is known of a car turns it into the unit of `monitor.signals`


SHARE = Unit(name="share", label="0 to 1", factor=100.0, most=1.05)
PERCENT = Unit(name="percent", label="0 to 100 %", factor=1.0, most=105.0)
NEWTON_METRES = Unit(name="nm", label="Nm", factor=None, most=100_000.0, above=1.05, converts=False)
BAR = Unit(name="bar", label="bar", factor=None, most=1_000.0, above=1.05, converts=False)
LITRES = Unit(name="litres", label="litres", factor=1.0, most=10_000.0)
MPS = Unit(name="mps", label="m/s", factor=1.0, most=FASTEST_MPS)
KMH = Unit(name="kmh", label="km/h", factor=1 / 3.6, most=FASTEST_KMH)
STEERING_PERCENT = Unit(name="percent", label="-100 to 100 %, negative left", factor=1.0, most=105.0)
TYRE_RAD = Unit(name="tyre_rad", label="tyre angle in rad, positive left", factor=None, most=1.2)
TYRE_DEG = Unit(name="tyre_deg", label="tyre angle in degrees, positive left", factor=None, most=70.0)
WHEEL_RAD = Unit(name="wheel_rad", label="steering wheel in rad", factor=None, most=25.0)
WHEEL_DEG = Unit(name="wheel_deg", label="steering wheel in degrees", factor=None, most=1400.0)
BY_RATIO = Unit(
    name="ratio", label="the unit of the setting *Tyre angle per unit of steering*", factor=None, most=10_000.0
)  # a setting

_OF_WHOLE = (SHARE, PERCENT)
_PEDAL = (SHARE, PERCENT, NEWTON_METRES, BAR)
_STEERING = (STEERING_PERCENT, TYRE_RAD, TYRE_DEG, WHEEL_RAD, WHEEL_DEG)

UNITS: Mapping[str, tuple[Unit, ...]] = {
    "speed": (MPS, KMH),
    "fuel": (SHARE, PERCENT, LITRES),
    "brake": _PEDAL,
    "accelerator": _PEDAL,
    "steering": _STEERING,
}


@dataclass(frozen=True, slots=True, kw_only=True)
class UnitRule:
    """What decides the unit of a signal that comes in messages of some types."""

    signals: tuple[str, ...]
    types: tuple[str, ...]  # ROS 1 spelling
    field: str
    units: tuple[Unit, ...]  # that it may be in
    definition: Unit | None  # by the message or by convention, unless the values contradict it; None: there is none
    by_values: tuple[Unit, ...]  # what values alone can decide: the one of these that allows all of them
    is_signed: bool = False  # a number below zero contradicts no unit
    by_way: bool = False  # the way that follows from it is compared with the way of odometry and of the receiver
    decided: str  # for readers of the table
    source: str


_VALUES = (
    "all values at most 1: not known; three above 1, or one above 2: 0 to 100 %; one above 100, or below 0: not known"
)
_PEDAL_VALUES = (
    "not known unless chosen: all values at most 1 may be of both scales, above 1 they may be 0 to 100 %, Nm or bar; "
    "in Nm or bar the pedal is not checked, because its full scale is not known"
)
_WAY = (
    "m/s; km/h where the way that follows from it is 3.6 times (±10 %) that of the odometry's pose or the receiver's "
    "positions over 20 m faster than 2 m/s; not known where these contradict each other"
)

RULES: tuple[UnitRule, ...] = (
    UnitRule(
        signals=("speed",),
        types=("geometry_msgs/Twist", "geometry_msgs/TwistStamped"),
        field="linear.x",
        units=(MPS, KMH),
        definition=MPS,
        by_values=(),
        is_signed=True,
        by_way=True,
        decided=_WAY,
        source="REP-103: SI units",
    ),
    UnitRule(
        signals=("speed",),
        types=FLOATS,
        field="data",
        units=(MPS, KMH),
        definition=MPS,
        by_values=(),
        is_signed=True,
        by_way=True,
        decided=_WAY,
        source="REP-103: SI units; the message has none",
    ),
    UnitRule(
        signals=("brake", "accelerator"),
        types=("geometry_msgs/Wrench",),
        field="force.x",
        units=_PEDAL,
        definition=None,
        by_values=(),
        decided=f"CATVehicle: 0 to 100 %; any other car: {_PEDAL_VALUES}",
        source="profile of the CATVehicle; newton by geometry_msgs/Wrench, which no pedal has",
    ),
    UnitRule(
        signals=("brake", "accelerator"),
        types=FLOATS,
        field="data",
        units=_PEDAL,
        definition=None,
        by_values=(),
        decided=_PEDAL_VALUES,
        source="the message has no unit",
    ),
    UnitRule(
        signals=("steering",),
        types=("geometry_msgs/Wrench",),
        field="torque.z",
        units=_STEERING,
        definition=None,
        by_values=(),
        is_signed=True,
        decided="CATVehicle: percent; its simulator: rad; any other car: not known unless chosen",
        source="profiles of the CATVehicle, whose message it is",
    ),
    UnitRule(
        signals=("steering",),
        types=FLOATS,
        field="data",
        units=_STEERING,
        definition=None,
        by_values=(),
        is_signed=True,
        decided="not known: rad, degrees and percent have values in common; with the setting *Tyre angle per unit of "
        "steering* the tyre angle is known all the same",
        source="the message has no unit",
    ),
    UnitRule(
        signals=("fuel",),
        types=("sensor_msgs/BatteryState",),
        field="percentage",
        units=_OF_WHOLE,
        definition=SHARE,
        by_values=_OF_WHOLE,
        decided="0 to 1; 0 to 100 % as soon as three values are above 1, or one above 2, also for values below 1; one "
        "above 100: not known",
        source="sensor_msgs/BatteryState: charge percentage on 0 to 1 range",
    ),
    UnitRule(
        signals=("fuel",),
        types=FLOATS,
        field="data",
        units=(SHARE, PERCENT, LITRES),
        definition=None,
        by_values=_OF_WHOLE,
        decided=f"{_VALUES}; litres only by choice",
        source="the message has no unit",
    ),
)


def rule_for(signal: str, plain_type: str) -> UnitRule | None:
    """The rule of a signal in messages of a type (ROS 1 spelling); None: its unit is not in doubt.

    A type without a rule has that of a plain number; a nav_msgs/Odometry has its pose in the same message.
    """
    if signal not in UNITS or plain_type == "nav_msgs/Odometry":
        return None
    rules = [rule for rule in RULES if signal in rule.signals]
    return next((rule for rule in rules if plain_type in rule.types), rules[-1])


def unit_named(signal: str, name: str | None) -> Unit | None:
    """A unit of a signal by its name; None: it has none of that name."""
    return None if name is None else next((unit for unit in UNITS.get(signal, ()) if unit.name == name), None)


def table() -> str:
    """The rules as a Markdown table."""
    head = ("| signal | type | field | unit | source |", "|---|---|---|---|---|")
    rows = [
        f"| {', '.join(rule.signals)} | {', '.join(rule.types)} | {rule.field} | {rule.decided} | {rule.source} |"
        for rule in RULES
    ]
    return "\n".join((*head, *rows)) + "\n"
