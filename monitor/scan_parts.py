"""The parts of a sweep, where a laser sends them one by one: each message looks into another direction."""

from __future__ import annotations

from monitor.reading import Reading
from monitor.scan_shape import ScanHabit
from monitor.values import LaserScan

SWEEP_S = 1.0  # a slower laser is of no use for driving
MOST = 64

_Key = tuple[int, float, float, str]  # beams, first angle, increment, frame


class ScanParts:
    """The newest message of each direction. Times are the receiver's, in seconds."""

    __slots__ = ("_newest", "_parts")

    def __init__(self) -> None:
        self._parts: dict[_Key, Reading[LaserScan]] = {}  # the oldest first
        self._newest: _Key | None = None

    def add(self, reading: Reading[LaserScan]) -> None:
        """The newest scan."""
        scan, parts = reading.value, self._parts
        key = (scan.beams, scan.angle_min_rad, scan.angle_increment_rad, scan.frame_id)
        if key != self._newest or len(parts) > 1:
            parts.pop(key, None)
            for old in list(parts):
                if reading.received_s - parts[old].received_s <= SWEEP_S and len(parts) < MOST:
                    break
                del parts[old]
            self._newest = key
        parts[key] = reading

    def others(self, now_s: float) -> tuple[Reading[LaserScan], ...]:
        """Beside the newest scan, those of the same sweep that look elsewhere; none of a laser that sends it whole."""
        if len(self._parts) < 2:
            return ()
        return tuple(
            part for key, part in self._parts.items() if key != self._newest and now_s - part.received_s <= SWEEP_S
        )


class Scans:
    """What is kept of a laser's messages beside the newest one."""

    __slots__ = ("habit", "parts")

    def __init__(self) -> None:
        self.habit = ScanHabit()
        self.parts = ScanParts()

    def add(self, reading: Reading[LaserScan]) -> None:
        """The newest scan."""
        self.habit.add(reading.value)
        self.parts.add(reading)

    def forget_times(self) -> None:
        """The clock was set back: how old a part is, is not known."""
        self.parts = ScanParts()
