"""The catalog's database: one row per file, and the search. It can be rebuilt from the files."""

from __future__ import annotations

import contextlib
import logging
import os
import sqlite3
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import orjson

from server.recording.catalog.annotations import NONE, Annotations

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
    words TEXT NOT NULL DEFAULT ''
) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS recording_kept ON recording (trashed_ms, started_ms DESC, id DESC);
CREATE INDEX IF NOT EXISTS recording_id ON recording (id);
CREATE TABLE IF NOT EXISTS trends (sha256 TEXT PRIMARY KEY, body BLOB NOT NULL) WITHOUT ROWID;
PRAGMA user_version = {(VERSION := 1)};
"""
# Of files that are gone. A file that is being moved is forgotten for a moment, so this is done at the start only.
_FORGET_TRENDS = """
DELETE FROM trends WHERE sha256 NOT IN (SELECT found ->> 'sha256' FROM recording WHERE found ->> 'sha256' IS NOT NULL)
"""
COLUMNS = "path, id, trashed_ms, vehicle, started_ms, size, changed_ns, found, title, note, tags"


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


@dataclass(frozen=True, slots=True, kw_only=True)
class Which:
    """Which recordings are wanted; None: all."""

    vehicle: str | None = None
    tag: str | None = None
    text: str | None = None  # in title, note, tags, vehicle or name
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
        database.execute(_FORGET_TRENDS)
        return database
    except BaseException:
        database.close()
        raise


def entry(row: Sequence[Any]) -> Entry:
    """Of a row with COLUMNS."""
    path, id, trashed_ms, vehicle, started_ms, size, changed_ns, found, title, note, tags = row
    return Entry(
        path=os.fsdecode(path),
        id=id,
        trashed_ms=trashed_ms,
        vehicle=vehicle,
        started_ms=started_ms,
        size=size,
        changed_ns=changed_ns,
        found=orjson.loads(found) if found is not None else None,
        annotations=Annotations(title=title, note=note, tags=tuple(orjson.loads(tags))),
    )


def put(database: sqlite3.Connection, entries: Iterable[Entry]) -> None:
    """Keeps them, in place of what there was of the same files."""
    rows = [
        (
            *(os.fsencode(e.path), e.id, e.trashed_ms, e.vehicle, e.started_ms, e.size, e.changed_ns),
            None if e.found is None else orjson.dumps(e.found).decode(),
            *(e.annotations.title, e.annotations.note, orjson.dumps(e.annotations.tags).decode(), _words(e)),
        )
        for e in entries
    ]
    database.execute("BEGIN IMMEDIATE")
    try:
        database.executemany(f"INSERT OR REPLACE INTO recording ({COLUMNS}, words) VALUES (?{', ?' * 11})", rows)
        database.execute("COMMIT")
    except BaseException:
        database.execute("ROLLBACK")
        raise


def forget(database: sqlite3.Connection, paths: Iterable[str]) -> None:
    """Takes files out of it."""
    database.executemany("DELETE FROM recording WHERE path = ?", [(os.fsencode(path),) for path in paths])


def put_trends(database: sqlite3.Connection, sha256: str, body: bytes) -> None:
    """Keeps the trends of a file by its content, so that a file that is moved has them still."""
    database.execute("INSERT OR REPLACE INTO trends VALUES (?, ?)", (sha256, body))


def trends(database: sqlite3.Connection, sha256: str) -> bytes | None:
    row = database.execute("SELECT body FROM trends WHERE sha256 = ?", (sha256,)).fetchone()
    return row[0] if row is not None else None


def _words(e: Entry) -> str:
    """The searchable text; each tag is on its own line, so that a search can match whole tags."""
    tags = "".join(f"\n#{tag}\n" for tag in e.annotations.tags)
    return f"{e.annotations.title}\n{e.annotations.note}\n{e.vehicle}\n{e.id}{tags}".casefold()


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
