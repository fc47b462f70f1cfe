"""What the scenarios put around the simulated car: the obstacle across its way, and the end of a hurry."""

from __future__ import annotations

import math

from server.simulator.driver import Order
from server.simulator.lap import LENGTH_M, lap
from server.simulator.running import Scenarios
from server.simulator.scenery import Scenery, box
from server.simulator.vehicle import LASER_AHEAD_M, Motion

# A driver in a hurry has had enough after so long above the operator's usual limit, or when a bend ends it before: one
# hurry is one alarm.
LIMIT_MPS, HURRY_FOR_S, LEAST_HURRY_S = 11.0, 8.0, 0.3

# What pulls across the way stands so far ahead of the laser that the driver can stop, and the alarm can be raised.
BLOCKER_LENGTH_M, BLOCKER_WIDTH_M = 4.4, 1.8


class Stage:
    """Of one car. `blocked_at_m`: the station on the lap where an obstacle stands; None: the way is free."""

    def __init__(self, scenery: Scenery, scenarios: Scenarios) -> None:
        self.blocked_at_m: float | None = None
        self._scenery = scenery
        self._scenarios = scenarios
        self._hurried_s = 0.0

    def moved(self, motion: Motion, for_s: float) -> None:
        """The car drove on."""
        if motion.speed_mps > LIMIT_MPS:
            self._hurried_s += for_s

    def set(self, now: Motion, station_m: float, orders: set[Order]) -> None:
        """Lets the obstacle come and go, and ends a hurry that has shown what it should."""
        if Order.HURRY not in orders:
            self._hurried_s = 0.0
        elif self._hurried_s >= (HURRY_FOR_S if now.speed_mps > LIMIT_MPS else LEAST_HURRY_S):
            self._scenarios.stop("speeding")
        if Order.YIELD not in orders:
            if self.blocked_at_m is not None:
                self.blocked_at_m = None
                self._scenery.put(None)
        elif self.blocked_at_m is None:
            self._block(now.speed_mps, station_m)

    def _block(self, speed_mps: float, station_m: float) -> None:
        ahead_m = LASER_AHEAD_M + 4.5 + 0.6 * speed_mps + speed_mps**2 / 6
        middle = lap().at(station_m + ahead_m + BLOCKER_WIDTH_M / 2)
        self._scenery.put(box(middle.x_m, middle.y_m, middle.yaw_rad + math.pi / 2, BLOCKER_LENGTH_M, BLOCKER_WIDTH_M))
        self.blocked_at_m = (station_m + ahead_m) % LENGTH_M
