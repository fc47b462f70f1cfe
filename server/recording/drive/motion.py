"""How the car moved in a drive: distance, speed, steering and place over time, and when nothing was received of it.

Times are seconds since the beginning of the recording.
"""

from __future__ import annotations

import math
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field
from typing import Any, Literal

from monitor.drive_trends import BLIND_S
from monitor.geo import distance_m
from monitor.state import State
from monitor.values import GpsFix, MotionCommand, Steering
from server.judge.offline import Observer
from server.recording.drive.parts import Span, outside

LEAST_STEP_S = 0.1  # two numbers of a course are at least so far apart
FASTEST_MPS = 1000.0  # what is faster is no speed of a car
MOST_PLACES = 50_000
Source = Literal["position", "speed"]


@dataclass(slots=True)
class Course:
    """Numbers over time, in order."""

    at_s: array[float] = field(default_factory=lambda: array("d"))
    values: array[float] = field(default_factory=lambda: array("d"))

    def add(self, at_s: float, value: float) -> None:
        """One more, where enough time has passed since the last."""
        if not self.at_s or at_s - self.at_s[-1] >= LEAST_STEP_S:
            self.at_s.append(at_s)
            self.values.append(value)

    def at(self, at_s: float, longest_s: float = BLIND_S) -> float | None:
        """The last value not after a moment; None where there is none, or it is older than `longest_s`."""
        place = bisect_right(self.at_s, at_s) - 1
        return self.values[place] if place >= 0 and at_s - self.at_s[place] <= longest_s else None

    def last(self, at_s: float) -> tuple[float, float] | None:
        """The last moment not after this one that has a value, and the value; None: there is none."""
        place = bisect_right(self.at_s, at_s) - 1
        return (self.at_s[place], self.values[place]) if place >= 0 else None

    def between(self, from_s: float, to_s: float) -> list[tuple[float, float]]:
        """Moments and values after one moment and before another."""
        first, last = bisect_right(self.at_s, from_s), bisect_left(self.at_s, to_s)
        return list(zip(self.at_s[first:last], self.values[first:last], strict=True))


class Motion(Observer):
    """Follows a run through a recording, without judging it."""

    def __init__(self, length_s: float, *, speed: str = "speed", gaps: Sequence[Span] = ()) -> None:
        """`speed`: the signal that has it; `gaps`: times between two parts, whose way is not counted as driven."""
        self.speed = Course()
        self.steering = Course()  # percent, negative = left
        self.commanded = Course()  # speed
        self.sigma_m = Course()  # of the positions
        self.places: list[tuple[float, float, float]] = []  # s, latitude, longitude [deg]
        self.blind: list[tuple[float, float]] = []  # no message of any signal came
        self._length_s = length_s
        self._gaps = gaps
        self._left_out_m = 0.0  # the way over the gaps
        self._last_track: tuple[float, float] | None = None
        self._speed = speed
        self._by_position = Course()
        self._by_speed = Course()
        self._driven_m = 0.0
        self._last: tuple[float, float] | None = None  # the newest speed
        self._heard_s = 0.0

    @property
    def source(self) -> Source | None:
        """By what the distance is known; None: not at all."""
        return "position" if self._by_position.at_s else "speed" if self._by_speed.at_s else None

    @property
    def distance_m(self) -> float | None:
        """All of it; None: not known."""
        course = self._course()
        return max(course.values, default=None) if course is not None else None

    def odometer(self) -> tuple[array[float], array[float]]:
        """The distance over time: moments, and metres that never grow less. Only where `source` is known."""
        course = self._course()
        return (array("d"), array("d")) if course is None else (course.at_s, course.values)

    def until(self, at_s: float) -> float | None:
        """The distance driven until a moment; None: not known. Between two numbers it grows evenly."""
        course = self._course()
        if course is None:
            return None
        times, values = course.at_s, course.values
        place = bisect_right(times, at_s)
        if place == 0:
            return 0.0
        if place == len(times):
            return values[-1]
        share = (at_s - times[place - 1]) / (times[place] - times[place - 1])
        return values[place - 1] + share * (values[place] - values[place - 1])

    def when(self, at_m: float) -> float | None:
        """When the car had driven so far; between two numbers its distance grew evenly. None: not known, or never."""
        times, metres = self.odometer()
        place = bisect_left(metres, at_m)
        if place == len(times):
            return None
        if place == 0 or metres[place] <= metres[place - 1]:
            return times[place]
        share = (at_m - metres[place - 1]) / (metres[place] - metres[place - 1])
        return times[place - 1] + share * (times[place] - times[place - 1])

    def apart_m(self, from_s: float, to_s: float) -> float | None:
        """How far apart the car was, as the crow flies, before and after a time without positions; None: not known."""
        times = [place[0] for place in self.places]
        before, after = bisect_right(times, from_s) - 1, bisect_left(times, to_s)
        if before < 0 or after == len(times):
            return None
        return distance_m(*self.places[before][1:], *self.places[after][1:])

    def blind_spans(self) -> list[tuple[float, float]]:
        """When nothing was received, the end of the recording included."""
        spans = [*self.blind, (self._heard_s, self._length_s)]
        pieces = [piece for span in spans for piece in outside(span, self._gaps)]
        return [(from_s, to_s) for from_s, to_s in pieces if to_s - from_s > BLIND_S]

    def message_received(self, topic: str, now_s: float) -> None:
        """Note when nothing was received."""
        if now_s - self._heard_s > BLIND_S:
            self.blind.append((self._heard_s, now_s))
        self._heard_s = max(self._heard_s, now_s)

    def value_decoded(self, signal: str, value: Any, now_s: float, stamp_s: float | None) -> None:
        """Speed, steering and place."""
        if signal == self._speed:
            self._drive(getattr(value, "speed_mps", math.nan), now_s)
        elif isinstance(value, Steering) and math.isfinite(value.percent):
            self.steering.add(now_s, value.percent)
        elif isinstance(value, MotionCommand) and value.speed_mps is not None:
            self.commanded.add(now_s, value.speed_mps)
        elif isinstance(value, GpsFix) and value.status >= 0:
            self._place(value, now_s)

    def following_mps(self, at_s: float) -> float | None:
        """The speed minus the commanded speed; None: one of them is not known then."""
        speed, wanted = self.speed.at(at_s), self.commanded.at(at_s)
        return None if speed is None or wanted is None else speed - wanted

    def _place(self, value: GpsFix, now_s: float) -> None:
        if value.sigma_m is not None and math.isfinite(value.sigma_m):
            self.sigma_m.add(now_s, value.sigma_m)
        if len(self.places) < MOST_PLACES:
            if math.isfinite(value.lat_deg) and math.isfinite(value.lon_deg):
                if not self.places or now_s - self.places[-1][0] >= LEAST_STEP_S:
                    self.places.append((now_s, value.lat_deg, value.lon_deg))

    def signals_changed(self, changed: Collection[str], state: State, now_s: float) -> None:
        """The distance as the operator saw it."""
        if "position" in changed and state.track_m is not None:
            track_m = state.track_m + state.track_ahead_m  # to where the car is: what is smoothed ends before it
            last_s, last_m = self._last_track or (now_s, track_m)
            if any(last_s <= from_s and to_s <= now_s for from_s, to_s in self._gaps):
                self._left_out_m += track_m - last_m
            self._last_track = now_s, track_m
            self._by_position.add(now_s, max([track_m - self._left_out_m, *self._by_position.values[-1:]]))

    def _drive(self, speed_mps: float, now_s: float) -> None:
        if not abs(speed_mps) < FASTEST_MPS:
            return
        if self._last is not None and 0.0 < now_s - self._last[0] <= BLIND_S:
            self._driven_m += (abs(self._last[1]) + abs(speed_mps)) / 2 * (now_s - self._last[0])
        self._last = now_s, speed_mps
        self.speed.add(now_s, speed_mps)
        self._by_speed.add(now_s, self._driven_m)

    def _course(self) -> Course | None:
        return {"position": self._by_position, "speed": self._by_speed, None: None}[self.source]
