"""Starts the parts of a server in order, and stops them in order."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial
from pathlib import Path

from server.bus.journal import Journal
from server.mail.drive_reports import DriveReports
from server.recording.folder import RecordingsFolder
from server.recording.recover import Recovered, recover_left
from server.storage.storage_thread import StorageThread
from server.system import log_context
from server.web.services import Services

log = logging.getLogger("catgraph.app")

STOPS_WITHIN_S = 30.0  # a slow disk is given time for what is not written yet; a disk that hangs is not waited for
_AT_LEAST_S = 0.5  # for each part, also of a server that has no time left


@asynccontextmanager
async def lifespan(
    running: Services, journal: Journal, storage: StorageThread, *, stops_within_s: float = STOPS_WITHIN_S
) -> AsyncIterator[None]:
    """From the start-up of a server to its shut-down; the journal is closed after all that writes to it.

    A part that does not stop in time, as behind a disk that hangs, is left, and the log states what was not written.
    """
    recovering = await _start(running)
    try:
        yield
    finally:
        if recovering is not None:
            recovering.cancel()  # what it was at is done again at the next start
        await _stop(running, partial(asyncio.to_thread, _close, storage, journal), stops_within_s)


def _close(storage: StorageThread, journal: Journal) -> None:
    storage.close()
    journal.close()


async def _start(running: Services) -> asyncio.Task[None] | None:
    """Start all parts; the recovery of what the last run left continues in the background."""
    if running.recordings is not None:
        await running.recordings.start()
    running.people.start()
    if running.marks is not None:
        running.marks.start()
    if running.exports is not None:
        await running.exports.start()
    if running.uploader is not None:
        await running.uploader.start()
    if running.mailer is not None:
        await running.mailer.start()
        running.drive_reports = DriveReports(running.mailer, now=running.now)
        running.drive_reports.start()
    recovering = _recover(running)  # once all are there that are notified of a recording
    for name, session in running.sessions.items():
        with log_context.about(name if len(running.sessions) > 1 else ""):
            await session.start()
    if running.link is not None:
        running.link.start()
    return recovering


async def _stop(running: Services, close: Callable[[], Awaitable[None]], within_s: float) -> None:
    """Stop all parts: first what records and judges, then what works on recordings, at last what writes."""
    ends_s = running.now() + within_s

    async def ends(part: str, stop: Callable[[], Awaitable[object]]) -> bool:
        stopping = asyncio.ensure_future(stop())
        done, _ = await asyncio.wait([stopping], timeout=max(_AT_LEAST_S, ends_s - running.now()))
        if done:
            if (error := stopping.exception()) is not None:  # the other parts are stopped all the same
                log.error("a part did not stop well: part=%s", part, exc_info=error)
            return True
        jobs, events = running.storage.waiting, running.unwritten_events()
        log.error("shutdown_incomplete part=%s unwritten_jobs=%d unwritten_events=%d", part, jobs, events)
        return False

    sessions = running.sessions
    if running.link is not None:
        await ends("broker", running.link.stop)
    await ends("replays", running.replays.close_all)
    await ends("sessions", lambda: asyncio.gather(*(session.stop() for session in sessions.values())))
    parts = (
        ("marks", running.marks),
        ("store", running.uploader),
        ("drive reports", running.drive_reports),
        ("mail", running.mailer),
        ("exports", running.exports),
    )
    for part, one in (*parts, ("recordings", running.recordings)):
        if one is not None:
            await ends(part, one.stop)
    running.access.stop()
    running.people.stop()
    await ends("storage", close)
    running.ground.close()
    if running.folder is not None:
        running.folder.close()


def _recover(running: Services) -> asyncio.Task[None] | None:
    """Start to recover the files of the last run; they are listed before a new recording starts."""
    recordings = running.recordings
    if recordings is None:
        return None
    folder = RecordingsFolder(recordings.folder)
    try:
        left = folder.unfinished()
    except OSError as why:
        log.error("the recordings cannot be looked through: %s", why)
        return None

    def on_recovered(path: Path, found: Recovered) -> None:
        if found.path is not None:
            running.recording_finished(found.path)
        elif running.marks is not None:
            running.marks.finished(path)  # what waited for it is looked at again
        for name, session in running.sessions.items():
            if folder.place(name, found.id).parent == path.parent:
                session.note("recovered", found.sentence, recording=found.id)

    if running.drive_reports is not None:
        for path in left:
            running.drive_reports.finished(path)  # as soon as it is recovered, also after another kill
    return (
        asyncio.create_task(recover_left(left, on_recovered=on_recovered), name="recover recordings") if left else None
    )
