"""A planned stop of the car; monitor/planned_stop.py has the rules."""

from __future__ import annotations

from typing import Annotated, ClassVar, Literal

from monitor.planned_stop import StopReason
from server.protocol.command_base import Needs, OfCar
from server.protocol.doc import doc


class OfPlannedStop(OfCar):
    """Of the planned stop of a car."""


class BeginPlannedStop(OfPlannedStop):
    """The car stands on purpose: its alarms are marked, and only critical ones sound. It ends by itself once the car
    moves."""

    http: ClassVar[str] = "The car stands on purpose: its alarms are marked, and only critical ones sound"
    kind: Literal["planned_stop"]
    reason: Annotated[StopReason, doc("why it stands; another one replaces it")]


class EndPlannedStop(OfPlannedStop):
    """Ends the planned stop."""

    needs: ClassVar[Needs] = "operator"  # alarms sound again by it
    http: ClassVar[str] = "End the planned stop"
    has_body: ClassVar[bool] = False
    kind: Literal["end_planned_stop"]


PlannedStopCommand = BeginPlannedStop | EndPlannedStop
