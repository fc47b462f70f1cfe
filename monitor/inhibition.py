"""The cause table: which alarm explains which, so that one cause is one announcement; and which alarms are shown."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass

from monitor.alarm import Alarm
from monitor.check import Verdict

GRACE_S = 3.0  # for the alarms which explain that messages are missing: the messages need a moment to come again
UNSEEN_S = 3.0  # beyond its on-delay an alarm that is not announced explains others for so long


@dataclass(slots=True)
class _Hidden:
    """How long an alarm's fault has lasted since something that is not announced began to hide it."""

    faulty_s: float = 0.0
    at_s: float | None = None  # of the newest judgement, if that found the fault
    gone_at_s: float | None = None  # since when its condition is absent


class CauseTable:
    """Holds every alarm's inhibitors, direct and indirect, and which of them are active now.

    The table is `AlarmSpec.inhibited_by`: lost link ⊃ silent car ⊃ stale signal ⊃ slow signal. What is judged *by* a
    stale signal needs no row: its value cannot be read, its check is UNKNOWN, and UNKNOWN neither raises nor clears;
    nor a grace: a returned signal is valid at once.

    An inhibitor holds while its condition does, whatever its own delays, and for its grace after. The grace is for
    missing messages; for a judged value it must be 0, because a returning danger must not be delayed.

    While its alarm is not announced, an inhibitor holds for its on-delay and `UNSEEN_S` at most: a condition that comes
    and goes faster than the on-delay would hide all that it explains, and nobody would be informed of anything. That
    time begins anew only after a pause in which all that it explains could be announced.

    Several such conditions in turn hide an alarm no longer than the slowest one of them alone: once its fault has
    lasted for their longest on-delay and `UNSEEN_S`, and as long again for what hides those, only announced alarms
    suppress it.
    """

    def __init__(
        self,
        inhibited_by: Mapping[str, tuple[str, ...]],
        grace_s: Mapping[str, float] | None = None,
        on_delay_s: Mapping[str, float] | None = None,
    ) -> None:
        """`inhibited_by` has the direct inhibitors of each alarm; raises ValueError for an unknown name or a circle."""
        self._grace_s = dict(grace_s or {})
        self._on_delay_s = dict(on_delay_s or {})
        self._closure: dict[str, tuple[str, ...]] = {}
        self.order: list[str] = []  # every alarm after all that inhibit it
        for alarm_id in inhibited_by:
            self._visit(alarm_id, inhibited_by, ())
        self.inhibitors = frozenset(name for names in self._closure.values() for name in names)
        self._over_s = self._pauses()
        self._most_hidden_s = {alarm_id: self._longest(names) for alarm_id, names in self._closure.items()}
        self._gone_at_s: dict[str, float | None] = {}  # when each inhibitor's condition went; None: it is there
        self._unseen_s: dict[str, float | None] = {}  # since when each holds unannounced; None: it is announced
        self._announced: set[str] = set()  # the inhibitors that are
        self._hidden: dict[str, _Hidden] = {}  # by the id of what is explained
        self._held: frozenset[str] = frozenset()  # the inhibitors that hold at `_held_s`
        self._held_s: float | None = None  # None: they are to be found anew

    def note(self, alarm: Alarm, now_s: float) -> None:
        """Store whether this alarm's condition holds; called after each of its evaluations."""
        if alarm.id in self._hidden or (alarm.suppressed_by and alarm.condition):
            self._note_hidden(alarm, now_s)
        if alarm.id not in self.inhibitors:
            return
        (self._announced.add if alarm.active else self._announced.discard)(alarm.id)
        self._note_unseen(alarm, now_s)
        if alarm.condition:
            if self._gone_at_s.get(alarm.id, now_s) is not None:
                self._gone_at_s[alarm.id] = self._held_s = None
        elif alarm.id in self._gone_at_s:
            gone_at_s = self._gone_at_s[alarm.id]
            if gone_at_s is None or gone_at_s > now_s:  # it ends now, or the clock went back: the grace restarts
                self._gone_at_s[alarm.id] = now_s
                self._held_s = None

    def _note_unseen(self, alarm: Alarm, now_s: float) -> None:
        unseen_s = self._unseen_s.get(alarm.id)
        if alarm.active or alarm.suppressed_by:  # what suppresses it is announced, or holds for a bounded time itself
            self._unseen_s[alarm.id] = None
            return
        gone_at_s = self._gone_at_s.get(alarm.id, -math.inf)
        is_over = gone_at_s is not None and not 0.0 <= now_s - gone_at_s < self._over_s[alarm.id]
        if unseen_s is None or unseen_s > now_s or (alarm.condition and is_over):
            self._unseen_s[alarm.id] = now_s

    def _note_hidden(self, alarm: Alarm, now_s: float) -> None:
        if not self._announced.isdisjoint(alarm.suppressed_by):
            self._hidden.pop(alarm.id, None)
            return
        hidden = self._hidden.setdefault(alarm.id, _Hidden())
        gone_at_s, at_s = hidden.gone_at_s, hidden.at_s
        hidden.at_s = None
        if not alarm.condition:
            hidden.gone_at_s = now_s if gone_at_s is None else min(gone_at_s, now_s)
            return
        hidden.gone_at_s = None
        if gone_at_s is not None and now_s - gone_at_s >= UNSEEN_S + GRACE_S:
            hidden.faulty_s = 0.0
        if alarm.finding is not None and alarm.finding.verdict is Verdict.FAULT:  # UNKNOWN pauses, as it does the delay
            hidden.faulty_s += 0.0 if at_s is None else max(0.0, now_s - at_s)
            hidden.at_s = now_s

    def holding(self, alarm_id: str, now_s: float) -> tuple[str, ...]:
        """The alarms that suppress this one now."""
        if not self._gone_at_s:
            return ()
        if self._held_s != now_s:  # it is called for all alarms at each moment
            self._held_s = now_s
            self._held = frozenset(name for name in self._gone_at_s if self._holds(name, now_s))
        if not self._held:
            return ()
        by = tuple(name for name in self._closure[alarm_id] if name in self._held)
        hidden = self._hidden.get(alarm_id)
        if hidden is None or hidden.faulty_s <= self._most_hidden_s[alarm_id] or not self._announced.isdisjoint(by):
            return by
        return ()

    def clear(self) -> None:
        self._announced.clear()
        self._hidden.clear()
        self._gone_at_s.clear()
        self._unseen_s.clear()
        self._held_s = None

    def _pauses(self) -> dict[str, float]:
        """How long the condition of each inhibitor must be absent until it is over: a shorter time could be used up by
        its grace, or end the on-delay of what it explains again and again."""
        longest = dict.fromkeys(self.inhibitors, 0.0)
        for alarm_id, names in self._closure.items():
            for name in names:
                longest[name] = max(longest[name], self._on_delay_s.get(alarm_id, 0.0))
        return {name: UNSEEN_S + self._grace_s.get(name, 0.0) + delay_s for name, delay_s in longest.items()}

    def _longest(self, names: Iterable[str]) -> float:
        """How long all of these may hide an alarm while none of them is announced: one that is itself hidden so is
        announced later."""
        return self._alone(names) + max((self._alone(self._closure[name]) for name in names), default=0.0)

    def _alone(self, names: Iterable[str]) -> float:
        delays_s = [self._on_delay_s.get(name, 0.0) for name in names]
        return UNSEEN_S + max(delays_s) if delays_s else 0.0

    def _holds(self, name: str, now_s: float) -> bool:
        gone_at_s, unseen_s = self._gone_at_s[name], self._unseen_s[name]
        if unseen_s is not None and now_s - unseen_s > self._on_delay_s.get(name, 0.0) + UNSEEN_S:
            return False
        return gone_at_s is None or now_s - gone_at_s < self._grace_s.get(name, 0.0)

    def _visit(self, alarm_id: str, table: Mapping[str, tuple[str, ...]], path: tuple[str, ...]) -> None:
        if alarm_id in path:
            raise ValueError(f"alarms inhibit each other in a circle: {' → '.join((*path, alarm_id))}")
        if alarm_id in self._closure:
            return
        found: dict[str, None] = {}
        for name in table[alarm_id]:
            if name not in table:
                raise ValueError(f"{alarm_id} is inhibited by {name}, which does not exist")
            self._visit(name, table, (*path, alarm_id))
            found |= dict.fromkeys((name, *self._closure[name]))
        self._closure[alarm_id] = tuple(found)
        self.order.append(alarm_id)


def table_of(alarms: Iterable[Alarm]) -> CauseTable:
    known = tuple(alarms)
    return CauseTable(
        {alarm.id: alarm.spec.inhibited_by for alarm in known},
        {alarm.id: alarm.spec.grace_s for alarm in known},
        {alarm.id: alarm.spec.on_delay_s for alarm in known},
    )


def standing(alarms: Iterable[Alarm]) -> list[Alarm]:
    """Alarms to show, most urgent first: active or unacknowledged, shelved ones last, suppressed ones not."""
    shown = [
        alarm
        for alarm in alarms
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


def suppressed(alarms: Iterable[Alarm]) -> list[Alarm]:
    """Alarms that would stand if nothing explained them, most urgent first."""
    hidden = [
        alarm
        for alarm in alarms
        if alarm.suppressed_by and (alarm.is_standing or (alarm.finding and alarm.finding.verdict is Verdict.FAULT))
    ]
    return sorted(hidden, key=lambda alarm: (alarm.spec.priority.rank, alarm.id))
