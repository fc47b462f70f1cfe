"""The link along the way: of each stretch of a drive the delay, and for how long nothing was received."""

from __future__ import annotations

from dataclasses import dataclass

from server.recording.drive.facts import DriveFacts
from server.recording.drive.parts import Span

STRETCHES = 60
LEAST_M = 20.0  # driven: of less there is no way
STEPS_M = (1, 2, 5, 10, 20, 50, 100, 200, 500, 1000, 2000, 5000, 10_000, 20_000, 50_000)


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
