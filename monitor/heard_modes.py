"""Every change of what the car says of who drives, between one judgement and the next."""

from __future__ import annotations

from dataclasses import dataclass

from monitor.values import DriveMode

KEPT = 64  # changes; a topic that flickered with every message at 1000 Hz would need as many in a tick


@dataclass(frozen=True, slots=True, kw_only=True)
class HeardMode:
    """From this moment on the car said so."""

    number: int  # counts the changes, from 1 on
    at_s: float  # received
    value: DriveMode


class HeardModes:
    """Follows the messages of the mode; bounded."""

    def __init__(self) -> None:
        self.changes: tuple[HeardMode, ...] = ()
        self._count = 0

    def add(self, at_s: float, value: DriveMode) -> None:
        """One message. Only one that differs from the message before is kept."""
        if self.changes and self.changes[-1].value == value:
            return
        self._count += 1
        self.changes = (*self.changes[-KEPT + 1 :], HeardMode(number=self._count, at_s=at_s, value=value))

    def forget(self) -> None:
        """The clock went back: what was heard before has no time any more."""
        self.changes = ()
