"""The catalog of recordings: files, annotations, and the trash.

The files are authoritative; the database is a cache that is rebuilt if it is lost. A file is surveyed by a
process of its own (survey_task.py), so that the event loop never waits for one; until then it is listed by its name.
"""

from __future__ import annotations

import asyncio
import os
from collections.abc import Callable, Collection, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import orjson

from server.protocol.answers import Recording, RecordingNames, Total, VerificationAnswer
from server.protocol.logbook import LogbookDrive
from server.recording import space
from server.recording.catalog import annotations as annotation_store
from server.recording.catalog.catalog_db import Entry, Which
from server.recording.catalog.entries import Entries, Refused
from server.recording.catalog.folder_listing import FolderListing
from server.recording.catalog.rows import Page, page_of, row_of
from server.recording.catalog.survey_task import SurveyTask
from server.recording.catalog.trash import Trash
from server.recording.catalog.verifications import Verifications
from server.recording.drive.course import joined, with_marks
from server.recording.drive.logbook import drives_of
from server.recording.folder import first_part, part_number

MOST_IN_LOGBOOK = 20_000  # recordings
AROUND_MS = 7 * 86_400_000  # no drive takes longer

MAX_LATE = 200  # late marks of a recording that is requested alone


class Catalog:
    """Of one folder. Its methods may be called from any thread; none of them waits for the survey of a file."""

    def __init__(
        self, folder: Path, database: Path | None, *, wall_ms: Callable[[], int], now: Callable[[], float]
    ) -> None:
        """`folder` need not exist yet; `database` None: in memory."""
        self.folder = folder
        self._wall_ms = wall_ms
        self._entries = Entries(database)
        self._verifications = Verifications(folder)
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
        """List what is in the folder: new and changed files; remove those that no longer exist."""
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
        return page_of(self._entries, which or Which(), self._verifications, cursor=cursor, limit=limit)

    def row(self, id: str, *, is_trashed: bool = False) -> Recording | None:
        """One recording, with what was raised in it and its speed; None: it is not there."""
        entry = self._listing.entry(id, is_trashed=is_trashed)
        if entry is None:
            return None
        found = entry.found or {}
        row: Recording = {
            **self._row_of(entry),
            "raised": found.get("raised", []),
            "speed_mps": found.get("speed_mps", []),
        }
        if entry.annotations.marks:
            row["late_marks"] = list(entry.annotations.marks[:MAX_LATE])
        return row

    def _row_of(self, entry: Entry) -> Recording:
        return row_of(entry, self._verifications.of(entry))

    def verify(self, id: str) -> VerificationAnswer:
        """Whether it is as it was recorded; reads the whole file. Raises NotThere, Refused."""
        entry = self._listing.need(id)
        return self._verifications.verify(entry, self._wall_ms())

    def trends(self, id: str) -> dict[str, Any] | None:
        """The sketch of all its signals; None: it has not been read yet."""
        entry = self._listing.entry(id)
        sha256 = (entry.found or {}).get("sha256") if entry is not None else None
        body = self._entries.body("trends", sha256) if sha256 is not None else None
        found: dict[str, Any] | None = None if body is None else orjson.loads(body)
        return found

    def course(self, id: str) -> bytes | None:
        """The course of its drive as JSON, late marks among its events; None: it is not there, or not read yet."""
        if self._course(id) is None:
            return None
        parts = [part for one in self.drive_of(id) if (part := self._course(one)) is not None]
        return parts[0] if len(parts) == 1 else orjson.dumps(joined(list(map(orjson.loads, parts))))

    def _course(self, id: str) -> bytes | None:
        """Of one recording."""
        entry = self._listing.entry(id)
        sha256 = (entry.found or {}).get("sha256") if entry is not None else None
        body = self._entries.body("course", sha256) if sha256 is not None else None
        if body is None or entry is None:
            return None
        beside = entry.annotations
        return orjson.dumps(with_marks(orjson.loads(body), entry.marks)) if beside.marks or beside.removed else body

    def drives(self, which: Which) -> list[LogbookDrive]:
        """The drives for the logbook, oldest first; those that are yet to be read are not among them."""
        self._listing.list_fresh()
        return drives_of(self._entries.figures(which, MOST_IN_LOGBOOK))

    def drive_of(self, id: str) -> list[str]:
        """The recordings of the drive of which it is a part, oldest first; those that are yet to be read, or cannot be
        read, where their names say so. A clip, and what is not there, is of no other."""
        entry = self._listing.entry(id)
        if entry is None or _is_clip(entry):
            return [id]
        known, firsts = [id], {first_part(id)}
        one = entry if _is_read(entry) else next(filter(_is_read, self._named(entry, firsts)), None)
        if one is not None:
            since_ms, until_ms = one.started_ms - AROUND_MS, one.started_ms + AROUND_MS
            near = self.drives(Which(vehicle=one.vehicle, since_ms=since_ms, until_ms=until_ms))
            known = next((drive["recordings"] for drive in near if one.id in drive["recordings"]), [one.id])
            firsts |= {first_part(part) for part in known}
        others = {part.id for part in self._named(entry, firsts) if not _is_read(part)} | {id}
        if others <= set(known):
            return known
        sessions = list(dict.fromkeys(map(first_part, [*known, *sorted(others)])))
        return sorted({*known, *others}, key=lambda part: (sessions.index(first_part(part)), part_number(part), part))

    def _named(self, entry: Entry, firsts: Collection[str]) -> list[Entry]:
        """The recordings beside one that their names make parts of these sessions."""
        marks = " OR ".join("id = ? OR substr(id, 1, length(?) + 2) = ? || '_p'" for _ in firsts)
        values = [first for first in firsts for _ in range(3)]
        folder = entry.path.rpartition("/")[0]
        found = self._entries.select(f"WHERE trashed_ms IS NULL AND ({marks}) ORDER BY id", values)
        return [one for one in found if one.path.rpartition("/")[0] == folder and not _is_clip(one)]

    def path(self, id: str) -> Path | None:
        """Its file, of a split bag its folder; None: it is not there. No id leads out of the folder."""
        entry = self._listing.entry(id)
        path = self.folder / entry.path if entry is not None else None
        return path if path is not None and path.exists() else None

    def of_mark(self, vehicle: str, mark: str) -> list[Path]:
        """The files in which, or beside which, a mark may be: those that name it, and those that are yet to be read."""
        self._listing.list_fresh()
        entries = self._entries.select(
            "WHERE trashed_ms IS NULL AND vehicle = ? "
            "AND (found IS NULL OR instr(found, ?) > 0 OR instr(marks, ?) > 0) "
            "ORDER BY started_ms DESC LIMIT 5",
            [vehicle, f'"mark":"{mark}"', f'"mark":"{mark}"'],
        )
        return [self.folder / entry.path for entry in entries]

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
        try:
            return space.free_at(self.folder)
        except OSError:
            return None

    # -- what people do with it ----------------------------------------------------------------------------------------

    def annotate(
        self,
        id: str,
        *,
        title: str | None = None,
        note: str | None = None,
        tags: Sequence[str] | None = None,
        weather: str | None = None,
    ) -> Recording:
        """Another title, note, weather or tags; None leaves it. Raises NotThere, Refused, BadAnnotation."""
        with self._entries.lock:
            entry = self._listing.need(id)
            new = annotation_store.changed(entry.annotations, title=title, note=note, tags=tags, weather=weather)
            try:
                new = annotation_store.write(self.folder / entry.path, new)
            except OSError as why:
                raise Refused(f"It cannot be stored: {(why.strerror or str(why)).lower()}.") from None
            self._entries.put([replace(entry, annotations=new)])
            return self._row_of(replace(entry, annotations=new))

    def reread_annotations(self, path: Path) -> None:
        """Marks were written beside a file: its row has them from now on."""
        with self._entries.lock:
            inside = path.relative_to(self.folder).as_posix()
            known = self._entries.select("WHERE path = ?", [os.fsencode(inside)])
            self._entries.put([replace(entry, annotations=annotation_store.read(path)) for entry in known])

    def delete(self, id: str) -> Recording:
        """Into the trash, where it stays until somebody empties it. Raises NotThere, Refused."""
        return row_of(self._trash.delete(id))

    def put_in_trash(self, id: str) -> Entry:
        """As `delete`: the entry that was moved, for `put_back` and `destroy_entry`. Raises NotThere, Refused."""
        return self._trash.delete(id)

    def put_back(self, trashed: Entry) -> None:
        """Exactly this one out of the trash. Raises NotThere, Refused."""
        self._trash.put_back(trashed)

    def destroy_entry(self, trashed: Entry) -> None:
        """Exactly this one of the trash, for good. Raises Refused."""
        self._trash.destroy_entries([trashed])

    def restore(self, id: str) -> Recording:
        """Out of the trash, to where it was. Raises NotThere, Refused."""
        return row_of(self._trash.restore(id))

    def destroy(self, id: str | None) -> Total:
        """For good: one of the trash, or with None all of it; how many and how large. Raises NotThere, Refused."""
        return self._trash.destroy(id)


def _is_read(entry: Entry) -> bool:
    return entry.found is not None and not entry.found.get("problem")


def _is_clip(entry: Entry) -> bool:
    return bool((entry.found or {}).get("is_clip"))
