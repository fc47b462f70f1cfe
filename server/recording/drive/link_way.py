"""The link in a drive: the delay of each stretch of the way, and when an operator saw no new values of the car."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

from monitor.reading import AGEING_FLOOR_S
from monitor.transport import MIDDLE_AT_MOST_S
from monitor.unseen import unseen_m
from server.recording.drive.facts import DriveFacts
from server.recording.drive.parts import Span

STRETCHES = 60
LEAST_M = 20.0  # driven: of less there is no way
STEPS_M = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000)
MOST_TIMES = 500  # of each kind


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkStretch:
    """None: not known."""

    from_m: float
    to_m: float
    delay_s: float | None  # mean over time
    most_s: float | None
    blind_s: float  # no message came for longer than 1 s


def link_along(facts: DriveFacts) -> list[LinkStretch]:
    """Of equal length, in order; none: the distance is not known, or the car stood."""
    length_m = facts.motion.distance_m
    if length_m is None or length_m < LEAST_M:
        return []
    step_m = next((step for step in STEPS_M if length_m / step - STRETCHES <= 0.01), STEPS_M[-1])
    ends = [float(step_m * number) for number in range(1, int(length_m / step_m) + 1)]
    if not ends or length_m - ends[-1] > 0.01 * step_m:
        ends.append(length_m)
    moments = [0.0, *(facts.motion.when(end_m) or 0.0 for end_m in ends[:-1]), facts.length_s]
    held, blind = facts.held_delays(), facts.motion.blind_spans()
    found = []
    for number, to_m in enumerate(ends):
        span = moments[number], moments[number + 1]
        delays = [(late_s, within) for a, b, late_s in held if (within := _overlap((a, b), span)) > 0]
        whole_s = sum(within for _, within in delays)
        found.append(
            LinkStretch(
                from_m=0.0 if number == 0 else ends[number - 1],
                to_m=to_m,
                delay_s=sum(late_s * within for late_s, within in delays) / whole_s if whole_s else None,
                most_s=max((late_s for late_s, _ in delays), default=None),
                blind_s=sum(_overlap(one, span) for one in blind),
            )
        )
    return found


def _overlap(one: Span, other: Span) -> float:
    return max(0.0, min(one[1], other[1]) - max(one[0], other[0]))


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
        age_s = None if last is None else to_s - last[0] + _most_late_s(late_s)
        metres = unseen_m(None if last is None else last[1], age_s, _most(facts.accelerations, from_s, to_s))
        found.append(UnseenTime(from_s=from_s, to_s=to_s, metres=metres))
    return found


def late_times(facts: DriveFacts) -> list[UnseenTime]:
    """Each time in which messages came so late that the page covers their values, with the longest way there."""
    spans: list[tuple[float, float, float]] = []
    for from_s, to_s, estimated_s in facts.held_delays():
        if estimated_s <= AGEING_FLOOR_S:
            continue
        late_s = _most_late_s(estimated_s)
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


def _most_late_s(late_s: float | None) -> float:
    """The recorded delay is an estimate: how late messages may have been."""
    return 0.0 if late_s is None else round(late_s + MIDDLE_AT_MOST_S, 3)


def _in_force(steps: Sequence[tuple[float, float]], at_s: float) -> float | None:
    return next((value for from_s, value in reversed(steps) if from_s <= at_s), None)


def _most(steps: Sequence[tuple[float, float]], from_s: float, to_s: float) -> float | None:
    """The highest of the values in force in a time; None: none is known."""
    begin = _in_force(steps, from_s)
    within = [value for at_s, value in steps if from_s < at_s < to_s]
    return max(within if begin is None else [begin, *within], default=None)
