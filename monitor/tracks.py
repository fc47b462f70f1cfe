"""Where the car has been and how far it has driven, from positions that are never quite still; and its last seconds."""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterable
from dataclasses import dataclass

from monitor.geo import Plane, course_deg, offset_m
from monitor.values import GpsFix

TRAIL_KEPT_S = 15.0
MOST_OF_TRAIL = 512
TRAIL_GAP_S = 2.0  # after a longer one the car may have been anywhere
VELOCITY_S = 1.0  # over this long, so that the noise of single fixes is no speed
SIGMA_UNKNOWN_M = 5.0  # of a receiver whose covariance cannot be trusted

SMOOTH_S = 1.0  # the place of the car is the mean of this long: takes the noise of single fixes off the length
LOOK_BACK_S = 2.5  # over this long the positions show whether and where the car moves
ENDS_S = 0.5  # of that, what is averaged at either end …
SPAN_S = 1.0  # … and the least distance of the ends
MOVES_ABOVE_MPS = 0.5  # drift of a standing receiver stays below (19 m in a minute at the worst); a walk is above
STANDS_BELOW_MPS = 0.3
CHORD_M = 1.0  # the way is summed in chords of at least this, or of two sigma of a receiver that reports its own
CHORD_AT_MOST_M = 10.0
GAP_S = 5.0  # after a longer gap the current wheel speed proves nothing about the distance in it
FASTEST_MPS = 70.0
JUMP_M = 10.0
POINTS = 2000
FAR_M = 20_000.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Place:
    """The car at one moment."""

    lat_deg: float
    lon_deg: float
    sigma_m: float  # one sigma per axis
    velocity_mps: tuple[float, float]  # over ground: east, north


class Trail:
    """The newest positions of the car, by the time they were received; bounded by time and number."""

    def __init__(self) -> None:
        self._fixes: deque[tuple[float, float, float, float]] = deque(
            maxlen=MOST_OF_TRAIL
        )  # s, latitude, longitude, sigma m

    @property
    def newest_s(self) -> float:
        """When the newest position came; −Infinity without any."""
        return self._fixes[-1][0] if self._fixes else -math.inf

    def add(self, fix: GpsFix, at_s: float) -> None:
        """One position. Without a fix, and when the clock went back, the positions before are discarded."""
        fixes = self._fixes
        if fix.status < 0 or not (math.isfinite(fix.lat_deg) and math.isfinite(fix.lon_deg)):
            fixes.clear()
            return
        if fixes and at_s < fixes[-1][0]:
            fixes.clear()
        fixes.append((at_s, fix.lat_deg, fix.lon_deg, SIGMA_UNKNOWN_M if fix.sigma_m is None else fix.sigma_m))
        while fixes[0][0] < at_s - TRAIL_KEPT_S:
            fixes.popleft()

    def at(self, moment_s: float) -> Place | None:
        """The car's position at that time, interpolated linearly between two positions; None: unknown."""
        found = self._between(moment_s)
        if found is None:
            return None
        lat_deg, lon_deg, sigma_m = found
        before_s = moment_s - VELOCITY_S
        before = self._between(before_s)
        if before is None and moment_s - self._fixes[0][0] >= VELOCITY_S / 2:  # the trail has just started
            before_s, *_ = self._fixes[0]
            before = self._fixes[0][1:]
        velocity_mps = (0.0, 0.0)
        if before is not None:
            east_m, north_m = offset_m(before[0], before[1], lat_deg, lon_deg)
            velocity_mps = (east_m / (moment_s - before_s), north_m / (moment_s - before_s))
        return Place(lat_deg=lat_deg, lon_deg=lon_deg, sigma_m=sigma_m, velocity_mps=velocity_mps)

    def _between(self, moment_s: float) -> tuple[float, float, float] | None:
        after: tuple[float, float, float, float] | None = None
        for fix in reversed(self._fixes):
            if fix[0] <= moment_s:
                if fix[0] == moment_s:
                    return fix[1:]
                if after is None or after[0] - fix[0] > TRAIL_GAP_S:
                    return None
                share = (moment_s - fix[0]) / (after[0] - fix[0])
                lon_deg = fix[2] + share * math.remainder(after[2] - fix[2], 360.0)
                return (
                    fix[1] + share * (after[1] - fix[1]),
                    math.remainder(lon_deg, 360.0),
                    max(fix[3], after[3]),
                )
            after = fix
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class TrackPoint:
    """One place the car was at."""

    at_s: float  # received
    lat_deg: float
    lon_deg: float
    distance_m: float  # driven until here
    is_jump: bool = False  # the car did not drive from the point before to this one: draw no line
    is_after_gap: bool = False  # for a while before it no position came: the way from the point before is not known
    number: int = 0  # of this track, from 1 on; thinning leaves numbers out


class Track:
    """Follows the positions of a car.

    Standing receivers drift and single fixes jump about, so their sum grows without a car moving. Here the way grows
    only while the car moves: by its wheels where they are known, else by what the positions show over 2.5 s; and it is
    the sum of chords between smoothed places. A leap which no car can make breaks the track and is no way driven.
    """

    def __init__(self) -> None:
        self.points: tuple[TrackPoint, ...] = ()
        self.course_deg: float | None = None  # of the motion over ground at the newest fix; None: standing or unknown
        self._plane: Plane | None = None
        self._fixes: deque[tuple[float, float, float]] = deque(maxlen=512)  # (s, east m, north m)
        self._anchor: tuple[float, float] | None = None
        self._driven_m = 0.0  # up to the anchor
        self._shown_m: float | None = None
        self._moves: bool | None = None  # by the newest fix; None: too few fixes
        self._moved: bool | None = None  # by the one before
        self._marked = 0
        self._had_gap = False  # since the newest point
        self._ahead_m = 0.0

    @property
    def distance_m(self) -> float | None:
        """Driven since the first position [m], never shrinking; None before there is one."""
        return self._shown_m

    @property
    def ahead_m(self) -> float:
        """How far the newest position is ahead of the smoothed place up to which `distance_m` counts: half of
        SMOOTH_S of the way. 0 while the car stands, whose positions are never quite still."""
        return self._ahead_m if self._moves else 0.0

    def receive(self, fix: GpsFix, at_s: float, speed_mps: float | None, is_standing: bool | None) -> None:
        """Add a position. `speed_mps` and `is_standing` are by the wheels; None: not fresh."""
        if fix.status < 0 or not (math.isfinite(fix.lat_deg) and math.isfinite(fix.lon_deg)):
            return
        plane = self._plane or Plane(fix.lat_deg, fix.lon_deg)
        east_m, north_m = plane.enu(fix.lat_deg, fix.lon_deg)
        is_jump = self._leaps(at_s, east_m, north_m, speed_mps)
        if is_jump:
            self._fixes.clear()
            self._anchor = None
        if is_jump or math.hypot(east_m, north_m) > FAR_M:
            plane = Plane(fix.lat_deg, fix.lon_deg)
            self._move_origin(east_m, north_m)
            east_m = north_m = 0.0
        self._plane = plane
        self._had_gap = self._had_gap or (bool(self._fixes) and at_s - self._fixes[-1][0] > GAP_S)
        self._fixes.append((at_s, east_m, north_m))
        while self._fixes[0][0] < at_s - LOOK_BACK_S and len(self._fixes) > 2:
            self._fixes.popleft()
        self._look_back(is_standing)
        self._drive(fix, at_s, is_jump)

    def _leaps(self, at_s: float, east_m: float, north_m: float, speed_mps: float | None) -> bool:
        if not self._fixes:
            return False
        last_s, last_east_m, last_north_m = self._fixes[-1]
        gap_s = at_s - last_s
        if gap_s < 0.0:
            return True  # the clock went back: restart
        step_m = math.hypot(east_m - last_east_m, north_m - last_north_m)
        if speed_mps is None or gap_s > GAP_S:
            return step_m > JUMP_M + FASTEST_MPS * max(gap_s, 1.0)  # fixes may come bunched: allow a second
        return step_m > JUMP_M + (abs(speed_mps) + 5.0) * max(gap_s, 1.0)

    def _look_back(self, is_standing: bool | None) -> None:
        """Speed and course over ground between the mean places at either end of the look-back."""
        first_s, last_s = self._fixes[0][0], self._fixes[-1][0]
        self.course_deg = None
        old = _mean(self._fixes, first_s, first_s + ENDS_S)
        new = _mean(reversed(self._fixes), last_s - ENDS_S, last_s)
        span_s = new[0] - old[0]
        east_m, north_m = new[1] - old[1], new[2] - old[2]
        over_ground_mps = math.hypot(east_m, north_m) / span_s if span_s >= SPAN_S else None
        self._moved = self._moves
        if is_standing is not None:
            self._moves = not is_standing
        elif over_ground_mps is not None:
            self._moves = over_ground_mps > (STANDS_BELOW_MPS if self._moves else MOVES_ABOVE_MPS)
        if self._moves and over_ground_mps is not None and over_ground_mps > MOVES_ABOVE_MPS:
            self.course_deg = course_deg(east_m, north_m)

    def _drive(self, fix: GpsFix, at_s: float, is_jump: bool) -> None:
        _, east_m, north_m = _mean(reversed(self._fixes), at_s - SMOOTH_S, at_s)
        self._ahead_m = math.hypot(self._fixes[-1][1] - east_m, self._fixes[-1][2] - north_m)
        if self._anchor is None:
            self._anchor = (east_m, north_m)
            self._driven_m = self._shown_m = self._shown_m or 0.0
            self._mark(fix, at_s, is_jump)
            return
        ahead_m = math.hypot(east_m - self._anchor[0], north_m - self._anchor[1])
        if self._moves is None:
            return
        if not self._moves:
            if self._moved:
                self._driven_m += ahead_m  # the rest of the way to the halt
            self._show(self._driven_m)
            self._anchor = (east_m, north_m)
            return
        self._show(self._driven_m + ahead_m)
        chord_m = max(CHORD_M, min(2.0 * fix.sigma_m, CHORD_AT_MOST_M)) if fix.sigma_m else CHORD_M
        if ahead_m >= chord_m:
            self._driven_m += ahead_m
            self._anchor = (east_m, north_m)
            self._mark(fix, at_s, False)

    def _show(self, distance_m: float) -> None:
        self._shown_m = max(self._shown_m or 0.0, distance_m)

    def _move_origin(self, east_m: float, north_m: float) -> None:
        """The plane is good near its origin only; far from it, it follows the car."""
        self._fixes = deque(((s, e - east_m, n - north_m) for s, e, n in self._fixes), maxlen=self._fixes.maxlen)
        if self._anchor is not None:
            self._anchor = (self._anchor[0] - east_m, self._anchor[1] - north_m)

    def _mark(self, fix: GpsFix, at_s: float, is_jump: bool) -> None:
        self._marked += 1
        points = self.points
        if len(points) >= POINTS:
            points = tuple(
                point
                for index, point in enumerate(points)
                if index % 2 == 0 or point.is_jump or point.is_after_gap or index == len(points) - 1
            )[-POINTS + 1 :]
        point = TrackPoint(
            at_s=at_s,
            lat_deg=fix.lat_deg,
            lon_deg=fix.lon_deg,
            distance_m=self._driven_m,
            is_jump=is_jump,
            is_after_gap=self._had_gap,
            number=self._marked,
        )
        self._had_gap = False
        self.points = (*points, point)


def _mean(fixes: Iterable[tuple[float, float, float]], from_s: float, to_s: float) -> tuple[float, float, float]:
    """The fixes up to the first outside of a time; the first of all is inside."""
    n = 0
    sum_s = sum_east_m = sum_north_m = 0.0
    for at_s, east_m, north_m in fixes:
        if not from_s <= at_s <= to_s:
            break
        n += 1
        sum_s += at_s
        sum_east_m += east_m
        sum_north_m += north_m
    return sum_s / n, sum_east_m / n, sum_north_m / n
