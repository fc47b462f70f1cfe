"""What the simulated car's GPS and wheel sensors make of its true motion."""

from __future__ import annotations

import math

import numpy as np

from server.simulator.vehicle import Motion

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
