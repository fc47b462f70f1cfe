"""Which of several files are parts of one recording."""

from __future__ import annotations

from collections.abc import Hashable, Sequence
from pathlib import Path

from server.recording.read.errors import RecordingUnreadable
from server.recording.read.read import open_recording

_SUFFIXES = (".mcap", ".writing")  # of catgraph's own files


def by_recording(paths: Sequence[Path]) -> list[list[Path]]:
    """The files of each recording, in the order in which the recordings are first named.

    Parts of a recording of catgraph name it in their metadata. Every other file is a recording, as is a clip.
    """
    groups: dict[Hashable, list[Path]] = {}
    for number, path in enumerate(paths):
        groups.setdefault(_recording_of(path) or number, []).append(path)
    return list(groups.values())


def _recording_of(path: Path) -> tuple[str, str] | None:
    """Vehicle and recording of the file; None: unknown."""
    if path.suffix not in _SUFFIXES or not path.is_file():
        return None
    try:
        with open_recording([path]) as recording:
            about = recording.metadata
    except (RecordingUnreadable, MemoryError):
        return None  # reading it reports the reason
    return (about.get("vehicle", ""), about["session"]) if "session" in about and "clip_of" not in about else None
