"""How much the alarms ask of one operator, measured after EEMUA 191."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

from monitor.alarm import Transition

# EEMUA 191, 3rd ed.: an operator can bear about one alarm in ten minutes, and more than ten in ten minutes are a flood.
BEARABLE_IN_10_MIN = 1.0
FLOOD_IN_10_MIN = 10
WINDOW_S = 600.0
CHATTER_IN_60_S = 3  # transitions of one alarm


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
        """On average; a shorter run is not scaled up, for nobody knows what the rest would have brought."""
        return self.announced * WINDOW_S / max(self.judged_s, WINDOW_S)

    @property
    def verdict(self) -> str:
        """In one word: bearable, demanding or flood."""
        if self.most_in_10_min > FLOOD_IN_10_MIN:
            return "flood"
        return "bearable" if self.in_10_min <= BEARABLE_IN_10_MIN else "demanding"


def load_of(transitions: Sequence[Transition], judged_s: float, standing: int) -> Load:
    """The figures of one run which was judged for `judged_s`."""
    announced = [transition.at_s for transition in transitions if transition.announces]
    comings: dict[str, list[float]] = {}
    for transition in transitions:
        if transition.change in ("raised", "cleared"):
            comings.setdefault(transition.alarm_id, []).append(transition.at_s)
    return Load(
        announced=len(announced),
        judged_s=judged_s,
        most_in_10_min=_most_within(announced, WINDOW_S),
        chattering=tuple(name for name, times in comings.items() if _most_within(times, 60.0) >= CHATTER_IN_60_S),
        standing=standing,
    )


def _most_within(times: Iterable[float], window_s: float) -> int:
    recent: deque[float] = deque()
    most = 0
    for at_s in times:
        recent.append(at_s)
        while at_s - recent[0] > window_s:
            recent.popleft()
        most = max(most, len(recent))
    return most
