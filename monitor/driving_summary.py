"""The drive so far: time and distance in each mode, changes, interventions, and what comes on a kilometre.

The same class follows a live car and a recording; both give it a snapshot with every judgement.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Sequence
from typing import Any, TypedDict

from monitor.driving_mode import ModeChange, ModeWatch
from monitor.interventions import Intervention, InterventionWatch, Sample
from monitor.snapshot import Snapshot
from monitor.values import Mode

MODES: tuple[Mode, ...] = ("autonomous", "manual", "unknown")
LONGEST_STEP_S = 1.0  # a longer one was not watched: its time is of an unknown mode, and its distance is not known
KEPT = 1000  # changes and interventions; beyond it they are only counted
BEFORE_STEP_S = 0.5  # of the samples that an event carries


class PerKilometre(TypedDict):
    interventions: float | None
    alarms: float | None


class InMode(TypedDict):
    s: float
    m: float


class Driving:
    """Mode, interventions and totals of one car."""

    def __init__(self) -> None:
        self.watch = ModeWatch()
        self._interventions = InterventionWatch()
        self.time_s: dict[Mode, float] = dict.fromkeys(MODES, 0.0)
        self.way_m: dict[Mode, float] = dict.fromkeys(MODES, 0.0)
        self.mode_way_m: float | None = None  # in this mode, since it began; None: no speed was known
        self._pending_s = self._pending_m = 0.0  # since the car reported a mode that is not confirmed yet
        self._newest: Mode = "unknown"
        self._last_s: float | None = None

    @property
    def newest(self) -> Sample | None:
        """The newest sample, for what follows an intervention."""
        return self._interventions.samples[-1] if self._interventions.samples else None

    def step(
        self, snapshot: Snapshot, limits: Any, active: Callable[[], Collection[str]] = tuple
    ) -> tuple[list[ModeChange], list[Intervention]]:
        """Advance to `snapshot`. `limits`: all thresholds; `active`: ids of the alarms that stand."""
        watch = self.watch
        self._go_on(snapshot)
        changes = watch.step(snapshot, limits.driving)
        for change in changes:
            self._changed(change)
        if watch.newest != self._newest:
            self._newest = watch.newest
            self._pending_s = self._pending_m = 0.0
        found = self._interventions.step(
            snapshot,
            limits,
            changes,
            is_autonomous=watch.mode == "autonomous",
            drives_itself=watch.mode == watch.newest == "autonomous",
            mode_text=watch.text,
            active=active,
        )
        return changes, found

    def _go_on(self, snapshot: Snapshot) -> None:
        last_s, self._last_s = self._last_s, snapshot.now_s
        if last_s is None or snapshot.now_s <= last_s:
            return
        passed_s = snapshot.now_s - last_s
        if passed_s > LONGEST_STEP_S:
            self.time_s["unknown"] += passed_s
            return
        mode, speed = self.watch.mode, snapshot.get("speed")
        self.time_s[mode] += passed_s
        self._pending_s += passed_s
        if speed is not None and speed.is_fresh(snapshot.now_s):
            way_m = abs(speed.value.speed_mps) * passed_s
            self.way_m[mode] += way_m
            self.mode_way_m = (self.mode_way_m or 0.0) + way_m
            self._pending_m += way_m

    def _changed(self, change: ModeChange) -> None:
        """Count what passed between the car's report and its confirmation for the new mode."""
        before, after = change.before, change.mode
        is_known = self.mode_way_m is not None
        self.mode_way_m = None
        if after == self._newest:
            pending_s = min(self._pending_s, self.time_s[before])
            pending_m = min(self._pending_m, self.way_m[before])
            self.time_s[before] -= pending_s
            self.way_m[before] -= pending_m
            self.time_s[after] += pending_s
            self.way_m[after] += pending_m
            self.mode_way_m = pending_m if is_known else None
        elif is_known:
            self.mode_way_m = 0.0


class DrivingSummary:
    """A drive, from its snapshots; times are on their clock. `limits` are given with each, as they may change."""

    def __init__(self) -> None:
        self.driving = Driving()
        self.changes: list[ModeChange] = []
        self.interventions: list[Intervention] = []
        self.alarms = 0  # announced
        self.changes_counted = self.interventions_counted = 0

    def step(self, snapshot: Snapshot, limits: Any, active: Callable[[], Collection[str]] = tuple) -> None:
        """One judgement; `limits`: all thresholds in force; `active`: ids of the alarms that stand."""
        self.add(*self.driving.step(snapshot, limits, active))

    def add(self, changes: Sequence[ModeChange], interventions: Sequence[Intervention]) -> None:
        """What a step of `driving` brought."""
        self.changes_counted += len(changes)
        self.interventions_counted += len(interventions)
        self.changes += changes[: KEPT - len(self.changes)]
        self.interventions += interventions[: KEPT - len(self.interventions)]

    def announced(self, count: int) -> None:
        """So many alarms were announced."""
        self.alarms += count

    def per_km(self) -> PerKilometre:
        """Of the drive so far."""
        way_m = self.driving.way_m
        rates = per_km(way_m["autonomous"], sum(way_m.values()), self.interventions_counted, self.alarms)
        return {"interventions": _plain(rates["interventions"], 3), "alarms": _plain(rates["alarms"], 3)}

    def as_json(self) -> dict[str, Any]:
        """Everything, for a report: SI, times as those of the snapshots."""
        time_s, way_m = self.driving.time_s, self.driving.way_m
        modes: dict[str, InMode] = {mode: {"s": round(time_s[mode], 2), "m": round(way_m[mode], 1)} for mode in MODES}
        return {
            "modes": modes,
            "mode_source": self.driving.watch.source,
            "changes": [change_json(one) for one in self.changes],
            "changes_counted": self.changes_counted,
            "changes_heard": self.driving.watch.changes_received,
            "interventions": [intervention_json(one) for one in self.interventions],
            "interventions_counted": self.interventions_counted,
            "per_km": self.per_km(),
        }


def per_km(
    autonomous_m: float | None, all_m: float | None, interventions: int | None, alarms: int | None
) -> PerKilometre:
    """Interventions on a kilometre that the car drove by itself, alarms on any kilometre: the rule of the live page,
    the report and the logbook. None: the count or the distance is not known, or there is no such distance."""
    return {"interventions": _on_km(interventions, autonomous_m), "alarms": _on_km(alarms, all_m)}


def _on_km(count: int | None, metres: float | None) -> float | None:
    return None if count is None or not metres or metres <= 0 else count / metres * 1000


def _plain(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)


def change_json(change: ModeChange) -> dict[str, Any]:
    return {
        "at_s": round(change.at_s, 3),
        "mode": change.mode,
        "before": change.before,
        "flickers": change.flickers,
    }


def intervention_json(one: Intervention) -> dict[str, Any]:
    """An intervention with the 10 s before it."""
    return {
        "at_s": round(one.at_s, 3),
        "kind_of": one.kind_of,
        "speed_mps": round(one.speed_mps, 2),
        "lat_deg": None if one.lat_deg is None else round(one.lat_deg, 7),
        "lon_deg": None if one.lon_deg is None else round(one.lon_deg, 7),
        "initiated_by": one.initiated_by,
        "active": list(one.active),
        "brake_percent": None if one.brake_percent is None else round(one.brake_percent, 1),
        "acted_before_s": one.acted_before_s,
        "before": before_json(one),
    }


def before_json(one: Intervention) -> list[dict[str, float | None]]:
    """Two samples a second, at most 21, at seconds before the intervention."""
    kept: list[Sample] = []
    for sample in one.samples:
        if sample.at_s <= one.at_s + 0.05 and (not kept or sample.at_s - kept[-1].at_s >= BEFORE_STEP_S - 0.05):
            kept.append(sample)
    return [sample_json(sample, one.at_s) for sample in kept[-21:]]


def sample_json(sample: Sample, zero_s: float) -> dict[str, float | None]:
    """A sample, at seconds from `zero_s`."""
    return {
        "at_s": round(sample.at_s - zero_s, 2),
        "speed_mps": _plain(sample.speed_mps, 2),
        "brake_percent": _plain(sample.brake_percent, 1),
    }
