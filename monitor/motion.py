"""Derived from the speed: acceleration and standstill."""

from __future__ import annotations

import math
from collections import deque

SPAN_S = 0.6  # 12 samples at 20 Hz: long enough to average wheel noise and Wi-Fi bunching, short enough to feel live
SPAN_AT_MOST_S = 3.0  # for slow speed signals
SAMPLES = 4

STANDS_BELOW_MPS = 0.10  # wheel-speed noise of the real car at rest reaches 0.084 m/s
STANDS_AFTER_S = 2.0
MOVES_ABOVE_MPS = 0.30


class Slope:
    """Least-squares slope of the newest samples of a signal."""

    def __init__(self) -> None:
        self._samples: deque[tuple[float, float]] = deque(maxlen=256)

    def add(self, at_s: float, value: float) -> float | None:
        """The slope [1/s] including this sample; None while there are too few samples."""
        samples = self._samples
        if samples and (at_s < samples[-1][0] or at_s - samples[-1][0] > SPAN_AT_MOST_S):
            samples.clear()
        if not math.isfinite(value):
            return None
        samples.append((at_s, value))
        # Drop the oldest while what stays is enough by itself.
        while len(samples) > SAMPLES and at_s - samples[1][0] >= SPAN_S:
            samples.popleft()
        if len(samples) < SAMPLES or not SPAN_S / 2 <= at_s - samples[0][0] <= SPAN_AT_MOST_S:
            return None
        return _fit(samples)


def _fit(samples: deque[tuple[float, float]]) -> float | None:
    """Slope of the least-squares line, Σ(t−t̄)(v−v̄)/Σ(t−t̄)²."""
    n = len(samples)
    sum_s = sum_value = 0.0
    for at_s, value in samples:
        sum_s += at_s
        sum_value += value
    mean_s, mean = sum_s / n, sum_value / n
    spread = common = 0.0
    for at_s, value in samples:
        off_s = at_s - mean_s
        spread += off_s * off_s
        common += off_s * (value - mean)
    return common / spread if spread > 0.0 else None


class Standstill:
    """Whether the car stands, with the hysteresis that wheel-speed noise needs."""

    def __init__(self) -> None:
        self.is_standing: bool | None = None  # None: not known yet
        self.since_s: float | None = None  # when it came to rest, while standing
        self._slow_since_s: float | None = None

    def add(self, at_s: float, speed_mps: float) -> None:
        speed_mps = abs(speed_mps)
        if self._slow_since_s is not None and at_s < self._slow_since_s:
            self._slow_since_s = at_s  # the clock went back
            self.since_s = None if self.since_s is None else at_s
        if speed_mps < STANDS_BELOW_MPS:
            if self._slow_since_s is None:
                self._slow_since_s = at_s
            if not self.is_standing and at_s - self._slow_since_s >= STANDS_AFTER_S:
                self.is_standing, self.since_s = True, self._slow_since_s
        elif speed_mps > MOVES_ABOVE_MPS:
            self.is_standing, self.since_s, self._slow_since_s = False, None, None
        elif not self.is_standing:
            self._slow_since_s = None
