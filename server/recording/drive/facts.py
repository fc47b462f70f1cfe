"""All facts of a drive in its recording, read once: for the report, its tables and the logbook."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

from monitor.driving_summary import per_km
from server.judge.active_settings import ActiveSettings
from server.judge.drive import Drive
from server.judge.offline import OfflineRun
from server.judge.recorded_events import NewSettings
from server.protocol.marks import DriveMark
from server.recording.delay import RecordedDelay
from server.recording.drive.alarms import AlarmInDrive, alarms_of, by_component, percentile
from server.recording.drive.departure import Departure, check_of, departure_of
from server.recording.drive.drive_events import Event, PartEvents, joined, of_change, read_part_events, whole_of
from server.recording.drive.modes import (
    MODES,
    Intervention,
    ModeSpan,
    PlannedStopInDrive,
    SlowDownInDrive,
    are_modes_known,
    interventions_of,
    mode_spans,
    planned_stops_of,
    slow_downs_of,
)
from server.recording.drive.motion import Motion
from server.recording.drive.parts import DrivePart, Span, gaps_of, outside, parts_of
from server.recording.drive.people import PersonInDrive, joined_people, names_of, people_of
from server.recording.event_channels import read_recorded_events
from server.recording.marks.described import as_event
from server.recording.marks.recorded import described_late, marks_of
from server.recording.read.read import Recording

SIGNALS = ("speed", "odometry", "position", "steering", "command")
MOST_NAMES = 20


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveLog:
    """The facts in the log of a drive."""

    people: Sequence[PersonInDrive]
    departure: Departure
    modes: Sequence[ModeSpan]
    are_modes_known: bool
    interventions: Sequence[Intervention]
    marks: Sequence[DriveMark]
    alarms: Sequence[AlarmInDrive]
    slow_downs: Sequence[SlowDownInDrive]
    planned_stops: Sequence[PlannedStopInDrive]
    resumes: bool  # the server was started again: the drive is that of the recording before
    stood: Sequence[Event] = ()  # what stood when it began, where the drive began before

    @property
    def own_alarms(self) -> list[AlarmInDrive]:
        """Without those that a part before counts."""
        stood = {(event["alarm"][:120], event["at_ms"]) for event in of_change(self.stood, "raised") if event["alarm"]}
        return [alarm for alarm in self.alarms if (alarm.alarm, alarm.raised_ms) not in stood]

    @property
    def own_slow_downs(self) -> list[SlowDownInDrive]:
        """The same of orders."""
        stood = {whole_of(event, "order") for event in of_change(self.stood, "slow_down")}
        return [order for order in self.slow_downs if order.order not in stood]


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveFacts:
    """Of one recording, or of several parts of a drive. `log` None: it has none, so nobody knows."""

    start_ms: int
    end_ms: int
    log: DriveLog | None
    motion: Motion
    late: Sequence[tuple[float, float]]  # s since the beginning, delay of the link [s]
    limits: Sequence[tuple[float, float]] = ()  # s since the beginning, speed limit in force from then on [m/s]
    accelerations: Sequence[tuple[float, float]] = ()  # the same of what the car can do [m/s²]
    are_settings_recorded: bool = False  # else they are those of today
    parts: Sequence[DrivePart] = ()  # files of ours
    gaps: Sequence[Span] = ()  # between the parts [s since the beginning]

    @property
    def length_s(self) -> float:
        return (self.end_ms - self.start_ms) / 1000

    @property
    def recorded_s(self) -> float:
        """Without the times between the parts."""
        return self.length_s - sum(to_s - from_s for from_s, to_s in self.gaps)

    def held_delays(self) -> list[tuple[float, float, float]]:
        """From when to when the delay of the link was which [s]; between two parts nobody knows it."""
        found = []
        ends = [at_s for at_s, _ in self.late[1:]] + [self.length_s]
        for (at_s, late_s), end_s in zip(self.late, ends, strict=False):
            for from_s, to_s in outside((max(0.0, at_s), min(end_s, self.length_s)), self.gaps)[:1]:
                found.append((from_s, to_s, late_s))
        return found

    def last_speed(self, at_s: float) -> tuple[float, float] | None:
        """The last moment not after this one that has a speed, in the same part, and the speed."""
        last = self.motion.speed.last(at_s)
        return None if last is None or any(last[0] <= gap[0] and gap[1] <= at_s for gap in self.gaps) else last

    def at_s(self, at_ms: float) -> float:
        """A time of day as seconds since the beginning."""
        return (at_ms - self.start_ms) / 1000


def read_facts(recording: Recording) -> DriveFacts:
    """Read the whole recording, with what is beside it, without judging it. Raises RecordingUnreadable."""
    drive = Drive(recording, read_recorded_events(recording), signals=SIGNALS)
    has_speed = any("speed" in epoch.published for epoch in drive.epochs)
    motion = Motion(drive.length_s, speed="speed" if has_speed else "odometry", gaps=gaps_of(recording))
    OfflineRun(recording, drive, observer=motion, with_checks=False).advance(math.inf, to_last_message=True)
    return replace(
        facts_of(recording, motion),
        limits=limits_of(drive),
        accelerations=_in_force(drive, lambda tuning: tuning.limits.unseen.acceleration_mps2),
        are_settings_recorded=drive.settings_from_recording,
    )


def limits_of(drive: Drive) -> list[tuple[float, float]]:
    """Without settings in the recording nobody knows which limit was in force."""
    if not drive.settings_from_recording:
        return []
    return _in_force(drive, lambda tuning: tuning.limits.speed_limit.max_mps)


def _in_force(drive: Drive, of: Callable[[ActiveSettings], float]) -> list[tuple[float, float]]:
    """From when on [s since the beginning] a setting had which value."""
    moments = [0.0, *(at_s for at_s, event in drive.recorded.events if isinstance(event, NewSettings))]
    return list(zip(moments, (of(epoch.tuning) for epoch in drive.epochs), strict=False))


def facts_of(recording: Recording, motion: Motion) -> DriveFacts:
    """With a motion that was followed already; the limits are left out."""
    start_ms = round(recording.start_s * 1000)
    end_ms = start_ms + round(recording.duration_s * 1000)
    parts = parts_of(recording)
    events = read_part_events(recording, parts)
    delay = RecordedDelay(recording)
    return DriveFacts(
        start_ms=start_ms,
        end_ms=end_ms,
        log=None if events is None else _log_of(recording, events, parts, _spans_ms(parts, start_ms, end_ms)),
        motion=motion,
        late=delay.course(),
        parts=parts,
        gaps=gaps_of(recording),
    )


def _spans_ms(parts: Sequence[DrivePart], start_ms: int, end_ms: int) -> list[tuple[int, int]]:
    """From when to when each part was recorded [ms since 1970]."""
    if len(parts) < 2:
        return [(start_ms, end_ms)]
    return [(start_ms + round(part.from_s * 1000), start_ms + round(part.to_s * 1000)) for part in parts]


def _log_of(
    recording: Recording, logs: Sequence[PartEvents], parts: Sequence[DrivePart], spans: Sequence[tuple[int, int]]
) -> DriveLog:
    """`spans`: from when to when each part was recorded. Who was on duty and the mode are known within a part alone."""
    events = joined(logs)
    each = [(log.all, *span) for log, span in zip(logs, spans, strict=True)]
    resumes = any(event.get("resumes") is True for event in of_change(logs[0].all, "started"))
    is_later = resumes or (bool(parts) and (parts[0].number or 1) > 1)
    return DriveLog(
        people=joined_people([(start_ms, end_ms, people_of(of, start_ms)) for of, start_ms, end_ms in each]),
        departure=departure_of(events),
        modes=[span for of, start_ms, end_ms in each for span in mode_spans(of, start_ms, end_ms)],
        are_modes_known=all(are_modes_known(of) for of, _, _ in each),
        interventions=interventions_of([*events, *map(as_event, described_late(recording))]),
        marks=marks_of(recording),
        alarms=alarms_of(events),
        slow_downs=slow_downs_of(events),
        planned_stops=planned_stops_of(events),
        resumes=resumes,
        stood=logs[0].stood if is_later else (),
    )


def figures_of(facts: DriveFacts) -> dict[str, Any]:
    """The numbers of a drive for the logbook, as JSON has them: metres, seconds; None: not known."""
    log, motion = facts.log, facts.motion
    blind = motion.blind_spans()
    found: dict[str, Any] = {
        "distance_m": _rounded(motion.distance_m, 1),
        "distance_by": motion.source,
        "driven_s": round(facts.recorded_s, 1),
        "blind_s": round(sum(to_s - from_s for from_s, to_s in blind), 1),
        "blind": len(blind),
        "modes": by_mode(facts),
        **dict.fromkeys(("alarms", "interventions", "undescribed", "marks", "slow_downs", "departure")),
        **dict.fromkeys(("unacknowledged", "acknowledged_p50_s", "acknowledged_p90_s")),
        "check": None,
        "resumes": False,
        "components": {},
        "people": [],
    }
    if log is not None:
        alarms = log.own_alarms
        waited = [alarm.to_acknowledge_s for alarm in alarms if alarm.to_acknowledge_s is not None]
        found |= {
            "alarms": len(alarms),
            "interventions": len(log.interventions) if log.are_modes_known else None,
            "undescribed": len(undescribed_of(log)) if log.are_modes_known else None,
            "marks": len(log.marks),
            "slow_downs": len(log.own_slow_downs),
            "departure": log.departure.state,
            "check": check_of(log.departure),
            "resumes": log.resumes,
            "unacknowledged": len(alarms) - len(waited),
            "acknowledged_p50_s": _rounded(percentile(waited, 0.5), 1),
            "acknowledged_p90_s": _rounded(percentile(waited, 0.9), 1),
            "components": by_component(alarms),
            "people": names_of(log.people)[:MOST_NAMES],
        }
    rates = per_km(found["modes"]["autonomous"]["m"], motion.distance_m, found["interventions"], found["alarms"])
    found["interventions_per_autonomous_km"] = _rounded(rates["interventions"], 3)
    found["alarms_per_km"] = _rounded(rates["alarms"], 3)
    return found


def undescribed_of(log: DriveLog) -> list[str]:
    """The interventions that nobody has described."""
    return [one.intervention for one in log.interventions if not one.what and not one.category]


def by_mode(facts: DriveFacts) -> Mapping[str, dict[str, float | None]]:
    """Metres and seconds of each mode; without a log all of it is unknown."""
    spans = modes_of(facts)
    is_known = facts.motion.source is not None
    found: dict[str, dict[str, float | None]] = {mode: {"m": 0.0 if is_known else None, "s": 0.0} for mode in MODES}
    for span in spans:
        row = found[span.mode]
        row["s"] = (row["s"] or 0.0) + (span.to_ms - span.from_ms) / 1000
        if is_known:
            until_m, from_m = facts.motion.until(facts.at_s(span.to_ms)), facts.motion.until(facts.at_s(span.from_ms))
            row["m"] = (row["m"] or 0.0) + (until_m or 0.0) - (from_m or 0.0)
    return {mode: {"m": _rounded(row["m"], 1), "s": _rounded(row["s"], 1)} for mode, row in found.items()}


def modes_of(facts: DriveFacts) -> Sequence[ModeSpan]:
    """All that was recorded; without a log all of it is unknown."""
    if facts.log is not None and facts.log.modes:
        return facts.log.modes
    pieces = outside((0.0, facts.length_s), facts.gaps)
    ms = [tuple(facts.start_ms + round(at_s * 1000) for at_s in piece) for piece in pieces]
    return [ModeSpan(mode="unknown", from_ms=from_ms, to_ms=to_ms) for from_ms, to_ms in ms]


def _rounded(value: float | None, digits: int) -> float | None:
    return None if value is None else round(value, digits)
