"""Makes the clip around an alarm for the store: by the export that people use, into a folder of its own."""

from __future__ import annotations

import asyncio
import contextlib
import shutil
from collections.abc import Callable, Iterator
from datetime import UTC, datetime
from pathlib import Path

from server.recording.export.clip import AFTER_S, BEFORE_S
from server.recording.export.export_format import ExportRefused, NothingRecorded, nothing
from server.recording.export.formats import CLIP
from server.recording.export.worker import Made, run_worker

_POLL_S = 0.2


class ClipMaker:
    """Blocking: for the thread of the uploader."""

    def __init__(self, folder: Path, may_go_on: Callable[[], None]) -> None:
        """`folder` belongs to this class: existing files are deleted. `may_go_on` raises where work must end."""
        self._folder = folder
        self._may_go_on = may_go_on

    @contextlib.contextmanager
    def made(self, path: Path, id: str, at_ms: int) -> Iterator[Path | None]:
        """The clip, until the end of the block; None: nothing was recorded then. Raises OSError."""
        shutil.rmtree(self._folder, ignore_errors=True)
        self._folder.mkdir(parents=True)
        moment = datetime.fromtimestamp(at_ms / 1000, UTC).isoformat(timespec="milliseconds")
        about = ["--format", CLIP, "--name", id, "--at", moment, "--before", str(BEFORE_S), "--after", str(AFTER_S)]
        arguments = [str(path), *about, "--out", str(self._folder / "clip.mcap")]
        try:
            try:
                clip = asyncio.run(self._run(arguments)).path
            except NothingRecorded:
                clip = None
            except ExportRefused as why:
                raise OSError(f"The clip was not made: {why}".rstrip(".")) from None
            yield clip
        finally:
            shutil.rmtree(self._folder, ignore_errors=True)

    async def _run(self, arguments: list[str]) -> Made:
        """The export, ended where work must end."""
        work = asyncio.create_task(run_worker(arguments, nothing))
        try:
            while not (await asyncio.wait([work], timeout=_POLL_S))[0]:
                self._may_go_on()
            return await work
        finally:
            work.cancel()
            with contextlib.suppress(asyncio.CancelledError, Exception):
                await work
