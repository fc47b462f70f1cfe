"""The export jobs of one server: start, progress, cancel, download, and deletion of unused files.

One job runs at a time, each in its own process; queue, stored files and their lifetime are bounded.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import re
import secrets
import shutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from server.protocol.answers import ExportJob, ExportState
from server.recording.catalog import annotations as annotation_store
from server.recording.export.clip import Window
from server.recording.export.export_format import ExportRefused
from server.recording.export.formats import CLIP, FORMATS
from server.recording.export.worker import Made, run_worker
from server.recording.folder import FINISHED, WRITING, RecordingsFolder, id_of, is_id
from server.recording.space import why

log = logging.getLogger("catgraph.export")

MOST_BESIDE = 10_000  # files beside a recording that are looked at
MOST_WAITING = 20  # jobs that are not done
MOST_KEPT = 100  # jobs that are
KEEP_S = 3600.0  # the file of a job that is done
KEEP_BYTES = 2_000_000_000  # of all such files together
FLUSHED_S = 1.5  # after this time the recorder has written what it received
POLL_S = 0.25
NOT_ALL = "The export is incomplete."
NOT_WHOLE = f"It is ready. {NOT_ALL}"
AHEAD_S = 60.0  # a clip may end so long after now: it is waited for


class TooMany(Exception):
    """Nothing more is taken now. The text is one sentence."""


class NoSuchRecording(Exception):
    """The text is one sentence."""


class NotYet(Exception):
    """The requested time is in the future. The text is one sentence."""


@dataclass(slots=True, eq=False)
class Job:
    """One export, or one clip."""

    id: str
    of: str  # the recording
    format: str
    key: tuple[Any, ...]  # the same for the same work
    named: str = ""  # the recording that was named: of a drive, any part
    state: ExportState = "waiting"
    progress: float = 0.0
    sentence: str = "Waiting for the previous export."
    notes: list[str] = field(default_factory=list)  # what is not in it, and why
    is_whole: bool | None = None  # False: something of the recording is not in it; None: not made yet
    path: Path | None = None
    size: int | None = None
    recording: str | None = None  # the new one, of a clip that is done
    done_s: float | None = None
    finished: asyncio.Event = field(default_factory=asyncio.Event)

    @property
    def is_over(self) -> bool:
        return self.state in ("done", "failed", "cancelled")

    def as_json(self) -> ExportJob:
        return {
            "job": self.id,
            "of": self.of,
            "format": self.format,
            "state": self.state,
            "progress": round(self.progress, 3),
            "sentence": self.sentence,
            "notes": self.notes,
            "is_whole": self.is_whole,
            "size_bytes": self.size,
            "recording": self.recording,
        }


class Exports:
    """To be used on the event loop alone."""

    def __init__(
        self,
        folder: Path,
        recordings: RecordingsFolder,
        path_of: Callable[[str], Path | None],
        on_clip: Callable[[Path], None],
        *,
        now: Callable[[], float],
        wall_ms: Callable[[], int],
        drive_of: Callable[[str], Sequence[str]] = lambda id: [id],
    ) -> None:
        """`folder` belongs to this class: existing files are deleted. `path_of` finds finished recordings and
        `drive_of` all those of the same drive, in any thread; `on_clip` is called for each new one."""
        self._folder = folder
        self._recordings = recordings
        self._path_of = path_of
        self._drive_of = drive_of
        self._on_clip = on_clip
        self._now = now
        self._wall_ms = wall_ms
        self._jobs: dict[str, Job] = {}
        self._tasks: dict[str, asyncio.Task[None]] = {}
        self._removing: set[asyncio.Task[None]] = set()  # of files that can no longer be downloaded
        self._turn = asyncio.Lock()

    async def start(self) -> None:
        """Sweeps up what a server left that was killed."""
        await asyncio.to_thread(shutil.rmtree, self._folder, ignore_errors=True)

    async def stop(self) -> None:
        """Ends all that is going on and removes every file."""
        for task in list(self._tasks.values()):
            task.cancel()
        await asyncio.gather(*self._tasks.values(), *self._removing, return_exceptions=True)
        await asyncio.to_thread(shutil.rmtree, self._folder, ignore_errors=True)

    def job(self, id: str) -> Job | None:
        self._sweep()
        return self._jobs.get(id)

    def jobs(self) -> list[Job]:
        self._sweep()
        return list(self._jobs.values())

    async def begin(self, of: str, format: str) -> Job:
        """Exports a recording, or answers the job that does so already; a format of the drive is made of all its parts,
        whichever of them is named. Raises NoSuchRecording, TooMany."""
        first, sources = await asyncio.to_thread(self._sources, of, format)
        changed = await asyncio.to_thread(lambda: tuple(map(_state_of, sources)))
        return self._begin(first, format, (first, format, changed), lambda job: self._export(job, sources), named=of)

    async def clip(self, of: str, window: Window) -> Job:
        """Cuts a recording, one being written too. Raises NoSuchRecording, NotYet, TooMany."""
        await asyncio.to_thread(self._source, of)
        if window.to_ns / 1e6 > self._wall_ms() + AHEAD_S * 1000:
            raise NotYet("This time is in the future.")
        return self._begin(of, CLIP, (of, CLIP, window), lambda job: self._clip(job, window), named=of)

    async def cancel(self, id: str) -> None:
        """End a running job; its file is deleted when this returns."""
        job, task = self._jobs.get(id), self._tasks.get(id)
        if job is not None and task is not None:
            task.cancel()
            await job.finished.wait()
        elif job is not None and job.state == "done":
            self._drop(job)
            await asyncio.gather(*self._removing)

    def _begin(self, of: str, format: str, key: tuple[Any, ...], work: Callable[[Job], Any], *, named: str) -> Job:
        self._sweep()
        for job in self._jobs.values():
            if job.is_whole is False and job.named != named:
                continue  # another part may be readable with others
            if job.key == key and (not job.is_over or (job.state == "done" and job.path is not None)):
                return job
        if len(self._tasks) >= MOST_WAITING:
            raise TooMany(f"{MOST_WAITING} exports are already waiting: try again later.")
        job = Job(id=secrets.token_hex(8), of=of, format=format, key=key, named=named)
        self._jobs[job.id] = job
        task = self._tasks[job.id] = asyncio.create_task(self._run(job, work), name=f"export {of} as {format}")
        task.add_done_callback(lambda _: self._over(job))
        return job

    async def _run(self, job: Job, work: Callable[[Job], Any]) -> None:
        try:
            await work(job)
            job.state, job.progress = "done", 1.0
        except asyncio.CancelledError:
            job.state, job.sentence = "cancelled", "It was cancelled."
            raise
        except (ExportRefused, NoSuchRecording) as refused:
            job.state, job.sentence = "failed", str(refused)
        except OSError as error:
            job.state, job.sentence = "failed", f"It cannot be written: {why(error)}."
        except Exception:
            log.exception("export failed")
            job.state, job.sentence = "failed", "Internal server error; the server's log has the details."
        finally:
            if job.state != "done" or job.format == CLIP:
                await asyncio.shield(asyncio.to_thread(shutil.rmtree, self._folder / job.id, ignore_errors=True))

    def _over(self, job: Job) -> None:
        """Also of one that was cancelled before it began."""
        if not job.is_over:
            job.state, job.sentence = "cancelled", "It was cancelled."
        job.done_s = self._now()
        self._tasks.pop(job.id, None)
        job.finished.set()

    async def _export(self, job: Job, sources: Sequence[Path]) -> None:
        async with self._turn:
            out = await self._place(job, f"{job.of}.{FORMATS[job.format].extension}")
            named = next((path for path in sources if id_of(path) == job.named), sources[0])
            arguments = ["--format", job.format, "--name", job.of, "--required", str(named), "--out", str(out)]
            made = await self._work(job, sources, arguments)
            job.path = made.path
            job.size = (await asyncio.to_thread(made.path.stat)).st_size
            job.sentence = "It is ready." if made.is_whole else NOT_WHOLE

    async def _clip(self, job: Job, window: Window) -> None:
        await self._until_recorded(job, window)
        async with self._turn:
            sources = await asyncio.to_thread(self._with_neighbours, job.of)
            out = await self._place(job, f"clip{FINISHED}")
            moment = datetime.fromtimestamp(window.at_ns / 1e9, UTC)
            about = ["--at", moment.isoformat(timespec="milliseconds")]
            about += ["--before", str(window.before_s), "--after", str(window.after_s)]
            arguments = ["--format", CLIP, "--name", job.of, *about, "--out", str(out)]
            try:
                made = await self._work(job, sources, arguments)
            except ExportRefused:
                if len(sources) == 1:
                    raise
                made = await self._work(job, sources[:1], arguments)  # another part must not spoil this one
            path = await asyncio.to_thread(_keep, made.path, sources[0].parent, f"{job.of[:50]}_clip_{moment:%H%M%S}")
            job.recording, job.size = id_of(path), (await asyncio.to_thread(path.stat)).st_size
            job.sentence = (
                "It is in the list of recordings." if made.is_whole else f"It is in the list of recordings. {NOT_ALL}"
            )
            self._on_clip(path)

    async def _until_recorded(self, job: Job, window: Window) -> None:
        """Wait for data that is still being recorded, at most until the recording ends."""
        while True:
            left_s = window.to_ns / 1e9 + FLUSHED_S - self._wall_ms() / 1000
            source = await asyncio.to_thread(self._source, job.of)
            if left_s <= 0 or not source.name.endswith(WRITING):
                return
            job.sentence = f"Waiting for {window.after_s:.0f} s after it to be recorded: {left_s:.0f} s left."
            await asyncio.sleep(min(left_s, POLL_S))

    async def _work(self, job: Job, sources: Sequence[Path], arguments: Sequence[str]) -> Made:
        def on_progress(part: float) -> None:
            job.progress = max(job.progress, min(part, 0.999))

        job.state, job.sentence = "working", "In progress."
        made = await run_worker([*map(str, sources), *arguments], on_progress)
        job.notes, job.is_whole = made.notes, made.is_whole
        return made

    async def _place(self, job: Job, name: str) -> Path:
        folder = self._folder / job.id
        await asyncio.to_thread(folder.mkdir, parents=True, exist_ok=True)
        return folder / name

    def _sources(self, of: str, format: str) -> tuple[str, list[Path]]:
        """What is exported: its name and its files."""
        source = self._source(of)
        ids = list(self._drive_of(of)) if FORMATS[format].of_drive else [of]
        others = {id: source if id == of else self._path_of(id) for id in ids}
        found = {id: path for id, path in others.items() if path is not None}
        return next(iter(found)), list(found.values())

    def _source(self, id: str) -> Path:
        path = self._path_of(id)
        if path is None and is_id(id):
            path = next((path for path in self._recordings.unfinished() if id_of(path) == id), None)
        if path is None:
            raise NoSuchRecording("There is no such recording.")
        return path

    def _with_neighbours(self, id: str) -> list[Path]:
        """The recording, and the parts of its session before and after it: a clip may reach into them."""
        first, _, number = id.rpartition("_p")
        part = int(number) if first and re.fullmatch(r"[1-9]\d{0,3}", number) else 1
        first = first if part > 1 else id
        found = [self._source(id)]
        for other in (part - 1, part + 1):
            if other >= 1:
                with contextlib.suppress(NoSuchRecording):
                    found.append(self._source(first if other == 1 else f"{first}_p{other}"))
        return found

    def _sweep(self) -> None:
        """Forgets what was done long ago, and the oldest files where they are too many."""
        ended = {
            job.id: job.done_s for job in self._jobs.values() if job.done_s is not None
        }  # the clean-up task continues
        done = sorted((self._jobs[id] for id in ended), key=lambda job: ended[job.id])
        room = sum(job.size or 0 for job in done if job.path is not None)
        for index, job in enumerate(done):
            is_old = self._now() - ended[job.id] > KEEP_S
            is_newest = index == len(done) - 1
            if is_old or len(done) - index > MOST_KEPT or (room > KEEP_BYTES and not is_newest):
                room -= (job.size or 0) if job.path is not None else 0
                self._drop(job)

    def _drop(self, job: Job) -> None:
        self._jobs.pop(job.id, None)
        if job.path is not None:
            removing = asyncio.create_task(asyncio.to_thread(shutil.rmtree, job.path.parent, ignore_errors=True))
            self._removing.add(removing)
            removing.add_done_callback(self._removing.discard)


def _state_of(path: Path) -> tuple[tuple[str, int, int], ...]:
    """Another value: another content of the file, or of what is beside it: annotations, late marks, their files."""
    try:
        stat = path.stat()
    except OSError:
        raise NoSuchRecording("There is no such recording.") from None
    found = [("", stat.st_size, stat.st_mtime_ns)]
    folder = annotation_store.media_beside(path)
    with contextlib.suppress(OSError):
        listed = sorted(folder.iterdir())[:MOST_BESIDE] if folder.is_dir() else []
        for file in (annotation_store.beside(path), *listed):
            with contextlib.suppress(FileNotFoundError):
                beside = file.stat()
                found.append((file.name, beside.st_size, beside.st_mtime_ns))
    return tuple(found)


def _keep(clip: Path, folder: Path, id: str) -> Path:
    """Moves a clip among the recordings, under a name that nothing has."""
    for n in range(1, 1000):
        path = folder / f"{id if n == 1 else f'{id}-{n}'}{FINISHED}"
        with contextlib.suppress(FileExistsError):
            os.link(clip, path)  # unlike a rename it never writes over another file
            clip.unlink()
            return path
    raise FileExistsError(f"a thousand clips are named {id}")
