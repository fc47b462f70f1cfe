"""Turns the transitions of a run into episodes, one for each time that an alarm was active; the load that they are for
one operator, measured after EEMUA 191; and the differences between two runs: alarms that appear, vanish or move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

from monitor.alarm import Alarm, Transition
from monitor.alarm_spec import Priority
from monitor.check import Finding
from monitor.load import (
    BEARABLE_IN_10_MIN,
    CHATTER_IN_60_S,
    CHATTER_WINDOW_S,
    FLOOD_IN_10_MIN,
    WINDOW_S,
    most_within,
    turns_of,
)
from server.judge.pipeline import TICK_S

NEAR_S = 5.0  # an alarm that came so much earlier or later is the same one, moved

Kind = Literal["appears", "vanishes", "moves"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Announcement:
    """One announcement to the operator."""

    at_s: float
    text: str
    change: str  # raised, recaused or unshelved


@dataclass(frozen=True, slots=True, kw_only=True)
class Episode:
    """An alarm from its raising to its clearing. Times are seconds since the beginning of the recording."""

    alarm_id: str
    title: str
    priority: Priority
    raised_s: float
    cleared_s: float | None  # None: it stood at the end
    until_s: float  # cleared, or the end of what was judged
    trip_text: str  # text of the check when it raised
    worst: Finding | None  # furthest beyond its limit, where it measures against one
    causes: tuple[str, ...] = ()
    advice: str = ""
    announcements: tuple[Announcement, ...] = ()
    suppressed: tuple[tuple[float, float], ...] = ()  # from, to: explained by another alarm meanwhile

    @property
    def for_s(self) -> float:
        return self.until_s - self.raised_s

    @property
    def worst_text(self) -> str:
        """The text of the check at the worst moment, if it differs from the first one; else empty."""
        return self.worst.text if self.worst is not None and self.worst.text != self.trip_text else ""


class Diary:
    """Follows the alarms of one run."""

    def __init__(self) -> None:
        self.transitions: list[Transition] = []
        self._open: dict[str, Episode] = {}
        self._hidden_since_s: dict[str, float] = {}
        self._closed: list[Episode] = []

    def note(self, transitions: Sequence[Transition], alarms: dict[str, Alarm]) -> None:
        """Take the transitions of one judgement; `alarms` are all alarms after it."""
        for transition in transitions:
            self.transitions.append(transition)
            self._note(transition, alarms[transition.alarm_id])

    def episodes(self, alarms: dict[str, Alarm], end_s: float) -> tuple[Episode, ...]:
        """All episodes in the order of their raising, with those still active at `end_s`, the end of the run."""
        standing = [
            replace(self._with_worst(episode, alarms[alarm_id], end_s), until_s=end_s)
            for alarm_id, episode in self._open.items()
        ]
        return tuple(sorted((*self._closed, *standing), key=lambda e: (e.raised_s, e.priority.rank, e.alarm_id)))

    def _note(self, transition: Transition, alarm: Alarm) -> None:
        alarm_id, at_s = transition.alarm_id, transition.at_s
        announcement = Announcement(at_s=at_s, text=transition.text, change=transition.change)
        episode = self._open.get(alarm_id)
        match transition.change:
            case "raised":
                self._open[alarm_id] = Episode(
                    alarm_id=alarm_id,
                    title=alarm.spec.title,
                    priority=alarm.spec.priority,
                    raised_s=at_s,
                    cleared_s=None,
                    until_s=at_s,
                    trip_text=transition.text,
                    worst=alarm.worst,
                    causes=() if alarm.trip is None else alarm.trip.causes,
                    advice=alarm.spec.advice,
                    announcements=(announcement,),
                )
            case "cleared" if episode is not None:
                done = self._with_worst(self._open.pop(alarm_id), alarm, at_s)
                self._closed.append(replace(done, cleared_s=at_s, until_s=at_s))
            case "suppressed" if episode is not None:
                self._hidden_since_s[alarm_id] = at_s
            case "unsuppressed" if episode is not None:
                self._open[alarm_id] = self._shown_again(episode, at_s)
            case _ if episode is not None and transition.announces:
                causes = () if alarm.trip is None else alarm.trip.causes
                self._open[alarm_id] = replace(
                    episode,
                    announcements=(*episode.announcements, announcement),
                    causes=tuple(dict.fromkeys((*episode.causes, *causes))),
                )

    def _with_worst(self, episode: Episode, alarm: Alarm, at_s: float) -> Episode:
        return replace(self._shown_again(episode, at_s), worst=alarm.worst or episode.worst)

    def _shown_again(self, episode: Episode, at_s: float) -> Episode:
        since_s = self._hidden_since_s.pop(episode.alarm_id, None)
        return episode if since_s is None else replace(episode, suppressed=(*episode.suppressed, (since_s, at_s)))


@dataclass(frozen=True, slots=True, kw_only=True)
class Load:
    """Alarms announced in one run."""

    announced: int
    judged_s: float
    most_in_10_min: int
    chattering: tuple[str, ...]  # ids of alarms which came and went three times within a minute
    standing: int  # at the end

    @property
    def in_10_min(self) -> float:
        """The average per 10 min; a shorter run is not scaled up, because its rest is not known."""
        return self.announced * WINDOW_S / max(self.judged_s, WINDOW_S)

    @property
    def verdict(self) -> str:
        """The rating: bearable, demanding or flood."""
        if self.most_in_10_min > FLOOD_IN_10_MIN:
            return "flood"
        return "bearable" if self.in_10_min <= BEARABLE_IN_10_MIN else "demanding"


def load_of(transitions: Sequence[Transition], judged_s: float, standing: int) -> Load:
    """The figures of one run which was judged for `judged_s`."""
    announced = [transition.at_s for transition in transitions if transition.announces]
    turns = turns_of(transitions)
    return Load(
        announced=len(announced),
        judged_s=judged_s,
        most_in_10_min=most_within(announced, WINDOW_S),
        chattering=tuple(
            name for name, times in turns.items() if most_within(times, CHATTER_WINDOW_S) >= CHATTER_IN_60_S
        ),
        standing=standing,
    )


@dataclass(frozen=True, slots=True, kw_only=True)
class Change:
    """One alarm that differs between the runs."""

    kind: Kind
    before: Episode | None  # None: appears
    after: Episode | None  # None: vanishes

    @property
    def episode(self) -> Episode:
        episode = self.after or self.before
        assert episode is not None
        return episode

    @property
    def at_s(self) -> float:
        return self.episode.raised_s


def compare(before: Sequence[Episode], after: Sequence[Episode]) -> list[Change]:
    """All changes in the order of time; an alarm that came and went within a tick of when it did is none."""
    changes: list[Change] = []
    for alarm_id in dict.fromkeys(episode.alarm_id for episode in (*before, *after)):
        old = [episode for episode in before if episode.alarm_id == alarm_id]
        new = [episode for episode in after if episode.alarm_id == alarm_id]
        changes += _changes(old, new)
    return sorted(changes, key=lambda change: (change.at_s, change.episode.priority.rank, change.episode.alarm_id))


def _changes(old: list[Episode], new: list[Episode]) -> list[Change]:
    changes: list[Change] = []
    left = list(new)
    for before in old:
        near = [after for after in left if _apart_s(before, after) <= NEAR_S]
        if not near:
            changes.append(Change(kind="vanishes", before=before, after=None))
            continue
        after = min(near, key=lambda one: (_apart_s(before, one), abs(one.raised_s - before.raised_s)))
        left.remove(after)
        if _has_moved(before, after):
            changes.append(Change(kind="moves", before=before, after=after))
    return changes + [Change(kind="appears", before=None, after=after) for after in left]


def _apart_s(one: Episode, other: Episode) -> float:
    """Seconds between the two; 0 where they overlap."""
    return max(0.0, one.raised_s - other.until_s, other.raised_s - one.until_s)


def _has_moved(before: Episode, after: Episode) -> bool:
    least = TICK_S * 1.5
    return (
        abs(before.raised_s - after.raised_s) > least
        or abs(before.until_s - after.until_s) > least
        or (before.cleared_s is None) != (after.cleared_s is None)
        or before.priority is not after.priority
    )
