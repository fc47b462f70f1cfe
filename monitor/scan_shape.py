"""How many beams a scan has, against the number that its angles give; and the parts of a sweep sent one by one."""

from __future__ import annotations

import math

from monitor.reading import Reading
from monitor.values import LaserScan

LEARNED_FROM = 20  # scans
WHOLE = 0.01  # steps: nearer to a whole number is that number; else the increment is rounded, and either side fits

SWEEP_S = 1.0  # a slower laser is of no use for driving
MOST_PARTS = 64

_Key = tuple[int, float, float, str]  # beams, first angle, increment, frame


def steps(scan: LaserScan) -> float:
    """From the first beam to the last; NaN, infinite or negative where the angles contradict each other."""
    if scan.angle_increment_rad == 0.0:
        return math.nan
    return (scan.angle_max_rad - scan.angle_min_rad) / scan.angle_increment_rad


def difference(scan: LaserScan) -> int | None:
    """Beams that a scan has more than (angle_max − angle_min) / angle_increment + 1; None: its angles give no number.

    Where the increment does not divide the angle, the number of beams below and that above are both right.
    """
    exact = steps(scan)
    if not 0.0 <= exact < math.inf:
        return None
    nearest = round(exact)
    low, high = (nearest, nearest) if abs(exact - nearest) <= WHOLE else (math.floor(exact), math.ceil(exact))
    return min(scan.beams - 1 - low, 0) or max(scan.beams - 1 - high, 0)


class ScanHabit:
    """Which differences of at most one a driver has by itself: those of its first scans."""

    __slots__ = ("_scans", "_seen")

    def __init__(self) -> None:
        self._scans = 0
        self._seen: frozenset[int] = frozenset()

    def add(self, scan: LaserScan) -> None:
        """One scan."""
        if self._scans >= LEARNED_FROM:
            return
        found = difference(scan)
        if found is not None and abs(found) <= 1:
            self._scans += 1
            self._seen |= {found}

    @property
    def usual(self) -> frozenset[int] | None:
        """The differences; None: too few scans."""
        return self._seen if self._scans >= LEARNED_FROM else None


def habit_words(usual: frozenset[int] | None) -> str | None:
    """What is to be known of a driver's count, once; None: it is that of the angles."""
    if usual is None or usual == frozenset({0}):
        return None
    if len(usual) == 1:
        return f"always one beam {'less' if -1 in usual else 'more'} than its angles give, as its driver counts"
    return "up to one beam more or less than its angles give, as its driver counts"


class ScanParts:
    """The parts of a sweep, where a laser sends them one by one: each message looks into another direction.

    The newest message of each direction. Times are the receiver's, in seconds.
    """

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
                if reading.received_s - parts[old].received_s <= SWEEP_S and len(parts) < MOST_PARTS:
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
