"""A planned stop: the car stands on purpose, in a workshop for example. Its alarms are judged, shown and recorded, and
bear a mark; those that are not critical make no sound. Pure."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from typing import Literal

from monitor.alarm_spec import Priority
from monitor.catalog import AnyCheck
from monitor.check import Scope
from monitor.motion import MOVES_ABOVE_MPS

StopReason = Literal["parked", "workshop", "charging", "set_up"]
REASONS: Mapping[StopReason, str] = {
    "parked": "parked",
    "workshop": "in the workshop",
    "charging": "charging or refuelling",
    "set_up": "being set up",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class PlannedStop:
    """`since_s` is on the clock of its owner."""

    reason: StopReason
    since_s: float
    by: str | None = None


def reason_of(found: object) -> StopReason:
    """Return the reason that a log names; "parked" where another version of catgraph wrote another one."""
    return next((reason for reason in REASONS if reason == found), "parked")


def is_moving(speed_mps: float | None) -> bool:
    """Whether the measured speed ends a planned stop; one that is not known does not."""
    return speed_mps is not None and abs(speed_mps) > MOVES_ABOVE_MPS


def silent_checks(checks: Iterable[AnyCheck]) -> frozenset[str]:
    """Ids of the checks whose alarms make no sound in a planned stop: of the car and its link, and not critical. Alarms
    about catgraph itself sound, because the stop of a car does not explain them."""
    return frozenset(
        check.id
        for check in checks
        if check.scope is not Scope.SERVER and check.alarm.priority is not Priority.CRITICAL
    )
