"""Recordings in the forms that others read: ROS 1 bag, tables, tracks, a page; and the minute around an alarm."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from server.recording.export.export_format import ExportRefused, Progress, nothing
from server.recording.export.formats import FORMATS
from server.recording.export.worker import Made, run_worker

__all__ = ["ExportRefused", "Made", "make_export"]


async def make_export(
    paths: Sequence[Path], format: str, into: Path, progress: Progress = nothing, *, required: Path | None = None
) -> Made:
    """Writes a recording in a format of FORMATS into a folder, by a process of its own; several files are one,
    with `required` as far as they can be read with that one of them.

    `progress` is called with 0 to 1. Raises ExportRefused with one sentence, ValueError for an unknown format,
    OSError. Where it is cancelled the process is ended and leaves nothing behind.
    """
    if format not in FORMATS:
        raise ValueError(f"There is no format {format[:40]!r}.")
    out = into / f"{paths[0].name.partition('.')[0]}.{FORMATS[format].extension}"
    with_required = [] if required is None else ["--required", str(required)]
    return await run_worker([*map(str, paths), "--format", format, "--out", str(out), *with_required], progress)
