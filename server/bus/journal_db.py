"""The file of the log: opened, or set aside where it is damaged, with what could be read of it taken over."""

from __future__ import annotations

import contextlib
import logging
import sqlite3
from collections.abc import Callable, Iterable, Iterator, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import orjson

from server.bus.log_runs import LogRuns, Run
from server.storage import durable_file
from server.storage.durable_file import free_name

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
_FILES = ("", "-wal", "-shm", "-journal")  # of a database
_NO_ROOM = (sqlite3.SQLITE_IOERR, sqlite3.SQLITE_FULL, sqlite3.SQLITE_CANTOPEN)
_OPEN_WITHIN_S = 5.0  # so long a program that holds the file is waited for at the start; afterwards not at all
_RUNS_KNOWN = 1000  # the newest; a page of an older one gets the newest events again


@dataclass(frozen=True, slots=True, kw_only=True)
class Kept:
    """What a log has."""

    newest: Mapping[str, int]  # number of each vehicle's newest event
    find: Callable[[str, int], tuple[int, str | None, str] | None]  # moment [ms], alarm and change of an event


Lost = Callable[[Kept], Iterable[tuple[str, Mapping[str, Any]]]]  # the events that a log lacks, each with its vehicle


def nothing_lost(_: Kept) -> Iterable[tuple[str, Mapping[str, Any]]]:
    return ()


@dataclass(frozen=True, slots=True, kw_only=True)
class Opened:
    """What became of opening the log."""

    database: sqlite3.Connection | None  # None: this run's events stay in memory
    runs: LogRuns
    last: Mapping[str, int] = field(default_factory=dict)  # newest number of each vehicle
    why: str | None = None  # it cannot be written
    complaint: str | None = None  # it was damaged; what was done about it, as a sentence


def why(error: Exception) -> str:
    """A short reason for the operator."""
    if isinstance(error, orjson.JSONDecodeError):
        return "the file is damaged"
    return _WHY.get(_code(error), str(error)[:80])


def _code(error: Exception) -> int:
    """SQLite's primary result code; 0: it is no error of SQLite."""
    code = getattr(error, "sqlite_errorcode", None)
    return code & 0xFF if isinstance(code, int) else 0


def open_at(path: Path | None, run: str, lost: Lost = nothing_lost) -> Opened:
    """The log at `path`, in memory where it is None, for a run that no log has had, with what `lost` brings back."""
    try:
        if path is not None and not path.exists() and _copy_of(path).exists():
            _put_in_place(path, free_name(path, "damaged"))  # a kill left it there: it is whole once the log is aside
        return _open_either_way(path, run, lost)
    except (OSError, sqlite3.Error) as error:
        if path is None or _code(error) not in _DAMAGED:
            return Opened(database=None, runs=LogRuns((), Run(id=run)), why=why(error))
    return _begin_anew(path, run, lost)


def _open_either_way(path: Path | None, run: str, lost: Lost) -> Opened:
    """On a full disk SQLite cannot make the file that processes share (-shm); alone it does without."""
    try:
        return _open(path, run, lost)
    except sqlite3.OperationalError as error:
        if _code(error) not in _NO_ROOM:
            raise
        return _open(path, run, lost, is_alone=True)


def _open(path: Path | None, run: str, lost: Lost, *, is_alone: bool = False) -> Opened:
    database = _connect(path, is_alone=is_alone)
    refused: str | None = None
    complaint: str | None = None
    try:
        try:
            _make_tables(database, path)
            complaint = _bring_back(database, lost)
        except (sqlite3.OperationalError, OSError) as error:
            refused = why(error)  # it may still be read, so that its numbers and its alarms go on
        last = dict(_numbers(database))
        runs = LogRuns(_earlier_runs(database), Run(id=run, before=last))
        if refused is None:
            try:
                note_run(database, runs.present)
            except sqlite3.OperationalError as error:
                refused = why(error)
        database.execute("PRAGMA busy_timeout=0")
        return Opened(database=database, runs=runs, last=last, why=refused, complaint=complaint)
    except sqlite3.Error:
        database.close()
        raise


def _connect(path: Path | None, *, is_alone: bool = False) -> sqlite3.Connection:
    file = str(path) if path else ":memory:"
    database = sqlite3.connect(file, isolation_level=None, timeout=_OPEN_WITHIN_S, check_same_thread=False)
    if is_alone:
        database.execute("PRAGMA locking_mode=EXCLUSIVE")
    return database


def _make_tables(database: sqlite3.Connection, path: Path | None) -> None:
    database.execute("PRAGMA synchronous=FULL")  # with WAL: a commit is on the disk before it returns
    database.execute("PRAGMA journal_mode=WAL")
    for statement in (_SCHEMA, _INDEX, _RUNS):
        database.execute(statement)
    if path is not None:
        durable_file.sync_folder(path.parent)


def _bring_back(database: sqlite3.Connection, lost: Lost) -> str | None:
    """Stores what the log has lost, before a run begins: to everybody it is of before. Returns what that was, as a
    sentence, if anything. Raises sqlite3.Error where the log is damaged or cannot be written, and nothing else."""

    def find(vehicle: str, n: int) -> tuple[int, str | None, str] | None:
        query = "SELECT at_ms, alarm, change FROM event WHERE vehicle = ? AND n = ?"
        found: tuple[int, str | None, str] | None = database.execute(query, (vehicle, n)).fetchone()
        return found

    newest = dict(_numbers(database))
    rows: list[tuple[Any, ...]] = []
    late = ""
    try:
        try:
            for vehicle, one in lost(Kept(newest=newest, find=find)):
                row = (vehicle, one["n"], one["at_ms"], one.get("alarm"), one["change"], orjson.dumps(one))
                rows.append(row)
        except TimeoutError as error:
            log.warning("recordings not all searched for events: error=%s", error)
            late = (
                "Not all recordings were searched for events that the alarm log lacks: it would have delayed the start."
            )
        if not rows:
            return late or None
        database.execute("BEGIN IMMEDIATE")
        database.executemany("INSERT OR IGNORE INTO event VALUES (?, ?, ?, ?, ?, ?)", rows)
        database.execute("COMMIT")
    except Exception as error:  # whatever is found in recordings, the log is opened without it
        if database.in_transaction:
            with contextlib.suppress(sqlite3.Error):
                database.execute("ROLLBACK")
        if isinstance(error, sqlite3.OperationalError) or _code(error) in _DAMAGED:
            raise
        log.exception("events not brought back")
        return "Events of recordings could not be brought back into the alarm log."
    brought = "1 event was" if len(rows) == 1 else f"{len(rows)} events were"
    return f"The alarm log was not complete: {brought} brought back from recordings. {late}".rstrip()


def note_run(database: sqlite3.Connection, run: Run) -> None:
    """Stores where a run begins, if it is not stored yet; to be done before its first event is."""
    database.execute(_RUNS)  # the disk may have refused the table when the log was opened
    database.execute("INSERT OR IGNORE INTO run (id, before) VALUES (?, ?)", (run.id, orjson.dumps(dict(run.before))))


def _earlier_runs(database: sqlite3.Connection) -> list[Run]:
    """The newest, oldest first; none where the log is of a version that kept none, or one of them cannot be read."""
    try:
        rows = database.execute("SELECT id, before FROM run ORDER BY number DESC LIMIT ?", (_RUNS_KNOWN,)).fetchall()
        return [Run(id=id, before=_numbers_of(before)) for id, before in reversed(rows)]
    except (sqlite3.OperationalError, ValueError):
        return []


def _numbers_of(before: bytes) -> dict[str, int]:
    """Raises ValueError."""
    found = orjson.loads(before)
    if not isinstance(found, dict) or not all(type(n) is int for n in found.values()):
        raise ValueError("no numbers of vehicles")
    return found


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


def _begin_anew(path: Path, run: str, lost: Lost) -> Opened:
    """What can be read is copied first. Until the copy is on the disk the damaged log keeps its name: where there is no
    room for the copy, the next start tries again."""
    aside, made = free_name(path, "damaged"), _copy_of(path)
    try:
        _remove(made)
        with contextlib.closing(_connect(made)) as new:
            new.execute("PRAGMA synchronous=FULL")  # not WAL: what is committed is in the file that is renamed
            for statement in (_SCHEMA, _INDEX, _RUNS):
                new.execute(statement)
            saved = _take_over(path, new)
        _put_in_place(path, aside)
        opened = _open_either_way(path, run, lost)
    except (OSError, sqlite3.Error) as error:
        log.error("damaged log not set aside: path=%s error=%s", path, error)
        with contextlib.suppress(OSError):
            _remove(made)
        return Opened(database=None, runs=LogRuns((), Run(id=run)), why="the file is damaged")
    damaged = f"The alarm log was damaged: it is set aside as {aside.name}; {saved} of its events could be read."
    return replace(opened, complaint=f"{damaged} {opened.complaint}" if opened.complaint else damaged)


def _copy_of(path: Path) -> Path:
    return path.with_name(f"{path.name}.anew")


def _put_in_place(path: Path, aside: Path) -> None:
    """The copy takes the name of the log, whose files are set aside: with them SQLite would change the copy."""
    for suffix in _FILES:
        old = path.with_name(path.name + suffix)
        if old.exists():
            old.rename(aside.with_name(aside.name + suffix))
    _copy_of(path).rename(path)
    durable_file.sync_folder(path.parent)


def _remove(path: Path) -> None:
    for suffix in _FILES:
        path.with_name(path.name + suffix).unlink(missing_ok=True)


def _take_over(old: Path, new: sqlite3.Connection) -> int:
    """Copies what can be read of a damaged log, from both ends towards the damage; how many events that were. Raises
    sqlite3.Error where the new one cannot be written."""
    with contextlib.closing(_connect(old, is_alone=True)) as source:
        new.execute("BEGIN")
        new.executemany("INSERT INTO run VALUES (?, ?, ?)", _readable(source, "SELECT number, id, before FROM run"))
        for order in ("ASC", "DESC"):
            events = f"SELECT vehicle, n, at_ms, alarm, change, body FROM event ORDER BY vehicle {order}, n {order}"
            new.executemany("INSERT OR IGNORE INTO event VALUES (?, ?, ?, ?, ?, ?)", _readable(source, events))
        new.execute("COMMIT")
    (count,) = new.execute("SELECT COUNT(*) FROM event").fetchone()
    return int(count)


def _readable(source: sqlite3.Connection, query: str) -> Iterator[tuple[Any, ...]]:
    """The rows up to a damage."""
    with contextlib.closing(source.cursor()) as rows:  # an open one would keep the file locked
        try:
            yield from rows.execute(query)
        except sqlite3.Error as error:
            log.warning("damaged log read stopped: error=%s", error)
