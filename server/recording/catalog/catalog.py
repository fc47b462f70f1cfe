"""The list of recordings: what is there, what people call it, and what was deleted and can still be taken back.

Files are the truth, the database is a memory of them: it is made anew where it is lost. A file is surveyed by a
process of its own (survey_worker.py), so that the event loop never waits for one; until then it is listed by its name.
"""

from __future__ import annotations

import asyncio
import shutil
from collections.abc import Callable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

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
        """Begins to look through the folder and to read what is new in it."""
        await self._survey.start()

    async def stop(self) -> None:
        await self._survey.stop()
        self._entries.close()

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
        """Forgets what is known and makes it anew from the files."""
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

    def row(self, id: str, *, is_trashed: bool = False) -> dict[str, Any] | None:
        """One recording, with what was raised in it; None: it is not there."""
        entry = self._listing.entry(id, is_trashed=is_trashed)
        return None if entry is None else row_of(entry) | {"raised": (entry.found or {}).get("raised", [])}

    def path(self, id: str) -> Path | None:
        """Its file; None: it is not there. No id leads out of the folder."""
        entry = self._listing.entry(id)
        path = self.folder / entry.path if entry is not None else None
        return path if path is not None and path.is_file() else None

    def totals(self, which: Which | None = None) -> dict[str, int]:
        """How many recordings there are of some kind, and how large together."""
        return self._entries.totals(which)

    @property
    def waiting(self) -> int:
        """Files that are yet to be read."""
        return self._entries.waiting

    @property
    def unreadable(self) -> int:
        return self._entries.unreadable

    def names(self) -> dict[str, list[str]]:
        """The vehicles and tags that recordings have, to choose among."""
        return self._entries.names()

    def free_bytes(self) -> int | None:
        """What the disk has left; None: it does not tell."""
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
    ) -> dict[str, Any]:
        """Another title, note or tags; None leaves it. Raises NotThere, Refused, BadAnnotation."""
        with self._entries.lock:
            entry = self._listing.need(id)
            new = annotation_store.changed(entry.annotations, title=title, note=note, tags=tags)
            try:
                annotation_store.write(self.folder / entry.path, new)
            except OSError as why:
                raise Refused(f"It cannot be kept: {(why.strerror or str(why)).lower()}.") from None
            self._entries.put([replace(entry, annotations=new)])
            return row_of(replace(entry, annotations=new))

    def delete(self, id: str) -> dict[str, Any]:
        """Into the trash, where it stays until somebody empties it. Raises NotThere, Refused."""
        return row_of(self._trash.delete(id))

    def restore(self, id: str) -> dict[str, Any]:
        """Out of the trash, to where it was. Raises NotThere, Refused."""
        return row_of(self._trash.restore(id))

    def destroy(self, id: str | None) -> dict[str, int]:
        """For good: one of the trash, or with None all of it; how many and how large. Raises NotThere, Refused."""
        return self._trash.destroy(id)
