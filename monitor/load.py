"""The load of the alarms on one operator, measured after EEMUA 191."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass

from monitor.alarm import Transition

# EEMUA 191, 3rd ed.: an operator can bear about one alarm in ten minutes, and more than ten in ten minutes are a flood.
BEARABLE_IN_10_MIN = 1.0
FLOOD_IN_10_MIN = 10
WINDOW_S = 600.0
CHATTER_WINDOW_S = 60.0
CHATTER_IN_60_S = 3  # transitions of one alarm: it came, went and came again
KEPT = 5000  # raised and cleared; the bound is far above a flood


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmLoad:
    """The load at one moment."""

    in_10_min: int  # alarms announced in the last ten minutes
    chattering: tuple[str, ...] = ()  # ids of alarms that came and went three times within the last minute

    @property
    def is_flood(self) -> bool:
        return self.in_10_min > FLOOD_IN_10_MIN

    @property
    def is_bearable(self) -> bool:
        return self.in_10_min <= BEARABLE_IN_10_MIN and not self.chattering


class RecentLoad:
    """Keep the transitions that count for the current load."""

    def __init__(self) -> None:
        self._announced: deque[float] = deque(maxlen=KEPT)
        self._turns: deque[tuple[float, str]] = deque(maxlen=KEPT)

    def add(self, transitions: Iterable[Transition]) -> None:
        """Transitions as they happen, in order of time."""
        for transition in transitions:
            _forget(self._announced, transition.at_s)
            if transition.announces:
                self._announced.append(transition.at_s)
            if is_turn(transition):
                self._turns.append((transition.at_s, transition.alarm_id))

    def at(self, now_s: float) -> AlarmLoad:
        """The load at `now_s`. After the clock went back, times up to a window ahead count like those behind."""
        announced = sum(abs(now_s - at_s) < WINDOW_S for at_s in self._announced)
        turns: dict[str, int] = {}
        for at_s, alarm_id in self._turns:
            if abs(now_s - at_s) < CHATTER_WINDOW_S:
                turns[alarm_id] = turns.get(alarm_id, 0) + 1
        return AlarmLoad(
            in_10_min=announced,
            chattering=tuple(name for name, number in turns.items() if number >= CHATTER_IN_60_S),
        )


def _forget(announced: deque[float], now_s: float) -> None:
    while announced and now_s - announced[0] >= WINDOW_S:
        announced.popleft()


def is_turn(transition: Transition) -> bool:
    """Whether the alarm came or went; an operator's action is no turn."""
    return transition.change in ("raised", "cleared")


def turns_of(transitions: Sequence[Transition]) -> Mapping[str, Sequence[float]]:
    """When each alarm came and went."""
    turns: dict[str, list[float]] = {}
    for transition in transitions:
        if is_turn(transition):
            turns.setdefault(transition.alarm_id, []).append(transition.at_s)
    return turns


def most_within(times: Iterable[float], window_s: float) -> int:
    """The largest number of these sorted times within one window."""
    recent: deque[float] = deque()
    most = 0
    for at_s in times:
        recent.append(at_s)
        while at_s - recent[0] > window_s:
            recent.popleft()
        most = max(most, len(recent))
    return most
