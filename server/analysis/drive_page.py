"""One drive as one page that works offline: the drive's report, and below it the page of `catgraph check` with the
recorded log and the settings in force."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

from server.analysis.drive.drive_report import DriveReport
from server.analysis.page import page
from server.analysis.recorded_log import read_recorded_log
from server.analysis.rehearse import rehearse
from server.analysis.report import Report
from server.recording.export.export_format import Outcome
from server.recording.read.read import Recording
from server.recording.verification import of_files


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
