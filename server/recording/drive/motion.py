"""How the car moved in a drive: distance, speed, steering and place over time, and when nothing was heard of it.

Times are seconds since the beginning of the recording.
"""

from __future__ import annotations

import math
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Collection
from dataclasses import dataclass, field
from typing import Any, Literal

from monitor.drive_trends import BLIND_S
from monitor.state import State
from monitor.values import GpsFix, Steering
from server.judge.offline import Observer

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

    def __init__(self, length_s: float, *, speed: str = "speed") -> None:
        """`speed`: the signal that has it."""
        self.speed = Course()
        self.steering = Course()  # percent, negative = left
        self.places: list[tuple[float, float, float]] = []  # s, latitude, longitude [deg]
        self.blind: list[tuple[float, float]] = []  # no message of any signal came
        self._length_s = length_s
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

    def blind_spans(self) -> list[tuple[float, float]]:
        """When nothing was heard, the end of the recording included."""
        end = [(self._heard_s, self._length_s)] if self._length_s - self._heard_s > BLIND_S else []
        return self.blind + end

    def message_received(self, topic: str, now_s: float) -> None:
        """Notes when nothing was heard."""
        if now_s - self._heard_s > BLIND_S:
            self.blind.append((self._heard_s, now_s))
        self._heard_s = max(self._heard_s, now_s)

    def value_decoded(self, signal: str, value: Any, now_s: float, stamp_s: float | None) -> None:
        """Speed, steering and place."""
        if signal == self._speed:
            self._drive(getattr(value, "speed_mps", math.nan), now_s)
        elif isinstance(value, Steering) and math.isfinite(value.percent):
            self.steering.add(now_s, value.percent)
        elif isinstance(value, GpsFix) and value.status >= 0 and len(self.places) < MOST_PLACES:
            if math.isfinite(value.lat_deg) and math.isfinite(value.lon_deg):
                if not self.places or now_s - self.places[-1][0] >= LEAST_STEP_S:
                    self.places.append((now_s, value.lat_deg, value.lon_deg))

    def signals_changed(self, changed: Collection[str], state: State, now_s: float) -> None:
        """The distance as the operator saw it."""
        if "position" in changed and (track_m := state.track_m) is not None:
            self._by_position.add(now_s, track_m)

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
