"""All that a run through a recording has made of what it read so far."""

from __future__ import annotations

from dataclasses import dataclass, field

from monitor.alarm import Alarm
from monitor.load import RecentLoad
from monitor.runner import Monitor
from monitor.state import State
from monitor.trends import Trends
from server.judge.reception_stats import Reception
from server.judge.recorded_slowdown import Slowed


@dataclass(slots=True, kw_only=True)
class RunState:
    """All that a run has made of what it read: with it, it goes on from there."""

    state: State
    monitor: Monitor
    trends: Trends
    opened_s: float
    at_s: float
    recorded_alarms: dict[str, Alarm]  # as they were told then
    reception: Reception = field(default_factory=Reception)
    load: RecentLoad = field(default_factory=RecentLoad)
    heard: set[str] = field(default_factory=set)
    ticks: int = 0  # done
    words: int = 0  # of the recording's own, taken
    epoch: int = 0  # how many changes of the settings have come
    scans: int = 0
    kinds_kept: bool = True
    last_message_s: float | None = None
    paused_s: float | None = None
    paused_by: str | None = None
    slowed: Slowed = field(default_factory=Slowed)
