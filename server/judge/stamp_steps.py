"""Corrects stamps by the clock that a recorder and its sensors share, where that clock was set.

A sensor with a clock of its own is recognised by its first message behind the step, and its stamps are left as they
are.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol


class ClockStep(Protocol):
    """The recorder's clock was set."""

    @property
    def at_s(self) -> float:
        """Since the start of the recording."""
        ...

    @property
    def by_s(self) -> float:
        """Ahead positive, back negative."""
        ...


@dataclass(slots=True)
class _Stamps:
    """Of one topic."""

    steps: int  # passed so far
    stamp_s: float
    at_s: float
    correction_s: float = 0.0


@dataclass(slots=True)
class StampSteps:
    """What is known of the stamps of each topic."""

    _by_topic: dict[str, _Stamps] = field(default_factory=dict)

    def corrected(self, topic: str, stamp_s: float, at_s: float, steps: Sequence[ClockStep]) -> float:
        """The stamp of a message by the clock as it was before the first step. `at_s`: since the start."""
        known = self._by_topic.get(topic)
        passed = sum(step.at_s <= at_s + SLACK_S for step in steps)
        if known is None:
            known = self._by_topic[topic] = _Stamps(steps=passed, stamp_s=stamp_s, at_s=at_s)
        elif passed > known.steps:
            by_s = sum(step.by_s for step in steps[known.steps : passed])
            change_s = (stamp_s - known.stamp_s) - (at_s - known.at_s)
            if abs(change_s - by_s) < abs(change_s):
                known.correction_s -= by_s
            known.steps = passed
        known.stamp_s, known.at_s = stamp_s, at_s
        return stamp_s + known.correction_s


SLACK_S = 1e-6  # times are rounded to less
