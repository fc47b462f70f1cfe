"""The ramp down: from a speed to zero with a constant deceleration, the wheels held as they are."""

from __future__ import annotations

import math
from dataclasses import dataclass

CAP_MPS2 = 4.6  # as hard as the car brakes


@dataclass(frozen=True, slots=True, kw_only=True)
class Ramp:
    """`from_mps` may be negative: a car that rolls backwards is slowed too."""

    from_mps: float
    tyre_rad: float  # held all the way: zero would straighten the wheels
    deceleration_mps2: float
    began_s: float

    def __post_init__(self) -> None:
        if not (math.isfinite(self.from_mps) and math.isfinite(self.tyre_rad)):
            raise ValueError("A ramp needs a start speed and a tyre angle.")
        if not 0.0 < self.deceleration_mps2 <= CAP_MPS2:
            raise ValueError(f"A deceleration is above 0 and at most {CAP_MPS2} m/s².")

    def speed_mps(self, now_s: float) -> float:
        """What is ordered at a moment; zero for ever once it is reached."""
        left_mps = abs(self.from_mps) - self.deceleration_mps2 * max(0.0, now_s - self.began_s)
        return math.copysign(left_mps, self.from_mps) if left_mps > 0.0 else 0.0
