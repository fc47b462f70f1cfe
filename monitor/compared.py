"""Further sources of what a signal shows: kept beside it, to be compared with it and never to take its place."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from monitor.geo import offset_m
from monitor.pace import Pace, PlaceFollower, SourceClock, SpeedFollower
from monitor.rates import RateMeter
from monitor.reading import Reading
from monitor.shell_facts import LinkFacts
from monitor.values import GpsFix, Odometry, Twist

MOST_OTHERS = 8  # of one signal
SIGMA_UNKNOWN_M = 2.5  # of a receiver without quality
POSE_SIGMA_M = 0.5  # of a pose, whose own error is often left out


@dataclass(frozen=True, slots=True, kw_only=True)
class Other:
    """A further source of a signal."""

    topic: str
    reading: Reading[Any]  # the newest
    stated: Pace | None = None  # by the speed that it states
    made: Pace | None = None  # by its places


@dataclass(frozen=True, slots=True, kw_only=True)
class Compared:
    """What may be compared, at one moment."""

    others: Mapping[str, tuple[Other, ...]] = field(default_factory=dict)  # by signal, in the order they came
    stated: Mapping[str, Pace | None] = field(default_factory=dict)  # by the signal's own speeds
    made: Mapping[str, Pace | None] = field(default_factory=dict)  # by the signal's own places
    # By signal: further topics of which nothing came, and since when they are awaited.
    awaited: Mapping[str, Mapping[str, float]] = field(default_factory=dict)

    def of(self, signal: str) -> tuple[Other, ...]:
        """The further sources of a signal."""
        return self.others.get(signal, ())


NOTHING_COMPARED = Compared()


MOTION = frozenset({"speed", "odometry", "position"})  # signals whose sources are compared with each other
MOVING = frozenset({Twist, Odometry, GpsFix})  # values that show how the car moves


class SourceFollower:
    """Follows the motion that one source shows."""

    __slots__ = ("_clock", "_last", "_places", "_speeds", "_x_m", "_y_m")

    def __init__(self) -> None:
        self._speeds: SpeedFollower | None = None
        self._places: PlaceFollower | None = None
        self._clock = SourceClock()
        self._last: GpsFix | None = None
        self._x_m = self._y_m = 0.0

    @property
    def stated(self) -> Pace | None:
        return None if self._speeds is None else self._speeds.pace

    @property
    def made(self) -> Pace | None:
        return None if self._places is None else self._places.pace

    def receive(self, reading: Reading[Any]) -> bool:
        """One reading; values that show no motion are left out. Whether it showed another pace."""
        value = reading.value
        speeds, places = self._speeds, self._places
        stated, made = None if speeds is None else speeds.pace, None if places is None else places.pace
        kind = type(value)
        if kind is Twist:
            self._state(reading.received_s, value.speed_mps)
        elif kind is Odometry:
            if value.speed_mps is not None:
                self._state(reading.received_s, value.speed_mps)
            self._place(self._clock.time_s(reading.received_s, reading.stamp_s), value.x_m, value.y_m, POSE_SIGMA_M)
        elif kind is GpsFix:
            self._fix(self._clock.time_s(reading.received_s, reading.stamp_s), value)
        return self.stated is not stated or self.made is not made

    def _state(self, at_s: float, mps: float) -> None:
        if self._speeds is None:
            self._speeds = SpeedFollower()
        self._speeds.add(at_s, mps)

    def _fix(self, at_s: float, fix: GpsFix) -> None:
        if fix.status < 0 or not (math.isfinite(fix.lat_deg) and math.isfinite(fix.lon_deg)):
            self._last = None
            if self._places is not None:
                self._places.restart()
            return
        if self._places is not None and not self._places.is_due(at_s):
            return
        last, self._last = self._last, fix
        if last is not None:
            east_m, north_m = offset_m(last.lat_deg, last.lon_deg, fix.lat_deg, fix.lon_deg)
            self._x_m, self._y_m = self._x_m + east_m, self._y_m + north_m
        self._place(at_s, self._x_m, self._y_m, SIGMA_UNKNOWN_M if fix.sigma_m is None else fix.sigma_m)

    def _place(self, at_s: float, x_m: float, y_m: float, sigma_m: float) -> None:
        if self._places is None:
            self._places = PlaceFollower()
        self._places.add(at_s, x_m, y_m, sigma_m)


class Comparisons:
    """Follows the sources of one vehicle: those of the signals, and at most eight others of each signal."""

    def __init__(self) -> None:
        self._own: dict[str, SourceFollower] = {}
        self._others: dict[str, dict[str, tuple[RateMeter, SourceFollower, Other]]] = {}
        self._awaited: dict[str, dict[str, float]] = {}
        self._came: set[tuple[str, str]] = set()  # signal and topic of what was awaited and sent anything
        self._is_awaiting = False  # `_awaited` is of the link that is open
        self._link = LinkFacts()
        self._has_several = True  # sources of the motion, as far as is known
        self._known: Compared | None = NOTHING_COMPARED

    def link(self, facts: LinkFacts, now_s: float) -> None:
        """Set what is compared from now on. The history of what is not compared any more is dropped; so is what another
        topic carried of a signal."""
        before, self._link = self._link, facts
        if facts.opened_s is not None and facts.opened_s != before.opened_s:
            self.opened()
        if facts.carriers is not before.carriers:
            for signal, topic in before.carriers.items():
                if facts.carriers.get(signal, topic) != topic:
                    self.forget(signal)
        if facts.carriers is not before.carriers or facts.compared is not before.compared:
            is_known = facts.compared is not None and bool(facts.carriers)
            self._has_several = not is_known or bool(facts.compared) or len(facts.carriers.keys() & MOTION) > 1
        wanted = facts.compared
        if wanted is None or facts.opened_s is None or (wanted is before.compared and self._is_awaiting):
            return
        self._is_awaiting, since_s = True, max(now_s, facts.opened_s)
        self._others = {
            signal: {topic: row for topic, row in rows.items() if topic in wanted.get(signal, ())}
            for signal, rows in self._others.items()
        }
        self._awaited = {
            signal: {
                topic: self._awaited.get(signal, {}).get(topic, since_s)
                for topic in topics
                if topic not in self._others.get(signal, {}) and (signal, topic) not in self._came
            }
            for signal, topics in wanted.items()
        }
        self._known = None

    def receive(self, signal: str, reading: Reading[Any]) -> None:
        """A reading of the signal itself."""
        if type(reading.value) not in MOVING or not self._has_several:
            return
        follower = self._own.get(signal)
        if follower is None:
            follower = self._own[signal] = SourceFollower()
        if follower.receive(reading):
            self._known = None

    def receive_other(
        self, signal: str, topic: str, value: Any, received_s: float, stamp_s: float | None, delay_s: float
    ) -> None:
        """A value of a further source, None: one that cannot be used; of more than eight topics of one signal the later
        ones are left out."""
        if self._awaited.get(signal, {}).pop(topic, None) is not None:
            self._came.add((signal, topic))
            self._known = None
        if value is None:
            return
        known = self._others.setdefault(signal, {})
        if topic not in known and len(known) >= MOST_OTHERS:
            return
        meter, follower, before = known.get(topic) or (RateMeter(None), SourceFollower(), None)
        meter.receive(received_s)
        reading = Reading(
            value=value,
            received_s=received_s,
            stamp_s=stamp_s,
            horizon_s=meter.horizon_s,
            period_s=meter.period_s,
            count=1 if before is None else before.reading.count + 1,
            delay_s=delay_s,
        )
        follower.receive(reading)
        known[topic] = (
            meter,
            follower,
            Other(topic=topic, reading=reading, stated=follower.stated, made=follower.made),
        )
        self._known = None

    def forget(self, signal: str) -> None:
        """The values of the signal itself are void: their unit was another."""
        self._own.pop(signal, None)
        self._known = None

    def restart(self) -> None:
        """The clock went back: no age of what came before is known."""
        self._own.clear()
        self.opened()

    def opened(self) -> None:
        """The link opens: the others must come anew."""
        self._others.clear()
        self._awaited.clear()
        self._came.clear()
        self._is_awaiting = False
        self._known = None

    @property
    def known(self) -> Compared:
        """What may be compared now; later messages do not change it."""
        found = self._known
        if found is None:
            found = self._known = Compared(
                others=MappingProxyType(
                    {signal: tuple(row[2] for row in rows.values()) for signal, rows in self._others.items()}
                ),
                stated=MappingProxyType({signal: one.stated for signal, one in self._own.items()}),
                made=MappingProxyType({signal: one.made for signal, one in self._own.items()}),
                awaited=MappingProxyType({signal: dict(topics) for signal, topics in self._awaited.items() if topics}),
            )
        return found
