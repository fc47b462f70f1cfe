"""The catalog of recordings: files, annotations, and the trash.

The files are authoritative; the database is a cache that is rebuilt if it is lost. A file is surveyed by a
process of its own (survey_worker.py), so that the event loop never waits for one; until then it is listed by its name.
"""

from __future__ import annotations

import asyncio
import shutil
import zlib
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson

from server.protocol.answers import Recording, RecordingNames, Total
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.catalog_db import Which
from server.recording.catalog.entries import Entries
from server.recording.catalog.errors import Refused
from server.recording.catalog.folder_listing import FolderListing
from server.recording.catalog.rows import Page, page_of, row_of
from server.recording.catalog.survey_task import SurveyTask
from server.recording.catalog.trash import Trash


class Catalog:
    """Of one folder. Its methods may be called from any thread; none of them waits for the survey of a file."""

    def __init__(
        self, folder: Path, database: Path | None, *, wall_ms: Callable[[], int], now: Callable[[], float]
    ) -> None:
        """`folder` need not exist yet; `database` None: in memory."""
        self.folder = folder
        self._entries = Entries(database)
        self._listing = FolderListing(folder, self._entries, wall_ms=wall_ms)
        self._trash = Trash(folder, self._entries, self._listing, wall_ms=wall_ms)
        self._survey = SurveyTask(folder, self._entries, self._listing, now=now)

    # -- its life ------------------------------------------------------------------------------------------------------

    async def start(self) -> None:
        """Start to scan the folder and to survey new files."""
        await self._survey.start()

    async def stop(self) -> None:
        await self._survey.stop()
        await asyncio.to_thread(self._entries.close)

    def problems(self) -> list[str]:
        """What is wrong with its task, a sentence each."""
        return self._survey.problems()

    async def settled(self) -> None:
        """Returns once all that is there has been read; for tests and scripts."""
        while not self._survey.is_settled:  # noqa: ASYNC110
            await asyncio.sleep(0.02)

    def add(self, path: Path) -> None:
        """A recording is finished: it is listed from now on, and read soon."""
        self._listing.add(path)
        self._survey.rouse()

    def look_again(self) -> None:
        """Has the folder walked for what was copied into it by hand, if that was not done just now."""
        self._survey.look_again()

    def walk(self) -> None:
        """Lists what is in the folder: new files, changed ones, and no more those that are gone."""
        self._listing.walk()

    def rebuild(self) -> None:
        """Rebuild the catalog from the files."""
        self._entries.forget([entry.path for entry in self._entries.select("", [])])
        self.walk()
        self._survey.rouse()

    # -- what is there -------------------------------------------------------------------------------------------------

    def rows(self, which: Which | None = None, *, cursor: str | None = None, limit: int = 50) -> Page:
        """Newest first; those deleted last first among the deleted. `cursor` is the `next` of the page before.

        Raises Refused where there is no such page.
        """
        self._listing.list_fresh()
        return page_of(self._entries, which or Which(), cursor=cursor, limit=limit)

    def row(self, id: str, *, is_trashed: bool = False) -> Recording | None:
        """One recording, with what was raised in it and its speed; None: it is not there."""
        entry = self._listing.entry(id, is_trashed=is_trashed)
        if entry is None:
            return None
        found = entry.found or {}
        return {**row_of(entry), "raised": found.get("raised", []), "speed_mps": found.get("speed_mps", [])}

    def trends(self, id: str) -> dict[str, Any] | None:
        """The sketch of all its signals; None: it has not been read yet."""
        entry = self._listing.entry(id)
        sha256 = (entry.found or {}).get("sha256") if entry is not None else None
        body = self._entries.trends(sha256) if sha256 is not None else None
        found: dict[str, Any] | None = None if body is None else orjson.loads(zlib.decompress(body))
        return found

    def path(self, id: str) -> Path | None:
        """Its file; None: it is not there. No id leads out of the folder."""
        entry = self._listing.entry(id)
        path = self.folder / entry.path if entry is not None else None
        return path if path is not None and path.is_file() else None

    def totals(self, which: Which | None = None) -> Total:
        """How many recordings there are of some kind, and how large together."""
        return self._entries.totals(which)

    @property
    def waiting(self) -> int:
        """Files that are yet to be read."""
        return self._entries.waiting

    @property
    def unreadable(self) -> int:
        return self._entries.unreadable

    def names(self) -> RecordingNames:
        """The vehicles and tags that recordings have, to choose among."""
        return self._entries.names()

    def free_bytes(self) -> int | None:
        """The free space of the disk [B]; None: unknown."""
        folder = self.folder
        while not folder.exists() and folder != folder.parent:
            folder = folder.parent
        try:
            return shutil.disk_usage(folder).free
        except OSError:
            return None

    # -- what people do with it ----------------------------------------------------------------------------------------

    def annotate(
        self, id: str, *, title: str | None = None, note: str | None = None, tags: Sequence[str] | None = None
    ) -> Recording:
        """Another title, note or tags; None leaves it. Raises NotThere, Refused, BadAnnotation."""
        with self._entries.lock:
            entry = self._listing.need(id)
            new = annotation_store.changed(entry.annotations, title=title, note=note, tags=tags)
            try:
                annotation_store.write(self.folder / entry.path, new)
            except OSError as why:
                raise Refused(f"It cannot be stored: {(why.strerror or str(why)).lower()}.") from None
            self._entries.put([replace(entry, annotations=new)])
            return row_of(replace(entry, annotations=new))

    def delete(self, id: str) -> Recording:
        """Into the trash, where it stays until somebody empties it. Raises NotThere, Refused."""
        return row_of(self._trash.delete(id))

    def restore(self, id: str) -> Recording:
        """Out of the trash, to where it was. Raises NotThere, Refused."""
        return row_of(self._trash.restore(id))

    def destroy(self, id: str | None) -> Total:
        """For good: one of the trash, or with None all of it; how many and how large. Raises NotThere, Refused."""
        return self._trash.destroy(id)
