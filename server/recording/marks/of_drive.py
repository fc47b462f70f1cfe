"""The marks of a recording that is read, which may be of several files, and later descriptions of its interventions.

The report, the catalog, replays, and all that is exported read them here.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator, Sequence
from itertools import islice
from pathlib import Path

from server.protocol.driving_state import InterventionDescription
from server.protocol.marks import DriveMark
from server.recording.catalog import annotations as annotation_store
from server.recording.marks.media import MediaName
from server.recording.marks.recorded import MOST, TOPIC, all_media, with_late
from server.recording.marks.rows import folded
from server.recording.read.read import Recording


def marks_of(recording: Recording) -> list[DriveMark]:
    """Oldest first, late ones among them."""
    return with_late(in_recording(recording), files_of(recording), recording.start_s * 1000)


def in_recording(recording: Recording) -> list[DriveMark]:
    """Those that the recording itself holds. Raises RecordingUnreadable."""
    marks, _ = folded(row for _, row in islice(recording.own(TOPIC), MOST))
    return list(marks.values())


def media_of(recording: Recording) -> Iterator[tuple[MediaName, bytes]]:
    """The voice notes and photos of those marks."""
    marks = {row["mark"] for row in marks_of(recording)}
    for path in files_of(recording):
        with contextlib.suppress(OSError):
            yield from ((name, data) for name, data in all_media(path) if name.mark in marks)


def described_late(recording: Recording) -> list[InterventionDescription]:
    """The descriptions of its interventions after it was complete, oldest first."""
    rows = [row for path in files_of(recording) for row in annotation_store.read(path).described]
    return sorted(rows, key=lambda row: row["described_ms"])


def files_of(recording: Recording) -> Sequence[Path]:
    """Those of which it is, and before them the folder of a split bag: marks and descriptions can be beside each."""
    folders = [folder for path in recording.paths if path.is_dir() and (folder := path.absolute()).name]
    return [*folders, *(file.path for file in recording.files)]


def title_of(mark: DriveMark) -> str:
    """A short text for a map or a table."""
    return mark["category"] or (mark["words"][:60] if mark["words"] else "Mark")
