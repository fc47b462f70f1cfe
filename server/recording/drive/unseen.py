"""When an operator saw no new values of the car in a drive, and how far it may have driven meanwhile."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from monitor.reading import AGEING_FLOOR_S
from monitor.unseen import unseen_m
from server.recording.drive.facts import DriveFacts

MOST_TIMES = 500  # of each kind


@dataclass(frozen=True, slots=True, kw_only=True)
class UnseenTime:
    """Times are seconds since the beginning of the recording."""

    from_s: float
    to_s: float
    late_s: float | None = None  # the most that messages were late; None: none came, or their delay is not known
    metres: float | None  # the most that the car can have driven since a value that was shown; None: not known


def blind_times(facts: DriveFacts) -> list[UnseenTime]:
    """Each time without any message, with the way since the last speed before it."""
    found = []
    for from_s, to_s in facts.motion.blind_spans()[:MOST_TIMES]:
        last = facts.last_speed(from_s)
        late_s = _in_force(facts.late, from_s)
        age_s = None if last is None else to_s - last[0] + (late_s or 0.0)
        metres = unseen_m(None if last is None else last[1], age_s, _most(facts.accelerations, from_s, to_s))
        found.append(UnseenTime(from_s=from_s, to_s=to_s, metres=metres))
    return found


def late_times(facts: DriveFacts) -> list[UnseenTime]:
    """Each time in which messages came so late that the page covers their values, with the longest way there."""
    spans: list[tuple[float, float, float]] = []
    for from_s, to_s, late_s in facts.held_delays():
        if late_s <= AGEING_FLOOR_S:
            continue
        if spans and spans[-1][1] == from_s:
            spans[-1] = (spans[-1][0], to_s, max(spans[-1][2], late_s))
        elif len(spans) < MOST_TIMES:
            spans.append((from_s, to_s, late_s))
    return [
        UnseenTime(from_s=a, to_s=b, late_s=late_s, metres=_farthest_m(facts, a, b, late_s)) for a, b, late_s in spans
    ]


def _farthest_m(facts: DriveFacts, from_s: float, to_s: float, late_s: float) -> float | None:
    """The most of all speeds that were shown, each until the next one came."""
    before = facts.last_speed(from_s)
    shown = ([] if before is None else [before]) + facts.motion.speed.between(from_s, to_s)
    limit = _most(facts.accelerations, from_s, to_s)
    ways = (unseen_m(v, next_s - at_s + late_s, limit) for (at_s, v), (next_s, _) in pairwise([*shown, (to_s, 0.0)]))
    return max((way for way in ways if way is not None), default=None)


def _in_force(steps: Sequence[tuple[float, float]], at_s: float) -> float | None:
    return next((value for from_s, value in reversed(steps) if from_s <= at_s), None)


def _most(steps: Sequence[tuple[float, float]], from_s: float, to_s: float) -> float | None:
    """The highest of the values in force in a time; None: none is known."""
    begin = _in_force(steps, from_s)
    within = [value for at_s, value in steps if from_s < at_s < to_s]
    return max(within if begin is None else [begin, *within], default=None)
