"""Keeps the catalog up to date while a server runs: scans the folder on request, and has each new file surveyed.

A process of its own surveys them, one after the other; it is ended when there is nothing to do.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import sys
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson

from server.recording.catalog.annotations import line
from server.recording.catalog.catalog_db import TABLES, Entry
from server.recording.catalog.discovery import started_ms_of, vehicle_of
from server.recording.catalog.entries import Entries
from server.recording.catalog.folder_listing import FolderListing
from server.recording.catalog.survey import VERSION
from server.system.supervision import Supervisor

log = logging.getLogger("catgraph.catalog")

_ROOT = Path(__file__).resolve().parents[3]  # of the packages: the process must find the same code
_LINE = 4 << 20  # bytes of an answer at most
LONGEST_S = 1800.0  # of one file: at 300 times real time no drive takes so long

LOOK_AGAIN_S = 20.0  # shortest interval of folder scans for requests of the list


class Surveyor:
    """Has files surveyed by a process of its own, one after the other; ends it when there is nothing to do.

    Ask for one file at a time. Never raises for what a file does to its reader.
    """

    def __init__(self) -> None:
        self._starting: asyncio.Task[asyncio.subprocess.Process] | None = None

    async def ask(self, path: Path) -> dict[str, Any]:
        """What survey.survey() finds in the file."""
        try:
            process = await self._running()
            assert process.stdin is not None
            assert process.stdout is not None
            process.stdin.write(_question(path))
            await process.stdin.drain()
            async with asyncio.timeout(LONGEST_S):
                answer = await process.stdout.readline()
            found = orjson.loads(answer)
        except TimeoutError:
            await self.rest()
            return {"problem": f"{line(path.name)} could not be read within {LONGEST_S / 60:.0f} minutes."}
        except (OSError, ValueError, orjson.JSONDecodeError) as why:  # it was killed, or ran out of memory
            log.warning("recording reader failed: recording=%s error=%r", path, why)
            await self.rest()
            return {"problem": f"{line(path.name)} could not be read: the reader failed."}
        return found if isinstance(found, dict) else {"problem": f"{line(path.name)} could not be read."}

    async def rest(self) -> None:
        """Ends the process; the next question starts another."""
        if self._starting is None:
            return
        process = await asyncio.shield(self._starting)
        if process.stdin is not None:
            process.stdin.close()
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.communicate()  # to the end of its pipes: else they outlive the loop
        self._starting = None  # not before: a cancelled caller leaves it to the next call

    async def _running(self) -> asyncio.subprocess.Process:
        if self._starting is not None and (await asyncio.shield(self._starting)).returncode is not None:
            await self.rest()
        if self._starting is None:  # a task of its own: who gives up waiting leaves a process that `rest` finds
            self._starting = asyncio.create_task(
                asyncio.create_subprocess_exec(
                    *(sys.executable, "-m", "server.recording.catalog.survey"),
                    stdin=asyncio.subprocess.PIPE,
                    stdout=asyncio.subprocess.PIPE,
                    cwd=_ROOT,
                    limit=_LINE,
                )
            )
        return await asyncio.shield(self._starting)


def _question(path: Path) -> bytes:
    """In hex, as a name may hold anything; absolute, as the process has another working directory."""
    return os.fsencode(path.absolute()).hex().encode() + b"\n"


class SurveyTask:
    """Of one folder. `rouse` and `look_again` may be called from any thread, the others belong on the loop."""

    def __init__(self, folder: Path, entries: Entries, listing: FolderListing, *, now: Callable[[], float]) -> None:
        self._folder = folder
        self._entries = entries
        self._listing = listing
        self._now = now
        self._surveyor = Surveyor()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._wake = asyncio.Event()
        self._supervisor = Supervisor("catalog of recordings")
        self._walk_is_due = True
        self._walked_s: float | None = None

    async def start(self) -> None:
        """Start to scan the folder and to survey new files."""
        self._loop = asyncio.get_running_loop()
        self._supervisor.keep("survey", self._work)

    async def stop(self) -> None:
        await self._supervisor.stop()
        await self._surveyor.rest()

    def problems(self) -> list[str]:
        """What is wrong with its task, a sentence each."""
        return self._supervisor.problems()

    @property
    def is_settled(self) -> bool:
        """Whether the folder was walked and all that is listed has been read."""
        is_walked = self._walked_s is not None and not self._walk_is_due
        return is_walked and not self._listing.has_fresh and not self._entries.waiting

    def look_again(self) -> None:
        """Has the folder walked for what was copied into it by hand, if that was not done just now."""
        if self._walked_s is None or self._now() - self._walked_s > LOOK_AGAIN_S:
            self._walked_s = self._now()
            self.rouse(walk=True)

    def rouse(self, *, walk: bool = False) -> None:
        """There is something new to read; `walk`: somewhere in the folder."""
        if walk:
            self._walk_is_due = True
        if self._loop is not None and not self._loop.is_closed():
            self._loop.call_soon_threadsafe(self._wake.set)

    async def _work(self) -> None:
        while True:
            self._wake.clear()
            try:
                if self._walk_is_due:
                    self._walk_is_due = False
                    await asyncio.to_thread(self._listing.walk_if_changed)
                    self._walked_s = self._now()
                await asyncio.to_thread(self._listing.list_fresh)
                while (entry := await asyncio.to_thread(self._next)) is not None:
                    found = await self._surveyor.ask(self._folder / entry.path)
                    await asyncio.to_thread(self._keep, entry, found)
                    await asyncio.to_thread(self._listing.list_fresh)
            except Exception:  # whatever a disk does, the next call finds a catalog at work
                log.exception("catalog task failed")
            await self._surveyor.rest()
            await self._wake.wait()

    def _next(self) -> Entry | None:
        """The newest file that has not been read: what was just recorded is looked at first."""
        found = self._entries.select("WHERE found IS NULL ORDER BY trashed_ms IS NOT NULL, started_ms DESC LIMIT 1", [])
        return found[0] if found else None

    def _keep(self, entry: Entry, found: dict[str, Any]) -> None:
        """What the survey found, unless the file was moved or changed meanwhile."""
        with self._entries.lock:
            now = next(iter(self._entries.select("WHERE path = ?", [os.fsencode(entry.path)])), None)
            if now is None or (now.size, now.changed_ns) != (entry.size, entry.changed_ns):
                return
            for table in TABLES:
                if (body := found.pop(table, None)) is not None:
                    self._entries.put_body(table, found["sha256"], body)
            is_passing = found.pop("is_passing", False)  # then it is read again when the folder is scanned again
            found = {**found, "survey": None if is_passing else VERSION}
            origin = entry.path.split("/", 2)[2] if entry.trashed_ms is not None else entry.path
            new = replace(
                now,
                found=found,
                vehicle=vehicle_of(found, origin),
                started_ms=started_ms_of(found, Path(entry.path).name, entry.changed_ns),
            )
            self._entries.put([new])
