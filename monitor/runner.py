"""Runs the checks over a snapshot and keeps their alarms."""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from traceback import format_exception
from typing import Any

from monitor import response
from monitor.alarm import Alarm, Refused, Transition, advance, end
from monitor.alarm_spec import Action, AlarmSpec, Place, Priority, Sound
from monitor.catalog import CHECKS, AllLimits, AnyCheck, compose
from monitor.check import OK, Finding, Scope, Verdict, fault, unknown
from monitor.inhibition import table_of
from monitor.link import LinkFacts
from monitor.restoring import numbered_on, restore
from monitor.state import NotFresh, Snapshot, State
from monitor.tiles import Tile, places, tiles

__all__ = ["Crash", "Monitor", "Refused", "Tile", "Transition"]

IMPAIRED = "monitoring_impaired"
KEPT_SETS = 200  # of signals that come together: there are a dozen
ASKED_EVERY = 10  # ticks: within so many every check is really asked, so that one which fails is found out
IMPAIRED_SPEC = AlarmSpec(
    title="Monitoring impaired",
    priority=Priority.WARNING,
    place=Place.SNACKBAR,
    sound=Sound.MEDIUM,
    needs_ack=True,
    off_delay_s=10.0,  # a check that fails now and then is one failing check
    actions=(Action.SHELVE, Action.ACKNOWLEDGE),
    advice="The part named is not monitored. Tell the administrator of catgraph.",
)

NO_LINK = unknown("No link to the car", short="no link")
PAUSED = unknown("Monitoring is paused", short="paused")
ENDED = "Monitoring ended"


@dataclass(frozen=True, slots=True, kw_only=True)
class Crash:
    """A check that fails, for the shell to log once."""

    check_id: str
    error: str  # "ZeroDivisionError: division by zero"
    where: str  # traceback
    count: int  # ever; 1 is worth a line in the log


class _Row:
    """A check made ready to be looked at again and again."""

    __slots__ = ("calm", "check", "id", "limits", "look")

    def __init__(self, check: AnyCheck, limits: Any) -> None:
        self.check = check
        self.id = check.id
        self.look: Callable[[Any, Any], bool] = check.is_harmless or _never
        self.limits = limits
        self.calm: Alarm | None = None  # its alarm, as it was last found at rest


def _never(snapshot: Any, limits: Any) -> bool:
    """The look of a check which has none: it is always asked."""
    return False


class Monitor:
    """All checks of one vehicle and their alarms.

    The caller reads `findings` (by check id), `alarms` (by alarm id, which is the check's) and `crashes` (checks that
    fail now, by check id), and never writes to them.

    Most checks find nothing, most of the time. Where a check's quick look shows that it cannot be a fault and its alarm
    is at rest, it is not asked: no alarm can come of it. Its words are made when somebody reads them.
    """

    def __init__(self, checks: Sequence[AnyCheck] | None = None, limits: AllLimits | None = None) -> None:
        """Without `checks` all there are, without `limits` their defaults. Raises ValueError when the checks contradict
        each other: two of one id, a circle of inhibition."""
        declared = CHECKS if checks is None else tuple(checks)
        self._findings: dict[str, Finding] = {}
        self._asked: set[str] = set()  # since the last tick began
        self._passed_on: Snapshot | None = None  # of which the others were not asked, because harmless
        self._ticks = 0
        self.crashes: dict[str, Crash] = {}
        self.failed_parts: tuple[str, ...] = ()  # of what feeds the checks; written by the caller before a step
        self._failed: dict[str, int] = {}
        self.alarms = {check.id: Alarm(id=check.id, spec=check.alarm) for check in declared}
        if len(self.alarms) < len(declared):
            raise ValueError("two checks have one id")
        self.alarms[IMPAIRED] = Alarm(id=IMPAIRED, spec=IMPAIRED_SPEC)
        self._declared = declared
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
            _Row(check, getattr(limits, check.limits_group, None) or check.limits()) for check in self._checks
        )
        self._rows_by_signals: dict[Collection[str], tuple[_Row, ...]] = {}  # of the sets that were ever asked for

    def step(self, snapshot: Snapshot, changed: Collection[str] | None = None) -> tuple[Transition, ...]:
        """Judge. None: a tick, all checks; else only those that need one of the `changed` signals.

        With the link idle every alarm ends: there is nothing to monitor.
        """
        if snapshot.link.phase == "idle":
            return self.end(snapshot.now_s)
        if changed is None:
            return self._tick(snapshot)
        transitions: list[Transition] = []
        may_pass = self._may_pass(snapshot.link, snapshot.paused)
        for row in self._needing(changed):
            if may_pass and self._is_harmless(row, snapshot):
                continue  # its words are the last tick's, for a moment
            transitions += self._judge(row, snapshot)
        if self.crashes:
            transitions += self._advance(IMPAIRED, self._impaired(), snapshot.now_s, ())
        return tuple(transitions)

    @property
    def findings(self) -> Mapping[str, Finding]:
        """What each check last found, by its id."""
        if self._passed_on is not None:
            snapshot, self._passed_on = self._passed_on, None
            for row in self._rows:
                if row.id not in self._asked:
                    self._findings[row.id] = self._find(row, snapshot)
        return self._findings

    def _tick(self, snapshot: Snapshot) -> tuple[Transition, ...]:
        self._ticks += 1
        self._asked.clear()
        may_pass = self._may_pass(snapshot.link, snapshot.paused) and self._ticks % ASKED_EVERY != 0
        transitions: list[Transition] = []
        alarms = self.alarms
        for row in self._rows:
            if may_pass and (row.calm is alarms[row.id] or self._is_calm(row)):
                try:
                    if row.look(snapshot, row.limits):
                        continue
                except Exception:  # as in `_find`: it is asked, and if it fails too, that is said
                    pass
            transitions += self._judge(row, snapshot)
        self._passed_on = snapshot if may_pass else None
        if self.crashes or self.failed_parts or not self.alarms[IMPAIRED].is_at_rest:
            transitions += self._advance(IMPAIRED, self._impaired(), snapshot.now_s, ())
        return tuple(transitions)

    def _may_pass(self, link: LinkFacts, paused: bool) -> bool:
        return link.phase == "monitoring" and not paused

    def _is_calm(self, row: _Row) -> bool:
        """Whether its alarm is at rest, so that a look is enough. Asked once: an alarm is replaced, not changed."""
        alarm = self.alarms[row.id]
        if not alarm.is_at_rest or self._causes.remembers(row.id):
            return False
        row.calm = alarm
        return True

    def _is_harmless(self, row: _Row, snapshot: Snapshot) -> bool:
        try:
            return self._is_calm(row) and row.look(snapshot, row.limits)
        except Exception:  # as in `_find`: it is asked, and if it fails too, that is said
            return False

    @property
    def checks(self) -> tuple[AnyCheck, ...]:
        """What is judged, in the order of the home tab."""
        return self._declared

    def heeds(self, changed: tuple[str, ...], state: State) -> bool:
        """Whether a step for these signals could find anything; where not, there is no need of a snapshot."""
        rows = self._rows_by_signals.get(changed)
        if rows is None:
            rows = self._needing(changed)
        if not rows:
            return False
        if self.crashes or state.paused or state.link_facts.phase != "monitoring":
            return True
        alarms = self.alarms
        try:
            for row in rows:
                if not ((row.calm is alarms[row.id] or self._is_calm(row)) and row.look(state, row.limits)):
                    return True
        except Exception:  # as in `_find`: it will be asked, and if it fails too, that is said
            return True
        return False

    def end(self, now_s: float) -> tuple[Transition, ...]:
        """Monitoring ends by the operator's wish: nothing is judged and nothing stands any more."""
        transitions: list[Transition] = []
        for alarm_id, alarm in self.alarms.items():
            self.alarms[alarm_id], happened = end(alarm, now_s, ENDED)
            transitions += happened
        self._findings.clear()
        self._passed_on = None
        self.crashes.clear()
        self._causes.clear()
        for row in self._rows:
            row.calm = None
        return tuple(transitions)

    def restore(self, transitions: Iterable[Transition]) -> None:
        """Goes on from where the alarms stood after these transitions, oldest first; see `monitor.restoring`."""
        self.alarms = restore(self.alarms, transitions)

    def number_on(self, transitions: Iterable[Transition]) -> None:
        """Only counts on from the occurrences of these transitions: what they told of is over, or not yet due."""
        self.alarms = numbered_on(self.alarms, transitions)

    def standing(self) -> list[Alarm]:
        """Alarms to show, most urgent first: active or unacknowledged, shelved ones last, suppressed ones not."""
        shown = [
            alarm
            for alarm in self.alarms.values()
            if (alarm.is_standing or alarm.shelved_until_s is not None)
            and not alarm.suppressed_by
            and not alarm.out_of_service
        ]
        return sorted(
            shown,
            key=lambda alarm: (
                alarm.shelved_until_s is not None,
                alarm.spec.priority.rank,
                -(alarm.announced_s or 0.0),
            ),
        )

    def suppressed(self) -> list[Alarm]:
        """Alarms that would stand if nothing explained them, most urgent first."""
        hidden = [
            alarm
            for alarm in self.alarms.values()
            if alarm.suppressed_by and (alarm.is_standing or (alarm.finding and alarm.finding.verdict is Verdict.FAULT))
        ]
        return sorted(hidden, key=lambda alarm: (alarm.spec.priority.rank, alarm.id))

    def tiles(self) -> list[Tile]:
        """What the home tab shows of the checks: a tile for each label, at its fixed place."""
        return tiles(self._places, self.findings)

    def acknowledge(self, alarm_id: str, occurrence: int, by: str, now_s: float) -> tuple[Transition, ...]:
        """Raises Refused with the reason, as do `shelve` and `unshelve`."""
        return self._respond(alarm_id, lambda alarm: response.acknowledge(alarm, occurrence, by, now_s))

    def shelve(self, alarm_id: str, occurrence: int, minutes: float, by: str, now_s: float) -> tuple[Transition, ...]:
        is_inhibitor = alarm_id in self._causes.inhibitors
        return self._respond(
            alarm_id,
            lambda alarm: response.shelve(alarm, occurrence, minutes, by, now_s, is_inhibitor=is_inhibitor),
        )

    def unshelve(self, alarm_id: str, by: str, now_s: float) -> tuple[Transition, ...]:
        return self._respond(alarm_id, lambda alarm: response.unshelve(alarm, by, now_s))

    def _respond(
        self, alarm_id: str, act: Callable[[Alarm], tuple[Alarm, tuple[Transition, ...]]]
    ) -> tuple[Transition, ...]:
        alarm = self.alarms.get(alarm_id)
        if alarm is None:
            raise Refused("There is no such alarm")
        self.alarms[alarm_id], transitions = act(alarm)
        return transitions

    def _needing(self, changed: Collection[str]) -> tuple[_Row, ...]:
        together = changed if type(changed) is tuple else frozenset(changed)
        found = self._rows_by_signals.get(together)
        if found is None:
            wanted = frozenset(together)
            found = tuple(row for row in self._rows if not wanted.isdisjoint(row.check.needs))
            if len(self._rows_by_signals) < KEPT_SETS:
                self._rows_by_signals[together] = found
        return found

    def _judge(self, row: _Row, snapshot: Snapshot) -> tuple[Transition, ...]:
        check, finding = row.check, self._find(row, snapshot)
        self._asked.add(check.id)
        by = self._causes.holding(check.id, snapshot.now_s)
        if not by and finding.verdict is not Verdict.FAULT and not snapshot.paused:
            if row.calm is self.alarms[check.id] or self._is_calm(row):
                self._findings[check.id] = finding
                return ()  # by far the most frequent case
        if by and finding.verdict is Verdict.FAULT:
            why = self.alarms[by[0]].spec.title
            self._findings[check.id] = unknown(f"Not judged yet: {why}", short="waiting")
        else:
            self._findings[check.id] = finding
        if snapshot.paused and check.scope is Scope.CAR:
            by = ("paused", *by)
        return self._advance(check.id, finding, snapshot.now_s, by)

    def _advance(self, alarm_id: str, finding: Finding, now_s: float, by: tuple[str, ...]) -> tuple[Transition, ...]:
        alarm, transitions = advance(self.alarms[alarm_id], finding, now_s, by)
        self.alarms[alarm_id] = alarm
        self._causes.note(alarm, now_s)
        return transitions

    def _find(self, row: _Row, snapshot: Snapshot) -> Finding:
        check = row.check
        if check.scope is Scope.CAR:
            if snapshot.link.phase != "monitoring":
                return NO_LINK
            if snapshot.paused:
                return PAUSED
        try:
            finding = check.find(snapshot, row.limits, self.alarms[check.id].active)
            if type(finding) is not Finding:
                raise TypeError(f"{check.id} found {finding!r}, which is no finding")
        except NotFresh as missing:
            finding = unknown(missing.why, short=missing.short)
        except Exception as error:  # the one net: a broken check must not silence the others
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

    def _impaired(self) -> Finding:
        if not self.crashes and not self.failed_parts:
            return OK
        labels = (*(check.label for check in self._declared if check.id in self.crashes), *self.failed_parts)
        return fault(f"Not watched: {', '.join(labels)}", causes=labels)
