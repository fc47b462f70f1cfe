"""Does a signal keep repeating the same? For how long, and how far the car drove meanwhile."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from monitor.motion import MOVES_ABOVE_MPS
from monitor.values import Acceleration, GpsFix, Heading, LaserScan, Odometry, Twist

STEP_AT_MOST_S = 1.0  # over a longer gap between two speeds the motion is unknown
MEMORY = 200  # messages: the last ten seconds in motion at 20 Hz decide …
KNOWN_AFTER = 40  # … and not before two
WEIGHT_AT_MOST = 20  # repetitions of one stretch that count: one that was frozen does not make a signal sluggish


@dataclass(frozen=True, slots=True, kw_only=True)
class Repeats:
    """What the newest message of a signal repeats; all zero if it is new."""

    value_n: int = 0  # messages before it in a row with the same value, to the last bit
    value_s: float = 0.0  # how long the car moved meanwhile, by its wheels
    value_m: float = 0.0  # how far
    stamp_n: int = 0  # messages before it in a row with the same stamp
    stamp_s: float = 0.0  # how long that has lasted
    liveliness: float | None = None  # share of messages in motion with a new value; None: too few


_NOTHING = Repeats()


class Wheels:
    """How long and how far the car has moved, by the speed of its wheels."""

    __slots__ = ("_at_s", "is_moving", "moved_m", "moved_s")

    def __init__(self) -> None:
        self.moved_s = self.moved_m = 0.0
        self.is_moving = False  # by the newest speed
        self._at_s: float | None = None

    def add(self, at_s: float, speed_mps: float) -> None:
        speed_mps = abs(speed_mps)
        self.is_moving = speed_mps > MOVES_ABOVE_MPS  # false for NaN
        if self.is_moving and self._at_s is not None and 0.0 < at_s - self._at_s <= STEP_AT_MOST_S:
            self.moved_s += at_s - self._at_s
            self.moved_m += speed_mps * (at_s - self._at_s)
        self._at_s = at_s


# The part of a value that differs from message to message; a value of another type may stay the same for any time.
_COMPARED_PART: dict[type, Callable[[Any], Any]] = {
    Twist: lambda twist: twist.speed_mps,
    Acceleration: lambda acceleration: acceleration.acceleration_mps2,
    Heading: lambda heading: heading.heading_deg,
    GpsFix: lambda fix: (fix.lat_deg, fix.lon_deg),
    Odometry: lambda odometry: (odometry.x_m, odometry.y_m, odometry.yaw_rad),
    LaserScan: lambda scan: scan.ranges_m.tobytes(),  # NaN is NaN, and 1081 beams take half a microsecond
}
COMPARED = frozenset(_COMPARED_PART)


class RepeatFollower:
    """Follows the messages of one signal."""

    __slots__ = (
        "_in_motion",
        "_known",
        "_lively",
        "_part",
        "_stamp_n",
        "_stamp_s",
        "_stamp_since_s",
        "_value_n",
        "_way",
    )

    def __init__(self) -> None:
        self._lively = 1.0
        self._known = 0
        self.restart()

    def restart(self) -> None:
        """Begin anew after a gap: a message after it repeats none before it. The learned share of changes stays."""
        self._part: Any = None
        self._value_n = self._in_motion = self._stamp_n = 0
        self._way = (0.0, 0.0)  # of the wheels, when the value was new
        self._stamp_s: float | None = None
        self._stamp_since_s = 0.0

    def receive(self, value: Any, stamp_s: float | None, at_s: float, wheels: Wheels) -> Repeats | None:
        """One message; None where nothing of it can be followed."""
        part_of = _COMPARED_PART.get(type(value))
        if part_of is None and stamp_s is None:
            return None
        if stamp_s is None or stamp_s != self._stamp_s:
            self._stamp_s, self._stamp_since_s, self._stamp_n = stamp_s, at_s, 0
        else:
            self._stamp_n += 1
        if part_of is not None:
            part = part_of(value)
            if part != self._part:
                if wheels.is_moving:
                    self._learn()
                self._part, self._value_n, self._in_motion = part, 0, 0
                self._way = (wheels.moved_s, wheels.moved_m)
            else:
                self._value_n += 1
                self._in_motion += wheels.is_moving
        if not (self._value_n or self._stamp_n):
            return _NOTHING
        moved_s, moved_m = self._way
        return Repeats(
            value_n=self._value_n,
            value_s=wheels.moved_s - moved_s if self._value_n else 0.0,
            value_m=wheels.moved_m - moved_m if self._value_n else 0.0,
            stamp_n=self._stamp_n,
            stamp_s=at_s - self._stamp_since_s if self._stamp_n else 0.0,
            liveliness=self._lively if self._known >= KNOWN_AFTER else None,
        )

    def _learn(self) -> None:
        """A new value ends a run of repetitions; both give the share of changes."""
        for is_new in (*[False] * min(self._in_motion, WEIGHT_AT_MOST), True):
            self._known += 1
            self._lively += (float(is_new) - self._lively) / min(self._known, MEMORY)
