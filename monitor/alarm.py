"""The life of one alarm after ISA-18.2: independent flags, a state derived from them, and pure steps between them."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass
from enum import StrEnum
from typing import Literal

from monitor.alarm_spec import AlarmSpec, Place, Sound
from monitor.check import Finding

Change = Literal["raised", "cleared", "acknowledged", "recaused", "shelved", "unshelved", "suppressed", "unsuppressed"]


class AlarmState(StrEnum):
    NORMAL = "NORMAL"
    UNACKED = "UNACKED"  # the condition stands, nobody has said that they saw it
    ACKED = "ACKED"
    RTN_UNACKED = "RTN_UNACKED"  # returned to normal, unseen
    SHELVED = "SHELVED"  # hidden by the operator for a time
    SUPPRESSED = "SUPPRESSED"  # hidden by design: another alarm explains it, or monitoring is paused
    OUT_OF_SERVICE = "OUT_OF_SERVICE"


class Refused(Exception):
    """A wish of the operator that cannot be met; `reason` is one sentence for them."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Transition:
    """One step in the life of an alarm, for the journal and the pages."""

    alarm_id: str
    occurrence: int
    change: Change
    at_s: float
    text: str  # what the check said at that moment
    by: str | None = None  # who, where a person did it
    announces: bool = False  # the operator is to be told now


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """One alarm as it stands now."""

    id: str
    spec: AlarmSpec
    occurrence: int = 0  # counts announcements; an acknowledgement names the one it saw
    condition: bool = False  # what the check last said, without delays; UNKNOWN leaves it
    active: bool = False  # the same with delays: what the operator is told
    acknowledged: bool = True
    latched: bool = False  # active only because it latches
    shelved_until_s: float | None = None
    shelved_by: str | None = None
    suppressed_by: tuple[str, ...] = ()  # alarm ids, or "paused"
    out_of_service: bool = False
    raised_s: float | None = None  # when the standing or last occurrence was raised
    cleared_s: float | None = None
    acknowledged_by: str | None = None
    finding: Finding | None = None  # the newest
    trip: Finding | None = None  # as announced
    worst: Finding | None = None  # furthest beyond its limit since raised

    @property
    def state(self) -> AlarmState:
        if self.out_of_service:
            return AlarmState.OUT_OF_SERVICE
        if self.suppressed_by:
            return AlarmState.SUPPRESSED
        if self.shelved_until_s is not None:
            return AlarmState.SHELVED
        if self.active:
            return AlarmState.ACKED if self.acknowledged else AlarmState.UNACKED
        return AlarmState.NORMAL if self.acknowledged else AlarmState.RTN_UNACKED

    @property
    def is_standing(self) -> bool:
        """Active, or gone and still unacknowledged."""
        return self.active or not self.acknowledged

    @property
    def place(self) -> Place:
        """Where it shows now; use this rather than the spec's."""
        return self.spec.place if self.active or self.spec.place_after is None else self.spec.place_after

    @property
    def sound(self) -> Sound:
        """What it sounds like now: silent once it is gone, acknowledged, shelved or suppressed."""
        return self.spec.sound if self.state is AlarmState.UNACKED else Sound.NONE


def advance(
    alarm: Alarm, finding: Finding, now_s: float, inhibited_by: Collection[str] = ()
) -> tuple[Alarm, tuple[Transition, ...]]:
    raise NotImplementedError
