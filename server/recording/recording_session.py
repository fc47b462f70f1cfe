"""One session of recording and its parts, the settings of the recorder, and the other state of its controller."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from monitor.check import Limits
from server.judge.active_settings import ActiveSettings
from server.recording.delay import DelayWriter
from server.recording.recorded_topics import Missing
from server.recording.recorder_queue import Part
from server.recording.space import Allowance

GB = 1e9


class RecordingSettings:
    """The active settings of the recorder, and all settings in the form that is recorded.

    Read each time, because settings change during a recording.
    """

    def __init__(self, tuning: ActiveSettings) -> None:
        self._tuning = tuning

    def value(self, name: str) -> float:
        """One setting of recording, in SI."""
        limits: Limits = self._tuning.limits.recording
        return float(getattr(limits, name))

    def allowance(self) -> Allowance:
        """What recordings may take of the disk."""
        return Allowance(quota=round(self.value("quota_gb") * GB), min_free=round(self.value("min_free_gb") * GB))

    def as_entry(self) -> dict[str, Any]:
        """All settings in force, for the channel of settings."""
        return {
            "version": self._tuning.settings.version,
            "profile": self._tuning.profile.name,
            "toml": self._tuning.as_toml(),
            "in_force": self._tuning.in_force(),
        }


@dataclass(slots=True)
class RecordingSession:
    """From the beginning of a recording until it is ended, over all links in between."""

    id: str  # of its first part, and of the session
    session: str
    by: str | None  # who began it; None: it began with monitoring
    began_s: float
    part: int = 0  # the one being written, or the last
    begun: Part | None = None
    is_open: bool = False  # the part is being written
    lost_s: float | None = None  # since when it is held
    due_s: float | None = None  # a part is to begin with the next message, or at this moment
    noted: Missing | None = None  # the missing topics that the part's metadata already has
    noted_s: float = -math.inf
    delays: DelayWriter = field(default_factory=DelayWriter)  # of the part

    @property
    def newest(self) -> int:
        """The part that is written, was written last, or is about to begin."""
        return self.part + 1 if self.due_s is not None else max(1, self.part)


@dataclass(slots=True)
class ControllerState:
    """Of one vehicle's recording; changed on the loop only."""

    session: RecordingSession | None = None
    is_monitoring: bool = False
    stopped_by: str | None = None  # who ended it by hand: it does not begin by itself again
    completing: int = 0  # parts that are being completed
    saved: tuple[str, int] | None = None  # the newest finished part, and the time of day it reaches [ms]
    address: str | None = None
    ros_version: int | None = None
    missing: Missing = field(default_factory=Missing)
