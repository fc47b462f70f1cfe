"""The file of the log: opened, or set aside where it is damaged, with what could be read of it taken over."""

from __future__ import annotations

import logging
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from pathlib import Path

import orjson

from server.storage.set_aside import free_name

log = logging.getLogger("catgraph.journal")

_SCHEMA = """
CREATE TABLE IF NOT EXISTS event (
    vehicle TEXT NOT NULL,
    n INTEGER NOT NULL,
    at_ms INTEGER NOT NULL,
    alarm TEXT,
    change TEXT NOT NULL,
    body BLOB NOT NULL,
    PRIMARY KEY (vehicle, n)
) WITHOUT ROWID
"""
_INDEX = "CREATE INDEX IF NOT EXISTS event_of_alarm ON event (vehicle, alarm, n)"

_WHY = {
    sqlite3.SQLITE_FULL: "the disk is full",
    sqlite3.SQLITE_READONLY: "the file may not be written",
    sqlite3.SQLITE_PERM: "the file may not be written",
    sqlite3.SQLITE_BUSY: "another program holds the file",
    sqlite3.SQLITE_LOCKED: "another program holds the file",
    sqlite3.SQLITE_CORRUPT: "the file is damaged",
    sqlite3.SQLITE_NOTADB: "the file is damaged",
    sqlite3.SQLITE_CONSTRAINT: "another server writes into the same file",
    sqlite3.SQLITE_IOERR: "the disk does not accept it",
    sqlite3.SQLITE_CANTOPEN: "the file cannot be opened",
}
_DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


@dataclass(frozen=True, slots=True, kw_only=True)
class Opened:
    """What became of opening the log."""

    database: sqlite3.Connection | None  # None: this run's events stay in memory
    last: Mapping[str, int] = field(default_factory=dict)  # newest number of each vehicle
    why: str | None = None  # it cannot be written
    complaint: str | None = None  # it was damaged; what was done about it, as a sentence


def why(error: Exception) -> str:
    """In few words, for the operator."""
    if isinstance(error, orjson.JSONDecodeError):
        return "the file is damaged"
    code = getattr(error, "sqlite_errorcode", None)
    return _WHY.get(code & 0xFF, str(error)[:80]) if isinstance(code, int) else str(error)[:80]


def open_at(path: Path | None) -> Opened:
    """The log at `path`, in memory where it is None."""
    try:
        return _open(path)
    except sqlite3.Error as error:
        if path is None or (getattr(error, "sqlite_errorcode", 0) or 0) & 0xFF not in _DAMAGED:
            return Opened(database=None, why=why(error))
    return _begin_anew(path)


def _open(path: Path | None) -> Opened:
    database = sqlite3.connect(
        str(path) if path else ":memory:", isolation_level=None, timeout=0, check_same_thread=False
    )
    refused: str | None = None
    try:
        try:
            database.execute("PRAGMA journal_mode=WAL")
            database.execute("PRAGMA synchronous=NORMAL")  # WAL: survives kill -9, not the loss of power
            database.execute(_SCHEMA)
            database.execute(_INDEX)
        except sqlite3.OperationalError as error:
            refused = why(error)  # it may still be read, so that its numbers and its alarms go on
        return Opened(database=database, last=dict(_numbers(database)), why=refused)
    except sqlite3.Error:
        database.close()
        raise


def _numbers(database: sqlite3.Connection) -> Iterator[tuple[str, int]]:
    """The newest number of each vehicle, by the key alone: a log of years is not read through."""
    name = ""
    while True:
        (vehicle,) = database.execute("SELECT MIN(vehicle) FROM event WHERE vehicle > ?", (name,)).fetchone()
        if vehicle is None:
            return
        (last,) = database.execute("SELECT MAX(n) FROM event WHERE vehicle = ?", (vehicle,)).fetchone()
        yield vehicle, last
        name = vehicle


def _begin_anew(path: Path) -> Opened:
    aside = free_name(path, "damaged")
    try:
        for suffix in ("", "-wal", "-shm"):
            old = path.with_name(path.name + suffix)
            if old.exists():
                old.rename(aside.with_name(aside.name + suffix))
        opened = _open(path)
    except (OSError, sqlite3.Error) as error:
        log.error("damaged log not set aside: path=%s error=%s", path, error)
        return Opened(database=None, why="the file is damaged")
    assert opened.database is not None
    saved = _take_over(aside, opened.database)
    return Opened(
        database=opened.database,
        last=dict(_numbers(opened.database)),
        why=opened.why,
        complaint=f"The alarm log was damaged: it is set aside as {aside.name}; {saved} of its events could be read.",
    )


def _take_over(old: Path, new: sqlite3.Connection) -> int:
    """Copies what can be read of a damaged log, from both ends towards the damage; how many events that were."""
    try:
        source = sqlite3.connect(f"{old.absolute().as_uri()}?mode=ro", uri=True, timeout=0)
    except sqlite3.Error:
        return 0
    new.execute("BEGIN")
    try:
        for order in ("ASC", "DESC"):
            try:
                rows = source.execute(
                    f"SELECT vehicle, n, at_ms, alarm, change, body FROM event ORDER BY vehicle {order}, n {order}"
                )
                while (row := rows.fetchone()) is not None:
                    new.execute("INSERT OR IGNORE INTO event VALUES (?, ?, ?, ?, ?, ?)", row)
            except sqlite3.Error as error:
                log.warning("damaged log read stopped: path=%s error=%s", old.name, error)
            else:
                break
    finally:
        new.execute("COMMIT")
        source.close()
    (count,) = new.execute("SELECT COUNT(*) FROM event").fetchone()
    return int(count)
