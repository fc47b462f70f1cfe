"""The simulated car itself: a kinematic bicycle whose speed and tyre angle follow the last command."""

from __future__ import annotations

import math
from dataclasses import dataclass

WHEELBASE_M = 2.62
LASER_AHEAD_M = 2.5  # of base_link, which is the middle of the rear axle
TYRE_LIMIT_RAD = 0.53  # about 99 % on the real car's steering scale
TYRE_RATE_RADPS = 0.5
ACCELERATION_MPS2 = 1.5
BRAKING_MPS2 = 4.6
JERK_MPS3 = 8.0
SPEED_GAIN = 2.5  # 1/s: acceleration asked for a metre per second of difference
LEAST_STOPPING_MPS2 = 0.5  # so that a stop ends in a stop and not in an ever slower crawl

HOLD_PERCENT = 40 * 100 / 255  # brake held at standstill, as on the real drive
PERCENT_PER_BRAKING = 12.0  # brake, percent for each m/s²
PERCENT_PER_DRIVING = 20.0  # accelerator, likewise


@dataclass(frozen=True, slots=True, kw_only=True)
class MotionCommand:
    """What the car shall do: speed in m/s, tyre angle in rad, positive to the left."""

    speed_mps: float
    tyre_rad: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Motion:
    """How the car stands and moves: base_link in the lap's metres, yaw counter-clockwise from east."""

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
