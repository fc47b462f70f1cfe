"""The file of the log: opened, or set aside where it is damaged, with what could be read of it taken over."""

from __future__ import annotations

import contextlib
import logging
import sqlite3
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path

import orjson

from server.bus.log_runs import LogRuns, Run
from server.storage import durable_file
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
_RUNS = "CREATE TABLE IF NOT EXISTS run (number INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, before BLOB NOT NULL)"
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
_RUNS_KNOWN = 1000  # the newest; who names an older one is sent the newest events anew


@dataclass(frozen=True, slots=True, kw_only=True)
class Opened:
    """What became of opening the log."""

    database: sqlite3.Connection | None  # None: this run's events stay in memory
    runs: LogRuns
    last: Mapping[str, int] = field(default_factory=dict)  # newest number of each vehicle
    why: str | None = None  # it cannot be written
    complaint: str | None = None  # it was damaged; what was done about it, as a sentence


def why(error: Exception) -> str:
    """In few words, for the operator."""
    if isinstance(error, orjson.JSONDecodeError):
        return "the file is damaged"
    code = getattr(error, "sqlite_errorcode", None)
    return _WHY.get(code & 0xFF, str(error)[:80]) if isinstance(code, int) else str(error)[:80]


def open_at(path: Path | None, run: str) -> Opened:
    """The log at `path`, in memory where it is None, for a run that no log has had."""
    try:
        return _open(path, run)
    except sqlite3.Error as error:
        if path is None or (getattr(error, "sqlite_errorcode", 0) or 0) & 0xFF not in _DAMAGED:
            return Opened(database=None, runs=LogRuns((), Run(id=run)), why=why(error))
    return _begin_anew(path, run)


def _open(path: Path | None, run: str) -> Opened:
    database = _connect(path)
    refused: str | None = None
    try:
        try:
            _make_tables(database, path)
        except (sqlite3.OperationalError, OSError) as error:
            refused = why(error)  # it may still be read, so that its numbers and its alarms go on
        last = dict(_numbers(database))
        runs = LogRuns(_earlier_runs(database), Run(id=run, before=last))
        if refused is None:
            try:
                note_run(database, runs.present)
            except sqlite3.OperationalError as error:
                refused = why(error)
        return Opened(database=database, runs=runs, last=last, why=refused)
    except sqlite3.Error:
        database.close()
        raise


def _connect(path: Path | None) -> sqlite3.Connection:
    database = str(path) if path else ":memory:"
    return sqlite3.connect(database, isolation_level=None, timeout=0, check_same_thread=False)


def _make_tables(database: sqlite3.Connection, path: Path | None) -> None:
    database.execute("PRAGMA synchronous=FULL")  # with WAL: a commit is on the disk before it returns
    database.execute("PRAGMA journal_mode=WAL")
    for statement in (_SCHEMA, _INDEX, _RUNS):
        database.execute(statement)
    if path is not None:
        durable_file.sync_folder(path.parent)


def note_run(database: sqlite3.Connection, run: Run) -> None:
    """Stores where a run begins, if it is not stored yet; to be done before its first event is."""
    database.execute(_RUNS)  # the disk may have refused the table when the log was opened
    database.execute("INSERT OR IGNORE INTO run (id, before) VALUES (?, ?)", (run.id, orjson.dumps(dict(run.before))))


def _earlier_runs(database: sqlite3.Connection) -> list[Run]:
    """The newest, oldest first; none where the log is of a version that kept none, or one of them cannot be read."""
    try:
        rows = database.execute("SELECT id, before FROM run ORDER BY number DESC LIMIT ?", (_RUNS_KNOWN,)).fetchall()
        return [Run(id=id, before=orjson.loads(before)) for id, before in reversed(rows)]
    except (sqlite3.OperationalError, orjson.JSONDecodeError):
        return []


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


def _begin_anew(path: Path, run: str) -> Opened:
    aside = free_name(path, "damaged")
    try:
        for suffix in ("", "-wal", "-shm"):
            old = path.with_name(path.name + suffix)
            if old.exists():
                old.rename(aside.with_name(aside.name + suffix))
        with contextlib.closing(_connect(path)) as new:
            _make_tables(new, path)
            saved = _take_over(aside, new)
        opened = _open(path, run)
    except (OSError, sqlite3.Error) as error:
        log.error("damaged log not set aside: path=%s error=%s", path, error)
        return Opened(database=None, runs=LogRuns((), Run(id=run)), why="the file is damaged")
    said = f"The alarm log was damaged: it is set aside as {aside.name}; {saved} of its events could be read."
    return replace(opened, complaint=said)


def _take_over(old: Path, new: sqlite3.Connection) -> int:
    """Copies what can be read of a damaged log, from both ends towards the damage; how many events that were."""
    try:
        source = sqlite3.connect(f"{old.absolute().as_uri()}?mode=ro", uri=True, timeout=0)
    except sqlite3.Error:
        return 0
    new.execute("BEGIN")
    try:
        with contextlib.suppress(sqlite3.Error):
            new.executemany("INSERT INTO run VALUES (?, ?, ?)", source.execute("SELECT number, id, before FROM run"))
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
