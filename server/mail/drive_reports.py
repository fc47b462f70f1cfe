"""Mails the report of each drive by itself, where that is wished: to the addresses of the setting `report_to`.

A drive has ended once nothing of its session has been written for a while: a link that returns goes on in another part.
What is still to be mailed is in a file, so that a server that is killed mails it after its next start.
"""

from __future__ import annotations

import asyncio
import logging
import re
from collections.abc import Callable, Iterable
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import orjson

from server.mail.mail_folder import MailRefused
from server.mail.mailer import Mailer
from server.mail.order import Order
from server.recording.folder import FINISHED, WRITING, id_of, is_id
from server.storage import durable_file
from server.system.supervision import Supervisor

log = logging.getLogger("catgraph.mail")

QUIET_S = 60.0  # nothing was written for so long: the drive has ended
MOST_PARTS = 20  # recordings of one mail
MOST_WAITING = 10_000  # recordings that wait to be mailed
MAX_BYTES = 4 * 1024 * 1024  # of the file of what waits
FILE = "reports.json"
TEXT = "The report of the drive, sent when it ended. It opens in any browser without a network, and prints on A4."
_PART = re.compile(r"_p\d+(-\d+)?$")
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
        self._loop: asyncio.AbstractEventLoop | None = None
        self._due = asyncio.Event()
        self._supervisor = Supervisor("drive reports")

    def start(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._supervisor.keep("mailing", self._run)

    async def stop(self) -> None:
        """What waits is ordered at once: the outbox keeps it, and it is sent after the next start."""
        await self._supervisor.stop()
        self._loop = None
        for (folder, session), drive in list(self._waiting.items()):
            if session not in await asyncio.to_thread(_written, folder):
                await self._mail(folder, session, drive)
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
        drive = self._waiting.setdefault((folder, _PART.sub("", id)), _Drive())
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
            for (folder, session), drive in list(self._waiting.items()):
                written = await asyncio.to_thread(_written, folder)
                if session not in written and self._is_over(folder, session, drive, written):
                    await self._mail(folder, session, drive)

    def _is_over(self, folder: Path, session: str, drive: _Drive, written: Iterable[str]) -> bool:
        """Whether nothing more will come: it is quiet, or a later session has begun."""
        others = [*written, *(other for place, other in self._waiting if place == folder)]
        is_followed = any(other > session for other in others)
        return self._now() - drive.at_s >= self._quiet_s or (is_followed and not drive.is_refused)

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

    async def _mail(self, folder: Path, session: str, drive: _Drive) -> None:
        """Orders the mails of one drive; what the outbox does not take is tried again."""
        to = self._mailer.settings.report_to
        ids = list(drive.ids)
        there = await asyncio.to_thread(lambda: [id for id in ids if (folder / f"{id}{FINISHED}").is_file()])
        try:
            for first in range(0, len(there) if to else 0, MOST_PARTS):
                part = there[first : first + MOST_PARTS]
                await self._mailer.order(f"report-{part[-1][-_KEY:]}", _order(folder, part, to))
        except MailRefused as why:
            if not drive.is_refused:
                log.warning("drive report not mailed, tried again: recording=%s reason=%s", session, why)
            drive.is_refused, drive.at_s = True, self._now()
            return
        drive.ids = [id for id in drive.ids if id not in ids]  # others came meanwhile
        if not drive.ids:
            del self._waiting[folder, session]


def _order(folder: Path, ids: list[str], to: tuple[str, ...]) -> Order:
    return Order(
        recordings=tuple(ids),
        format="html",
        to=to,
        subject=f"Drive report: {folder.name} {ids[0]}"[:200],
        text=TEXT,
        too_large="split",
        by="catgraph",
    )


def _written(folder: Path) -> set[str]:
    """The sessions of which something is being written, or waits to be recovered."""
    try:
        return {_PART.sub("", id_of(path)) for path in folder.iterdir() if path.name.endswith(WRITING)}
    except OSError:
        return set()


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
