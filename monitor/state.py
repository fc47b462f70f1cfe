"""All that is known of one vehicle: readings as they come, and the immutable snapshot that checks judge."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from types import MappingProxyType
from typing import Any, Generic, Literal, TypeVar, overload

from monitor.components import Components
from monitor.freeze_detection import COMPARED, RepeatFollower, Repeats, Wheels
from monitor.gps_watch import GpsFollower, GpsWatch
from monitor.heading_fusion import HeadingFusion
from monitor.link import LinkFacts, Phase
from monitor.motion import Slope, Standstill
from monitor.phones import NO_PHONE, Phones, PhoneView, PhoneWord
from monitor.quick import maker
from monitor.rates import Rate, RateMeter
from monitor.reach import ReachFacts
from monitor.reading_history import ReadingHistory
from monitor.recorder import RecorderFacts
from monitor.signals import SIGNALS, Signal
from monitor.slow_proof import NOTHING_SHOWN, ProofFollower, SlowProof
from monitor.slowing import SlowingFacts
from monitor.stamps import MANY_WRITERS, ClockJump, StampFollower, merged
from monitor.tracks import Track, TrackPoint
from monitor.unusable import Unusable
from monitor.values import (
    Acceleration,
    Bearing,
    Diagnostics,
    Distance,
    Effort,
    GpsFix,
    Heading,
    LaserScan,
    Level,
    MotionCommand,
    Odometry,
    Steering,
    Twist,
    Value,
)

__all__ = ["Extent", "Freshness", "LinkFacts", "NotFresh", "Phase", "Reading", "Snapshot", "State", "TrackPoint"]

AGEING_PERIODS = 3
AGEING_FLOOR_S = 0.4  # three periods of a 75 Hz signal are one hiccup of Wi-Fi; a healthy link has its own 0.15 s
DELAY_AT_MOST_S = 2.0  # later than this a value is old, however patient one is with a signal that comes seldom
CLOCK_BACK_S = 0.5
RATES_EVERY_S = 0.5  # a rate over 5 s does not change faster

Freshness = Literal["fresh", "ageing", "stale"]
T_co = TypeVar("T_co", covariant=True)


class NotFresh(Exception):
    """A value is missing or too old to judge by; `short` is the reason in at most 8 letters."""

    def __init__(self, why: str, short: str = "stale") -> None:
        super().__init__(why)
        self.why = why
        self.short = short


@dataclass(frozen=True, slots=True, kw_only=True)
class Reading(Generic[T_co]):
    """The newest value of a signal, and how old it may grow. Times are on the receiver's monotonic clock."""

    value: T_co
    received_s: float
    horizon_s: float  # older than this is stale
    stamp_s: float | None = (
        None  # the vehicle's own time, seconds since 1970; another clock: never subtract it from received_s
    )
    period_s: float | None = None  # seconds between two messages, as far as known
    count: int = 0  # messages since connecting; 0 for a derived value
    derived_from: str | None = None  # the signal it was computed from; None: published by the car
    repeats: Repeats | None = None  # what it repeats of the messages before it; None: nothing of it can be followed
    delay_s: float = 0.0  # how old it was when it came, at most: what its transport may have taken
    # How much further its stamp is behind the receiver's clock (negative) or ahead of it (positive) than usual since
    # connecting; None: no stamp, or many writers.
    stamp_change_s: float | None = None

    def age_s(self, now_s: float) -> float:
        """How old the value is, its transport included."""
        return self.silent_s(now_s) + self.delay_s

    def silent_s(self, now_s: float) -> float:
        """Since it came: of the messages, not of what they say."""
        return max(0.0, now_s - self.received_s)

    def is_fresh(self, now_s: float) -> bool:
        # Both ways: a reading from far in the future says that the clock went back, not that the value is new.
        silent_s = now_s - self.received_s
        return -self.horizon_s <= silent_s <= self.horizon_s - self.delay_s and self.delay_s <= DELAY_AT_MOST_S

    def is_coming(self, now_s: float) -> bool:
        """Whether messages come, however late they are."""
        return -self.horizon_s <= now_s - self.received_s <= self.horizon_s

    def freshness(self, now_s: float) -> Freshness:
        if not self.is_fresh(now_s):
            return "stale"
        if self.period_s is None:
            return "fresh"
        return "ageing" if self.age_s(now_s) > max(AGEING_PERIODS * self.period_s, AGEING_FLOOR_S) else "fresh"


@dataclass(frozen=True, slots=True, kw_only=True)
class Extent:
    """Lowest and highest headline number since connecting."""

    lowest: float
    highest: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Snapshot:
    """Everything known of a vehicle at one moment, immutable: any moment of a recording can be judged alone."""

    now_s: float
    readings: Mapping[str, Reading[Any]] = field(default_factory=dict)  # only signals that were ever heard or derived
    link: LinkFacts = field(default_factory=LinkFacts)
    rates: Mapping[str, Rate] = field(default_factory=dict)  # of every signal; up to 0.5 s old
    paused: bool = False
    paused_since_s: float | None = None
    heard_s: float | None = None  # when any signal last came
    unusable: Mapping[str, Unusable] = field(default_factory=dict)  # signals whose newest messages cannot be used
    extents: Mapping[str, Extent] = field(default_factory=dict)  # where a headline number was ever heard
    track: tuple[TrackPoint, ...] = ()  # where the car was, thinned and bounded, oldest first
    track_m: float | None = None  # distance driven since connecting; None: never had a position
    gps: GpsWatch = field(default_factory=GpsWatch)  # what the newest fixes tell of the receiver
    phone: PhoneView = NO_PHONE  # the operator's phone beside the car
    phones: tuple[PhoneView, ...] = ()  # every phone that tells where it is, in the order in which they came
    scan_before: Reading[LaserScan] | None = None  # some 0.4 s before the newest
    distance_before: Reading[Distance] | None = None
    standing_since_s: float | None = None  # when the car came to rest by its wheels; None: it moves, or cannot be told
    speed_slope_mps2: float | None = None  # how the wheels' speed changes, over 0.6 s; None: too little heard to tell
    clock_jump: ClockJump | None = None  # the newest since connecting
    recorder: RecorderFacts = field(default_factory=RecorderFacts)
    reach: ReachFacts | None = None  # whom an alarm would reach; None: nobody is asked, as in a recording
    slowing: SlowingFacts = field(default_factory=SlowingFacts)
    slow_proof: SlowProof = NOTHING_SHOWN  # what the car's speed shows of the order

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
        unusable = self.unusable.get(signal)
        if unusable is not None and (reading is None or not reading.is_fresh(self.now_s)):
            raise NotFresh(f"{label}: {unusable.words}", "unusable")
        if reading is None:
            if signal in self.link.published:
                raise NotFresh(f"{label}: nothing received yet", "no data")
            raise NotFresh(f"{label} is not published", "no data")
        if not reading.is_fresh(self.now_s):
            raise NotFresh(f"{label} is {reading.age_s(self.now_s):.1f} s old", "stale")
        return reading.value


_new_snapshot, _new_reading, _new_acceleration = maker(Snapshot), maker(Reading), maker(Acceleration)
_TELLING = frozenset({Twist, GpsFix, Odometry, Heading})  # from which something else is derived


class _Heard:
    """What the state keeps of one signal between messages."""

    __slots__ = ("alone", "count", "headline", "highest", "history", "lowest", "meter", "repeats", "stamps")

    def __init__(self, signal: Signal, set_hz: float | None, *, one_writer: bool) -> None:
        self.alone = (signal.name,)
        self.headline = signal.headline
        self.lowest, self.highest = math.inf, -math.inf  # headline since connecting
        self.history: ReadingHistory | None = None  # where a check wants to know
        self.meter = RateMeter(signal.expected_hz, set_hz)
        self.repeats = RepeatFollower()
        self.stamps = StampFollower() if one_writer else None
        self.count = 0

    def restart(self) -> None:
        """Measure anew: what comes now does not follow upon what came before."""
        self.meter.restart()
        self.repeats.restart()
        if self.stamps is not None:
            self.stamps.restart()


class State:
    """The one owner of what is known; only the session writes to it."""

    def __init__(self, expected_hz: Mapping[str, float] | None = None) -> None:
        self._expected_hz = dict(expected_hz or {})
        self.reset()

    def reset(self) -> None:
        """Forget everything but the operator's rates: another car, or monitoring begins anew."""
        self._heard = {
            name: _Heard(signal, self._expected_hz.get(name), one_writer=name not in MANY_WRITERS)
            for name, signal in SIGNALS.items()
        }
        self._readings: dict[str, Reading[Any]] = {}
        self._extents: dict[str, Extent] = {}
        # The view of both that snapshots share; what is shared is copied before it is changed.
        self._readings_shared: Mapping[str, Reading[Any]] | None = None
        self._extents_shared: Mapping[str, Extent] | None = None
        self._rates: Mapping[str, Rate] = MappingProxyType({})
        self._rates_at_s: float | None = None
        self._heard_s: float | None = None
        self._unusable: Mapping[str, Unusable] = MappingProxyType({})
        self._latest_s = -math.inf
        self._slope = Slope()
        self._slope_mps2: float | None = None
        self._wheels = Wheels()
        self._clock_jump: ClockJump | None = None
        self._standstill = Standstill()
        self._track = Track()
        self._headings = HeadingFusion()
        self._components = Components()
        self._gps_follower = GpsFollower()
        self._gps = GpsWatch()
        self._phones = Phones()
        self._fix_s = -math.inf  # when the newest position was sent
        self._rides: str | None = None
        self._scan_history = self._heard["scan"].history = ReadingHistory()
        self._distance_history = self._heard["distance"].history = ReadingHistory()
        # Read by whoever likes, written by `link` and `set_paused` alone: asked at every message.
        self.link_facts = LinkFacts()
        self.paused = False
        self._recorder = RecorderFacts()
        self._reach: ReachFacts | None = None
        self._slowing = SlowingFacts()
        self._slow_proof = ProofFollower()
        self._paused_since_s: float | None = None

    def expect(self, expected_hz: Mapping[str, float]) -> None:
        """The operator's rates [Hz] by signal; 0 or absent: learn the car's own."""
        self._expected_hz = dict(expected_hz)
        for name, heard in self._heard.items():
            heard.meter.expect(self._expected_hz.get(name))

    def receive(
        self, signal: str, value: Value, received_s: float, stamp_s: float | None = None, delay_s: float = 0.0
    ) -> tuple[str, ...]:
        """Take one decoded value; returns the signals that changed by it, derived ones included, for `Monitor.step`.

        `delay_s`: how old it was when it came, at most.
        """
        if received_s >= self._latest_s:
            self._latest_s = received_s
        else:
            self._follow_clock(received_s)
        heard = self._heard[signal]
        heard.count += 1
        meter = heard.meter
        meter.receive(received_s)
        self._heard_s = received_s
        if signal in self._unusable:
            self._unusable = MappingProxyType({name: one for name, one in self._unusable.items() if name != signal})
        kind = type(value)
        if kind is Twist:
            self._wheels.add(received_s, value.speed_mps)  # type: ignore[union-attr, arg-type]
            self._slow_proof.add(received_s, value.speed_mps)  # type: ignore[union-attr, arg-type]
        elif kind is Diagnostics:
            value = self._components.merge(value, received_s)  # type: ignore[arg-type]
        reading = _new_reading(
            value=value,
            received_s=received_s,
            stamp_s=stamp_s,
            horizon_s=meter.horizon_s,
            period_s=meter.period_s,
            count=heard.count,
            delay_s=delay_s,
            repeats=None
            if stamp_s is None and kind not in COMPARED
            else heard.repeats.receive(value, stamp_s, received_s, self._wheels),
            stamp_change_s=None if stamp_s is None else self._compare_clocks(signal, heard, stamp_s, received_s),
        )
        if self._readings_shared is not None:
            self._readings = self._readings.copy()
            self._readings_shared = None
        self._readings[signal] = reading
        if heard.history is not None:
            heard.history.add(reading)
        if heard.headline is not None:
            number = getattr(value, heard.headline, None)
            if number is not None and not heard.lowest <= number <= heard.highest:
                self._extend(heard, signal, number)
        if kind not in _TELLING:
            return heard.alone
        derived = self._derive(signal, reading)
        return heard.alone if derived is None else (signal, derived)

    def refuse(self, signal: str, reason: str, received_s: float) -> None:
        """A message came that says nothing usable of this signal, and why."""
        self._follow_clock(received_s)
        meter = self._heard[signal].meter
        meter.receive(received_s)
        self._heard_s = received_s
        before = self._unusable.get(signal)
        self._unusable = MappingProxyType(
            {
                **self._unusable,
                signal: Unusable(
                    reason=reason,
                    at_s=received_s,
                    since_s=received_s if before is None else before.since_s,
                    count=1 if before is None else before.count + 1,
                    horizon_s=meter.horizon_s,
                    period_s=meter.period_s,
                ),
            }
        )

    def hear_phone(self, word: PhoneWord, now_s: float) -> None:
        """What an operator's phone says of its own position; judged on the next tick."""
        self._follow_clock(now_s)
        self._phones.hear(word, now_s)

    def ride(self, phone: str | None, now_s: float) -> None:
        """Which phone rides in the car, as the operator says; None: nobody says."""
        self._follow_clock(now_s)
        self._rides = phone
        self._phones.ride(phone, now_s)

    # What `Snapshot` says of the newest moment, without a snapshot.

    def get(self, signal: str) -> Reading[Any] | None:
        return self._readings.get(signal)

    @property
    def now_s(self) -> float:
        return self._latest_s

    @property
    def gps(self) -> GpsWatch:
        return self._gps

    @property
    def scan_before(self) -> Reading[LaserScan] | None:
        return self._scan_history.before

    @property
    def distance_before(self) -> Reading[Distance] | None:
        return self._distance_history.before

    @property
    def standing_since_s(self) -> float | None:
        return self._standstill.since_s if self._is_fresh("speed", self._latest_s) else None

    def phones(self, now_s: float) -> int:
        """How many phones were heard within the last minute."""
        return self._phones.view.count if self._phones.view.is_there(now_s) else 0

    def link(self, facts: LinkFacts) -> None:
        """What is now known of the link. A link that opens (again) starts the measuring of rates anew."""
        before, self.link_facts = self.link_facts, facts
        if facts.opened_s is not None and facts.opened_s != before.opened_s:
            for heard in self._heard.values():
                heard.restart()
            self._clock_jump = None
            self._unusable = MappingProxyType({})

    def recorder(self, facts: RecorderFacts) -> None:
        """What is now known of the recorder."""
        self._recorder = facts

    @property
    def slowing(self) -> SlowingFacts:
        return self._slowing

    def slow(self, facts: SlowingFacts) -> None:
        """What is now known of an order to slow the car."""
        self._slowing = facts
        self._slow_proof.order(facts)

    def reach(self, facts: ReachFacts) -> None:
        """Whom an alarm would reach now."""
        self._reach = facts

    def set_paused(self, paused: bool, since_s: float | None = None) -> None:
        """Monitoring is paused or goes on. `since_s` is when the pause began, where it was not now."""
        self.paused = paused
        self._paused_since_s = since_s if paused else None

    def snapshot(self, now_s: float) -> Snapshot:
        """What is known at `now_s`, which later messages do not change."""
        self._follow_clock(now_s)
        if self.paused and self._paused_since_s is None:
            self._paused_since_s = now_s
        readings, extents = self._readings_shared, self._extents_shared
        if readings is None:
            readings = self._readings_shared = MappingProxyType(self._readings)
        if extents is None:
            extents = self._extents_shared = MappingProxyType(self._extents)
        return _new_snapshot(
            now_s=now_s,
            readings=readings,
            link=self.link_facts,
            rates=self._measure(now_s),
            paused=self.paused,
            paused_since_s=self._paused_since_s,
            heard_s=self._heard_s,
            unusable=self._unusable,
            extents=extents,
            track=self._track.points,
            track_m=self._track.distance_m,
            gps=self._gps,
            phone=self._phones.view,
            phones=self._phones.views,
            scan_before=self._scan_history.before,
            distance_before=self._distance_history.before,
            standing_since_s=self._standstill.since_s if self._is_fresh("speed", now_s) else None,
            speed_slope_mps2=self._slope_mps2,
            clock_jump=self._clock_jump,
            recorder=self._recorder,
            reach=self._reach,
            slowing=self._slowing,
            slow_proof=self._slow_proof.proof,
        )

    def glance(self, now_s: float) -> Snapshot:
        """As `snapshot`, for showing only: whether and when anybody looks changes nothing of what is judged later."""
        kept = self._rates_at_s, self._rates, self._latest_s
        try:
            return self.snapshot(now_s)
        finally:
            self._rates_at_s, self._rates, self._latest_s = kept

    def _follow_clock(self, at_s: float) -> None:
        """When the clock goes back, what is known keeps its age; else old values would look new for a long time."""
        if at_s >= self._latest_s:
            self._latest_s = at_s
            return
        shift_s = at_s - self._latest_s
        if shift_s > -CLOCK_BACK_S:
            return  # a message waited a moment between its arrival and here
        self._latest_s = at_s
        self._slow_proof.forget()
        self._fix_s = -math.inf
        self._phones = Phones()  # they speak again within seconds
        self._phones.ride(self._rides, at_s)
        self._readings = {
            name: replace(reading, received_s=reading.received_s + shift_s) for name, reading in self._readings.items()
        }
        self._readings_shared = None
        self._unusable = MappingProxyType({})
        if self._heard_s is not None:
            self._heard_s += shift_s
        if self._paused_since_s is not None:
            self._paused_since_s += shift_s
        self._clock_jump = None
        for heard in self._heard.values():
            heard.restart()

    def _compare_clocks(self, signal: str, heard: _Heard, stamp_s: float, received_s: float) -> float | None:
        stamps = heard.stamps
        if stamps is None:
            return None
        jump_s = stamps.receive(stamp_s, received_s)
        if jump_s is not None:
            self._clock_jump = merged(self._clock_jump, signal, received_s, jump_s)
        return stamps.change_s

    def _derive(self, signal: str, reading: Reading[Any]) -> str | None:
        """Follow what this reading tells of other signals; the name of the derived signal that changed."""
        value, at_s = reading.value, reading.received_s
        match value:
            case Twist():
                return self._derive_acceleration(reading)
            case GpsFix():
                speed_mps = self._readings["speed"].value.speed_mps if self._is_fresh("speed", at_s) else None
                is_standing = None if speed_mps is None else self._standstill.is_standing
                self._track.receive(value, at_s, speed_mps, is_standing)
                standing_since_s = None if speed_mps is None else self._standstill.since_s
                self._gps = self._gps_follower.receive(value, at_s, reading.stamp_s, standing_since_s)
                self._fix_s = max(self._fix_s, at_s - reading.delay_s)  # the phone's time is when it was measured too
                self._phones.car(value, self._fix_s)
                heading = self._headings.on_course(
                    self._track.course_deg, speed_mps, yaw_is_fresh=self._is_fresh("odometry", at_s)
                )
                return self._derived("heading", heading, signal, reading)
            case Odometry():
                return self._derived("heading", self._headings.on_odometry(value), signal, reading)
            case Heading():
                self._headings.is_published = True
        return None

    def _derive_acceleration(self, reading: Reading[Twist]) -> str | None:
        speed_mps = reading.value.speed_mps
        self._standstill.add(reading.received_s, speed_mps)
        # The car's own stamps are free of the jitter of the way here, where there are any.
        at_s = reading.received_s if reading.stamp_s is None else reading.stamp_s
        slope_mps2 = self._slope_mps2 = self._slope.add(at_s, speed_mps)
        if slope_mps2 is None or self._heard["acceleration"].count:
            return None
        acceleration = _new_acceleration(acceleration_mps2=slope_mps2, source="speed")
        return self._derived("acceleration", acceleration, "speed", reading)

    def _derived(self, signal: str, value: Value | None, source: str, reading: Reading[Any]) -> str | None:
        if value is None:
            return None
        if self._readings_shared is not None:
            self._readings = self._readings.copy()
            self._readings_shared = None
        self._readings[signal] = _new_reading(
            value=value,
            received_s=reading.received_s,
            stamp_s=reading.stamp_s,
            horizon_s=reading.horizon_s,
            period_s=reading.period_s,
            delay_s=reading.delay_s,
            derived_from=source,
        )
        heard = self._heard[signal]
        number = None if heard.headline is None else getattr(value, heard.headline, None)
        if number is not None:
            self._extend(heard, signal, number)
        return signal

    def _is_fresh(self, signal: str, now_s: float) -> bool:
        reading = self._readings.get(signal)
        return reading is not None and reading.is_fresh(now_s)

    def _measure(self, now_s: float) -> Mapping[str, Rate]:
        at_s = self._rates_at_s
        if at_s is None or not 0.0 <= now_s - at_s < RATES_EVERY_S:
            self._rates_at_s = now_s
            self._rates = MappingProxyType({name: heard.meter.rate(now_s) for name, heard in self._heard.items()})
        return self._rates

    def _extend(self, heard: _Heard, signal: str, number: float) -> None:
        if heard.lowest <= number <= heard.highest or not math.isfinite(number):
            return
        heard.lowest, heard.highest = min(heard.lowest, number), max(heard.highest, number)
        if self._extents_shared is not None:
            self._extents = self._extents.copy()
            self._extents_shared = None
        self._extents[signal] = Extent(lowest=heard.lowest, highest=heard.highest)
