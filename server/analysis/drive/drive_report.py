"""The report of one drive, read once from its recording and what is beside it; and as one page that works offline, with
the page of `catgraph check` below it, the recorded log and the settings in force.

The page, the JSON and the tables show the same plain values. What nobody knows is None, and is shown as "not known".
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, dataclass, replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Self

from jinja2 import Environment
from markupsafe import Markup

from server.analysis.drive.axis import dated_time
from server.analysis.drive.sheet import sheet
from server.analysis.drive.sheet_things import media_of
from server.analysis.episodes import Load
from server.analysis.page import page
from server.analysis.recorded_log import RecordedLog, read_recorded_log
from server.analysis.rehearse import rehearse
from server.analysis.report import Report
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.annotations import Annotations
from server.recording.drive import people
from server.recording.drive.facts import DriveFacts, DriveLog, figures_of, read_facts
from server.recording.drive.link_way import LinkStretch, UnseenTime, blind_times, late_times, link_along
from server.recording.drive.parts import DrivePart, Span
from server.recording.drive.unrecorded import Unrecorded, unrecorded_of
from server.recording.export.export_format import Outcome
from server.recording.folder import id_of
from server.recording.marks.recorded import files_of
from server.recording.read.read import Recording
from server.recording.verification import Verification, of_files
from server.version import catgraph_version

MOST_ROWS = 500  # of one table on the page


@dataclass(frozen=True, slots=True, kw_only=True)
class DriveReport:
    """`found` is all of it as JSON has it."""

    facts: DriveFacts
    found: dict[str, Any]
    files: Sequence[Path]

    @classmethod
    def read(
        cls,
        recording: Recording,
        *,
        name: str,
        log: RecordedLog | None = None,
        verified: Sequence[Verification] | None = None,
    ) -> Self:
        """Reads the whole recording. `log`, `verified`: where they are known already. Raises RecordingUnreadable."""
        files = files_of(recording)
        facts = read_facts(recording)
        log = log or read_recorded_log(recording)
        found = report_json(
            facts,
            recording,
            name=name,
            load=None if log is None else log.load,
            verified=of_files(recording) if verified is None else verified,
            annotations=annotation_store.joined([annotation_store.read(file) for file in files]),
        )
        return cls(facts=facts, found=found, files=files)

    @property
    def foot(self) -> str:
        """Whether it is as it was recorded, at the foot of each page."""
        chain = self.found["chain"]
        parts = [f"{one['short']}, head {(one['head'] or 'not known')[:16]}" for one in chain[:2]]
        return ", ".join([*parts, f"{len(chain) - 2} more parts"] if len(chain) > 2 else parts)

    def sheet(self, environment: Environment, template: str) -> Markup:
        """As the first part of the page."""
        return sheet(environment, template, self.facts, self.found, media_of(self.files))


def write_drive_page(
    recording: Recording, path: Path, *, name: str, progress: Callable[[float], None] = lambda part: None
) -> Outcome:
    """Writes the page; `name` is what it calls the drive. Raises RecordingUnreadable, AssetsMissing, OSError.

    Where the recording is ours, the alarms are those that were announced during the drive; the checks beside the curves
    are judged again.
    """
    length_s = max(recording.duration_s, 1e-9)
    log = read_recorded_log(recording)
    run = rehearse(
        recording,
        with_traces=True,
        on_progress=lambda at_s: progress(min(1.0, at_s / length_s)),
    )
    notes = [f"{sentence}." for sentence in run.damage]
    notes += [
        f"{count} messages on {topic} could not be decoded: {recording.why_rejected.get(topic, 'not JSON')}."
        for topic, count in sorted(recording.rejected.items())
    ]
    if log is not None:
        run = replace(run, episodes=log.episodes, load=log.load, titles={**log.titles, **run.titles})
    report = Report(files=[name], recording=recording, run=run, recorded_log=log, verified=of_files(recording))
    drive = DriveReport.read(recording, name=name, log=log, verified=report.verified)
    path.write_text(page(report, drive), encoding="utf-8")
    return Outcome(entries=run.messages, notes=notes + ([] if run.broke_off is None else [f"{run.broke_off}."]))


def report_json(
    facts: DriveFacts,
    recording: Recording,
    *,
    name: str,
    load: Load | None,
    verified: Sequence[Verification],
    annotations: Annotations,
) -> dict[str, Any]:
    """The whole report. Times are ms since 1970 and ISO 8601, lengths m and s, speeds m/s."""
    log, first = facts.log, recording.metadata
    every = [part.metadata for part in facts.parts] or [first]
    unrecorded = unrecorded_of(recording, facts.parts)[:MOST_ROWS]
    return {
        "catgraph": catgraph_version(),
        "name": name,
        "vehicle": first.get("vehicle") or None,
        "session": first.get("session") or None,
        "part": first.get("part") or None if len(facts.parts) < 2 else None,
        "start": _iso(facts.start_ms) if recording.count else None,
        "end": _iso(facts.end_ms) if recording.count else None,
        "start_ms": facts.start_ms,
        "end_ms": facts.end_ms,
        "title": annotations.title,
        "weather": annotations.weather,
        "remarks": annotations.note,
        "tags": list(annotations.tags),
        "parts": [_part(part, facts) for part in facts.parts],
        "gaps": [_gap(gap, facts) for gap in facts.gaps[:MOST_ROWS]],
        "no_record": [_unrecorded(one, facts) for one in unrecorded],
        "parts_missing": [_unrecorded(one, facts)["sentence"] for one in unrecorded if one.parts],
        "chain": [{"recording": id_of(one.path), **one.as_json()} for one in verified],
        "figures": figures_of(facts),
        "load": None if load is None or log is None else _load(load),
        "blind": [_unseen(one) for one in blind_times(facts)[:MOST_ROWS]],
        "late": [_unseen(one) | {"late_s": one.late_s} for one in late_times(facts)[:MOST_ROWS]],
        "unseen_by": _unseen_by(facts),
        "damage": list(recording.damage),
        "left_out": _lines(every, "left_out"),
        "not_received": _lines(every, "not_received"),
        "speed_limits": [{"from_s": round(at_s, 2), "max_mps": value} for at_s, value in facts.limits],
        "link_delay": _delay(facts),
        "link_along": [_stretch(one) for one in link_along(facts)],
        **(_unknown() if log is None else _of_log(log, facts)),
    }


def _unrecorded(one: Unrecorded, facts: DriveFacts) -> dict[str, Any]:
    """A time of which this report has no record; null: it is not known since when, or until when."""

    def at_ms(at_s: float) -> int:
        return facts.start_ms + round(at_s * 1000)

    def clock(at_s: float) -> str:
        return dated_time(at_ms(at_s), facts.start_ms)

    return {
        "from_ms": None if one.from_s is None else at_ms(one.from_s),
        "to_ms": None if one.to_s is None else at_ms(one.to_s),
        "time": one.time(clock),
        "parts": list(one.parts),
        "what": one.what,
        "sentence": one.sentence(clock),
    }


def _part(part: DrivePart, facts: DriveFacts) -> dict[str, Any]:
    from_ms, to_ms = (facts.start_ms + round(at_s * 1000) for at_s in (part.from_s, part.to_s))
    return {
        "recording": part.id,
        "session": part.session or None,
        "part": part.number,
        "from_ms": from_ms,
        "to_ms": to_ms,
        "ended": part.metadata.get("ended") or None,
    }


def _gap(gap: Span, facts: DriveFacts) -> dict[str, Any]:
    """A time between two parts; `apart_m`: by how far the positions before and after it are apart."""
    apart_m = facts.motion.apart_m(*gap)
    return {
        "from_s": round(gap[0], 2),
        "to_s": round(gap[1], 2),
        "apart_m": None if apart_m is None else round(apart_m, 1),
    }


def _lines(every: Sequence[Mapping[str, str]], name: str) -> list[str]:
    """The topics that the metadata of any part names."""
    lines = [line for metadata in every for line in metadata.get(name, "").split("\n") if line]
    return list(dict.fromkeys(lines))[:MOST_ROWS]


def _unknown() -> dict[str, Any]:
    """Of a recording without a log."""
    names = ("people", "departure", "modes", "alarms", "marks", "interventions", "slow_downs", "planned_stops")
    return dict.fromkeys(names)


def _of_log(log: DriveLog, facts: DriveFacts) -> dict[str, Any]:
    return {
        "people": [
            {
                "name": one.name,
                "role": one.role,
                "on_duty": [_span(span) for span in one.on_duty],
                "in_control": [_span(span) for span in one.in_control],
            }
            for one in log.people
        ],
        "departure": asdict(log.departure),
        "modes": [asdict(span) for span in log.modes] if log.are_modes_known else None,
        "alarms": [{**asdict(one), "to_acknowledge_s": one.to_acknowledge_s} for one in log.alarms],
        "marks": [{**row, "at_s": round(facts.at_s(row["marked_ms"]), 3)} for row in log.marks],
        "interventions": [{**asdict(one), "at_s": round(facts.at_s(one.at_ms), 3)} for one in log.interventions]
        if log.are_modes_known
        else None,
        "slow_downs": [asdict(one) for one in log.slow_downs],
        "planned_stops": [asdict(one) for one in log.planned_stops],
    }


def _span(span: people.Span) -> dict[str, int | None]:
    return {"from_ms": span.from_ms, "to_ms": span.to_ms}


def _load(load: Load) -> dict[str, Any]:
    return {
        "announced": load.announced,
        "in_10_min": round(load.in_10_min, 2),
        "most_in_10_min": load.most_in_10_min,
        "chattering": list(load.chattering),
        "standing": load.standing,
        "verdict": load.verdict,
    }


def _unseen(one: UnseenTime) -> dict[str, float | None]:
    metres = None if one.metres is None else math.ceil(one.metres * 100) / 100
    return {"from_s": round(one.from_s, 2), "to_s": round(one.to_s, 2), "unseen_m": metres}


def _unseen_by(facts: DriveFacts) -> dict[str, Any]:
    """By what the metres unseen are counted."""
    return {
        "acceleration_mps2": max((value for _, value in facts.accelerations), default=None),
        "is_recorded": facts.are_settings_recorded,
        "with_delay": bool(facts.late),
    }


def _delay(facts: DriveFacts) -> dict[str, float] | None:
    """Weighted by how long each delay held; None: it was not recorded."""
    held = [(late_s, to_s - from_s) for from_s, to_s, late_s in facts.held_delays()]
    if not held:
        return None
    whole_s = sum(time_s for _, time_s in held)
    return {
        "median_s": _weighted(held, 0.5 * whole_s),
        "p90_s": _weighted(held, 0.9 * whole_s),
        "most_s": round(max(late_s for late_s, _ in held), 3),
    }


def _stretch(one: LinkStretch) -> dict[str, float | None]:
    rounded = {name: None if value is None else round(value, 3) for name, value in asdict(one).items()}
    return {**rounded, "from_m": round(one.from_m, 1), "to_m": round(one.to_m, 1), "blind_s": round(one.blind_s, 2)}


def _weighted(held: Sequence[tuple[float, float]], until_s: float) -> float:
    passed_s = 0.0
    for late_s, time_s in sorted(held):
        passed_s += time_s
        if passed_s >= until_s:
            return round(late_s, 3)
    return round(max(held)[0], 3)


def _iso(at_ms: int) -> str | None:
    try:
        return datetime.fromtimestamp(at_ms / 1000, UTC).isoformat(timespec="milliseconds")
    except (OverflowError, ValueError, OSError):
        return None
