"""The life of one alarm after ISA-18.2: independent flags, a state derived from them, and one pure step of time.

- *Delays* count only time in which the check has a verdict: UNKNOWN pauses the on-delay (earlier time still counts) and
  restarts the off-delay; so UNKNOWN neither raises nor clears.
- *Occurrence* counts announcements: a raise, a new or worse cause, the end of shelving. Each needs its own
  acknowledgement, and an acknowledgement names its occurrence.
- *Silence* takes the sound for a while and nothing else. A new occurrence, and the end of the while, sound again.
- *Repeats*: if the spec has it, an alarm that returns with recently announced causes is restored in the list as it was,
  acknowledged or not, and is not announced again.
- *Suppressed* alarms neither raise nor clear, and come back as they were: known ones are not announced again.
- A clock that goes back shifts the alarm's times: no delay gets longer, none is skipped.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from typing import Any

from monitor.alarm import LEVEL, Alarm, Cause, Change, Transition, rebased, there, transition
from monitor.check import Finding, Verdict

ROUNDING_S = 1e-6  # delays are summed in steps


def advance(
    alarm: Alarm, finding: Finding, now_s: float, inhibited_by: Collection[str] = ()
) -> tuple[Alarm, tuple[Transition, ...]]:
    """One judgement at `now_s`: the alarm after it, and what happened. `inhibited_by` explains it away for now."""
    if alarm.out_of_service:
        return alarm, ()
    if finding.verdict is not Verdict.FAULT and not inhibited_by and alarm.is_at_rest:
        return alarm, ()  # by far the most frequent case, and it needs no state
    alarm = rebased(alarm, now_s)
    step = _Step(alarm, finding, now_s if alarm.at_s is None else max(now_s, alarm.at_s))
    step.suppress(tuple(inhibited_by))
    step.unshelve_when_due()
    step.unsilence_when_due()
    step.judge()
    return step.result()


def end(alarm: Alarm, now_s: float, why: str) -> tuple[Alarm, tuple[Transition, ...]]:
    """Return to normal at the end of monitoring, with a transition if the alarm was active or shelved."""
    fresh = Alarm(id=alarm.id, spec=alarm.spec, occurrence=alarm.occurrence, out_of_service=alarm.out_of_service)
    if alarm.is_standing:
        return fresh, (transition(fresh, "cleared", now_s, text=why),)
    if alarm.shelved_until_s is not None:
        return fresh, (transition(fresh, "unshelved", now_s, text=why),)
    return fresh, ()


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
        alarm = replace(
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
            self._add_transition("suppressed" if self._suppressed else "unsuppressed")

    def unshelve_when_due(self) -> None:
        until_s = self._alarm.shelved_until_s
        if until_s is None or self._now_s < until_s:
            return
        self._shelved = False
        self._set |= {"shelved_until_s": None, "shelved_by": None}
        if self._active:
            self._announce("unshelved")
        else:
            self._add_transition("unshelved")

    def unsilence_when_due(self) -> None:
        until_s = self._alarm.silenced_until_s
        if until_s is None or self._now_s < until_s:
            return
        self._set |= {"silenced_until_s": None, "silenced_by": None}
        if self._active and not self._acknowledged:
            self._add_transition("unsilenced")

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
        # A suppressed fault does not count as seen: the delay counts from the end of the suppression.
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
                self._add_transition("raised")
            else:
                self._announce("raised")

    def _was_announced(self, names: Collection[str]) -> bool:
        """Whether all these causes were announced too recently to be repeated."""
        within_s = self._alarm.spec.repeat_after_s
        known = {name for name, at_s in self._alarm.announced if self._now_s - at_s < within_s}
        return within_s > 0.0 and bool(names) and known.issuperset(names)

    def _blame(self) -> None:
        """An unannounced cause re-alarms; one that was absent no longer than the off-delay is not new."""
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
        self._set |= {"silenced_until_s": None, "silenced_by": None}
        if not self._alarm.spec.needs_ack:
            self._acknowledged = True
        self._add_transition("cleared")

    def _announce(self, change: Change) -> None:
        self._occurrence += 1
        self._acknowledged = False
        self._set |= {"acknowledged_by": None, "announced_s": self._now_s}
        self._set |= {"silenced_until_s": None, "silenced_by": None}
        if self._finding.verdict is Verdict.FAULT:
            self._set["trip"] = self._finding
        if self._alarm.spec.repeat_after_s > 0.0:
            names = _names(self._finding)
            older = [(name, at_s) for name, at_s in self._alarm.announced if name not in names]
            self._set["announced"] = (*older, *((name, self._now_s) for name in names))
        self._add_transition(change, announces=not (self._shelved or self._suppressed))

    def _add_transition(self, change: Change, *, announces: bool = False) -> None:
        alarm, _ = self.result()
        self._transitions.append(transition(alarm, change, self._now_s, text=self._finding.text, announces=announces))
