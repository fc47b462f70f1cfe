"""The alarms announced in a drive, as marks on its time line: bounded, the most urgent kept."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

from monitor.alarm import Transition
from monitor.alarm_spec import Priority

MOST_MARKS = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class AlarmMark:
    """One announcement. `at_s` is on the clock of its transition."""

    at_s: float
    alarm: str
    title: str
    priority: Priority


class AlarmMarks:
    """Of one drive, in the order of time."""

    def __init__(self) -> None:
        self._marks: list[AlarmMark] = []
        self.left_out = 0

    def add(self, transition: Transition, at_s: float) -> None:
        """Mark it, if it announces an alarm. Beyond `MOST_MARKS` the oldest of the least urgent is dropped."""
        if not transition.announces:
            return
        spec = transition.spec
        mark = AlarmMark(at_s=at_s, alarm=transition.alarm_id, title=spec.title, priority=spec.priority)
        self._marks.append(mark)
        if len(self._marks) > MOST_MARKS:
            self._marks.remove(max(self._marks, key=lambda one: (one.priority.rank, -one.at_s)))
            self.left_out += 1

    def __iter__(self) -> Iterator[AlarmMark]:
        return iter(self._marks)
