"""What is mailed, from where it is kept: the catalog of recordings and the exports."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from pathlib import Path

from server.recording.export import Made, make_export


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
