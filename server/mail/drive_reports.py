"""Mails the report of each drive by itself, where that is wished: to the addresses of the setting `report_to`.

A drive has ended once nothing of its session has been written for a while: a link that returns goes on in another part,
and after a restart of the server the drive goes on in another session.
What is still to be mailed is in a file, so that a server that is stopped or killed mails it after its next start.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson

from server.mail.mail_folder import MailRefused
from server.mail.mailer import Mailer
from server.mail.order import Order
from server.recording.drive.drive_events import of_change, read_drive_events
from server.recording.folder import FINISHED, WRITING, first_part, id_of, is_id
from server.recording.read.read import RecordingUnreadable, open_recording
from server.storage import durable_file
from server.system.supervision import Supervisor

log = logging.getLogger("catgraph.mail")

QUIET_S = 60.0  # nothing was written for so long: the drive has ended
MOST_WAITING = 10_000  # recordings that wait to be mailed
MAX_BYTES = 4 * 1024 * 1024  # of the file of what waits
FILE = "reports.json"
TEXT = "The report of the drive, sent when it ended. It opens in any browser without a network, and prints on A4."
_KEY = 57  # letters of an id in the key of an order


@dataclass(slots=True)
class _Drive:
    """One session's recordings that wait to be mailed."""

    ids: list[str] = field(default_factory=list)
    at_s: float = 0.0  # when the newest was complete, or an order was refused
    is_refused: bool = False


class DriveReports:
    """Of one server. `finished` may be called from any thread."""

    def __init__(self, mailer: Mailer, *, now: Callable[[], float], quiet_s: float = QUIET_S) -> None:
        self._mailer = mailer
        self._file = mailer.place / FILE
        self._now = now
        self._quiet_s = quiet_s
        self._waiting: dict[tuple[Path, str], _Drive] = {}  # by folder of a car, and session
        self._kept: dict[str, list[str]] = {}  # folder → recordings, as the file has it
        self._resumed: dict[tuple[Path, str], bool] = {}  # whether a session continues the drive before it
        self._written: dict[Path, frozenset[str]] = {}  # sessions being written when last looked, by folder of a car
        self._loop: asyncio.AbstractEventLoop | None = None
        self._due = asyncio.Event()
        self._supervisor = Supervisor("drive reports")

    def start(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._supervisor.keep("mailing", self._run)

    async def stop(self) -> None:
        """Drives that are over are ordered; the others may go on after the next start, and are kept until then."""
        await self._supervisor.stop()
        self._loop = None
        await self._mail_all(self._is_over)
        await self._keep()

    def problems(self) -> list[str]:
        """What is wrong with its task, a sentence each."""
        return self._supervisor.problems()

    def finished(self, path: Path) -> None:
        """A recording is complete, or is being recovered."""
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._take, path.parent, id_of(path))

    def _take(self, folder: Path, id: str) -> None:
        if not self._mailer.settings.report_to:
            return
        drive = self._waiting.setdefault((folder, first_part(id)), _Drive())
        if id not in drive.ids:
            drive.ids.append(id)
        drive.at_s = self._now()
        if sum(len(one.ids) for one in self._waiting.values()) > MOST_WAITING:
            oldest = next(iter(self._waiting))
            del self._waiting[oldest]
            log.error("drive report not mailed, too many wait: recording=%s", oldest[1])
        self._due.set()

    async def _run(self) -> None:
        for place, ids in (await asyncio.to_thread(_read, self._file)).items():
            for id in ids:
                self._take(Path(place), id)
        while True:
            self._due.clear()
            await self._keep()
            try:
                async with asyncio.timeout(min(1.0, self._quiet_s) if self._waiting else None):
                    await self._due.wait()
                continue  # it is in the file before anything else
            except TimeoutError:
                pass
            await self._mail_all(self._is_over)

    async def _mail_all(self, is_over: Callable[[Sequence[_Drive], bool], bool]) -> None:
        """Mails each drive of which nothing is being written and that is over."""
        for folder in dict.fromkeys(folder for folder, _ in self._waiting):
            before, now = self._written.get(folder, frozenset()), await asyncio.to_thread(_written, folder)
            self._written[folder] = now
            written = now | before  # what was completed meanwhile is announced a moment later
            mine = {session: drive for (place, session), drive in self._waiting.items() if place == folder}
            groups = await asyncio.to_thread(self._grouped, folder, sorted({*mine, *written}))
            for number, group in enumerate(groups):
                waiting = {session: mine[session] for session in group if session in mine}
                is_followed = number < len(groups) - 1
                if waiting and written.isdisjoint(group) and is_over(list(waiting.values()), is_followed):
                    await self._mail(folder, waiting)

    def _is_over(self, drives: Sequence[_Drive], is_followed: bool) -> bool:
        """Whether nothing more will come: it is quiet, or another drive has begun."""
        is_quiet = self._now() - max(drive.at_s for drive in drives) >= self._quiet_s
        return is_quiet or (is_followed and not any(drive.is_refused for drive in drives))

    def _grouped(self, folder: Path, sessions: Iterable[str]) -> list[list[str]]:
        """The sessions of each drive: one that continues after a restart of the server is of the drive before it."""
        groups: list[list[str]] = []
        for session in sessions:
            if groups and self._resumes(folder, session):
                groups[-1].append(session)
            else:
                groups.append([session])
        return groups

    def _resumes(self, folder: Path, session: str) -> bool:
        if (folder, session) not in self._resumed:
            found = _says_it_resumes(folder, session)
            if found is None:
                return True  # nothing is written yet that could say so: the drive before it waits
            self._resumed[folder, session] = found
        return self._resumed[folder, session]

    async def _keep(self) -> None:
        """Writes what waits, where that has changed."""
        kept: dict[str, list[str]] = {}
        for (folder, _), drive in self._waiting.items():
            kept.setdefault(str(folder), []).extend(drive.ids)
        if kept == self._kept:
            return
        try:
            await asyncio.to_thread(durable_file.write, self._file, orjson.dumps(kept), mode=0o600)
        except OSError as why:
            log.error("what is still to be mailed is not kept: %s", why)
        else:
            self._kept = kept

    async def _mail(self, folder: Path, drives: Mapping[str, _Drive]) -> None:
        """Orders the mail of one drive; what the outbox does not take is tried again."""
        to = self._mailer.settings.report_to
        taken = {session: list(drive.ids) for session, drive in drives.items()}
        there = await asyncio.to_thread(_one_of_each, folder, taken.values())
        try:
            if to and there:
                await self._mailer.order(f"report-{there[-1][-_KEY:]}", _order(folder, there, to))
        except MailRefused as why:
            for session, drive in drives.items():
                if not drive.is_refused:
                    log.warning("drive report not mailed, tried again: recording=%s reason=%s", session, why)
                drive.is_refused, drive.at_s = True, self._now()
            return
        for session, drive in drives.items():
            drive.ids = [id for id in drive.ids if id not in taken[session]]  # others came meanwhile
            if not drive.ids:
                del self._waiting[folder, session]
            self._resumed.pop((folder, session), None)


def _one_of_each(folder: Path, sessions: Iterable[Sequence[str]]) -> list[str]:
    """The first recording of each session that is there."""
    found = (next((id for id in ids if (folder / f"{id}{FINISHED}").is_file()), None) for ids in sessions)
    return [id for id in found if id is not None]


def _order(folder: Path, ids: Sequence[str], to: tuple[str, ...]) -> Order:
    """The report is of the whole drive of which these recordings are parts."""
    return Order(
        recordings=tuple(ids),
        format="html",
        to=to,
        subject=f"Drive report: {folder.name} {ids[0]}"[:200],
        text=TEXT,
        too_large="split",
        by="catgraph",
    )


def _says_it_resumes(folder: Path, session: str) -> bool | None:
    """None: it cannot be read yet, as nothing of it is on the disk."""
    path = next((path for end in (FINISHED, WRITING) if (path := folder / f"{session}{end}").exists()), None)
    if path is None:
        return False  # its first part is gone
    try:
        with open_recording([path]) as recording:
            events = read_drive_events(recording)
    except RecordingUnreadable:
        return None if path.name.endswith(WRITING) else False
    return any(event.get("resumes") is True for event in of_change(events or (), "started"))


def _written(folder: Path) -> frozenset[str]:
    """The sessions of which something is being written, or waits to be recovered."""
    try:
        return frozenset(first_part(id_of(path)) for path in folder.iterdir() if path.name.endswith(WRITING))
    except OSError:
        return frozenset()


def _read(path: Path) -> dict[str, list[str]]:
    """What the last run left to be mailed; none where there is no such file, or one that is not ours."""
    try:
        with path.open("rb") as file:
            found: Any = orjson.loads(file.read(MAX_BYTES))
    except FileNotFoundError:
        return {}
    except (OSError, orjson.JSONDecodeError) as why:
        log.error("what the last run left to be mailed cannot be read: %s", why)
        return {}
    rows = [(folder, ids) for folder, ids in found.items() if isinstance(ids, list)] if isinstance(found, dict) else []
    return {folder: [id for id in ids[:MOST_WAITING] if isinstance(id, str) and is_id(id)] for folder, ids in rows}
