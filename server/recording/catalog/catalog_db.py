"""The catalog's database: one row per file, and the search. It can be rebuilt from the files."""

from __future__ import annotations

import contextlib
import logging
import os
import sqlite3
import zlib
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, get_args

import orjson

from server.protocol.marks import DriveMark
from server.recording.catalog.annotations import LATE, NONE, Annotations, ids_of, marks_of
from server.recording.marks import described as descriptions
from server.recording.marks.rows import merged

log = logging.getLogger("catgraph.catalog")

_SCHEMA = f"""
CREATE TABLE IF NOT EXISTS recording (
    path BLOB PRIMARY KEY,
    id TEXT NOT NULL,
    trashed_ms INTEGER,
    vehicle TEXT NOT NULL,
    started_ms INTEGER NOT NULL,
    size INTEGER NOT NULL,
    changed_ns INTEGER NOT NULL,
    found TEXT,
    title TEXT NOT NULL DEFAULT '',
    note TEXT NOT NULL DEFAULT '',
    tags TEXT NOT NULL DEFAULT '[]',
    words TEXT NOT NULL DEFAULT '',
    weather TEXT NOT NULL DEFAULT '',
    marks TEXT NOT NULL DEFAULT '{{}}'
) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS recording_kept ON recording (trashed_ms, started_ms DESC, id DESC);
CREATE INDEX IF NOT EXISTS recording_id ON recording (id);
CREATE TABLE IF NOT EXISTS trends (sha256 TEXT PRIMARY KEY, body BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS course (sha256 TEXT PRIMARY KEY, body BLOB NOT NULL) WITHOUT ROWID;
CREATE TABLE IF NOT EXISTS figures (sha256 TEXT PRIMARY KEY, body TEXT NOT NULL) WITHOUT ROWID;
PRAGMA user_version = {(VERSION := 2)};
"""
# Of files that are gone. A file that is being moved is forgotten for a moment, so this is done at the start only.
_FORGET = """
DELETE FROM {table} WHERE sha256 NOT IN (SELECT found ->> 'sha256' FROM recording WHERE found ->> 'sha256' IS NOT NULL)
"""
Table = Literal["trends", "course", "figures"]  # what is beside the rows: a list reads every row, and needs none of it
TABLES: tuple[Table, ...] = get_args(Table)
COLUMNS = "path, id, trashed_ms, vehicle, started_ms, size, changed_ns, found, title, note, tags, weather, marks"


@dataclass(frozen=True, slots=True, kw_only=True)
class Entry:
    """One file."""

    path: str  # below the folder of recordings, as the system spells it
    id: str
    trashed_ms: int | None  # when it was deleted; None: it was not
    vehicle: str
    started_ms: int
    size: int  # bytes
    changed_ns: int
    found: dict[str, Any] | None = None  # by the survey; None: it has not been read yet
    annotations: Annotations = NONE

    @property
    def marks(self) -> list[DriveMark]:
        """Those in the file, as far as it has been read, and those beside it."""
        recorded = marks_of((self.found or {}).get("marks"))
        return merged(recorded, self.annotations.marks, self.annotations.removed)


@dataclass(frozen=True, slots=True, kw_only=True)
class Which:
    """Which recordings are wanted; None: all."""

    vehicle: str | None = None
    tag: str | None = None
    text: str | None = None  # in title, note, tags, marks, vehicle or name
    since_ms: int | None = None  # started then or later
    until_ms: int | None = None  # started before
    is_trashed: bool = False


def open_at(path: Path | None) -> sqlite3.Connection:
    """Open the database at `path`; in memory if it is None or not writable. A damaged one is rebuilt."""
    if path is not None:
        for _ in range(2):
            try:
                return _open(str(path))
            except sqlite3.DatabaseError as why:
                if isinstance(why, sqlite3.OperationalError):
                    log.warning("catalog in memory only: error=%s", why)
                    break
                log.warning("catalog rebuilt: error=%s", why)
                with contextlib.suppress(OSError):
                    for suffix in ("", "-wal", "-shm"):
                        path.with_name(path.name + suffix).unlink(missing_ok=True)
    return _open(":memory:")


def _open(name: str) -> sqlite3.Connection:
    database = sqlite3.connect(name, isolation_level=None, check_same_thread=False, timeout=5.0)
    try:
        (version,) = database.execute("PRAGMA user_version").fetchone()
        if version not in (0, VERSION):
            database.execute("DROP TABLE IF EXISTS recording")
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("PRAGMA synchronous=OFF")  # after a power loss it is rebuilt from the files
        database.executescript(_SCHEMA)
        database.execute("PRAGMA quick_check").fetchone()
        for table in TABLES:
            database.execute(_FORGET.format(table=table))
        return database
    except BaseException:
        database.close()
        raise


def entry(row: Sequence[Any]) -> Entry:
    """Of a row with COLUMNS."""
    path, id, trashed_ms, vehicle, started_ms, size, changed_ns, found, title, note, tags, weather, marks = row
    late = orjson.loads(marks)
    return Entry(
        path=os.fsdecode(path),
        id=id,
        trashed_ms=trashed_ms,
        vehicle=vehicle,
        started_ms=started_ms,
        size=size,
        changed_ns=changed_ns,
        found=orjson.loads(found) if found is not None else None,
        annotations=Annotations(
            title=title,
            note=note,
            tags=tuple(orjson.loads(tags)),
            weather=weather,
            marks=marks_of(late.get("marks")),
            removed=ids_of(late.get("removed")),
            described=descriptions.listed(late.get("described")),
        ),
    )


def put(database: sqlite3.Connection, entries: Iterable[Entry]) -> None:
    """Keeps them, in place of what there was of the same files."""
    rows = [
        (
            *(os.fsencode(e.path), e.id, e.trashed_ms, e.vehicle, e.started_ms, e.size, e.changed_ns),
            None if e.found is None else orjson.dumps(e.found).decode(),
            *(e.annotations.title, e.annotations.note, orjson.dumps(e.annotations.tags).decode()),
            e.annotations.weather,
            _late(e.annotations),
            _words(e),
        )
        for e in entries
    ]
    database.execute("BEGIN IMMEDIATE")
    try:
        database.executemany(f"INSERT OR REPLACE INTO recording ({COLUMNS}, words) VALUES (?{', ?' * 13})", rows)
        database.execute("COMMIT")
    except BaseException:
        database.execute("ROLLBACK")
        raise


def forget(database: sqlite3.Connection, paths: Iterable[str]) -> None:
    """Takes files out of it."""
    database.executemany("DELETE FROM recording WHERE path = ?", [(os.fsencode(path),) for path in paths])


def encoded(table: Table, body: dict[str, Any]) -> bytes | str:
    """Trends, course or figures of a drive as they are kept. Takes a while for a long one."""
    text = orjson.dumps(body)
    return text.decode() if table == "figures" else zlib.compress(text, 6)


def put_body(database: sqlite3.Connection, table: Table, sha256: str, kept: bytes | str) -> None:
    """Keeps what `encoded` gave of a file by its content, so that a file that is moved has it still."""
    database.execute(f"INSERT OR REPLACE INTO {table} VALUES (?, ?)", (sha256, kept))


def body(database: sqlite3.Connection, table: Literal["trends", "course"], sha256: str) -> bytes | None:
    """What `put_body` kept, as JSON; None: nothing."""
    row = database.execute(f"SELECT body FROM {table} WHERE sha256 = ?", (sha256,)).fetchone()
    return zlib.decompress(row[0]) if row is not None else None


def figures(database: sqlite3.Connection, which: Which, most: int) -> list[tuple[Any, ...]]:
    """Of each drive, oldest first: id, vehicle, began, title, tags, session, part, figures, what came beside it later,
    then the marks in it and the ids of interventions that nobody described in it, where something came. Clips are no
    drives."""
    where, values = condition(which)
    how = (
        "SELECT id, vehicle, started_ms, title, tags, found ->> 'session', found ->> 'part', body, marks, "
        "CASE marks WHEN ? THEN NULL ELSE found ->> 'marks' END, found ->> 'undescribed' FROM recording "
        f"JOIN figures ON sha256 = found ->> 'sha256' WHERE {where} AND NOT found ->> 'is_clip' "
        "ORDER BY started_ms DESC, id DESC LIMIT ?"
    )
    return database.execute(how, [_late(NONE), *values, most]).fetchall()[::-1]


def _late(annotations: Annotations) -> str:
    return orjson.dumps({name: getattr(annotations, name) for name in LATE}).decode()


def _words(e: Entry) -> str:
    """The searchable text; each tag is on its own line, so that a search can match whole tags."""
    tags = "".join(f"\n#{tag}\n" for tag in e.annotations.tags)
    marks = "\n".join(mark_text(mark) for mark in e.marks)
    return f"{e.annotations.title}\n{e.annotations.note}\n{e.vehicle}\n{e.id}{tags}\n{marks}".casefold()


def mark_text(mark: DriveMark) -> str:
    """The searchable text of a mark: category and text, a line each."""
    return f"{mark['category'] or ''}\n{mark['words']}".casefold()


def condition(which: Which) -> tuple[str, list[Any]]:
    """SQL and its values."""
    parts = ["trashed_ms IS NOT NULL" if which.is_trashed else "trashed_ms IS NULL"]
    values: list[Any] = []
    for part, value in (
        ("vehicle = ?", which.vehicle),
        ("instr(words, ?) > 0", which.text.casefold() if which.text else None),
        ("instr(words, ?) > 0", f"\n#{which.tag.casefold()}\n" if which.tag else None),
        ("started_ms >= ?", which.since_ms),
        ("started_ms < ?", which.until_ms),
    ):
        if value is not None:
            parts.append(part)
            values.append(value)
    return " AND ".join(parts), values
