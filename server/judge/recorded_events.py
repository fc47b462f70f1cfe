"""What a recording of ours holds beside the car's messages: alarms, pauses, settings, phones, slow-downs."""

from __future__ import annotations

from dataclasses import dataclass, field

from monitor.alarm import Transition
from monitor.phones import PhoneWord
from server.judge.recorded_slowdown import SlowDownTold


@dataclass(frozen=True, slots=True, kw_only=True)
class Pause:
    """Monitoring was paused or went on."""

    is_paused: bool
    by: str | None


@dataclass(frozen=True, slots=True, kw_only=True)
class NewSettings:
    """The settings from here on, as the file of all of them."""

    toml: str


Word = Transition | Pause | NewSettings | PhoneWord | SlowDownTold


@dataclass(frozen=True, slots=True, kw_only=True)
class RecordedEvents:
    """Everything of one recording, in the order of time. Times are seconds since its beginning."""

    words: tuple[tuple[float, Word], ...] = ()
    has_alarms: bool = False  # it holds the alarms as they were announced
    settings: str | None = None  # that were in force at its beginning; None: it does not say
    notes: tuple[str, ...] = field(default=())
