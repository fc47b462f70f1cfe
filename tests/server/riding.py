"""A phone in the simulated car, and the two before the judge in virtual time."""

from __future__ import annotations

import math
import random
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from monitor.catalog import CHECKS
from monitor.runner import Monitor
from monitor.shell_facts import LinkFacts
from monitor.state import State
from server.judge import pipeline
from server.judge.phone_report import phone_report
from server.judge.profiles import GENERIC, Profile
from server.judge.reception_stats import Reception
from server.judge.sources.choice import choose
from server.protocol import commands
from server.simulator.car import SimulatedCar
from server.simulator.lap import metres_per_degree
from server.simulator.scenarios import Planned

WANDER_S = 40.0  # the error of a receiver wanders slowly
WALL_MS = 1_790_000_000_000  # the server's time of day at the beginning
PHONE_CLOCK_MS = WALL_MS + 3_600_000 * 7  # the phone's clock is wrong by hours, and nothing may depend on it
WATCHED = {"gps_drift", "gps_jump", "phone_car", "phone_tracks", "phone_missing"}

Offset = Callable[[float], tuple[float, float]]


class Rider:
    """A phone beside the car's antenna, `offset(t)` metres east and north of it, that tells its position once a second.

    Its error is what it states: two axes of a Gauss-Markov process with sigma = accuracy / 1.51. A fix is 0.05 … 0.6 s
    old when it is sent; the way takes up to 0.2 s. `why(t)` is a reason to give instead of a fix.
    """

    def __init__(
        self,
        *,
        seed: int = 1,
        accuracy_m: float = 5.0,
        offset: Offset = lambda _: (1.0, 0.5),
        left_at_s: float = math.inf,
        why: Callable[[float], str | None] = lambda _: None,
    ) -> None:
        self._rng = random.Random(seed)
        self._accuracy_m, self._offset, self._left_at_s, self._why = accuracy_m, offset, left_at_s, why
        self._sigma_m = accuracy_m / 1.51
        self._error_m = [self._rng.gauss(0.0, self._sigma_m) for _ in range(2)]
        self._truth: deque[tuple[float, float, float]] = deque(maxlen=200)  # two seconds
        self._due_s = 0.0
        self._left: tuple[float, float] | None = None

    def ride(self, now_s: float, lat_deg: float, lon_deg: float) -> dict[str, Any] | None:
        """Where the car is now; returns the command that the phone's page sends at this moment."""
        if self._left is None and now_s >= self._left_at_s:
            self._left = lat_deg, lon_deg
        self._truth.append((now_s, *(self._left or (lat_deg, lon_deg))))
        if now_s < self._due_s:
            return None
        self._due_s = now_s + 1.0
        command: dict[str, Any] = {"kind": "position", "phone": "rider-1", "handheld": True}
        why = self._why(now_s)
        if why is not None:
            return command | {"why": why}
        keep = math.exp(-1.0 / WANDER_S)
        fresh = self._sigma_m * math.sqrt(1 - keep * keep)
        self._error_m = [keep * error + self._rng.gauss(0.0, fresh) for error in self._error_m]
        age_s, way_s = self._rng.uniform(0.05, 0.6), self._rng.uniform(0.0, 0.2)
        wanted_s = now_s - age_s - way_s / 2
        _, lat, lon = min(self._truth, key=lambda one: abs(one[0] - wanted_s))
        aside = self._offset(now_s)
        per_east, per_north = metres_per_degree(lat)
        return command | {
            "fix": {
                "lat_deg": lat + (aside[1] + self._error_m[1]) / per_north,
                "lon_deg": lon + (aside[0] + self._error_m[0]) / per_east,
                "accuracy_m": self._accuracy_m,
                "at_ms": round((now_s - age_s) * 1000 + PHONE_CLOCK_MS),
                "age_s": age_s,
                "heard_ms": WALL_MS + round((now_s - way_s - 0.1) * 1000),
                "held_s": 0.1,
            }
        }


@dataclass(frozen=True, slots=True, kw_only=True)
class RideEvent:
    """One step in the life of an alarm of the phone or the receiver."""

    at_s: float
    alarm: str
    change: str
    text: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Ride:
    events: list[RideEvent]
    briefs: dict[str, set[str]]  # each text of a check's tile

    @property
    def raised(self) -> list[str]:
        return [one.alarm for one in self.events if one.change == "raised"]


def ride(
    rider: Rider | None, seconds: float, *, seed: int = 1, plan: Sequence[Planned] = (), profile: Profile = GENERIC
) -> Ride:
    """The car's speed and position and the phone's commands before the checks of both, for so long."""
    car = SimulatedCar(seed=seed, plan=plan)
    sources = pipeline.by_topic(
        source
        for source in choose({p.topic: p.type for p in car.published}).sources.values()
        if source.signal in ("speed", "position")
    )
    checks = [check for check in CHECKS if check.id in WATCHED]
    monitor, state, reception = Monitor(checks), State(), Reception()
    events: list[RideEvent] = []
    briefs: dict[str, set[str]] = {check.id: set() for check in checks}
    start_s, tick_s = car.now_s, 0.0

    def judge(now_s: float, changed: tuple[str, ...] | None) -> None:
        events.extend(
            RideEvent(at_s=t.at_s, alarm=t.alarm_id, change=t.change, text=t.text)
            for t in pipeline.judge(monitor, state, now_s, changed)
        )

    for step in car.steps():
        now_s = step.at_s - start_s
        if now_s > seconds:
            break
        state.link(
            LinkFacts(phase="monitoring", connected_s=0.0, bridge_answers=True, published=frozenset({"position"}))
        )
        truth = car.state()["truth"]
        sent = rider.ride(now_s, truth["lat_deg"], truth["lon_deg"]) if rider is not None else None
        if sent is not None:
            command = commands.read(sent)
            assert isinstance(command, commands.Position)
            state.receive_phone(phone_report(command, now_s, WALL_MS + now_s * 1000), now_s)
        for message in step.messages:
            source = sources.get(message.topic)
            if source is not None:
                changed = pipeline.receive(
                    source,
                    message.message,
                    now_s,
                    None,
                    reception=reception,
                    state=state,
                    profile=profile,
                    tyre_rad_per_unit=0.0,
                )
                judge(now_s, changed)
        while tick_s <= now_s:
            judge(now_s, None)
            for name, finding in monitor.findings.items():
                if name in briefs:
                    briefs[name].add(finding.brief)
            tick_s += pipeline.TICK_S
    return Ride(events=events, briefs=briefs)
