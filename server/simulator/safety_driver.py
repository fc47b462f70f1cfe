"""The person at the wheel of the simulated car: brakes and takes over when a scenario says so."""

from __future__ import annotations

from collections import deque
from collections.abc import Set
from dataclasses import dataclass
from typing import Any, Literal

from server.simulator.driver import Order
from server.simulator.vehicle import Motion, MotionCommand

PEDAL_PERCENT = 46.0
BRAKING_MPS2 = 2.0
CREEP_MPS = 2.2  # by hand the car goes on at a slow pace
SWITCH_S = 0.2  # the by-wire unit turns to manual so long after the pedal
KEPT = 20


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
    """`step` first, then `mode`, `pedal_percent` and `hand` are those of this moment."""

    def __init__(self) -> None:
        self.mode: Literal["autonomous", "manual"] = "autonomous"
        self.pedal_percent = 0.0
        self.interventions: deque[Truth] = deque(maxlen=KEPT)
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
        self._target_mps = max(lowest_mps, self._target_mps - BRAKING_MPS2 * passed_s)
        self.pedal_percent = PEDAL_PERCENT if motion.speed_mps > lowest_mps + 0.3 or not takes_over else 0.0
        if takes_over and self.mode == "autonomous" and now_s - self._acts_since_s >= SWITCH_S - 1e-6:
            self.mode = "manual"
            self.interventions.append(Truth(at_s=now_s, kind_of="to_manual", speed_mps=motion.speed_mps))

    def hand(self, tyre_rad: float) -> MotionCommand | None:
        """What wheel and pedal are made to do; None: they are let alone. `tyre_rad`: as the way goes."""
        if self._acts_since_s is None:
            return None
        return MotionCommand(speed_mps=self._target_mps, tyre_rad=tyre_rad)
