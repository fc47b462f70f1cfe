"""One session of recording and its parts, and what else the controller of a vehicle's recording knows."""

from __future__ import annotations

import math
from dataclasses import dataclass, field

from server.recording.delay import DelayWriter
from server.recording.recorded_topics import Missing
from server.recording.recorder_queue import Part


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
