"""Starts the parts of a server in order, and stops them in order."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

from server.bus.journal import Journal
from server.recording.folder import RecordingsFolder
from server.recording.recover import Recovered
from server.recording.recovery import recover_left
from server.storage.storage_thread import StorageThread
from server.web.services import Services

log = logging.getLogger("catgraph.app")


@asynccontextmanager
async def lifespan(running: Services, journal: Journal, storage: StorageThread) -> AsyncIterator[None]:
    """From the start-up of a server to its shut-down; the journal is closed after all that writes to it.

    A disk that hangs holds the shut-down: what waits for it is written first.
    """
    recovering = await _start(running)
    try:
        yield
    finally:
        if recovering is not None:
            recovering.cancel()  # what it was at is done again at the next start
        await _stop(running)
        await asyncio.to_thread(_close, storage, journal)
        running.ground.close()
        if running.folder is not None:
            running.folder.close()


def _close(storage: StorageThread, journal: Journal) -> None:
    storage.close()
    journal.close()


async def _start(running: Services) -> asyncio.Task[None] | None:
    """Start all parts; the recovery of what the last run left, which goes on meanwhile."""
    if running.recordings is not None:
        await running.recordings.start()
    recovering = _recover(running)
    if running.exports is not None:
        await running.exports.start()
    if running.mailer is not None:
        await running.mailer.start()
    for session in running.sessions.values():
        await session.start()
    return recovering


async def _stop(running: Services) -> None:
    """Stop all parts: first what records and judges, then what works on recordings."""
    await running.replays.close_all()
    await asyncio.gather(*(session.stop() for session in running.sessions.values()))
    if running.mailer is not None:
        await running.mailer.stop()
    if running.exports is not None:
        await running.exports.stop()
    if running.recordings is not None:
        await running.recordings.stop()
    running.access.stop()


def _recover(running: Services) -> asyncio.Task[None] | None:
    """Begins to make whole what the last run left, which must be looked for before anything is recorded anew."""
    recordings = running.recordings
    if recordings is None:
        return None
    folder = RecordingsFolder(recordings.folder)
    try:
        left = folder.unfinished()
    except OSError as why:
        log.error("the recordings cannot be looked through: %s", why)
        return None

    def told(path: Path, found: Recovered) -> None:
        if found.path is not None:
            recordings.add(found.path)
        for name, session in running.sessions.items():
            if folder.place(name, found.id).parent == path.parent:
                session.recovered(found)

    return asyncio.create_task(recover_left(left, told=told), name="recover recordings") if left else None
