"""Remaining fuel or charge."""

from __future__ import annotations

from typing import Any

from monitor.values import Level
from server.judge.message_fields import Rejected, finite
from server.judge.not_measured import NO_BATTERY, NO_PERCENTAGE
from server.judge.topic import Topic, floats
from server.judge.units import plausible_percent


def level(message: Any) -> Level:
    """A number in the unit of the topic, which `server.judge.units` decides."""
    return Level(value=_not_below_zero(finite(message, "data")), unit="")


def battery(message: Any) -> Level:
    """As `level`, by `percentage`. Raises NotMeasured where it is not known."""
    NO_BATTERY.demand(message)
    NO_PERCENTAGE.demand(message)
    return Level(value=_not_below_zero(finite(message, "percentage")), unit="")


def _not_below_zero(value: float) -> float:
    if value < 0:
        raise Rejected("a level below zero")
    return plausible_percent(value)


TOPICS = (
    Topic(
        signal="fuel",
        names=("/catvehicle/fuel", "/fuel", "/fuel_level", "/battery_state"),
        types={**floats(level), "sensor_msgs/BatteryState": battery},
    ),
)
