"""The list of recordings: what is there, what people call it, and what was deleted and can still be taken back.

Files are the truth, the database is a memory of them: it is made anew where it is lost. A file is surveyed by a
process of its own (surveyor.py), so that the event loop never waits for one; until then it is listed by its name.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import re
import shutil
import sqlite3
import threading
from collections import deque
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from server.recording import catalog_file, moving, remarks
from server.recording.catalog_file import COLUMNS, Entry, Which
from server.recording.folder import DAMAGED, FINISHED, WRITING, is_id
from server.recording.found_files import TRASH, files_below, id_of, shape_of, started_ms_of, vehicle_of
from server.recording.survey import VERSION
from server.recording.surveyor import Surveyor
from server.supervision import Supervisor

log = logging.getLogger("catgraph.catalog")

LOOK_AGAIN_S = 20.0  # at most so often the folder is walked because a list is asked for
GROWS_MS = 120_000  # a file that changed so recently may still be copied: its folder does not tell
MAX_ROWS = 200  # a page
MAX_FRESH = 1000  # finished recordings that wait to be listed; more are found by walking the folder
_CURSOR = re.compile(r"(-?\d{1,16})\.([A-Za-z0-9][A-Za-z0-9_-]{0,89})")


class NotThere(Exception):
    """No such recording. The text is one sentence."""


class Refused(Exception):
    """It cannot be done now. The text is one sentence."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Page:
    """Some rows, newest first, and where the next page begins; None: there is none."""

    rows: list[dict[str, Any]]
    next: str | None


class Catalog:
    """Of one folder. Its methods may be called from any thread; none of them waits for the survey of a file."""

    def __init__(
        self, folder: Path, database: Path | None, *, wall_ms: Callable[[], int], now: Callable[[], float]
    ) -> None:
        """`folder` need not exist yet; `database` None: in memory."""
        self.folder = folder
        self._wall_ms = wall_ms
        self._now = now
        self._lock = threading.RLock()
        self._database = catalog_file.open_at(database)
        self._fresh: deque[Path] = deque(maxlen=MAX_FRESH)
        self._surveyor = Surveyor()
        self._loop: asyncio.AbstractEventLoop | None = None
        self._wake = asyncio.Event()
        self._supervisor = Supervisor("catalog of recordings")
        self._walk_is_due = True
        self._walked_s: float | None = None
        self._shape: object = None  # of the folders, when they were last walked
        self._is_closed = False

    # -- its life ------------------------------------------------------------------------------------------------------

    async def start(self) -> None:
        """Begins to look through the folder and to read what is new in it."""
        self._loop = asyncio.get_running_loop()
        self._supervisor.keep("survey", self._work)

    async def stop(self) -> None:
        await self._supervisor.stop()
        await self._surveyor.rest()
        with self._lock:
            self._is_closed = True
            self._database.close()

    def problems(self) -> list[str]:
        """What is wrong with its task, a sentence each."""
        return self._supervisor.problems()

    async def settled(self) -> None:
        """Returns once all that is there has been read; for tests and scripts."""
        while self._walked_s is None or self._walk_is_due or self._fresh or self.waiting:  # noqa: ASYNC110
            await asyncio.sleep(0.02)

    def add(self, path: Path) -> None:
        """A recording is finished: it is listed from now on, and read soon."""
        self._fresh.append(path)
        self._rouse()

    def look_again(self) -> None:
        """Has the folder walked for what was copied into it by hand, if that was not done just now."""
        if self._walked_s is None or self._now() - self._walked_s > LOOK_AGAIN_S:
            self._walked_s = self._now()
            self._rouse(walk=True)

    def rebuild(self) -> None:
        """Forgets what is known and makes it anew from the files."""
        self._forget([entry.path for entry in self._entries("", [])])
        self.walk()
        self._rouse()

    # -- what is there -------------------------------------------------------------------------------------------------

    def rows(self, which: Which | None = None, *, cursor: str | None = None, limit: int = 50) -> Page:
        """Newest first; those deleted last first among the deleted. `cursor` is the `next` of the page before."""
        which = which or Which()
        self._list_fresh()
        where, values = catalog_file.condition(which)
        order = "trashed_ms" if which.is_trashed else "started_ms"
        if cursor is not None:
            at = _CURSOR.fullmatch(cursor)
            if at is None:
                raise Refused("That page of the list is not there: begin anew.")
            where += f" AND ({order}, id) < (?, ?)"
            values += [int(at[1]), at[2]]
        limit = max(1, min(limit, MAX_ROWS))
        found = self._entries(f"WHERE {where} ORDER BY {order} DESC, id DESC LIMIT ?", [*values, limit + 1])
        page = found[:limit]
        more = len(found) > limit
        last = page[-1] if page else None
        at_ms = (last.trashed_ms if which.is_trashed else last.started_ms) if last else None
        return Page(
            rows=[self._row(entry) for entry in page],
            next=f"{at_ms}.{last.id}" if more and last else None,
        )

    def row(self, id: str, *, is_trashed: bool = False) -> dict[str, Any] | None:
        """One recording, with what was raised in it; None: it is not there."""
        entry = self._entry(id, is_trashed=is_trashed)
        return None if entry is None else self._row(entry) | {"raised": (entry.found or {}).get("raised", [])}

    def path(self, id: str) -> Path | None:
        """Its file; None: it is not there. No id leads out of the folder."""
        entry = self._entry(id)
        path = self.folder / entry.path if entry is not None else None
        return path if path is not None and path.is_file() else None

    def totals(self, which: Which | None = None) -> dict[str, int]:
        """How many recordings there are of some kind, and how large together."""
        where, values = catalog_file.condition(which or Which())
        with self._lock:
            count, size = self._database.execute(
                f"SELECT COUNT(*), COALESCE(SUM(size), 0) FROM recording WHERE {where}", values
            ).fetchone()
        return {"count": count, "bytes": size}

    @property
    def waiting(self) -> int:
        """Files that are yet to be read."""
        with self._lock:
            return int(self._database.execute("SELECT COUNT(*) FROM recording WHERE found IS NULL").fetchone()[0])

    @property
    def unreadable(self) -> int:
        with self._lock:
            query = "SELECT COUNT(*) FROM recording WHERE trashed_ms IS NULL AND found ->> 'problem' IS NOT NULL"
            return int(self._database.execute(query).fetchone()[0])

    def names(self) -> dict[str, list[str]]:
        """The vehicles and tags that recordings have, to choose among."""
        with self._lock:
            vehicles = [row[0] for row in self._database.execute("SELECT DISTINCT vehicle FROM recording ORDER BY 1")]
            query = (
                "SELECT DISTINCT value FROM recording, json_each(tags) WHERE trashed_ms IS NULL ORDER BY 1 LIMIT 200"
            )
            tags = [row[0] for row in self._database.execute(query)]
        return {"vehicles": [vehicle for vehicle in vehicles if vehicle], "tags": tags}

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

    def remark(
        self, id: str, *, title: str | None = None, note: str | None = None, tags: Sequence[str] | None = None
    ) -> dict[str, Any]:
        """Another title, note or tags; None leaves it. Raises NotThere, Refused, BadRemark."""
        with self._lock:
            entry = self._need(id)
            new = remarks.changed(entry.remarks, title=title, note=note, tags=tags)
            try:
                remarks.write(self.folder / entry.path, new)
            except OSError as why:
                raise Refused(f"It cannot be kept: {(why.strerror or str(why)).lower()}.") from None
            self._put([replace(entry, remarks=new)])
            return self._row(replace(entry, remarks=new))

    def delete(self, id: str) -> dict[str, Any]:
        """Into the trash, where it stays until somebody empties it. Raises NotThere, Refused."""
        with self._lock:
            if is_id(id) and any(self.folder.glob(f"*/{id}{WRITING}")):
                raise Refused("It is being recorded now: stop recording first.")
            entry = self._need(id)
            now_ms = max(self._wall_ms(), 1)
            while (self.folder / TRASH / str(now_ms) / entry.path).exists():
                now_ms += 1
            moved = replace(entry, path=f"{TRASH}/{now_ms}/{entry.path}", trashed_ms=now_ms)
            self._move(entry, moved)
            return self._row(moved)

    def restore(self, id: str) -> dict[str, Any]:
        """Out of the trash, to where it was. Raises NotThere, Refused."""
        with self._lock:
            entry = self._need(id, is_trashed=True)
            back = replace(entry, path=entry.path.split("/", 2)[2], trashed_ms=None)
            if (self.folder / back.path).exists():
                raise Refused("There is another recording of that name again: rename its file first.")
            self._move(entry, back)
            return self._row(back)

    def destroy(self, id: str | None) -> dict[str, int]:
        """For good: one of the trash, or with None all of it; how many and how large. Raises NotThere, Refused."""
        with self._lock:
            chosen = [self._need(id, is_trashed=True)] if id else self._entries("WHERE trashed_ms IS NOT NULL", [])
            gone: list[Entry] = []
            try:
                for entry in chosen:
                    path = self.folder / entry.path
                    path.unlink(missing_ok=True)
                    remarks.beside(path).unlink(missing_ok=True)
                    gone.append(entry)
            except OSError as why:
                raise Refused(f"It cannot be deleted: {(why.strerror or str(why)).lower()}.") from None
            finally:
                self._forget([entry.path for entry in gone])
                for entry in gone:
                    moving.tidy(self.folder / entry.path, self.folder / TRASH)
            return {"count": len(gone), "bytes": sum(entry.size for entry in gone)}

    def _move(self, old: Entry, new: Entry) -> None:
        source, target = self.folder / old.path, self.folder / new.path
        try:
            moving.move(source, target)
        except OSError as why:
            raise Refused(f"It cannot be moved: {(why.strerror or str(why)).lower()}.") from None
        if not target.exists():
            self._forget([old.path])
            raise NotThere("That recording is not there any more.")
        self._forget([old.path])
        self._put([new])
        if old.trashed_ms is not None:
            moving.tidy(source, self.folder / TRASH)

    # -- finding files -------------------------------------------------------------------------------------------------

    def walk(self) -> None:
        """Lists what is in the folder: new files, changed ones, and no more those that are gone."""
        known = {entry.path: entry for entry in self._entries("", [])}
        seen: set[str] = set()
        changed: list[Entry] = []
        for path in files_below(self.folder):
            entry = self._look(path, known.get(path.relative_to(self.folder).as_posix()))
            if entry is None:
                continue
            seen.add(entry.path)
            if entry != known.get(entry.path):
                changed.append(entry)
        with self._lock:  # what was moved or called otherwise while the folder was walked is looked at once more
            self._forget([path for path in known if path not in seen and not (self.folder / path).exists()])
            now = [self._look(self.folder / entry.path, known.get(entry.path)) for entry in changed]
            self._put([entry for entry in now if entry is not None])

    def _walk_if_changed(self) -> None:
        """Looking at a thousand files takes the interpreter from the judge for some 50 ms, at their folders for 1."""
        shape = shape_of(self.folder)
        still_ns = (self._wall_ms() - GROWS_MS) * 1_000_000
        if shape != self._shape or self._entries("WHERE changed_ns > ? LIMIT 1", [still_ns]):
            self.walk()
            self._shape = shape

    def _look(self, path: Path, known: Entry | None) -> Entry | None:
        """What can be said of a file without reading it, and what is known of it if it is still the same."""
        try:
            stat = path.stat()
        except OSError:
            return None
        inside = path.relative_to(self.folder).as_posix()
        trashed_ms, origin = None, inside
        if inside.startswith(f"{TRASH}/"):
            _, stamp, origin = inside.split("/", 2)
            trashed_ms = int(stamp)
        is_same = known is not None and (known.size, known.changed_ns) == (stat.st_size, stat.st_mtime_ns)
        found = known.found if is_same and known is not None else None
        if found is not None and found.get("survey") != VERSION:
            found = None
        return Entry(
            path=inside,
            id=id_of(origin),
            trashed_ms=trashed_ms,
            vehicle=vehicle_of(found, origin),
            started_ms=started_ms_of(found, path.name, stat.st_mtime_ns),
            size=stat.st_size,
            changed_ns=stat.st_mtime_ns,
            found=found,
            remarks=remarks.read(path),
        )

    def _list_fresh(self) -> None:
        entries = []
        while self._fresh:
            with contextlib.suppress(IndexError, ValueError):  # another thread took it; or it lies elsewhere
                entry = self._look(self._fresh.popleft(), None)
                if entry is not None:
                    entries.append(entry)
        if entries:
            self._put(entries)

    # -- reading them --------------------------------------------------------------------------------------------------

    def _rouse(self, *, walk: bool = False) -> None:
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
                    await asyncio.to_thread(self._walk_if_changed)
                    self._walked_s = self._now()
                await asyncio.to_thread(self._list_fresh)
                while (entry := await asyncio.to_thread(self._next)) is not None:
                    found = await self._surveyor.ask(self.folder / entry.path)
                    await asyncio.to_thread(self._keep, entry, found)
                    await asyncio.to_thread(self._list_fresh)
            except Exception:  # whatever a disk does, the next call finds a catalog at work
                log.exception("the catalog of recordings stumbled")
            await self._surveyor.rest()
            await self._wake.wait()

    def _next(self) -> Entry | None:
        """The newest file that has not been read: what was just recorded is looked at first."""
        found = self._entries("WHERE found IS NULL ORDER BY trashed_ms IS NOT NULL, started_ms DESC LIMIT 1", [])
        return found[0] if found else None

    def _keep(self, entry: Entry, found: dict[str, Any]) -> None:
        """What the survey found, unless the file was moved or changed meanwhile."""
        with self._lock:
            now = next(iter(self._entries("WHERE path = ?", [os.fsencode(entry.path)])), None)
            if now is None or (now.size, now.changed_ns) != (entry.size, entry.changed_ns):
                return
            found = {**found, "survey": VERSION}
            origin = entry.path.split("/", 2)[2] if entry.trashed_ms is not None else entry.path
            new = replace(
                now,
                found=found,
                vehicle=vehicle_of(found, origin),
                started_ms=started_ms_of(found, Path(entry.path).name, entry.changed_ns),
            )
            self._put([new])

    # -- the database --------------------------------------------------------------------------------------------------

    def _entries(self, how: str, values: Sequence[Any]) -> list[Entry]:
        with self._lock:
            if self._is_closed:
                return []
            return [
                catalog_file.entry(row)
                for row in self._database.execute(f"SELECT {COLUMNS} FROM recording {how}", values)
            ]

    def _entry(self, id: str, *, is_trashed: bool = False) -> Entry | None:
        self._list_fresh()
        kept = "IS NOT NULL ORDER BY trashed_ms DESC" if is_trashed else "IS NULL"
        return next(iter(self._entries(f"WHERE id = ? AND trashed_ms {kept}", [id])), None)

    def _need(self, id: str, *, is_trashed: bool = False) -> Entry:
        entry = self._entry(id, is_trashed=is_trashed)
        if entry is None:
            raise NotThere("That recording is not in the trash." if is_trashed else "There is no such recording.")
        return entry

    def _forget(self, paths: Sequence[str]) -> None:
        with self._lock:
            if paths and not self._is_closed:
                self._write(lambda database: catalog_file.forget(database, paths))

    def _put(self, entries: Sequence[Entry]) -> None:
        with self._lock:
            if entries and not self._is_closed:
                self._write(lambda database: catalog_file.put(database, entries))

    def _write(self, how: Callable[[sqlite3.Connection], None]) -> None:
        """A disk that takes nothing more leaves a catalog in memory: the files are the truth."""
        try:
            how(self._database)
        except sqlite3.Error as why:
            log.warning("the catalog of recordings goes on in memory: %s", why)
            old, self._database = self._database, catalog_file.open_at(None)
            with contextlib.suppress(sqlite3.Error):
                old.backup(self._database)
            old.close()
            how(self._database)

    def _row(self, entry: Entry) -> dict[str, Any]:
        found = entry.found or {}
        problem = found.get("problem")
        name = Path(entry.path).name
        return {
            "id": entry.id,
            "vehicle": entry.vehicle,
            "session": found.get("session"),
            "part": found.get("part"),
            "started_ms": entry.started_ms,
            "length_s": found.get("length_s"),
            "size_bytes": entry.size,
            "distance_m": found.get("distance_m"),
            "top_speed_mps": found.get("top_speed_mps"),
            "alarms": found.get("alarms"),
            "title": entry.remarks.title,
            "note": entry.remarks.note,
            "tags": list(entry.remarks.tags),
            "state": "waiting" if entry.found is None else "unreadable" if problem else "read",
            "problem": problem,
            "damage": found.get("damage", []),
            "left_out": found.get("left_out", []),
            "left_out_count": found.get("left_out_count", 0),
            "not_received": found.get("not_received", []),
            "not_received_count": found.get("not_received_count", 0),
            "ros_version": found.get("ros_version"),
            "ended": found.get("ended"),
            "ended_why": found.get("ended_why"),
            "is_clip": found.get("is_clip", False),
            "clip_of": found.get("clip_of"),
            "file": remarks.line(name),
            "format": "mcap" if name.endswith((FINISHED, DAMAGED)) else Path(name).suffix[1:],
            "sha256": found.get("sha256"),
            "thumbnail": f"/api/recordings/{entry.id}/track.svg",
            "sketch": found.get("sketch"),
            "trashed_ms": entry.trashed_ms,
        }
