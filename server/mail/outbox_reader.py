"""Letters and mails as the outbox holds them: its rows as `Letter` and `Mail`."""

from __future__ import annotations

import sqlite3
from dataclasses import replace

import orjson

from server.mail.order import Letter, Mail, Order, Recipient, detail_of, state_of


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
