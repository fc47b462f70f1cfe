"""The simulated car itself: a kinematic bicycle, what stands between its commands and its motion, and its sensors.

Its speed and tyre angle follow the last command. Without the obstacle stopper, which the real car has, it does what the
real one's simulator does: in silence it keeps the last commanded speed.

"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

WHEELBASE_M = 2.62
LASER_AHEAD_M = 2.5  # of base_link, which is the middle of the rear axle
TYRE_LIMIT_RAD = 0.53  # about 99 % on the real car's steering scale
TYRE_RATE_RADPS = 0.5
ACCELERATION_MPS2 = 1.5
BRAKING_MPS2 = 4.6
JERK_MPS3 = 8.0
SPEED_GAIN = 2.5  # 1/s: requested acceleration per metre per second of difference
LEAST_STOPPING_MPS2 = 0.5  # so that a stop ends in a stop and not in an ever slower crawl

HOLD_PERCENT = 40 * 100 / 255  # brake held at standstill, as on the real drive
PERCENT_PER_BRAKING = 12.0  # brake, percent for each m/s²
PERCENT_PER_DRIVING = 20.0  # accelerator, likewise

STANDOFF_M = 5.0  # at or within it the stopper lets no speed through
DEAD_MAN_S = 0.2  # a command older than this counts no more; the distance has no such limit

# Open sky: the error wanders slowly (a Gauss-Markov process) and hardly jumps from fix to fix.
GPS_SIGMA_M = 0.30
GPS_WANDER_S = 40.0
GPS_JITTER_M = 0.01
HEIGHT_SIGMA_M = 0.5

WHEEL_NOISE_MPS = 0.012
WHEEL_QUANTUM_MPS = 0.0022
WHEEL_RATTLE = 0.15  # how often the wheel sensors measure something at rest
WHEEL_REST_MAX_MPS = 0.08  # the real car's reach 0.084 m/s at rest

STEERING_RAD_PER_PERCENT = -0.00536  # negative percent is left
STEERING_QUANTUM_PERCENT = 0.0183
EFFORT_QUANTUM_PERCENT = 100 / 255


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCommand:
    """What the car shall do: speed in m/s, tyre angle in rad, positive to the left."""

    speed_mps: float
    tyre_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """The pose and motion of the car: base_link in the lap's metres, yaw counter-clockwise from east."""

    x_m: float
    y_m: float
    yaw_rad: float
    speed_mps: float = 0.0
    acceleration_mps2: float = 0.0
    tyre_rad: float = 0.0

    @property
    def yaw_rate_radps(self) -> float:
        return self.speed_mps * math.tan(self.tyre_rad) / WHEELBASE_M

    def after(self, time_s: float) -> Motion:
        """The same motion a moment later (or, with a negative time, earlier), on an arc at unchanged speed."""
        way_m = self.speed_mps * time_s
        turn = self.yaw_rate_radps * time_s
        middle = self.yaw_rad + turn / 2
        return Motion(
            x_m=self.x_m + way_m * math.cos(middle),
            y_m=self.y_m + way_m * math.sin(middle),
            yaw_rad=self.yaw_rad + turn,
            speed_mps=self.speed_mps,
            acceleration_mps2=self.acceleration_mps2,
            tyre_rad=self.tyre_rad,
        )


def drive(motion: Motion, command: MotionCommand, step_s: float) -> Motion:
    """One step of a kinematic bicycle about its rear axle: yaw rate = v tan(tyre) / wheelbase. It never reverses."""
    target_mps = max(0.0, command.speed_mps)
    wanted = SPEED_GAIN * (target_mps - motion.speed_mps)
    if target_mps == 0.0:
        wanted = min(wanted, -LEAST_STOPPING_MPS2)
    wanted = min(ACCELERATION_MPS2, max(-BRAKING_MPS2, wanted))
    change = JERK_MPS3 * step_s
    acceleration = motion.acceleration_mps2 + min(change, max(-change, wanted - motion.acceleration_mps2))
    speed_mps = motion.speed_mps + acceleration * step_s
    if speed_mps <= 0.0:
        speed_mps, acceleration = 0.0, max(0.0, acceleration)
    tyre_target = min(TYRE_LIMIT_RAD, max(-TYRE_LIMIT_RAD, command.tyre_rad))
    change = TYRE_RATE_RADPS * step_s
    tyre_rad = motion.tyre_rad + min(change, max(-change, tyre_target - motion.tyre_rad))
    there = motion.after(step_s)
    return Motion(
        x_m=there.x_m,
        y_m=there.y_m,
        yaw_rad=there.yaw_rad,
        speed_mps=speed_mps,
        acceleration_mps2=acceleration,
        tyre_rad=tyre_rad,
    )


def pedals(motion: Motion) -> tuple[float, float]:
    """Brake and accelerator in percent for a motion; never both at once."""
    if motion.speed_mps == 0.0 and motion.acceleration_mps2 <= 0.0:
        return HOLD_PERCENT, 0.0
    needed = motion.acceleration_mps2 + 0.08 + 0.02 * motion.speed_mps  # rolling and air resistance, roughly
    if needed > 0.0:
        return 0.0, min(100.0, PERCENT_PER_DRIVING * needed)
    if needed < -0.15:  # below that the engine's drag does it
        return min(100.0, -PERCENT_PER_BRAKING * needed), 0.0
    return 0.0, 0.0


STANDING = MotionCommand(speed_mps=0.0, tyre_rad=0.0)


class Stack:
    """The last command on the command topic, of any publisher, and the part of it that the car carries out."""

    def __init__(self, *, has_stopper: bool = True) -> None:
        self.has_stopper = has_stopper
        self._command = STANDING
        self._received_s = -math.inf
        self._distance_m = math.inf
        self.hand: MotionCommand | None = None  # of a person at wheel and brake, before whom everything gives way

    @property
    def tyre_rad(self) -> float:
        """The tyre angle of the last command: what a message without one leaves as it is."""
        return self._command.tyre_rad

    def receive(self, command: MotionCommand, now_s: float) -> None:
        """Take a message of the command topic, of any publisher; the last one counts."""
        self._command, self._received_s = command, now_s

    def see(self, distance_m: float) -> None:
        """What the distance estimator reports of the nearest object ahead. Until then the way is free."""
        self._distance_m = distance_m

    def passed(self, now_s: float) -> MotionCommand:
        """What the vehicle receives now: the command, or zero speed with its tyre angle where the stopper steps in."""
        if self.hand is not None:
            return self.hand
        is_silent = now_s - self._received_s > DEAD_MAN_S
        if self.has_stopper and (is_silent or self._distance_m <= STANDOFF_M):
            return MotionCommand(speed_mps=0.0, tyre_rad=self._command.tyre_rad)
        return self._command


class GpsError:
    """The receiver's error in metres east, north and up."""

    def __init__(self, rng: np.random.Generator) -> None:
        self._rng = rng
        self._sigma_m = np.array((GPS_SIGMA_M, GPS_SIGMA_M, HEIGHT_SIGMA_M))
        self._wander_m = self._sigma_m * rng.standard_normal(3)

    def next_m(self, step_s: float) -> tuple[float, float, float]:
        """The error `step_s` after the one before."""
        keep = math.exp(-step_s / GPS_WANDER_S)
        fresh = self._sigma_m * math.sqrt(1 - keep * keep) * self._rng.standard_normal(3)
        # held within ±3 sigma, so that no seed can draw a fault
        self._wander_m = np.clip(keep * self._wander_m + fresh, -3 * self._sigma_m, 3 * self._sigma_m)
        east, north, up = (self._wander_m + GPS_JITTER_M * self._rng.standard_normal(3)).tolist()
        return east, north, up


def wheel_speed_mps(motion: Motion, rng: np.random.Generator) -> float:
    """The speed the wheels measure. At rest it is mostly 0, and now and then a little more."""
    noise, luck = rng.standard_normal(), rng.random()
    if motion.speed_mps > 0.0:
        speed_mps = max(0.0, motion.speed_mps + WHEEL_NOISE_MPS * noise)
    else:
        speed_mps = min(WHEEL_REST_MAX_MPS, WHEEL_NOISE_MPS * abs(noise)) if luck < WHEEL_RATTLE else 0.0
    return _rounded(speed_mps, WHEEL_QUANTUM_MPS)


def steering_percent(motion: Motion) -> float:
    """The tyre angle on the car's scale: −100 full left to 100 full right."""
    return _rounded(min(100.0, max(-100.0, motion.tyre_rad / STEERING_RAD_PER_PERCENT)), STEERING_QUANTUM_PERCENT)


def effort_percent(percent: float) -> float:
    """A pedal as the car reports it, in steps of 100/255 %."""
    return _rounded(percent, EFFORT_QUANTUM_PERCENT)


def _rounded(value: float, quantum: float) -> float:
    return round(value / quantum) * quantum
