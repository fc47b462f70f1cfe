"""The drivers of the simulated car: the lap's driver, and the person at the wheel who brakes and takes over."""

from __future__ import annotations

import enum
import math
from collections import deque
from collections.abc import Set
from dataclasses import dataclass
from functools import lru_cache
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

from server.simulator.lap import LENGTH_M, STEP_M, STOP_M, lap
from server.simulator.laser import Scenery, fan
from server.simulator.vehicle import LASER_AHEAD_M, WHEELBASE_M, Motion, MotionCommand

Floats = npt.NDArray[np.float64]

SLOW_ZONES = ((140.0, 205.0, 5.5), (370.0, 440.0, 6.5))  # stations in m and the speed there, past the parked cars
ANSWER_S = 0.4  # the car answers to a command about so late
STOP_FOR_S = 5.0  # less than the 10 s after which a standing car is reported
STANDING_BRAKING_MPS2 = 1.5
HARD_BRAKING_MPS2 = 3.0
KEPT_GAP_M = 4.2  # from the laser to whatever stands in the way

# The driver drives no faster than this allows, so that a healthy drive never comes near an obstacle alarm.
ALARM_REACTION_S = 1.0
ALARM_BRAKING_MPS2 = 1.5
ALARM_COLLISION_S = 2.0
ALARM_STANDOFF_M = 5.0
SPARE_M = 1.5

CONE_RAD = 0.12  # the distance estimator covers ±0.1 rad ahead
CORRIDOR_M = 1.6  # the corridor is ±1.2 m wide

# Of the person at the wheel.
PEDAL_PERCENT = 46.0
HAND_BRAKING_MPS2 = 2.0
CREEP_MPS = 2.2  # driven by hand the car continues at a slow pace
SWITCH_S = 0.2  # the by-wire unit turns to manual so long after the pedal
KEPT_TRUTHS = 20


class Order(enum.StrEnum):
    """What a scenario requests from the driver."""

    HURRY = "hurry"
    STAND = "stand"
    STEADY = "steady"  # not faster than now
    YIELD = "yield"  # something stands in the way
    SILENCE = "silence"  # command nothing at all
    TAKE_OVER = "take_over"  # of the safety driver: brake, and drive by hand
    BRAKE = "brake"  # of the safety driver: brake, and let go


def clear_distance_m(speed_mps: float) -> float:
    """The free distance ahead of the laser below which an obstacle alarm may be raised at this speed.

    The largest of the standoff, the stopping distance v t + v²/2a with a slow reaction, and 2 s of way.
    """
    stopping_m = speed_mps * ALARM_REACTION_S + speed_mps**2 / (2 * ALARM_BRAKING_MPS2)
    return max(ALARM_STANDOFF_M, stopping_m, speed_mps * ALARM_COLLISION_S)


def fastest_mps(sight_m: float) -> float:
    """The inverse of clear_distance_m, with some distance to spare."""
    free_m = sight_m - SPARE_M
    if free_m <= ALARM_STANDOFF_M:
        return 1.0
    t, a = ALARM_REACTION_S, ALARM_BRAKING_MPS2
    stopping_mps = a * (math.sqrt(t * t + 2 * free_m / a) - t)
    return min(stopping_mps, free_m / ALARM_COLLISION_S)


@dataclass(frozen=True, slots=True, kw_only=True)
class _DrivingStyle:
    """The style of a driver."""

    cruise_mps: float
    sideways_mps2: float
    acceleration_mps2: float
    braking_mps2: float
    heeds_zones: bool


CALM = _DrivingStyle(cruise_mps=8.0, sideways_mps2=1.6, acceleration_mps2=1.0, braking_mps2=1.1, heeds_zones=True)
# one above the operator's usual limit of 11 m/s, and soon there
HASTY = _DrivingStyle(cruise_mps=12.0, sideways_mps2=2.6, acceleration_mps2=1.4, braking_mps2=1.5, heeds_zones=False)


@lru_cache(maxsize=1)
def _sight_mps() -> Floats:
    """At each station of the lap, the speed which the sight ahead allows."""
    way, scenery = lap(), Scenery()
    beams = fan(math.radians(-30), math.radians(0.5), 121, 0.0, 0.0)
    angles = beams.angles_rad
    limits = np.empty(len(way.stations_m))
    for index, station in enumerate(way.stations_m.tolist()):
        pose = way.at(station)
        distances = scenery.distances_m(
            pose.x_m + LASER_AHEAD_M * math.cos(pose.yaw_rad),
            pose.y_m + LASER_AHEAD_M * math.sin(pose.yaw_rad),
            pose.yaw_rad,
            beams,
            200.0,
        )
        sideways = np.minimum(distances, 200.0) * np.abs(beams.directions[1])
        in_way = (np.abs(angles) <= CONE_RAD) | (sideways <= CORRIDOR_M)
        limits[index] = fastest_mps(float(distances[in_way].min()))
    return limits


@lru_cache(maxsize=2)
def _plan_mps(temper: _DrivingStyle) -> Floats:
    """At each station the speed to drive, slowing before what needs slowing. Twice round, as the lap is closed."""
    curvature = np.array([abs(lap().at(station).curvature) for station in lap().stations_m.tolist()])
    plan = np.minimum(_sight_mps(), temper.cruise_mps)
    plan = np.minimum(plan, np.sqrt(temper.sideways_mps2 / np.maximum(curvature, 1e-9)))
    if temper.heeds_zones:
        for begin_m, end_m, zone_mps in SLOW_ZONES:
            inside = (lap().stations_m >= begin_m) & (lap().stations_m < end_m)
            plan[inside] = np.minimum(plan[inside], zone_mps)
    # the tyres need half a second to turn in, and the laser points elsewhere a little before and after: look around
    around = [np.roll(plan, shift) for shift in range(-6, 7)]
    speeds: list[float] = np.min(around, axis=0).tolist()
    count = len(speeds)
    for index in range(2 * count - 1, -1, -1):
        after = speeds[(index + 1) % count]
        here = index % count
        speeds[here] = min(speeds[here], math.sqrt(after**2 + 2 * temper.braking_mps2 * STEP_M))
    for index in range(2 * count):
        before = speeds[(index - 1) % count]
        here = index % count
        speeds[here] = min(speeds[here], math.sqrt(before**2 + 2 * temper.acceleration_mps2 * STEP_M))
    return np.array(speeds)


class Driver:
    """Follows the lap by pure pursuit (R. C. Coulter, 1992) at the planned speed, and waits at the stop line."""

    def __init__(self, station_m: float, rng: np.random.Generator) -> None:
        self.station_m = station_m
        self._rng = rng
        self._tremor_rad = 0.0
        self._target_mps = 0.0
        self._waiting_since_s: float | None = None
        self._has_waited = False
        self._steady_mps: float | None = None
        for temper in (CALM, HASTY):  # now, as it takes a moment
            _plan_mps(temper)

    def resume(self, motion: Motion) -> None:
        """Continue after another driver has driven."""
        self._target_mps = motion.speed_mps

    def command(
        self, motion: Motion, now_s: float, step_s: float, orders: Set[Order], blocked_at_m: float | None
    ) -> MotionCommand:
        """What to do now. `blocked_at_m` is the station where something stands in the way."""
        self.station_m = lap().nearest_m(motion.x_m, motion.y_m, near_m=self.station_m)
        if self._is_lost(motion):
            self.station_m = lap().nearest_m(motion.x_m, motion.y_m)
        temper = HASTY if Order.HURRY in orders else CALM
        braking = STANDING_BRAKING_MPS2 if blocked_at_m is None else HARD_BRAKING_MPS2
        lowest = self._target_mps - braking * 1.3 * step_s
        highest = self._target_mps + temper.acceleration_mps2 * 1.2 * step_s
        wanted_mps = self._speed_mps(motion, now_s, temper, orders, blocked_at_m)
        self._target_mps = min(highest, max(lowest, wanted_mps))
        return MotionCommand(speed_mps=self._target_mps, tyre_rad=self._tyre_rad(motion, step_s))

    def _is_lost(self, motion: Motion) -> bool:
        pose = lap().at(self.station_m)
        return math.hypot(motion.x_m - pose.x_m, motion.y_m - pose.y_m) > 8.0

    def _speed_mps(
        self, motion: Motion, now_s: float, temper: _DrivingStyle, orders: Set[Order], blocked_at_m: float | None
    ) -> float:
        if Order.STAND in orders:
            return 0.0
        ahead = self.station_m + ANSWER_S * motion.speed_mps
        plan = _plan_mps(temper)
        speed_mps = float(plan[int(ahead / STEP_M) % len(plan)])
        if Order.STEADY not in orders:
            self._steady_mps = None
        else:
            if self._steady_mps is None:
                self._steady_mps = max(2.0, motion.speed_mps)
            speed_mps = min(speed_mps, self._steady_mps)
        if blocked_at_m is not None:
            gap_m = (blocked_at_m - self.station_m) % LENGTH_M - LASER_AHEAD_M
            if gap_m < LENGTH_M / 2:
                speed_mps = min(
                    speed_mps, _approach_mps(gap_m - KEPT_GAP_M - ANSWER_S * motion.speed_mps, HARD_BRAKING_MPS2)
                )
        if Order.HURRY not in orders:
            speed_mps = min(speed_mps, self._stop_line_mps(motion, now_s))
        return speed_mps

    def _stop_line_mps(self, motion: Motion, now_s: float) -> float:
        left_m = (STOP_M - self.station_m + 2.0) % LENGTH_M - 2.0  # down to 2 m behind the line
        if left_m > 60.0:
            self._has_waited, self._waiting_since_s = False, None
        if self._has_waited:
            return math.inf
        if motion.speed_mps == 0.0 and left_m < 1.5:
            if self._waiting_since_s is None:
                self._waiting_since_s = now_s
            if now_s - self._waiting_since_s >= STOP_FOR_S:
                self._has_waited = True
            return 0.0
        return _approach_mps(left_m - 0.5, CALM.braking_mps2)

    def _tyre_rad(self, motion: Motion, step_s: float) -> float:
        reach_m = min(6.0, max(3.0, 1.5 + 0.5 * motion.speed_mps))
        goal = lap().at(self.station_m + reach_m)
        x, y = goal.x_m - motion.x_m, goal.y_m - motion.y_m
        left_m = y * math.cos(motion.yaw_rad) - x * math.sin(motion.yaw_rad)
        curvature = 2 * left_m / (x * x + y * y)
        # no hand keeps a wheel quite still
        self._tremor_rad += -0.7 * self._tremor_rad * step_s + 0.0015 * math.sqrt(step_s) * self._rng.standard_normal()
        return math.atan(WHEELBASE_M * curvature) + self._tremor_rad


def _approach_mps(left_m: float, braking_mps2: float) -> float:
    """The speed from which braking comes to a stop in the way that is left."""
    return math.sqrt(2 * braking_mps2 * left_m) if left_m > 0.02 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Truth:
    """An intervention as it truly was."""

    at_s: float  # of the drive
    kind_of: Literal["to_manual", "brake"]
    speed_mps: float

    def as_json(self, zero_s: float) -> dict[str, Any]:
        """`zero_s`: the car's clock at the beginning of the drive."""
        return {
            "at_s": round(self.at_s, 3),
            "at_ms": round((zero_s + self.at_s) * 1000),
            "kind_of": self.kind_of,
            "speed_mps": round(self.speed_mps, 2),
        }


class SafetyDriver:
    """The person at the wheel: brakes and takes over when a scenario requests it.

    `step` first, then `mode`, `pedal_percent` and `hand` are those of this moment.
    """

    def __init__(self) -> None:
        self.mode: Literal["autonomous", "manual"] = "autonomous"
        self.pedal_percent = 0.0
        self.interventions: deque[Truth] = deque(maxlen=KEPT_TRUTHS)
        self._acts_since_s: float | None = None
        self._target_mps = 0.0
        self._now_s = 0.0

    def step(self, orders: Set[Order], now_s: float, motion: Motion) -> None:
        """Time has passed."""
        passed_s, self._now_s = now_s - self._now_s, now_s
        takes_over = Order.TAKE_OVER in orders
        if not takes_over and Order.BRAKE not in orders:
            self._acts_since_s, self.pedal_percent, self.mode = None, 0.0, "autonomous"
            return
        if self._acts_since_s is None:
            self._acts_since_s, self._target_mps = now_s, motion.speed_mps
            if not takes_over:
                self.interventions.append(Truth(at_s=now_s, kind_of="brake", speed_mps=motion.speed_mps))
        lowest_mps = CREEP_MPS if takes_over else 0.0
        self._target_mps = max(lowest_mps, self._target_mps - HAND_BRAKING_MPS2 * passed_s)
        self.pedal_percent = PEDAL_PERCENT if motion.speed_mps > lowest_mps + 0.3 or not takes_over else 0.0
        if takes_over and self.mode == "autonomous" and now_s - self._acts_since_s >= SWITCH_S - 1e-6:
            self.mode = "manual"
            self.interventions.append(Truth(at_s=now_s, kind_of="to_manual", speed_mps=motion.speed_mps))

    def hand(self, tyre_rad: float) -> MotionCommand | None:
        """What wheel and pedal are made to do; None: they are let alone. `tyre_rad`: as the way goes."""
        if self._acts_since_s is None:
            return None
        return MotionCommand(speed_mps=self._target_mps, tyre_rad=tyre_rad)
