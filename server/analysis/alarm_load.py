"""The alarm load of one operator, measured after EEMUA 191."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

from monitor.alarm import Transition
from monitor.load import (
    BEARABLE_IN_10_MIN,
    CHATTER_IN_60_S,
    CHATTER_WINDOW_S,
    FLOOD_IN_10_MIN,
    WINDOW_S,
    most_within,
    turns_of,
)


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
