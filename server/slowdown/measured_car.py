"""Speed and steering of the car as measured now, for the next command."""

from __future__ import annotations

import logging
from collections.abc import Callable
from typing import Any

from monitor.state import Reading, Snapshot
from server.slowdown.order import Car

log = logging.getLogger("catgraph.slowing")


class MeasuredCar:
    """`snapshot`: what is known of the car now."""

    def __init__(self, snapshot: Callable[[], Snapshot]) -> None:
        self._snapshot = snapshot
        self.opened_s = 0.0  # the newest opening of the link; a reading from before it does not count
        self.is_steering_known = False  # whether an angle of the tyres follows from the steering signal
        self.tyre_rad: float | None = None  # the last known angle, in rad, positive to the left

    def now(self) -> Car:
        """The measured motion; unknown after an error, and an order continues without it."""
        try:
            return self._measured()
        except Exception:
            log.exception("speed and steering of the car cannot be read")
            return Car(speed_mps=None, tyre_rad=None)

    def update(self) -> bool:
        """Keeps the tyre angle; whether it is measured now."""
        measured_rad = self.now().tyre_rad
        if measured_rad is not None:
            self.tyre_rad = measured_rad
        return measured_rad is not None

    def _measured(self) -> Car:
        snapshot = self._snapshot()
        speed, steering, ordered = snapshot.get("speed"), snapshot.get("steering"), snapshot.get("command")
        now_s = snapshot.now_s
        tyre_rad = None
        if not self.is_steering_known:
            tyre_rad = None
        elif steering is not None and self._is_of_now(steering, now_s):
            tyre_rad = steering.value.tyre_rad
        elif ordered is not None and self._is_of_now(ordered, now_s):
            tyre_rad = ordered.value.tyre_angle_rad
        is_known = speed is not None and self._is_of_now(speed, now_s)
        return Car(speed_mps=speed.value.speed_mps if speed is not None and is_known else None, tyre_rad=tyre_rad)

    def _is_of_now(self, reading: Reading[Any], now_s: float) -> bool:
        """Fresh, and not from before the link was lost: meanwhile the car may have done anything."""
        return reading.is_fresh(now_s) and reading.received_s >= self.opened_s
