"""The scenarios of one simulated car: which wait, run or find back to normal, and what they put around the car."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Any

from server.judge.message import Message
from server.simulator.driver import Order
from server.simulator.effects import Effect
from server.simulator.lap import LENGTH_M, lap
from server.simulator.laser import Scenery, box
from server.simulator.scenario import BridgeFault, Scenario
from server.simulator.scenarios import SCENARIOS, Planned, laid_over
from server.simulator.vehicle import LASER_AHEAD_M, Motion

# A driver in a hurry has had enough after so long above the operator's usual limit, or when a bend ends it before: one
# hurry is one alarm.
LIMIT_MPS, HURRY_FOR_S, LEAST_HURRY_S = 11.0, 8.0, 0.3

# What pulls across the way stands so far ahead of the laser that the driver can stop, and the alarm can be raised.
BLOCKER_LENGTH_M, BLOCKER_WIDTH_M = 4.4, 1.8


@dataclass(slots=True, kw_only=True)
class Running:
    """A scenario under way."""

    scenario: Scenario
    began_s: float
    ends_s: float
    effect: Effect | None
    is_ending: bool = False

    def end(self) -> None:
        self.is_ending = True
        if self.effect is not None:
            self.effect.end()

    @property
    def is_over(self) -> bool:
        return self.is_ending and (self.effect is None or self.effect.is_over)


class Scenarios:
    """Starts and ends scenarios as time passes. Several may run at once; each at most once."""

    def __init__(self, plan: Iterable[Planned] = ()) -> None:
        self._waiting = sorted(plan, key=lambda planned: planned.after_s)
        self._running: dict[str, Running] = {}

    def start(self, scenario: Scenario, now_s: float, duration_s: float | None = None) -> None:
        """Begins a scenario; one that runs already begins anew, keeping what its effect has done so far."""
        ends_s = now_s + (scenario.duration_s if duration_s is None else duration_s)
        already = self._running.get(scenario.name)
        if already is not None and not already.is_ending:
            already.ends_s = ends_s
            return
        effect = None
        if scenario.effect is not None and not scenario.order_suffices:
            effect = scenario.effect()
        self._running[scenario.name] = Running(scenario=scenario, began_s=now_s, ends_s=ends_s, effect=effect)

    def stop(self, name: str | None = None) -> None:
        """Ends one scenario, or all, now; what is planned for later stays planned."""
        for running in self._running.values():
            if name is None or running.scenario.name == name:
                running.end()

    def advance(self, now_s: float) -> None:
        """Starts and ends what is due. `now_s` counts from the beginning of the drive."""
        while self._waiting and self._waiting[0].after_s <= now_s:
            due = self._waiting.pop(0)
            self.start(due.scenario, now_s, due.duration_s)
        for running in list(self._running.values()):
            if now_s >= running.ends_s and not running.is_ending:
                running.end()
            if running.is_over:
                del self._running[running.scenario.name]

    @property
    def orders(self) -> set[Order]:
        """What the driver is to do."""
        return {
            running.scenario.order
            for running in self._running.values()
            if running.scenario.order is not None and not running.is_ending
        }

    @property
    def bridge_faults(self) -> set[BridgeFault]:
        """What the bridge is to suffer."""
        return {
            running.scenario.bridge
            for running in self._running.values()
            if running.scenario.bridge is not None and not running.is_ending
        }

    def lay_over(self, message: Message, signal: str) -> list[Message]:
        """What becomes of a message."""
        effects = [running.effect for running in self._running.values() if running.effect is not None]
        return laid_over((message,), effects, signal) if effects else [message]

    def state(self, now_s: float) -> list[dict[str, Any]]:
        """Every scenario there is, for a person or a program to choose from, and its state."""
        rows = []
        for scenario in SCENARIOS.values():
            running = self._running.get(scenario.name)
            row: dict[str, Any] = {
                "name": scenario.name,
                "sentence": scenario.sentence,
                "duration_s": scenario.duration_s,
                "alarm": scenario.alarm,
                "consequences": list(scenario.consequences),
                "state": "off",
                "left_s": 0.0,
            }
            if running is not None:
                row["state"] = "ending" if running.is_ending else "running"
                row["left_s"] = 0.0 if running.is_ending else round(max(0.0, running.ends_s - now_s), 1)
            rows.append(row)
        return rows


class Stage:
    """Objects that the scenarios put around the car: the obstacle across its way, and the end of a hurry.

    Of one car. `blocked_at_m`: the station on the lap where an obstacle stands; None: the way is free.
    """

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
