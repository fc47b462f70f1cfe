"""The file of the outbox: opened for durable writing, or set aside with its mails where it is damaged."""

from __future__ import annotations

import contextlib
import logging
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from server.storage.durable_file import sync_folder

log = logging.getLogger("catgraph.mail")

_SCHEMA = """
CREATE TABLE IF NOT EXISTS letter (
    n INTEGER PRIMARY KEY AUTOINCREMENT,
    key TEXT NOT NULL UNIQUE,
    ordered_ms INTEGER NOT NULL,
    body TEXT NOT NULL,
    stage TEXT NOT NULL DEFAULT 'preparing',  -- preparing, ready, failed, cancelled
    said TEXT NOT NULL DEFAULT '',
    sender TEXT NOT NULL DEFAULT '',
    way TEXT,
    size INTEGER,
    sha256 TEXT
);
CREATE TABLE IF NOT EXISTS mail (
    n INTEGER PRIMARY KEY AUTOINCREMENT,
    letter INTEGER NOT NULL REFERENCES letter (n) ON DELETE CASCADE,
    part INTEGER NOT NULL,
    parts INTEGER NOT NULL,
    message_id TEXT NOT NULL,
    file TEXT NOT NULL,
    size INTEGER NOT NULL,
    state TEXT NOT NULL DEFAULT 'queued',     -- queued, sending, sent, failed, cancelled
    attempts INTEGER NOT NULL DEFAULT 0,
    next_ms INTEGER,
    done_ms INTEGER,
    of_account INTEGER NOT NULL DEFAULT 0,    -- failed because the server took none: new settings try it again
    said TEXT NOT NULL DEFAULT '',
    UNIQUE (letter, part)
);
CREATE TABLE IF NOT EXISTS recipient (
    mail INTEGER NOT NULL REFERENCES mail (n) ON DELETE CASCADE,
    place INTEGER NOT NULL,
    address TEXT NOT NULL,
    state TEXT NOT NULL DEFAULT 'waiting',    -- waiting, accepted, refused
    said TEXT NOT NULL DEFAULT '',
    PRIMARY KEY (mail, place)
) WITHOUT ROWID;
CREATE INDEX IF NOT EXISTS mail_of_state ON mail (state, next_ms);
CREATE INDEX IF NOT EXISTS letter_of_stage ON letter (stage, n);
"""
_DAMAGED = (sqlite3.SQLITE_CORRUPT, sqlite3.SQLITE_NOTADB)


def open_at(folder: Path) -> tuple[sqlite3.Connection, str | None]:
    """Open the outbox in `folder`; with a sentence if it was damaged and recreated. Raises sqlite3.Error, OSError."""
    path = folder / "outbox.sqlite"
    try:
        return _open(path), None
    except sqlite3.DatabaseError as error:
        if (getattr(error, "sqlite_errorcode", 0) or 0) & 0xFF not in _DAMAGED:
            raise
        log.error("the outbox %s is damaged: %s", path, error)
    aside = _set_aside(folder, path)
    waiting = sum(1 for _ in (folder / aside.name).glob("*.eml"))
    lost_text = f"{waiting} composed mails lie there too" if waiting != 1 else "1 composed mail lies there too"
    return _open(
        path
    ), f"The outbox was damaged and is begun anew; the old one is set aside as {aside.name}, {lost_text}."


@contextmanager
def transaction(database: sqlite3.Connection) -> Iterator[sqlite3.Connection]:
    """A transaction: on the disk as a whole, or not at all."""
    database.execute("BEGIN IMMEDIATE")
    try:
        yield database
        database.execute("COMMIT")
    except BaseException:
        if database.in_transaction:
            database.execute("ROLLBACK")
        raise


def _open(path: Path) -> sqlite3.Connection:
    database = sqlite3.connect(path, isolation_level=None, timeout=5, check_same_thread=False)
    try:
        database.row_factory = sqlite3.Row
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("PRAGMA synchronous=FULL")  # a commit is on the disk: nothing is lost with the power either
        database.execute("PRAGMA foreign_keys=ON")
        database.executescript(_SCHEMA)
        (verdict,) = database.execute("PRAGMA quick_check(1)").fetchone()
        if verdict != "ok":
            error = sqlite3.DatabaseError(verdict)
            error.sqlite_errorcode = sqlite3.SQLITE_CORRUPT
            raise error
    except sqlite3.Error:
        database.close()
        raise
    return database


def _set_aside(folder: Path, path: Path) -> Path:
    """Move a damaged outbox and its composed mails into a separate folder, from which they can be sent by hand."""
    number = 1
    while (aside := folder / f"damaged-{number}").exists():
        number += 1
    aside.mkdir()
    for suffix in ("", "-wal", "-shm"):
        with contextlib.suppress(FileNotFoundError):
            path.with_name(path.name + suffix).rename(aside / (path.name + suffix))
    for mail in (folder / "outbox").glob("*.eml"):
        mail.rename(aside / mail.name)
    sync_folder(aside)
    sync_folder(folder)
    return aside
