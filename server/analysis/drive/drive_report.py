"""The report of one drive, read once from its recording and what lies beside it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Self

from jinja2 import Environment
from markupsafe import Markup

from server.analysis.drive.media import media_of
from server.analysis.drive.report_view import report_json
from server.analysis.drive.sheet import sheet
from server.analysis.recorded_log import RecordedLog, read_recorded_log
from server.recording.catalog import annotations as annotation_store
from server.recording.drive.facts import DriveFacts, read_facts
from server.recording.marks.of_drive import files_of
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
