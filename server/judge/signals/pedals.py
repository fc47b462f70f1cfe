"""Brake and accelerator."""

from __future__ import annotations

from typing import Any

from monitor.values import Effort
from server.judge.message_fields import finite
from server.judge.topic import Topic, floats
from server.judge.units import plausible_percent


def effort(message: Any) -> Effort:
    """By force.x of a Wrench, where the CATVehicle has percent; `server.judge.units` decides."""
    return Effort(percent=plausible_percent(finite(message, "force", "x")))


def effort_of_float(message: Any) -> Effort:
    """As `effort`."""
    return Effort(percent=plausible_percent(finite(message, "data")))


TOPICS = (
    Topic(
        signal="brake",
        names=("/catvehicle/brake", "/vehicle/brake", "/brake"),
        types={"geometry_msgs/Wrench": effort, **floats(effort_of_float)},
    ),
    Topic(
        signal="accelerator",
        names=("/catvehicle/accelerator", "/vehicle/accelerator", "/accelerator", "/throttle"),
        types={"geometry_msgs/Wrench": effort, **floats(effort_of_float)},
    ),
)
