"""How fast one source shows that the car moves, over some seconds: by the speeds it states, or by its places."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

WINDOW_S = 3.0  # long against the noise of places and against latency, short for the operator
KEPT_EVERY_S = 0.2
FRESH_EVERY_S = 0.5  # a mean of 3 s does not change faster
SOONEST_S = 0.8 * KEPT_EVERY_S  # of places, which come about then
GAP_S = 2.5  # a receiver of 1 Hz that misses a fix
LEAST = 3  # samples within the window
FASTEST_MPS = 70.0
LEAP_M = 5.0  # a step of more than this, and faster than any car, begins the window anew
ERROR_SIGMAS = 3.0
STAMPS_WITHIN = 0.7  # of the time between two arrivals, which a slow link changes by two seconds at most


class Pace(NamedTuple):
    """How fast the car moved over the last 3 s, by one source. A tuple, because it is a key in each tick."""

    mps: float  # 0 or more: the size of a velocity is the same in every frame
    changed_mps: float = 0.0  # how much the speed changed within that time; of places 0
    error_mps: float = 0.0  # what the noise of the source may make of it
    is_live: bool = True  # False: it never had another value than the first, so it may not be filled


class SourceClock:
    """The time of a source's messages: by its own stamps, since Wi-Fi bunches arrivals; by their arrival while
    the stamps do not go on as time does."""

    __slots__ = ("_from", "_is_by_stamp", "_received_s")

    def __init__(self) -> None:
        self._is_by_stamp = True
        self._from: tuple[float, float] | None = None  # arrival and stamp that later ones are compared with
        self._received_s = -math.inf

    def time_s(self, received_s: float, stamp_s: float | None) -> float:
        """The time of one message [s], on a clock that is another one where the stamps turn out to be wrong."""
        last_s, self._received_s = self._received_s, received_s
        if stamp_s is None:
            return received_s
        if self._from is None or not 0.0 <= received_s - last_s <= GAP_S:
            self._from = received_s, stamp_s
        span_s = received_s - self._from[0]
        if span_s >= WINDOW_S:
            self._is_by_stamp = abs(stamp_s - self._from[1] - span_s) <= STAMPS_WITHIN * span_s
            self._from = received_s, stamp_s
        return stamp_s if self._is_by_stamp else received_s


class SpeedFollower:
    """Means of the speeds that one source states."""

    __slots__ = ("_at_s", "_is_live", "_made_s", "_mps", "_samples", "_way_m", "pace")

    def __init__(self) -> None:
        self._samples: deque[tuple[float, float]] = deque(maxlen=64)  # s, way made until then m
        self._is_live = False
        self._restart()

    def _restart(self) -> None:
        self._samples.clear()
        self._at_s: float | None = None
        self._made_s = -math.inf
        self._mps = self._way_m = 0.0
        self.pace: Pace | None = None

    def add(self, at_s: float, mps: float) -> None:
        """One speed [m/s], backwards negative where the source reports it."""
        if not math.isfinite(mps):
            return
        if self._at_s is not None:
            span_s = at_s - self._at_s
            if not 0.0 <= span_s <= GAP_S:
                self._restart()
            else:
                self._way_m += (mps + self._mps) / 2 * span_s
        self._at_s, self._mps = at_s, mps
        self._is_live = self._is_live or mps != 0.0
        samples = self._samples
        if not samples or at_s - samples[-1][0] >= KEPT_EVERY_S:
            samples.append((at_s, self._way_m))
            while len(samples) > LEAST and at_s - samples[1][0] >= WINDOW_S:
                samples.popleft()
            if at_s - self._made_s >= FRESH_EVERY_S:
                self._made_s, self.pace = at_s, self._measured()

    def _measured(self) -> Pace | None:
        samples = self._samples
        (first_s, first_m), (mid_s, mid_m), (last_s, last_m) = samples[0], samples[len(samples) // 2], samples[-1]
        if len(samples) < LEAST or last_s - first_s < WINDOW_S:
            return None
        before_mps = (mid_m - first_m) / (mid_s - first_s)
        after_mps = (last_m - mid_m) / (last_s - mid_s)
        return Pace(
            mps=abs(last_m - first_m) / (last_s - first_s),
            changed_mps=2.0 * abs(after_mps - before_mps),
            is_live=self._is_live,
        )


class PlaceFollower:
    """The velocity that one source's places show: slopes of the least-squares lines through them."""

    __slots__ = ("_is_live", "_made_s", "_places", "pace")

    def __init__(self) -> None:
        self._places: deque[tuple[float, float, float, float]] = deque(maxlen=64)  # s, x m, y m, sigma m
        self._is_live = False
        self.restart()

    def restart(self) -> None:
        """Discard what came before: it proves nothing about what follows."""
        self._places.clear()
        self._made_s = -math.inf
        self.pace: Pace | None = None

    def is_due(self, at_s: float) -> bool:
        """Whether a place of this time would be kept."""
        return not self._places or not 0.0 <= at_s - self._places[-1][0] < SOONEST_S

    def add(self, at_s: float, x_m: float, y_m: float, sigma_m: float) -> None:
        """One place on a plane [m] with its error; `at_s` by the source's own clock where it has one."""
        places = self._places
        if places:
            last_s, last_x_m, last_y_m, _ = places[-1]
            span_s, step_m = at_s - last_s, math.hypot(x_m - last_x_m, y_m - last_y_m)
            if 0.0 <= span_s < SOONEST_S:
                return
            if not 0.0 < span_s <= GAP_S or step_m > LEAP_M + FASTEST_MPS * span_s:
                self.restart()
            elif step_m > 0.0:
                self._is_live = True
        places.append((at_s, x_m, y_m, sigma_m))
        while len(places) > LEAST and at_s - places[1][0] >= WINDOW_S:
            places.popleft()
        if at_s - self._made_s >= FRESH_EVERY_S:
            self._made_s, self.pace = at_s, self._measured()

    def _measured(self) -> Pace | None:
        places = self._places
        span_s = places[-1][0] - places[0][0]
        if len(places) < LEAST or span_s < WINDOW_S - KEPT_EVERY_S:
            return None
        n = len(places)
        mean_s = sum(place[0] for place in places) / n
        spread = along_x = along_y = 0.0
        for at_s, x_m, y_m, _ in places:
            off_s = at_s - mean_s
            spread += off_s * off_s
            along_x += off_s * x_m
            along_y += off_s * y_m
        # Two places with an error each, over the whole window: a line through more of them is no worse.
        error_mps = ERROR_SIGMAS * math.sqrt(2.0) * max(place[3] for place in places) / span_s
        return Pace(mps=math.hypot(along_x, along_y) / spread, error_mps=error_mps, is_live=self._is_live)
