"""What a recording of ours holds beside the car's messages: alarms, pauses, planned stops, settings, phones,
slow-downs."""

from __future__ import annotations

from dataclasses import dataclass, field

from monitor.alarm import Transition
from monitor.phones import PhoneReport
from monitor.planned_stop import PlannedStop
from server.judge.recorded_slowdown import SlowDownEvent


@dataclass(frozen=True, slots=True, kw_only=True)
class Pause:
    """Monitoring was paused or went on."""

    is_paused: bool
    by: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class StopChange:
    """A planned stop began; None: it ended."""

    stop: PlannedStop | None


@dataclass(frozen=True, slots=True, kw_only=True)
class NewSettings:
    """The settings from here on, as the file of all of them."""

    toml: str


@dataclass(frozen=True, slots=True, kw_only=True)
class ChosenPhone:
    """The operator chose the phone that rides in the car; None: no phone any more."""

    phone: str | None


RecordedEvent = Transition | Pause | StopChange | NewSettings | PhoneReport | ChosenPhone | SlowDownEvent


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedEvents:
    """Everything of one recording, in the order of time. Times are seconds since its beginning."""

    events: tuple[tuple[float, RecordedEvent], ...] = ()
    has_alarms: bool = False  # it holds the alarms as they were announced
    settings: str | None = None  # that were in force at its start; None: unknown
    clock_was_set: bool = False  # of the server, while it recorded
    notes: tuple[str, ...] = field(default=())
