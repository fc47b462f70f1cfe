"""The differences between the alarms of two runs: alarms that appear, vanish or move."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

from server.analysis.episodes import Episode
from server.judge.pipeline import TICK_S

NEAR_S = 5.0  # an alarm that came so much earlier or later is the same one, moved

Kind = Literal["appears", "vanishes", "moves"]


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
