"""The source of the recordings that are mailed: the catalog and the exports, as the mailer needs them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Protocol

from server.recording.export import Made, make_export


class Source(Protocol):
    """What the rest of the server gives to the mailer."""

    def path_of(self, recording: str) -> Path | None:
        """The finished recording of that name; None where there is none. May be called from any thread."""

    def drive_of(self, recording: str) -> Sequence[str]:
        """All recordings of its drive, oldest first; the recording alone where nothing else is known. As `path_of`."""

    async def export(
        self, paths: Sequence[Path], format: str, into: Path, progress: Callable[[float], None], *, required: Path
    ) -> Made:
        """Writes a recording, or all parts of a drive, in another format into the folder `into`. Progress is 0 to 1.

        What cannot be read with `required`, one of the paths, is left out and named in the notes.
        Raises OSError, ValueError or RuntimeError with a sentence.
        """


class Recorded:
    """The mailer's source in a running server."""

    def __init__(self, path_of: Callable[[str], Path | None], drive_of: Callable[[str], Sequence[str]]) -> None:
        self._path_of = path_of
        self._drive_of = drive_of

    def path_of(self, recording: str) -> Path | None:
        return self._path_of(recording)

    def drive_of(self, recording: str) -> Sequence[str]:
        return self._drive_of(recording)

    async def export(
        self, paths: Sequence[Path], format: str, into: Path, progress: Callable[[float], None], *, required: Path
    ) -> Made:
        return await make_export(paths, format, into, progress, required=required)
