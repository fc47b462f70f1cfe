"""The report of one drive, read once from its recording and what is beside it; and as one page that works offline, with
the page of `catgraph check` below it, the recorded log and the settings in force."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, Self

from jinja2 import Environment
from markupsafe import Markup

from server.analysis.drive.report_view import report_json
from server.analysis.drive.sheet import sheet
from server.analysis.drive.sheet_things import media_of
from server.analysis.page import page
from server.analysis.recorded_log import RecordedLog, read_recorded_log
from server.analysis.rehearse import rehearse
from server.analysis.report import Report
from server.recording.catalog import annotations as annotation_store
from server.recording.drive.facts import DriveFacts, read_facts
from server.recording.export.export_format import Outcome
from server.recording.marks.recorded import files_of
from server.recording.read.read import Recording
from server.recording.verification import Verification, of_files


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
