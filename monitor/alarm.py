"""One alarm after ISA-18.2: independent flags, and a state derived from them. `monitor.alarm_life` moves it on.

Announced alarms are also marks on the time line of a drive: bounded, the most urgent kept.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Literal

from monitor.alarm_spec import Action, AlarmSpec, Place, Priority, Sound
from monitor.check import Finding

Change = Literal[
    "raised",
    "cleared",
    "acknowledged",
    "recaused",
    "shelved",
    "unshelved",
    "silenced",
    "unsilenced",
    "suppressed",
    "unsuppressed",
    "handed_over",
    "unacknowledged",
]


CLOCK_BACK_S = 0.5  # a smaller step back is a delayed message, not a clock that was set back
LEVEL = "level "  # begins the name of a cause that is a degree of badness


class AlarmState(StrEnum):
    NORMAL = "NORMAL"
    UNACKED = "UNACKED"  # the condition is active and not acknowledged
    ACKED = "ACKED"
    RTN_UNACKED = "RTN_UNACKED"  # returned to normal, unseen
    SHELVED = "SHELVED"  # hidden by the operator for a time
    SUPPRESSED = "SUPPRESSED"  # hidden by design: another alarm explains it, or monitoring is paused
    OUT_OF_SERVICE = "OUT_OF_SERVICE"


class Refused(Exception):
    """A refused command of an operator; `reason` is one sentence."""

    def __init__(self, reason: str) -> None:
        super().__init__(reason)
        self.reason = reason


@dataclass(frozen=True, slots=True, kw_only=True)
class Transition:
    """One step in the life of an alarm, for the journal and the pages."""

    alarm_id: str
    spec: AlarmSpec  # as declared when it happened
    occurrence: int
    change: Change
    at_s: float
    text: str  # the finding's text at that moment
    by: str | None = None  # who, where a person did it
    announces: bool = False  # to be announced now
    state: AlarmState = AlarmState.NORMAL  # the alarm's state after it
    finding: Finding | None = None  # the check's newest; None: it had none, or monitoring ended
    causes: tuple[str, ...] = ()  # the announced causes that were still active
    suppressed_by: tuple[str, ...] = ()
    shelved_until_s: float | None = None
    worst: Finding | None = None  # furthest beyond its limit since it was raised


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """One reason an alarm was announced for."""

    name: str
    absent_s: float | None = None  # how long the alarm has stood without it; None: it is there


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """The current state of one alarm."""

    id: str
    spec: AlarmSpec
    occurrence: int = 0  # counts announcements
    condition: bool = False  # by the newest finding, without delays; UNKNOWN leaves it
    active: bool = False  # the same with delays: the announced state
    acknowledged: bool = True
    latched: bool = False  # active only because it latches
    shelved_until_s: float | None = None
    shelved_by: str | None = None
    silenced_until_s: float | None = None  # no sound until then; it still waits for its acknowledgement
    silenced_by: str | None = None
    suppressed_by: tuple[str, ...] = ()  # alarm ids, or "paused"
    out_of_service: bool = False
    raised_s: float | None = None  # when the standing or last activity began
    announced_s: float | None = None  # time of the last announcement
    cleared_s: float | None = None
    acknowledged_by: str | None = None
    finding: Finding | None = None  # the newest while the alarm is awake
    trip: Finding | None = None  # as announced
    worst: Finding | None = None  # furthest beyond its limit since raised
    causes: tuple[Cause, ...] = ()  # the announced causes
    announced: tuple[tuple[str, float], ...] = ()  # causes announced of late, and when; where the spec limits repeats
    held_s: float = 0.0  # how long the other side (fault while not active, ok while active) has held
    at_s: float | None = None  # when last judged

    @property
    def state(self) -> AlarmState:
        if self.out_of_service:
            return AlarmState.OUT_OF_SERVICE
        if self.suppressed_by:
            return AlarmState.SUPPRESSED
        if self.shelved_until_s is not None:
            return AlarmState.SHELVED
        return _state(self.active, self.acknowledged)

    @property
    def is_standing(self) -> bool:
        """Active, or over and still unacknowledged."""
        return self.active or not self.acknowledged

    @property
    def place(self) -> Place:
        """Where it shows now; use this rather than the spec's."""
        return self.spec.place if self.active or self.spec.place_after is None else self.spec.place_after

    @property
    def sound(self) -> Sound:
        """The sound to play now: none once it is over, acknowledged, silenced, shelved or suppressed."""
        sounds = self.state is AlarmState.UNACKED and self.silenced_until_s is None
        return self.spec.sound if sounds else Sound.NONE

    @property
    def actions(self) -> tuple[Action, ...]:
        """What the operator can do about it now; what is unacknowledged can be acknowledged, also when it returned."""
        if self.shelved_until_s is not None:
            return (*self._others, Action.UNSHELVE)
        possible = self._others if self.acknowledged else (Action.ACKNOWLEDGE, *self._others)
        return (Action.SHELVE, *possible) if Action.SHELVE in self.spec.actions and self.is_standing else possible

    @property
    def _others(self) -> tuple[Action, ...]:
        return tuple(one for one in self.spec.actions if one not in (Action.ACKNOWLEDGE, Action.SHELVE))

    @property
    def is_at_rest(self) -> bool:
        """Whether it is normal in every respect: another judgement without a fault changes nothing."""
        return not (
            self.condition
            or self.active
            or not self.acknowledged
            or self.suppressed_by
            or self.shelved_until_s is not None
        )


def _state(active: bool, acknowledged: bool) -> AlarmState:
    if active:
        return AlarmState.ACKED if acknowledged else AlarmState.UNACKED
    return AlarmState.NORMAL if acknowledged else AlarmState.RTN_UNACKED


def transition(
    alarm: Alarm, change: Change, at_s: float, *, text: str = "", by: str | None = None, announces: bool = False
) -> Transition:
    """Return the transition by which `change` led to the alarm's present state."""
    return Transition(
        alarm_id=alarm.id,
        spec=alarm.spec,
        occurrence=alarm.occurrence,
        change=change,
        at_s=at_s,
        text=text,
        by=by,
        announces=announces,
        state=alarm.state,
        finding=alarm.finding,
        causes=there(alarm.causes),
        suppressed_by=alarm.suppressed_by,
        shelved_until_s=alarm.shelved_until_s,
        worst=alarm.worst,
    )


def there(causes: Collection[Cause]) -> tuple[str, ...]:
    """The names of those which are not away."""
    return tuple(cause.name for cause in causes if cause.absent_s is None)


def rebased(alarm: Alarm, now_s: float) -> Alarm:
    """Return the alarm with its times shifted after the clock went back, so that durations are unchanged."""
    if alarm.at_s is None or now_s >= alarm.at_s - CLOCK_BACK_S:
        return alarm
    shift_s = now_s - alarm.at_s

    def moved(at_s: float | None) -> float | None:
        return None if at_s is None else at_s + shift_s

    return replace(
        alarm,
        at_s=now_s,
        raised_s=moved(alarm.raised_s),
        announced_s=moved(alarm.announced_s),
        cleared_s=moved(alarm.cleared_s),
        shelved_until_s=moved(alarm.shelved_until_s),
        silenced_until_s=moved(alarm.silenced_until_s),
        announced=tuple((name, at_s + shift_s) for name, at_s in alarm.announced),
    )


MOST_MARKS = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmMark:
    """One announcement. `at_s` is on the clock of its transition."""

    at_s: float
    alarm: str
    title: str
    priority: Priority


class AlarmMarks:
    """The alarms that were announced in one drive, in the order of time."""

    def __init__(self) -> None:
        self._marks: list[AlarmMark] = []
        self.left_out = 0

    def add(self, transition: Transition, at_s: float) -> None:
        """Mark it, if it announces an alarm. Beyond `MOST_MARKS` the oldest of the least urgent is dropped."""
        if not transition.announces:
            return
        spec = transition.spec
        mark = AlarmMark(at_s=at_s, alarm=transition.alarm_id, title=spec.title, priority=spec.priority)
        self._marks.append(mark)
        if len(self._marks) > MOST_MARKS:
            self._marks.remove(max(self._marks, key=lambda one: (one.priority.rank, -one.at_s)))
            self.left_out += 1

    def __iter__(self) -> Iterator[AlarmMark]:
        return iter(self._marks)
