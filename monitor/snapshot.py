"""Everything known of a vehicle at one moment: the immutable input of every check."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, overload

from monitor.car_clock import ClockJump
from monitor.compared import NOTHING_COMPARED, Compared
from monitor.gps_watch import GpsWatch
from monitor.immutable import immutable
from monitor.phones import NO_PHONE, PhoneView
from monitor.rates import Rate
from monitor.reading import Extent, Reading, Unusable
from monitor.shell_facts import LinkFacts, ReachFacts, RecorderFacts, SlowingFacts
from monitor.signals import SIGNALS
from monitor.slow_proof import NOTHING_SHOWN, SlowProof
from monitor.tracks import TrackPoint
from monitor.values import (
    Acceleration,
    Bearing,
    Diagnostics,
    Distance,
    DriveMode,
    Effort,
    GpsFix,
    Heading,
    LaserScan,
    Level,
    MotionCommand,
    Odometry,
    Steering,
    Twist,
)

MODES_KEPT = 64  # changes; a topic that flickered with every message at 1000 Hz would need as many in a tick


@dataclass(frozen=True, slots=True, kw_only=True)
class ReceivedMode:
    """The car reported this mode from this moment on."""

    number: int  # counts the changes, from 1 on
    at_s: float  # received
    value: DriveMode


class ReceivedModes:
    """Every change of the mode that the car reports, between one judgement and the next.

    Follows the messages of the mode; bounded.
    """

    def __init__(self) -> None:
        self.changes: tuple[ReceivedMode, ...] = ()
        self._count = 0

    def add(self, at_s: float, value: DriveMode) -> None:
        """One message. Only one that differs from the message before is kept."""
        if self.changes and self.changes[-1].value == value:
            return
        self._count += 1
        self.changes = (*self.changes[-MODES_KEPT + 1 :], ReceivedMode(number=self._count, at_s=at_s, value=value))

    def forget(self) -> None:
        """The clock went back: what was received before has no valid time any more."""
        self.changes = ()


class NotFresh(Exception):
    """A value is missing or too old to judge by; `short` is the reason in at most 8 letters."""

    def __init__(self, why: str, short: str = "stale") -> None:
        super().__init__(why)
        self.why = why
        self.short = short


@immutable
class Snapshot:
    """Everything known of a vehicle at one moment, immutable: any moment of a recording can be judged alone."""

    now_s: float
    readings: Mapping[str, Reading[Any]] = field(default_factory=dict)  # only signals that were received or derived
    link: LinkFacts = field(default_factory=LinkFacts)
    rates: Mapping[str, Rate] = field(default_factory=dict)  # of every signal; up to 0.5 s old
    paused: bool = False
    paused_since_s: float | None = None
    heard_s: float | None = None  # when any signal last came
    unusable: Mapping[str, Unusable] = field(default_factory=dict)  # signals whose newest messages cannot be used
    extents: Mapping[str, Extent] = field(default_factory=dict)  # of signals with a received headline number
    track: tuple[TrackPoint, ...] = ()  # where the car was, thinned and bounded, oldest first
    track_m: float | None = None  # distance driven since connecting; None: never had a position
    gps: GpsWatch = field(default_factory=GpsWatch)  # the receiver's behaviour, by the newest fixes
    compared: Compared = NOTHING_COMPARED  # further sources of signals, and the speeds that each shows
    phone: PhoneView = NO_PHONE  # the operator's phone beside the car
    phones: tuple[PhoneView, ...] = ()  # every phone that shares its position, in order of arrival
    scan_before: Reading[LaserScan] | None = None  # some 0.4 s before the newest
    scan_parts: tuple[Reading[LaserScan], ...] = ()  # beside the newest: other parts of a sweep that is sent in parts
    scan_habit: frozenset[int] | None = None  # see `scan_shape.ScanHabit.usual`
    distance_before: Reading[Distance] | None = None
    standing_since_s: float | None = None  # when the wheels stopped; None: the car moves, or unknown
    speed_slope_mps2: float | None = None  # slope of the wheel speed over 0.6 s; None: too few messages
    clock_jump: ClockJump | None = None  # the newest since connecting
    recorder: RecorderFacts = field(default_factory=RecorderFacts)
    reach: ReachFacts | None = None  # operators that can hear an alarm; None: not applicable, as in a recording
    slowing: SlowingFacts = field(default_factory=SlowingFacts)
    slow_proof: SlowProof = NOTHING_SHOWN  # what the car's speed shows of the order
    modes_received: tuple[ReceivedMode, ...] = ()  # the newest changes of the mode that the car reports, oldest first

    @overload
    def get(self, signal: Literal["speed"]) -> Reading[Twist] | None: ...
    @overload
    def get(self, signal: Literal["acceleration"]) -> Reading[Acceleration] | None: ...
    @overload
    def get(self, signal: Literal["brake", "accelerator"]) -> Reading[Effort] | None: ...
    @overload
    def get(self, signal: Literal["steering"]) -> Reading[Steering] | None: ...
    @overload
    def get(self, signal: Literal["distance"]) -> Reading[Distance] | None: ...
    @overload
    def get(self, signal: Literal["bearing"]) -> Reading[Bearing] | None: ...
    @overload
    def get(self, signal: Literal["position"]) -> Reading[GpsFix] | None: ...
    @overload
    def get(self, signal: Literal["odometry"]) -> Reading[Odometry] | None: ...
    @overload
    def get(self, signal: Literal["heading"]) -> Reading[Heading] | None: ...
    @overload
    def get(self, signal: Literal["scan"]) -> Reading[LaserScan] | None: ...
    @overload
    def get(self, signal: Literal["diagnostics"]) -> Reading[Diagnostics] | None: ...
    @overload
    def get(self, signal: Literal["command"]) -> Reading[MotionCommand] | None: ...
    @overload
    def get(self, signal: Literal["fuel"]) -> Reading[Level] | None: ...
    @overload
    def get(self, signal: Literal["mode"]) -> Reading[DriveMode] | None: ...
    @overload
    def get(self, signal: str) -> Reading[Any] | None: ...
    def get(self, signal: str) -> Reading[Any] | None:
        """The newest reading whatever its age, None where there was none. To judge by a value use `need`."""
        return self.readings.get(signal)

    @overload
    def need(self, signal: Literal["speed"]) -> Twist: ...
    @overload
    def need(self, signal: Literal["acceleration"]) -> Acceleration: ...
    @overload
    def need(self, signal: Literal["brake", "accelerator"]) -> Effort: ...
    @overload
    def need(self, signal: Literal["steering"]) -> Steering: ...
    @overload
    def need(self, signal: Literal["distance"]) -> Distance: ...
    @overload
    def need(self, signal: Literal["bearing"]) -> Bearing: ...
    @overload
    def need(self, signal: Literal["position"]) -> GpsFix: ...
    @overload
    def need(self, signal: Literal["odometry"]) -> Odometry: ...
    @overload
    def need(self, signal: Literal["heading"]) -> Heading: ...
    @overload
    def need(self, signal: Literal["scan"]) -> LaserScan: ...
    @overload
    def need(self, signal: Literal["diagnostics"]) -> Diagnostics: ...
    @overload
    def need(self, signal: Literal["command"]) -> MotionCommand: ...
    @overload
    def need(self, signal: Literal["fuel"]) -> Level: ...
    @overload
    def need(self, signal: str) -> Any: ...
    def need(self, signal: str) -> Any:
        """The value while it is fresh; raises `NotFresh`, which the runner turns into UNKNOWN, otherwise."""
        reading = self.readings.get(signal)
        label = SIGNALS[signal].label
        undecided = self.link.undecided.get(signal) if self.link.undecided else None
        if undecided is not None:  # earlier values are not used either
            raise NotFresh(f"{label}: {undecided}", "not set")
        unusable = self.unusable.get(signal)
        if unusable is not None and (reading is None or not reading.is_fresh(self.now_s)):
            raise NotFresh(f"{label}: {unusable.text}", "unusable")
        if reading is None:
            if signal in self.link.published:
                raise NotFresh(f"{label}: nothing received yet", "no data")
            raise NotFresh(f"{label} is not published", "no data")
        if not reading.is_fresh(self.now_s):
            raise NotFresh(f"{label} is {reading.age_s(self.now_s):.1f} s old", "stale")
        return reading.value
