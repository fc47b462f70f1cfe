"""The life of one alarm after ISA-18.2: independent flags, a state derived from them, and one pure step of time.

- *Delays* count only time in which the check really said so: UNKNOWN stops the count to raising (what was seen still
  counts) and starts the count to clearing anew; so UNKNOWN neither raises nor clears.
- *Occurrence* counts announcements: a raise, a new or worse cause, the end of shelving. Each asks for its own
  acknowledgement, and an acknowledgement names the one it saw.
- *Repeats*: where the spec says so, an alarm that comes back with causes announced of late stands in the list as it was
  left, acknowledged or not, and is not announced again.
- *Suppressed* alarms neither raise nor clear, and come back as they were: known ones are not announced again.
- A clock that goes back moves the alarm's own times with it: no delay gets longer, none is skipped.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace
from enum import StrEnum
from typing import Any, Literal

from monitor.alarm_spec import Action, AlarmSpec, Place, Sound
from monitor.check import Finding, Verdict
from monitor.quick import changer

Change = Literal["raised", "cleared", "acknowledged", "recaused", "shelved", "unshelved", "suppressed", "unsuppressed"]


CLOCK_BACK_S = 0.5  # less is a message that waited a moment, not a clock that went back
ROUNDING_S = 1e-6  # delays are summed in steps
LEVEL = "level "  # begins the name of a cause that is a degree of badness


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
    state: AlarmState = AlarmState.NORMAL  # where the alarm stands after it
    finding: Finding | None = None  # what the check had last said; None: it had said nothing, or monitoring ended
    causes: tuple[str, ...] = ()  # what the operator had been told of, as far as it was still there
    suppressed_by: tuple[str, ...] = ()
    shelved_until_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Cause:
    """One reason an alarm was announced for."""

    name: str
    absent_s: float | None = None  # how long the alarm has stood without it; None: it is there


@dataclass(frozen=True, slots=True, kw_only=True)
class Alarm:
    """One alarm as it stands now."""

    id: str
    spec: AlarmSpec
    occurrence: int = 0  # counts announcements
    condition: bool = False  # what the check last said, without delays; UNKNOWN leaves it
    active: bool = False  # the same with delays: what the operator is told
    acknowledged: bool = True
    latched: bool = False  # active only because it latches
    shelved_until_s: float | None = None
    shelved_by: str | None = None
    suppressed_by: tuple[str, ...] = ()  # alarm ids, or "paused"
    out_of_service: bool = False
    raised_s: float | None = None  # when the standing or last activity began
    announced_s: float | None = None  # when the operator was last told
    cleared_s: float | None = None
    acknowledged_by: str | None = None
    finding: Finding | None = None  # the newest while the alarm is awake
    trip: Finding | None = None  # as announced
    worst: Finding | None = None  # furthest beyond its limit since raised
    causes: tuple[Cause, ...] = ()  # what the operator was told of
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
        """Normal in every respect: another judgement which is no fault changes nothing of it."""
        return not (
            self.condition
            or self.active
            or not self.acknowledged
            or self.suppressed_by
            or self.shelved_until_s is not None
        )


_changed = changer(Alarm)  # an alarm that stands is judged at every message


def _state(active: bool, acknowledged: bool) -> AlarmState:
    if active:
        return AlarmState.ACKED if acknowledged else AlarmState.UNACKED
    return AlarmState.NORMAL if acknowledged else AlarmState.RTN_UNACKED


def transition(
    alarm: Alarm, change: Change, at_s: float, *, text: str = "", by: str | None = None, announces: bool = False
) -> Transition:
    """That `change` has made of the alarm what it is now."""
    return Transition(
        alarm_id=alarm.id,
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
    )


def there(causes: Collection[Cause]) -> tuple[str, ...]:
    """The names of those which are not away."""
    return tuple(cause.name for cause in causes if cause.absent_s is None)


def advance(
    alarm: Alarm, finding: Finding, now_s: float, inhibited_by: Collection[str] = ()
) -> tuple[Alarm, tuple[Transition, ...]]:
    """One judgement at `now_s`: the alarm after it, and what happened. `inhibited_by` explains it away for now."""
    if alarm.out_of_service:
        return alarm, ()
    if finding.verdict is not Verdict.FAULT and not inhibited_by and alarm.is_at_rest:
        return alarm, ()  # by far the most frequent case, and nothing of it needs remembering
    alarm = rebased(alarm, now_s)
    step = _Step(alarm, finding, now_s if alarm.at_s is None else max(now_s, alarm.at_s))
    step.suppress(tuple(inhibited_by))
    step.unshelve_when_due()
    step.judge()
    return step.result()


def end(alarm: Alarm, now_s: float, why: str) -> tuple[Alarm, tuple[Transition, ...]]:
    """Monitoring ends: the alarm goes back to normal, and says so where it stood or lay on the shelf."""
    fresh = Alarm(id=alarm.id, spec=alarm.spec, occurrence=alarm.occurrence, out_of_service=alarm.out_of_service)
    if alarm.is_standing:
        return fresh, (transition(fresh, "cleared", now_s, text=why),)
    if alarm.shelved_until_s is not None:
        return fresh, (transition(fresh, "unshelved", now_s, text=why),)
    return fresh, ()


def rebased(alarm: Alarm, now_s: float) -> Alarm:
    """The alarm with its times moved along when the clock went back, so that every duration stays what it was."""
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
        announced=tuple((name, at_s + shift_s) for name, at_s in alarm.announced),
    )


def _names(finding: Finding) -> tuple[str, ...]:
    """What the finding blames; each degree of badness counts as a cause of its own, so a worse one is a new one."""
    return (*finding.causes, *(f"{LEVEL}{level}" for level in range(1, finding.level + 1)))


def _beyond(finding: Finding | None) -> float:
    if finding is None or finding.measured is None or finding.limit is None:
        return -1.0
    return abs(finding.measured.value - finding.limit.value)


class _Step:
    """Collects the changes of one judgement, so that a new `Alarm` is made once."""

    __slots__ = (
        "_acknowledged",
        "_active",
        "_alarm",
        "_dt_s",
        "_finding",
        "_now_s",
        "_occurrence",
        "_set",
        "_shelved",
        "_suppressed",
        "_transitions",
        "_verdict_before",
    )

    def __init__(self, alarm: Alarm, finding: Finding, now_s: float) -> None:
        self._alarm = alarm
        self._finding = finding
        self._now_s = now_s
        self._dt_s = 0.0 if alarm.at_s is None else now_s - alarm.at_s
        self._verdict_before = None if alarm.finding is None else alarm.finding.verdict
        self._active = alarm.active
        self._acknowledged = alarm.acknowledged
        self._occurrence = alarm.occurrence
        self._shelved = alarm.shelved_until_s is not None
        self._suppressed = bool(alarm.suppressed_by)
        self._set: dict[str, Any] = {"finding": finding, "at_s": now_s}
        self._transitions: list[Transition] = []

    def result(self) -> tuple[Alarm, tuple[Transition, ...]]:
        alarm = _changed(
            self._alarm,
            active=self._active,
            acknowledged=self._acknowledged,
            occurrence=self._occurrence,
            **self._set,
        )
        return alarm, tuple(self._transitions)

    def suppress(self, by: tuple[str, ...]) -> None:
        before = self._suppressed
        self._suppressed = bool(by)
        if by != self._alarm.suppressed_by:
            self._set["suppressed_by"] = by
        if before != self._suppressed and (self._active or not self._acknowledged):
            self._tell("suppressed" if self._suppressed else "unsuppressed")

    def unshelve_when_due(self) -> None:
        until_s = self._alarm.shelved_until_s
        if until_s is None or self._now_s < until_s:
            return
        self._shelved = False
        self._set |= {"shelved_until_s": None, "shelved_by": None}
        if self._active:
            self._announce("unshelved")
        else:
            self._tell("unshelved")

    def judge(self) -> None:
        match self._finding.verdict:
            case Verdict.FAULT:
                self._fault()
            case Verdict.OK:
                self._ok()
            case Verdict.UNKNOWN:
                if self._active:
                    self._set["held_s"] = 0.0

    def _fault(self) -> None:
        self._set["condition"] = True
        self._set["latched"] = False
        if self._active:
            self._set["held_s"] = 0.0
            if _beyond(self._finding) > _beyond(self._alarm.worst):
                self._set["worst"] = self._finding
            if not self._suppressed:
                self._blame()
            return
        if self._suppressed:
            self._set["held_s"] = 0.0
            return
        # What was explained away is no fault seen: the delay counts from the end of the suppression.
        seen_before = self._verdict_before is Verdict.FAULT and not self._alarm.suppressed_by
        held_s = self._alarm.held_s + (self._dt_s if seen_before else 0.0)
        self._set["held_s"] = held_s
        if held_s + ROUNDING_S >= self._alarm.spec.on_delay_s:
            self._active = True
            self._set |= {
                "held_s": 0.0,
                "raised_s": self._now_s,
                "cleared_s": None,
                "worst": self._finding,
                "causes": tuple(Cause(name=name) for name in _names(self._finding)),
            }
            if self._was_announced(_names(self._finding)):
                self._tell("raised")
            else:
                self._announce("raised")

    def _was_announced(self, names: Collection[str]) -> bool:
        """Whether the operator was told of all these causes so short a time ago that it is not repeated."""
        within_s = self._alarm.spec.repeat_after_s
        known = {name for name, at_s in self._alarm.announced if self._now_s - at_s < within_s}
        return within_s > 0.0 and bool(names) and known.issuperset(names)

    def _blame(self) -> None:
        """A cause the operator was not told of re-alarms; one that was away no longer than the off-delay is not new."""
        names = _names(self._finding)
        if len(names) == len(self._alarm.causes) and names == there(self._alarm.causes):
            return  # by far the most frequent case
        causes: dict[str, float | None] = {}
        for cause in self._alarm.causes:
            absent_s = None if cause.absent_s is None else cause.absent_s + self._dt_s
            if absent_s is None or absent_s <= self._alarm.spec.off_delay_s + ROUNDING_S:
                causes[cause.name] = 0.0 if absent_s is None else absent_s
        fresh = [name for name in names if name not in causes]
        causes |= dict.fromkeys(names)
        self._set["causes"] = tuple(Cause(name=name, absent_s=absent_s) for name, absent_s in causes.items())
        if fresh and not self._was_announced(fresh):
            self._announce("recaused")

    def _ok(self) -> None:
        self._set["condition"] = False
        if not self._active:
            self._set["held_s"] = 0.0
            return
        held_s = self._alarm.held_s + (self._dt_s if self._verdict_before is Verdict.OK else 0.0)
        self._set["held_s"] = held_s
        if self._suppressed or held_s + ROUNDING_S < self._alarm.spec.off_delay_s:
            return
        if self._alarm.spec.latches and not self._acknowledged:
            self._set["latched"] = True
            return
        self._active = False
        self._set |= {"held_s": 0.0, "cleared_s": self._now_s, "latched": False, "causes": ()}
        if not self._alarm.spec.needs_ack:
            self._acknowledged = True
        self._tell("cleared")

    def _announce(self, change: Change) -> None:
        self._occurrence += 1
        self._acknowledged = False
        self._set |= {"acknowledged_by": None, "announced_s": self._now_s}
        if self._finding.verdict is Verdict.FAULT:
            self._set["trip"] = self._finding
        if self._alarm.spec.repeat_after_s > 0.0:
            names = _names(self._finding)
            older = [(name, at_s) for name, at_s in self._alarm.announced if name not in names]
            self._set["announced"] = (*older, *((name, self._now_s) for name in names))
        self._tell(change, announces=not (self._shelved or self._suppressed))

    def _tell(self, change: Change, *, announces: bool = False) -> None:
        alarm, _ = self.result()
        self._transitions.append(transition(alarm, change, self._now_s, text=self._finding.text, announces=announces))
