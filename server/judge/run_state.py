"""All that a run through a recording has made of what it read so far."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Protocol

from monitor.alarm import Alarm
from monitor.load import RecentLoad
from monitor.planned_stop import PlannedStop
from monitor.runner import Monitor
from monitor.state import State
from monitor.trends import CheckMinute, Trends
from server.judge.frames import Frames
from server.judge.reception_stats import Reception
from server.judge.recorded_events import OwnerChange, Pause, RecordedSlowDown

SLACK_S = 1e-6  # times are rounded to less


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
    """Corrects stamps by the clock that a recorder and its sensors share, where that clock was set.

    A sensor with a clock of its own is recognised by its first message behind the step, and its stamps are left as they
    are.
    """

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


@dataclass(slots=True, kw_only=True)
class RunState:
    """The complete state of a run, from which it can continue."""

    state: State
    monitor: Monitor
    trends: Trends
    minute: CheckMinute = field(default_factory=CheckMinute)
    opened_s: float
    at_s: float
    recorded_alarms: dict[str, Alarm]  # as they were announced then
    reception: Reception = field(default_factory=Reception)
    load: RecentLoad = field(default_factory=RecentLoad)
    topics_received: set[str] = field(default_factory=set)
    ticks: int = 0  # done
    events_taken: int = 0  # of those recorded
    epoch: int = 0  # how many changes of the settings have come
    scans: int = 0
    kinds_kept: bool = True
    last_message_s: float | None = None
    paused_s: float | None = None
    paused_by: str | None = None
    planned_stop: PlannedStop | None = None
    owners_off: dict[str, int] = field(default_factory=dict)  # by name: when their duty ended
    stamps: StampSteps = field(default_factory=StampSteps)
    slow_down: RecordedSlowDown = field(default_factory=RecordedSlowDown)
    frames: Frames | None = None  # where transforms move; None: those of the drive count throughout

    def off_duty_ms(self, signed: str | None) -> int | None:
        """When the duty of who acted under this name ended, as the live page showed it; None: on duty, or not known."""
        return self.owners_off.get(signed or "")

    def note_owner(self, event: OwnerChange) -> None:
        self.owners_off.pop(event.owner, None)
        if event.off_duty_ms is not None:
            self.owners_off[event.owner] = event.off_duty_ms

    def pause(self, event: Pause, now_s: float) -> None:
        """Monitoring was paused then, or went on."""
        self.paused_s, self.paused_by = (now_s, event.by) if event.is_paused else (None, None)
        self.state.set_paused(event.is_paused, self.paused_s)
