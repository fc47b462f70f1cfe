"""The outbox database: every letter and the state of its mails, on the disk before anything is reported.

Used from one thread at a time. A mail's file is stored beside it as long as it may have to be sent.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import orjson

from server.mail import outbox_file
from server.mail.delivery_queue import DeliveryQueue
from server.mail.order import Composed, Letter, Order, Prepared
from server.mail.outbox_file import transaction
from server.mail.outbox_reader import OutboxReader

MAX_OPEN = 1000  # letters not sent and not cancelled
KEEP = 300  # letters that are over and still listed


class OutboxFull(Exception):
    """No more letters are taken."""


class WrongState(Exception):
    """That cannot be done to this letter now; `str()` is one sentence."""


class Outbox:
    """In `folder`: outbox.sqlite, and outbox/ with the mails. Raises sqlite3.Error for what the disk does."""

    def __init__(self, folder: Path) -> None:
        self.files = folder / "outbox"
        self.files.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._database, self.complaint = outbox_file.open_at(folder)
        self._reader = OutboxReader(self._database)
        self.queue = DeliveryQueue(self._database, self._reader, self.files)

    def close(self) -> None:
        self._database.close()

    def recover(self) -> None:
        """Recover after a start: mails being sent are requeued, cancelled ones stay so, unused files are deleted."""
        self.queue.requeue()
        self.sweep()

    def sweep(self) -> None:
        """Takes files away that no mail needs any more."""
        needed = self._reader.needed_files()
        for path in self.files.iterdir():
            if path.is_file() and path.name not in needed:
                path.unlink(missing_ok=True)

    def add(self, key: str, order: Order, now_ms: int) -> Letter:
        """A new letter; the one that has the key, where it was ordered before. Raises OutboxFull."""
        with transaction(self._database) as database:
            found = database.execute("SELECT n FROM letter WHERE key = ?", (key,)).fetchone()
            if found is None:
                if self._reader.open_letters() >= MAX_OPEN:
                    raise OutboxFull
                database.execute(
                    "INSERT INTO letter (key, ordered_ms, body) VALUES (?, ?, ?)",
                    (key, now_ms, orjson.dumps(asdict(order)).decode()),
                )
                self._forget_old(database)
        letter = self._reader.by_key(key)
        assert letter is not None
        return letter

    def letter(self, n: int) -> Letter | None:
        return self._reader.letter(n)

    def letters(self, before: int | None = None, limit: int = 100) -> list[Letter]:
        """Newest first, numbered below `before`."""
        return self._reader.letters(before, limit)

    def to_prepare(self) -> Letter | None:
        """The oldest letter whose mails are not composed."""
        return self._reader.to_prepare()

    def prepared(self, n: int, made: Prepared) -> bool:
        """The mails of a letter are composed and wait to be sent; False: it was cancelled meanwhile.

        A mail that was sent already, with the same content and so the same Message-ID, is not sent again; where the
        content is another, all are, for parts of two contents cannot be joined.
        """
        with transaction(self._database) as database:
            row = database.execute("SELECT * FROM letter WHERE n = ?", (n,)).fetchone()
            if row is None or row["stage"] != "preparing":
                return False
            old = {mail.message_id: mail for mail in self._reader.mails(n)}
            is_same = set(old) == {mail.message_id for mail in made.mails}
            if not is_same:
                database.execute("DELETE FROM mail WHERE letter = ?", (n,))
                for mail in made.mails:
                    self._insert(database, n, mail, Order(**orjson.loads(row["body"])).to)
            for mail in made.mails:  # for another sender it is of another size
                database.execute(
                    "UPDATE mail SET size = ?, file = ? WHERE letter = ? AND part = ?",
                    (mail.size_bytes, mail.file, n, mail.part),
                )
            database.execute(
                "UPDATE letter SET stage = 'ready', said = '', sender = ?, way = ?, size = ?, sha256 = ? WHERE n = ?",
                (made.sender, made.way, made.size_bytes, made.sha256, n),
            )
        return True

    def prepare_failed(self, n: int, reason: str) -> None:
        with transaction(self._database) as database:
            database.execute(
                "UPDATE letter SET stage = 'failed', said = ? WHERE n = ? AND stage = 'preparing'", (reason, n)
            )

    def discard(self, key: str) -> None:
        """Files that were composed for a letter and are not wanted any more."""
        needed = self._reader.needed_files(key)
        for path in self.files.glob(f"{key}-*.eml*"):
            if path.name not in needed:
                path.unlink(missing_ok=True)

    def cancel(self, n: int) -> Letter:
        """Nothing more of it is sent; what is on its way is for the caller to break off. Raises WrongState."""
        with transaction(self._database) as database:
            letter = self._reader.known(n)
            if letter.state in ("sent", "cancelled"):
                raise WrongState("It was already sent." if letter.state == "sent" else "It is already cancelled.")
            database.execute("UPDATE letter SET stage = 'cancelled', said = '' WHERE n = ?", (n,))
            database.execute(
                "UPDATE mail SET state = 'cancelled', next_ms = NULL "
                "WHERE letter = ? AND state IN ('queued', 'failed')",
                (n,),
            )
        for mail in letter.mails:
            if mail.state in ("queued", "failed"):
                (self.files / mail.file).unlink(missing_ok=True)
        return self._reader.known(n)

    def resend(self, n: int, sender: str, now_ms: int) -> Letter:
        """Tries now what has not arrived; what was sent as a whole is sent as a whole again. Raises WrongState.

        Whatever is sent again keeps its Message-ID and Date.
        """
        with transaction(self._database) as database:
            letter = self._reader.known(n)
            if letter.state == "sending" or (letter.state == "queued" and not letter.is_ready):
                raise WrongState("It is being sent.")
            is_whole = letter.state == "sent"
            again = [mail for mail in letter.mails if is_whole or mail.state != "sent"]
            for mail in again:
                database.execute(
                    "UPDATE mail SET state = 'queued', attempts = 0, next_ms = ?, done_ms = NULL, said = '', "
                    "of_account = 0 WHERE n = ?",
                    (now_ms, mail.n),
                )
                database.execute(
                    "UPDATE recipient SET state = 'waiting', said = '' WHERE mail = ? AND (? OR state != 'accepted')",
                    (mail.n, is_whole),
                )
            has_all = bool(again) and all((self.files / mail.file).is_file() for mail in again)
            stage = "ready" if has_all and letter.sender == sender else "preparing"
            database.execute("UPDATE letter SET stage = ?, said = '' WHERE n = ?", (stage, n))
        return self._reader.known(n)

    def _insert(self, database: sqlite3.Connection, letter: int, mail: Composed, to: Sequence[str]) -> None:
        row = database.execute(
            "INSERT INTO mail (letter, part, parts, message_id, file, size, next_ms) VALUES (?, ?, ?, ?, ?, ?, 0)",
            (letter, mail.part, mail.parts, mail.message_id, mail.file, mail.size_bytes),
        )
        database.executemany(
            "INSERT INTO recipient (mail, place, address) VALUES (?, ?, ?)",
            [(row.lastrowid, place, address) for place, address in enumerate(to)],
        )

    def _forget_old(self, database: sqlite3.Connection) -> None:
        """Delete old finished letters; failed ones stay until an operator has decided."""
        database.execute(
            "DELETE FROM letter WHERE n IN (SELECT n FROM letter WHERE stage = 'cancelled' OR (stage = 'ready' AND NOT "
            "EXISTS (SELECT 1 FROM mail WHERE mail.letter = letter.n AND state IN ('queued', 'sending', 'failed'))) "
            "ORDER BY n DESC LIMIT -1 OFFSET ?)",
            (KEEP,),
        )
