"""Who drives one car: logged as it changes, shown in the state; interventions are described afterwards."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any, cast

from monitor.driving_mode import FLICKERS, ModeChange
from monitor.driving_summary import DrivingSummary, intervention_json, sample_json
from monitor.interventions import AFTER_S, By, Intervention, KindOf, Sample
from monitor.runner import Refused
from monitor.values import Mode
from server.bus.bus import SessionBus
from server.judge.logged_transition import number_of, text_of
from server.protocol.alarm_state import Note
from server.protocol.drive_commands import DescribeIntervention
from server.protocol.driving_state import DriveSample, DrivingAnswer, InterventionAnswer, ModeState, WhyUnknown
from server.vehicle.connection import Connection
from server.vehicle.judgement import Judgement

MOST_OPEN = 20
KEPT = 200  # interventions that can still be described
OPEN_FOR_MS = 24 * 3_600_000  # after a restart older ones are not requested again
BY_RULE = "commands"
_KINDS: Mapping[KindOf, str] = {
    "to_manual": "Intervention: taken over by hand",
    "brake": "Intervention: the brake was pressed against the command",
    "steer": "Intervention: the wheel was turned against the command",
}
_MODES: Mapping[Mode, str] = {
    "autonomous": "The car drives itself.",
    "manual": "A person drives.",
    "unknown": "It is not known who drives.",
}
_BY = {"driver": ", by the driver", "operator": ", after the operator's order", "system": ", by the car itself"}


@dataclass(slots=True, kw_only=True)
class Known:
    """One intervention of this car; `event`: the fields of its event."""

    id: str
    at_ms: int
    kind_of: KindOf
    event: Mapping[str, Any]
    samples: list[DriveSample]
    zero_s: float | None = None  # its moment, while samples after it are awaited
    newest: Sample | None = None  # of them
    last_alarm_ago_s: float | None = None
    described: tuple[str, str | None, str | None] | None = None  # what, category, by whom it was begun
    described_by: str | None = None


class CarDriving:
    """Of one vehicle; its session is the only writer. `now` is a monotonic clock in seconds, `wall_ms` the time of day
    in ms since 1970."""

    def __init__(
        self,
        judgement: Judgement,
        connection: Connection,
        note: Note,
        on_described: Callable[[int, str], None],
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
    ) -> None:
        """`on_described`: called with moment [ms since 1970] and id of an intervention that somebody described."""
        self._judgement = judgement
        self._connection = connection
        self._note = note
        self._on_described = on_described
        self._now = now
        self._wall_ms = wall_ms
        self._known: dict[str, Known] = {}  # oldest first
        self._alarm_s: float | None = None  # when the newest was announced
        self._announced: int | None = None  # so far, of all alarms; None: not counted yet
        self._drive = judgement.track_number  # that the totals are of
        self.summary = DrivingSummary()

    def _reset(self) -> None:
        """Another drive begins with totals of zero. Interventions without a description stay open."""
        self._drive = self._judgement.track_number
        if self.summary.driving.watch.mode != "unknown":
            text = "Who drives is not known any more: the car is not monitored."
            self._note("mode", text, mode="unknown", before=self.summary.driving.watch.mode, mode_source="")
        self.summary = DrivingSummary()
        self._alarm_s = None
        for one in self._known.values():
            one.zero_s = None

    def restore(self, bus: SessionBus, vehicle: str) -> None:
        """After a restart: what was not described yet, and what was."""
        for event in reversed(bus.past_events(vehicle, change="intervention", limit=KEPT)):
            known = _from_event(event)
            if known is not None and self._wall_ms() - known.at_ms < OPEN_FOR_MS:
                self._keep(known)
        for event in reversed(bus.past_events(vehicle, change="intervention_described", limit=KEPT)):
            one = self._known.get(str(event.get("intervention")))
            if one is not None:
                one.described = (str(event.get("what", "")), text_of(event.get("category")), event.get("initiated_by"))
                one.described_by = text_of(event.get("by"))

    def tick(self, now_s: float) -> None:
        """Every check was judged."""
        if self._drive != self._judgement.track_number:
            self._reset()
        if self._connection.phase == "idle":
            return
        self._count_alarms(now_s)
        monitor, driving = self._judgement.monitor, self.summary.driving
        alarm_s = self._alarm_s
        snapshot = self._judgement.state.snapshot(now_s)
        changes, found = driving.step(snapshot, monitor.limits, self._active)
        self.summary.add(changes, found)
        for change in changes:
            self._log_mode(change, now_s)
        for one in found:
            self._log_intervention(one, now_s, alarm_s)
        newest = driving.newest
        for known in self._known.values():
            if known.zero_s is not None and newest is not None and newest is not known.newest:
                known.newest = newest
                known.samples.append(_sample(newest, known.zero_s))
                if newest.at_s >= known.zero_s + AFTER_S:
                    known.zero_s = None

    def _count_alarms(self, now_s: float) -> None:
        """An alarm counts its announcements."""
        count = sum(alarm.occurrence for alarm in self._judgement.monitor.alarms.values())
        new = count - (count if self._announced is None else self._announced)
        self._announced = count
        if new > 0:
            self.summary.announced(new)
            self._alarm_s = now_s

    def describe(self, command: DescribeIntervention, *, by: str) -> None:
        """Log a person's description of an intervention; the same again changes nothing. Raises Refused."""
        one = self._known.get(command.intervention)
        if one is None:
            raise Refused("This car has no such intervention.")
        what = command.what.strip()
        if not what and command.category is None:
            raise Refused("Choose what made you intervene, or describe it.")
        described = (what, command.category, command.initiated_by)
        if one.described == described:
            return
        one.described, one.described_by = described, by
        extra: dict[str, Any] = {} if command.initiated_by is None else {"initiated_by": command.initiated_by}
        text = ": ".join(part for part in (command.category, what) if part)
        self._note(
            "intervention_described",
            f"An intervention was described: {text[:300]}",
            by=by,
            intervention=one.id,
            what=what,
            category=command.category,
            **extra,
        )
        self._on_described(one.at_ms, one.id)

    # -- what others see ---------------------------------------------------------------------------------------------

    def frame(self, now_s: float, wall_ms: int) -> ModeState:
        """The `mode` of a state."""
        watch = self.summary.driving.watch
        way_m = self.summary.driving.mode_way_m
        return {
            "mode": watch.mode,
            "why": self._why(now_s),
            "since_ms": None if watch.since_s is None else round(wall_ms - (now_s - watch.since_s) * 1000),
            "way_m": None if way_m is None else round(way_m, 1),
            "source": self._source(),
            "open": [{"id": one.id, "at_ms": one.at_ms, "kind_of": one.kind_of} for one in self._open()[:MOST_OPEN]],
        }

    def answer(self, message: Mapping[str, Any], now_s: float, wall_ms: int) -> Mapping[str, Any]:
        """The answer to the queries `driving` and `intervention`."""
        if message.get("kind") == "driving":
            return dict(self._totals())
        one = self._known.get(str(message.get("intervention")))
        if one is None:
            return {"ok": False, "reason": "This car has no such intervention."}
        event = one.event
        what, category, by = one.described or (None, None, None)
        found: InterventionAnswer = {
            "id": one.id,
            "at_ms": one.at_ms,
            "kind_of": one.kind_of,
            "speed_mps": number_of(event.get("speed_mps"), 0.0),
            "lat_deg": event.get("lat_deg"),
            "lon_deg": event.get("lon_deg"),
            "initiated_by": cast(By, by or event.get("initiated_by", "unknown")),
            "brake_percent": event.get("brake_percent"),
            "acted_before_s": event.get("acted_before_s"),
            "active": [self._title(alarm) for alarm in event.get("active", ())],
            "last_alarm_ago_s": one.last_alarm_ago_s,
            "samples": one.samples,
            "what": what,
            "category": category,
            "described_by": one.described_by,
            "left": len(self._open()),
        }
        return dict(found)

    def _totals(self) -> DrivingAnswer:
        summary, driving = self.summary, self.summary.driving
        rates = summary.per_km()
        return {
            "modes": {
                mode: {"s": round(driving.time_s[mode], 1), "m": round(driving.way_m[mode], 1)}
                for mode in driving.time_s
            },
            "interventions": summary.interventions_counted,
            "alarms": summary.alarms,
            "per_km": {"interventions": rates["interventions"], "alarms": rates["alarms"]},
        }

    def _open(self) -> list[Known]:
        return [one for one in self._known.values() if one.described is None]

    def _active(self) -> list[str]:
        return [alarm.id for alarm in self._judgement.monitor.standing() if alarm.active]

    def _title(self, alarm: str) -> str:
        known = self._judgement.monitor.alarms.get(alarm)
        return alarm if known is None else known.spec.title

    def _source(self) -> str:
        kind = self.summary.driving.watch.source
        source = self._connection.subscriptions.signals.sources.get("mode")
        return BY_RULE if kind == "rule" else source.topic if source is not None else ""

    def _why(self, now_s: float) -> WhyUnknown | None:
        watch = self.summary.driving.watch
        if watch.mode != "unknown":
            return None
        if watch.source == "none":
            return "no_source"
        if watch.is_flickering:
            return "flickers"
        reading = self._judgement.state.get("mode")
        return "unclear" if reading is not None and reading.is_fresh(now_s) else "silent"

    # -- what is logged ------------------------------------------------------------------------------------------------

    def _log_mode(self, change: ModeChange, now_s: float) -> None:
        newest = self.summary.driving.newest
        speed_mps = None if newest is None or newest.speed_mps is None else round(newest.speed_mps, 2)
        extra: dict[str, Any] = {"flickers": change.flickers} if change.flickers else {}
        self._note(
            "mode",
            _mode_text(change),
            mode=change.mode,
            before=change.before,
            mode_source=self._source(),
            speed_mps=speed_mps,
            moment_ms=self._at_ms(change.at_s, now_s),
            **extra,
        )

    def _log_intervention(self, one: Intervention, now_s: float, alarm_s: float | None) -> None:
        at_ms = self._at_ms(one.at_s, now_s)
        event = intervention_json(one)
        del event["at_s"]
        name = f"i-{at_ms}"
        self._note(
            "intervention",
            f"{_KINDS[one.kind_of]}{_BY.get(one.initiated_by, '')}, at {one.speed_mps:.1f} m/s.",
            intervention=name,
            moment_ms=at_ms,
            **event,
        )
        known = Known(
            id=name,
            at_ms=at_ms,
            kind_of=one.kind_of,
            event=event,
            samples=[_sample(sample, one.at_s) for sample in one.samples],
            zero_s=one.at_s,
            newest=one.samples[-1] if one.samples else None,
            last_alarm_ago_s=None if alarm_s is None else round(max(0.0, one.at_s - alarm_s), 1),
        )
        self._keep(known)

    def _keep(self, known: Known) -> None:
        self._known[known.id] = known
        while len(self._known) > KEPT:
            del self._known[next(iter(self._known))]

    def _at_ms(self, at_s: float, now_s: float) -> int:
        return round(self._wall_ms() - (now_s - at_s) * 1000)


def _mode_text(change: ModeChange) -> str:
    if change.flickers and change.mode == "unknown":
        count = max(change.flickers, FLICKERS)
        return f"The driving mode flickers: {count} changes within seconds. It is not known who drives."
    ended = f" It flickered before: {change.flickers} changes." if change.flickers else ""
    return _MODES[change.mode] + ended


def _sample(sample: Sample, zero_s: float) -> DriveSample:
    found = sample_json(sample, zero_s)
    return {
        "at_s": found["at_s"] or 0.0,
        "speed_mps": found["speed_mps"],
        "brake_percent": found["brake_percent"],
    }


def _from_event(event: Mapping[str, Any]) -> Known | None:
    name, kind = text_of(event.get("intervention")), event.get("kind_of")
    if name is None or kind not in _KINDS:
        return None
    before = event.get("before")
    return Known(
        id=name,
        at_ms=round(number_of(event.get("moment_ms"), event["at_ms"])),
        kind_of=cast(KindOf, kind),
        event=event,
        samples=list(before) if isinstance(before, list) else [],
    )
