"""Interventions: somebody takes the car from its automation, or acts against it.

A change to manual in motion, the brake pressed while no braking is commanded, and the wheel turned away from the
commanded angle while the car drives itself. Brake and wheel that lead to a change to manual are one intervention.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Collection
from dataclasses import dataclass
from typing import Any, Literal

from monitor.driving_mode import ModeChange
from monitor.snapshot import Snapshot
from monitor.values import Mode

KindOf = Literal["to_manual", "brake", "steer"]
By = Literal["driver", "operator", "system", "unknown"]

MOVES_MPS = 0.3  # as everywhere: above the noise of standing wheels
SAMPLE_S = 0.25
BEFORE_S, AFTER_S = 10.0, 6.0
HELD_S = 0.5  # against the command for so long: longer than the delay of the car's response
REMEMBERED_S = 1.5  # what was commanded shortly before is still being carried out
SPARE_MPS = 0.3
COMING_S = 0.3  # a controller that is silent for longer, or than three of its periods, commands nothing
LONGEST_STEP_S = 1.0  # of a server that stalls
ONE_S = 3.0  # what happens so soon after another is part of it
LEADS_S = 2.0  # brake or wheel so long before a change of mode brought it about
GAP_S = 30.0  # after a longer time in an unknown mode nothing is concluded
OPERATOR_S = 5.0
MOST_ACTIVE = 20
SYSTEM_MODES = frozenset({"disengaged", "fault", "emergency", "failure"})


@dataclass(frozen=True, slots=True, kw_only=True)
class Sample:
    """The car at one moment; None: not fresh."""

    at_s: float
    speed_mps: float | None
    brake_percent: float | None
    place: tuple[float, float] | None  # latitude and longitude, in degrees


@dataclass(frozen=True, slots=True, kw_only=True)
class Intervention:
    """One of them, with what was known of it at its moment."""

    at_s: float
    kind_of: KindOf
    speed_mps: float
    lat_deg: float | None
    lon_deg: float | None
    initiated_by: By
    active: tuple[str, ...]  # ids of alarms
    samples: tuple[Sample, ...]  # of the 10 s before, four a second
    brake_percent: float | None = None  # the most, where the brake was pressed against the command
    acted_before_s: float | None = None  # brake or wheel so long before the mode changed


class Against:
    """Whether something is held against the command, and since when."""

    def __init__(self) -> None:
        self.since_s: float | None = None
        self.newest_s = -math.inf  # when it last was
        self.began_s = -math.inf  # the last time's beginning
        self.is_reported = False

    def step(self, is_against: bool, now_s: float, *, may_report: bool) -> bool:
        """True once, when it has been held long enough."""
        if not is_against:
            self.since_s, self.is_reported = None, False
            return False
        if self.since_s is None:
            self.since_s = self.began_s = now_s
        self.newest_s = now_s
        if self.is_reported or not may_report or now_s - self.since_s < HELD_S:
            return False
        self.is_reported = True
        return True


class InterventionWatch:
    """Follows one car; `step` must be called with snapshots in the order of time."""

    def __init__(self) -> None:
        self.forget()

    def forget(self) -> None:
        """Forget all: the clock went back, and times before that are void."""
        self.samples: deque[Sample] = deque(maxlen=math.ceil((BEFORE_S + 2.0) / SAMPLE_S))
        self._commands: deque[tuple[float, float | None, float | None]] = deque(maxlen=64)  # s, m/s, rad
        self._brake = Against()
        self._steer = Against()
        self._most_brake: float | None = None
        self._autonomous_s = -math.inf  # when it last was
        self._known: Mode = "unknown"  # the newest mode that was not unknown
        self._newest_s = -math.inf  # when the newest intervention was still going on
        self._slowed_s = -math.inf
        self._now_s = -math.inf
        self._step_s = 0.0  # since the judgement before: what happened in between is seen together

    def step(
        self,
        snapshot: Snapshot,
        limits: Any,
        changes: Collection[ModeChange],
        *,
        is_autonomous: bool,
        drives_itself: bool,
        mode_text: str,
        active: Callable[[], Collection[str]],
    ) -> list[Intervention]:
        """`limits`: all; `is_autonomous`: the mode is; `drives_itself`: and no other mode is reported; `mode_text`: the
        car's own name of its mode; `active`: ids of the alarms that stand."""
        now_s = snapshot.now_s
        if now_s < self._now_s:
            self.forget()
        self._step_s = min(now_s - self._now_s, LONGEST_STEP_S)
        self._now_s = now_s
        if snapshot.slowing.ordered_s is not None:
            self._slowed_s = now_s
        sample = self._sample(snapshot)
        self._remember(snapshot)
        braked, steered = self._against(
            snapshot, limits.driving, sample, is_autonomous=is_autonomous, may_report=drives_itself
        )
        found: list[Intervention] = []
        for change in changes:
            if change.mode == "manual" and self._was_autonomous(change):
                found += self._made("to_manual", change.at_s, mode_text, active)
            if change.mode != "unknown":
                self._known = change.mode
        for kind, held in (("brake", self._brake if braked else None), ("steer", self._steer if steered else None)):
            if held is not None and held.since_s is not None:
                found += self._made("brake" if kind == "brake" else "steer", held.since_s, mode_text, active)
        if is_autonomous:
            self._autonomous_s = now_s
        if self._brake.is_reported or self._steer.is_reported:
            self._newest_s = now_s
        return found

    def _was_autonomous(self, change: ModeChange) -> bool:
        return self._known == "autonomous" and change.at_s - self._autonomous_s <= GAP_S

    def _made(
        self, kind: KindOf, at_s: float, mode_text: str, active: Callable[[], Collection[str]]
    ) -> list[Intervention]:
        near = min(self.samples, key=lambda one: abs(one.at_s - at_s), default=None)
        speed_mps = None if near is None or abs(near.at_s - at_s) > 1.0 else near.speed_mps
        if near is None or speed_mps is None or abs(speed_mps) <= MOVES_MPS or abs(at_s - self._newest_s) <= ONE_S:
            return []
        self._newest_s = at_s
        lat_deg, lon_deg = near.place or (None, None)
        by, acted_before_s = self._who(kind, at_s, mode_text)
        return [
            Intervention(
                at_s=at_s,
                kind_of=kind,
                speed_mps=speed_mps,
                lat_deg=lat_deg,
                lon_deg=lon_deg,
                initiated_by=by,
                active=tuple(active())[:MOST_ACTIVE],
                samples=tuple(one for one in self.samples if one.at_s >= at_s - BEFORE_S - SAMPLE_S / 2),
                brake_percent=self._most_brake if self._brake.newest_s >= at_s - LEADS_S else None,
                acted_before_s=acted_before_s,
            )
        ]

    def _who(self, kind: KindOf, at_s: float, mode_text: str) -> tuple[By, float | None]:
        """Who began it, and how long before the mode changed. Of brake and wheel alone only the driver can be
        named for certain."""
        if at_s - self._slowed_s <= OPERATOR_S:
            return "operator", None
        if kind != "to_manual":
            return "driver", None
        acts = [
            held.began_s for held in (self._brake, self._steer) if held.newest_s >= at_s - LEADS_S and held.began_s > 0
        ]
        if acts:
            return "driver", round(max(0.0, at_s - min(acts)), 2)
        return ("system" if mode_text.casefold() in SYSTEM_MODES else "unknown"), None

    def _sample(self, snapshot: Snapshot) -> Sample:
        now_s, fresh = snapshot.now_s, _fresh
        speed, brake, fix = fresh(snapshot, "speed"), fresh(snapshot, "brake"), fresh(snapshot, "position")
        sample = Sample(
            at_s=now_s,
            speed_mps=speed.speed_mps if speed is not None else None,
            brake_percent=brake.percent if brake is not None else None,
            place=(fix.lat_deg, fix.lon_deg) if fix is not None and fix.status >= 0 else None,
        )
        if not self.samples or now_s - self.samples[-1].at_s >= SAMPLE_S - 0.001:
            self.samples.append(sample)
        return sample

    def _remember(self, snapshot: Snapshot) -> None:
        command, now_s = snapshot.get("command"), snapshot.now_s
        if command is not None and (not self._commands or self._commands[-1][0] != command.received_s):
            self._commands.append((command.received_s, command.value.speed_mps, command.value.tyre_angle_rad))
        while self._commands and not now_s - REMEMBERED_S <= self._commands[0][0] <= now_s:
            self._commands.popleft()

    def _against(
        self, snapshot: Snapshot, limits: Any, now: Sample, *, is_autonomous: bool, may_report: bool
    ) -> tuple[bool, bool]:
        """Whether the brake, and the wheel, has now been held against the command for long enough."""
        is_meant = is_autonomous and now.at_s - self._slowed_s > OPERATOR_S and _is_commanded(snapshot, self._step_s)
        speeds = [mps for _, mps, _ in self._commands if mps is not None]
        tyres = [rad for _, _, rad in self._commands if rad is not None]
        brakes = bool(
            is_meant
            and now.speed_mps is not None
            and (now.speed_mps > MOVES_MPS or self._brake.since_s is not None)
            and now.brake_percent is not None
            and now.brake_percent >= limits.brake_percent
            and speeds
            and min(speeds) >= now.speed_mps - SPARE_MPS
        )
        if brakes:
            before = self._most_brake if self._brake.since_s is not None else None
            self._most_brake = max(before or 0.0, now.brake_percent or 0.0)
        steering = _fresh(snapshot, "steering")
        tyre_rad = steering.tyre_rad if steering is not None else None
        steers = bool(
            is_meant
            and now.speed_mps is not None
            and now.speed_mps > MOVES_MPS
            and tyre_rad is not None
            and tyres
            and not min(tyres) - limits.steer_rad <= tyre_rad <= max(tyres) + limits.steer_rad
        )
        return (
            self._brake.step(brakes, now.at_s, may_report=may_report),
            self._steer.step(steers, now.at_s, may_report=may_report),
        )


def _is_commanded(snapshot: Snapshot, step_s: float) -> bool:
    command = snapshot.get("command")
    if command is None:
        return False
    return snapshot.now_s - command.received_s <= max(COMING_S, 3 * (command.period_s or 0.0)) + step_s


def _fresh(snapshot: Snapshot, signal: str) -> Any:
    reading = snapshot.readings.get(signal)
    return reading.value if reading is not None and reading.is_fresh(snapshot.now_s) else None
