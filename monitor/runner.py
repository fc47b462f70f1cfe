"""Runs the checks over a snapshot, so that one which fails silences none of the others, and keeps their alarms."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from traceback import format_exception
from typing import Any, NamedTuple

from monitor import response
from monitor.alarm import Alarm, Refused, Transition
from monitor.alarm_life import advance, end
from monitor.alarm_spec import Action, AlarmSpec, Place, Priority, Sound
from monitor.catalog import CHECKS, AllLimits, AnyCheck, compose
from monitor.check import OK, Finding, Scope, Verdict, fault, unknown
from monitor.inhibition import standing, suppressed, table_of
from monitor.planned_stop import silent_checks
from monitor.restoring import numbered_on, restore
from monitor.snapshot import NotFresh, Snapshot
from monitor.tiles import Tile, places, tiles

NO_LINK = unknown("No link to the car", short="no link")
PAUSED = unknown("Monitoring is paused", short="paused")

__all__ = ["Crash", "Monitor", "Refused", "Tile", "Transition"]

IMPAIRED = "monitoring_impaired"
KEPT_SETS = 200  # of signals that come together: there are a dozen
IMPAIRED_SPEC = AlarmSpec(
    title="Monitoring impaired",
    priority=Priority.WARNING,
    place=Place.SNACKBAR,
    sound=Sound.MEDIUM,
    needs_ack=True,
    off_delay_s=10.0,  # a check that fails now and then is one failing check
    actions=(Action.SHELVE, Action.ACKNOWLEDGE),
    advice="The named part is not monitored. Inform the administrator of catgraph.",
)

ENDED = "Monitoring ended"
NOT_HERE = unknown("This version of catgraph has no such check", short="no such check")


@dataclass(frozen=True, slots=True, kw_only=True)
class Crash:
    """A check that fails, for the shell to log once."""

    check_id: str
    error: str  # "ZeroDivisionError: division by zero"
    where: str  # traceback
    count: int  # ever; the first is logged


class CheckRow(NamedTuple):
    """A check and the limits in force for it."""

    check: AnyCheck
    limits: Any
    explains: bool  # whether its alarm explains others


def blind_to_the_car(snapshot: Snapshot) -> Finding | None:
    """Why nothing of the car can be judged now; None: it can."""
    if snapshot.link.phase != "monitoring":
        return NO_LINK
    return PAUSED if snapshot.paused else None


class CheckRunner:
    """Runs the checks, and records which of them raise."""

    __slots__ = ("_declared", "_failed", "crashes")

    def __init__(self, declared: Sequence[AnyCheck]) -> None:
        self._declared = declared
        self._failed: dict[str, int] = {}  # how often ever, by check id
        self.crashes: dict[str, Crash] = {}  # checks that fail now, by check id

    def find(self, row: CheckRow, snapshot: Snapshot, blind: Finding | None, *, is_active: bool) -> Finding:
        """What the check finds; `is_active`: whether its alarm is. A check that fails finds UNKNOWN.

        `blind`: what every check of the car finds, see `blind_to_the_car`.
        """
        check = row.check
        if blind is not None and check.scope is Scope.CAR:
            return blind
        try:
            finding = check.find(snapshot, row.limits, is_active)
            if type(finding) is not Finding:
                raise TypeError(f"{check.id} found {finding!r}, which is no finding")
        except NotFresh as missing:
            finding = unknown(missing.why, short=missing.short)
        except Exception as error:  # the only place that catches all: a broken check must not stop the others
            self._failed[check.id] = self._failed.get(check.id, 0) + 1
            self.crashes[check.id] = Crash(
                check_id=check.id,
                error=f"{type(error).__name__}: {error}",
                where="".join(format_exception(error)),
                count=self._failed[check.id],
            )
            return unknown("This check fails", short="failed")
        if self.crashes:
            self.crashes.pop(check.id, None)
        return finding

    def impaired(self, failed_parts: tuple[str, ...]) -> Finding:
        """Whether all is watched; `failed_parts`: what fails of that which feeds the checks."""
        if not self.crashes and not failed_parts:
            return OK
        labels = (*(check.label for check in self._declared if check.id in self.crashes), *failed_parts)
        return fault(f"Not watched: {', '.join(labels)}", causes=labels)


class Monitor:
    """All checks of one vehicle and their alarms.

    The caller reads `findings` (by check id), `alarms` (by alarm id, which is the check's) and `crashes` (checks that
    fail now, by check id), and never writes to them.
    """

    def __init__(self, checks: Sequence[AnyCheck] | None = None, limits: AllLimits | None = None) -> None:
        """Without `checks` all there are, without `limits` their defaults. Raises ValueError when the checks contradict
        each other: two of one id, a circle of inhibition."""
        declared = CHECKS if checks is None else tuple(checks)
        self.findings: dict[str, Finding] = {}
        self._runner = CheckRunner(declared)
        self.crashes = self._runner.crashes
        self.failed_parts: tuple[str, ...] = ()  # of what feeds the checks; written by the caller before a step
        self.alarms = {check.id: Alarm(id=check.id, spec=check.alarm) for check in declared}
        if len(self.alarms) < len(declared):
            raise ValueError("two checks have one id")
        self.alarms[IMPAIRED] = Alarm(id=IMPAIRED, spec=IMPAIRED_SPEC)
        self._declared = declared
        self.silent_at_stop = silent_checks(declared)  # ids of alarms that make no sound in a planned stop
        self._places = places(declared)
        self._causes = table_of(self.alarms.values())
        by_id = {check.id: check for check in declared}
        self._checks = tuple(by_id[name] for name in self._causes.order if name in by_id)
        self.limits = compose(declared)() if limits is None else limits  # type: ignore[assignment]

    @property
    def limits(self) -> AllLimits:
        """What is judged by; may be replaced at any time, and counts from the next step."""
        return self._limits

    @limits.setter
    def limits(self, limits: AllLimits) -> None:
        self._limits = limits
        self._rows = tuple(
            CheckRow(
                check,
                getattr(limits, check.limits_group, None) or check.limits(),
                check.id in self._causes.inhibitors,
            )
            for check in self._checks
        )
        self._immediate_rows: dict[Collection[str], tuple[CheckRow, ...]] = {}  # by the signals that changed together

    def step(self, snapshot: Snapshot, changed: Collection[str] | None = None) -> tuple[Transition, ...]:
        """Judge. None: a tick, all checks; else only the immediate ones that need one of the `changed` signals.

        With the link idle every alarm ends: there is nothing to monitor.
        """
        if snapshot.link.phase == "idle":
            return self.end(snapshot.now_s)
        transitions: list[Transition] = []
        blind = blind_to_the_car(snapshot)
        for row in self._rows if changed is None else self._immediate(changed):
            if happened := self._judge(row, snapshot, blind):
                transitions += happened
        if changed is None and len(self.alarms) > len(self._declared) + 1:
            for name in self.alarms.keys() - {check.id for check in self._declared} - {IMPAIRED}:
                transitions += self._advance(name, NOT_HERE, snapshot.now_s, ())
                transitions += self._end_foreign(self.alarms[name], snapshot.now_s)
        if self.crashes or (changed is None and (self.failed_parts or not self.alarms[IMPAIRED].is_at_rest)):
            transitions += self._advance(IMPAIRED, self._runner.impaired(self.failed_parts), snapshot.now_s, ())
        return tuple(transitions)

    def _end_foreign(self, alarm: Alarm, now_s: float) -> tuple[Transition, ...]:
        """End an alarm without a check here that somebody has acknowledged: nothing else would."""
        if not (alarm.latched and alarm.acknowledged) or alarm.suppressed_by or alarm.shelved_until_s is not None:
            return ()
        self.alarms[alarm.id], ended = end(alarm, now_s, NOT_HERE.text)
        return ended

    def has_immediate(self, changed: Collection[str]) -> bool:
        """Whether a step for these signals would judge anything."""
        return bool(self._immediate(changed))

    @property
    def checks(self) -> tuple[AnyCheck, ...]:
        """What is judged, in the order of the home tab."""
        return self._declared

    def end(self, now_s: float) -> tuple[Transition, ...]:
        """End monitoring on the operator's command: nothing is evaluated, and no alarm stays active."""
        transitions: list[Transition] = []
        for alarm_id, alarm in self.alarms.items():
            self.alarms[alarm_id], happened = end(alarm, now_s, ENDED)
            transitions += happened
        self.findings.clear()
        self.crashes.clear()
        self._causes.clear()
        return tuple(transitions)

    def restore(self, transitions: Iterable[Transition]) -> None:
        """Restore the alarms after these transitions, oldest first; see `monitor.restoring`. An alarm without a check
        here, of another version, stays as it was until it is acknowledged."""
        others = restore(self.alarms, transitions)
        for name in others.keys() - self.alarms.keys():
            others[name] = replace(others[name], finding=NOT_HERE, latched=others[name].active)
        self.alarms = others

    def number_on(self, transitions: Iterable[Transition]) -> None:
        """Continue the occurrence numbers of these transitions only; their alarms are over or not yet due."""
        self.alarms = numbered_on(self.alarms, transitions)

    def standing(self) -> list[Alarm]:
        """Alarms to show, most urgent first: active or unacknowledged, shelved ones last, suppressed ones not."""
        return standing(self.alarms.values())

    def suppressed(self) -> list[Alarm]:
        """Alarms that would stand if nothing explained them, most urgent first."""
        return suppressed(self.alarms.values())

    def tiles(self) -> list[Tile]:
        """What the home tab shows of the checks: a tile for each label, at its fixed place."""
        return tiles(self._places, self.findings)

    def acknowledge(self, alarm_id: str, occurrence: int, by: str, now_s: float) -> tuple[Transition, ...]:
        """Raises Refused with the reason, as do `shelve` and `unshelve`."""
        return self._respond(alarm_id, lambda alarm: response.acknowledge(alarm, occurrence, by, now_s))

    def silence(self, alarm_id: str, occurrence: int, by: str, now_s: float) -> tuple[Transition, ...]:
        return self._respond(alarm_id, lambda alarm: response.silence(alarm, occurrence, by, now_s))

    def shelve(self, alarm_id: str, occurrence: int, minutes: float, by: str, now_s: float) -> tuple[Transition, ...]:
        is_inhibitor = alarm_id in self._causes.inhibitors
        return self._respond(
            alarm_id,
            lambda alarm: response.shelve(alarm, occurrence, minutes, by, now_s, is_inhibitor=is_inhibitor),
        )

    def unshelve(self, alarm_id: str, by: str, now_s: float) -> tuple[Transition, ...]:
        return self._respond(alarm_id, lambda alarm: response.unshelve(alarm, by, now_s))

    def take_over(self, alarm_id: str, by: str, now_s: float, *, is_read_back: bool) -> tuple[Transition, ...]:
        """As `hand_over`, of one alarm; raises Refused."""
        return self._respond(alarm_id, lambda alarm: response.hand_over(alarm, by, now_s, is_read_back=is_read_back))

    def hand_over(self, is_read_back: Callable[[Alarm], bool], by: str, now_s: float) -> tuple[Transition, ...]:
        """Control went to `by`, who has read back some of the alarms."""
        transitions: list[Transition] = []
        for name, alarm in self.alarms.items():
            self.alarms[name], happened = response.hand_over(alarm, by, now_s, is_read_back=is_read_back(alarm))
            transitions += happened
        return tuple(transitions)

    def _respond(
        self, alarm_id: str, act: Callable[[Alarm], tuple[Alarm, tuple[Transition, ...]]]
    ) -> tuple[Transition, ...]:
        alarm = self.alarms.get(alarm_id)
        if alarm is None:
            raise Refused("There is no such alarm")
        self.alarms[alarm_id], transitions = act(alarm)
        return transitions

    def _immediate(self, changed: Collection[str]) -> tuple[CheckRow, ...]:
        together = changed if type(changed) is tuple else frozenset(changed)
        found = self._immediate_rows.get(together)
        if found is None:
            found = tuple(row for row in self._rows if row.check.immediate and not row.check.needs.isdisjoint(together))
            if len(self._immediate_rows) < KEPT_SETS:
                self._immediate_rows[together] = found
        return found

    def _judge(self, row: CheckRow, snapshot: Snapshot, blind: Finding | None) -> tuple[Transition, ...]:
        check = row.check
        alarm = self.alarms[check.id]
        finding = self._runner.find(row, snapshot, blind, is_active=alarm.active)
        by = self._causes.holding(check.id, snapshot.now_s)
        is_fault = finding.verdict is Verdict.FAULT
        if not is_fault and not by and not snapshot.paused and alarm.is_at_rest:  # by far the most frequent case
            self.findings[check.id] = finding
            if row.explains:
                self._causes.note(alarm, snapshot.now_s)
            return ()
        if by and is_fault:
            why = self.alarms[by[0]].spec.title
            self.findings[check.id] = unknown(f"Not evaluated yet: {why}", short="waiting")
        else:
            self.findings[check.id] = finding
        if snapshot.paused and check.scope is Scope.CAR:
            by = ("paused", *by)
        return self._advance(check.id, finding, snapshot.now_s, by)

    def _advance(self, alarm_id: str, finding: Finding, now_s: float, by: tuple[str, ...]) -> tuple[Transition, ...]:
        alarm, transitions = advance(self.alarms[alarm_id], finding, now_s, by)
        self.alarms[alarm_id] = alarm
        self._causes.note(alarm, now_s)
        return transitions
