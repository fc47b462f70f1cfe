"""The file of the outbox: opened for durable writing, or set aside with its mails where it is damaged; and its rows as
`Letter` and `Mail`."""

from __future__ import annotations

import contextlib
import logging
import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path

import orjson

from server.mail.order import Letter, Mail, Order, Recipient, detail_of, state_of
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


class OutboxReader:
    """Reads an open outbox; changes nothing. Raises sqlite3.Error for what the disk does."""

    def __init__(self, database: sqlite3.Connection) -> None:
        self._database = database

    def letter(self, n: int) -> Letter | None:
        row = self._database.execute("SELECT * FROM letter WHERE n = ?", (n,)).fetchone()
        return None if row is None else self.of_row(row)

    def by_key(self, key: str) -> Letter | None:
        row = self._database.execute("SELECT * FROM letter WHERE key = ?", (key,)).fetchone()
        return None if row is None else self.of_row(row)

    def letters(self, before: int | None, limit: int) -> list[Letter]:
        """Newest first, numbered below `before`."""
        rows = self._database.execute(
            "SELECT * FROM letter WHERE n < ? ORDER BY n DESC LIMIT ?", (before or 2**62, limit)
        ).fetchall()
        return [self.of_row(row) for row in rows]

    def to_prepare(self) -> Letter | None:
        """The oldest letter whose mails are not composed."""
        row = self._database.execute("SELECT * FROM letter WHERE stage = 'preparing' ORDER BY n LIMIT 1").fetchone()
        return None if row is None else self.of_row(row)

    def mail(self, n: int) -> Mail | None:
        row = self._database.execute("SELECT * FROM mail WHERE n = ?", (n,)).fetchone()
        return None if row is None else self.mail_of_row(row)

    def needed_files(self, key: str | None = None) -> set[str]:
        """Names of the files that a mail may still need: of all letters, or of the one with that key."""
        rows = self._database.execute(
            "SELECT file FROM mail JOIN letter ON letter.n = mail.letter "
            "WHERE (? IS NULL OR key = ?) AND state IN ('queued', 'sending', 'failed')",
            (key, key),
        )
        return {row["file"] for row in rows}

    def open_letters(self) -> int:
        (found,) = self._database.execute(
            "SELECT COUNT(*) FROM letter WHERE stage IN ('preparing', 'failed') OR (stage = 'ready' AND EXISTS "
            "(SELECT 1 FROM mail WHERE letter = letter.n AND state IN ('queued', 'sending', 'failed')))"
        ).fetchone()
        return int(found)

    def known(self, n: int) -> Letter:
        letter = self.letter(n)
        if letter is None:
            raise KeyError(n)
        return letter

    def of_row(self, row: sqlite3.Row) -> Letter:
        body = orjson.loads(row["body"])
        order = Order(**{**body, "recordings": tuple(body["recordings"]), "to": tuple(body["to"])})
        bare = Letter(
            n=row["n"],
            key=row["key"],
            ordered_ms=row["ordered_ms"],
            order=order,
            is_ready=row["stage"] == "ready",
            state="queued",
            detail=row["said"],
            sender=row["sender"],
            way=row["way"],
            size_bytes=row["size"],
            sha256=row["sha256"],
            mails=tuple(self.mails(row["n"])),
        )
        match row["stage"]:
            case "ready":
                return replace(bare, state=state_of(bare.mails), detail=detail_of(bare.mails))
            case "cancelled":
                is_under_way = any(mail.state == "sending" for mail in bare.mails)
                sent = sum(mail.state == "sent" for mail in bare.mails)
                if sent and sent == len(bare.mails):
                    return replace(bare, state="sent", detail="It was sent before it could be cancelled.")
                detail = f"{sent} of {len(bare.mails)} mails were sent before." if sent else ""
                return replace(bare, state="sending" if is_under_way else "cancelled", detail=detail)
            case "failed":
                return replace(bare, state="failed")
        return bare

    def mails(self, letter: int) -> list[Mail]:
        rows = self._database.execute("SELECT * FROM mail WHERE letter = ? ORDER BY part", (letter,)).fetchall()
        return [self.mail_of_row(row) for row in rows]

    def mail_of_row(self, row: sqlite3.Row) -> Mail:
        recipients = self._database.execute("SELECT * FROM recipient WHERE mail = ? ORDER BY place", (row["n"],))
        return Mail(
            n=row["n"],
            letter=row["letter"],
            part=row["part"],
            parts=row["parts"],
            message_id=row["message_id"],
            file=row["file"],
            size_bytes=row["size"],
            state=row["state"],
            attempts=row["attempts"],
            next_ms=row["next_ms"],
            done_ms=row["done_ms"],
            detail=row["said"],
            recipients=tuple(
                Recipient(address=one["address"], state=one["state"], detail=one["said"]) for one in recipients
            ),
        )
