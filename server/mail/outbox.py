"""The outbox database: every letter, the queue of its mails and their state, on the disk before anything is reported.

Used from one thread at a time. A mail's file is stored beside it as long as it may have to be sent.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Sequence
from dataclasses import asdict
from pathlib import Path

import orjson

from server.mail import outbox_file
from server.mail.order import Composed, Letter, Mail, Order, Outcome, Prepared
from server.mail.outbox_file import OutboxReader, transaction

MAX_OPEN = 1000  # letters not sent and not cancelled
KEEP = 300  # letters that are over and still listed
KILLED = (
    "The sender was ended while this mail was on its way; it is sent again and may arrive twice, "
    "known by its Message-ID."
)


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


class DeliveryQueue:
    """The mails of an open outbox that wait or are on their way. Raises sqlite3.Error for what the disk does."""

    def __init__(self, database: sqlite3.Connection, reader: OutboxReader, files: Path) -> None:
        self._database = database
        self._reader = reader
        self._files = files

    def requeue(self) -> None:
        """Requeue mails that were being sent when the sender was killed."""
        with transaction(self._database) as database:
            database.execute(
                "UPDATE mail SET state = 'cancelled' WHERE state IN ('sending', 'queued') "
                "AND letter IN (SELECT n FROM letter WHERE stage = 'cancelled')"
            )
            database.execute(
                "UPDATE mail SET state = 'queued', next_ms = 0, said = ? WHERE state = 'sending'", (KILLED,)
            )

    def next_due(self, now_ms: int, longest_ms: int) -> Mail | None:
        """The mail to be sent now. One that would have to wait longer than any pause is due: a clock was set back."""
        row = self._database.execute(
            "SELECT mail.* FROM mail JOIN letter ON letter.n = mail.letter WHERE mail.state = 'queued' "
            "AND letter.stage = 'ready' AND (next_ms <= ? OR next_ms > ?) ORDER BY next_ms, mail.n LIMIT 1",
            (now_ms, now_ms + longest_ms),
        ).fetchone()
        return None if row is None else self._reader.mail_of_row(row)

    def earliest_ms(self) -> int | None:
        """When the next mail is due; None: none waits."""
        (found,) = self._database.execute(
            "SELECT MIN(next_ms) FROM mail JOIN letter ON letter.n = mail.letter "
            "WHERE mail.state = 'queued' AND letter.stage = 'ready'"
        ).fetchone()
        return None if found is None else int(found)

    def begin(self, n: int) -> Mail | None:
        """An attempt begins; None: the mail does not wait any more."""
        with transaction(self._database) as database:
            done = database.execute(
                "UPDATE mail SET state = 'sending', attempts = attempts + 1 WHERE n = ? AND state = 'queued'", (n,)
            )
        return self._reader.mail(n) if done.rowcount == 1 else None

    def settle(self, n: int, outcome: Outcome, now_ms: int) -> None:
        """An attempt is over. A mail of a letter cancelled meanwhile waits no more."""
        with transaction(self._database) as database:
            row = database.execute("SELECT * FROM mail WHERE n = ?", (n,)).fetchone()
            if row is None:
                return
            (stage,) = database.execute("SELECT stage FROM letter WHERE n = ?", (row["letter"],)).fetchone()
            state = "cancelled" if stage == "cancelled" and outcome.state != "sent" else outcome.state
            database.execute(
                "UPDATE mail SET state = ?, said = ?, next_ms = ?, done_ms = ?, of_account = ? WHERE n = ?",
                (state, outcome.detail, outcome.next_ms, now_ms if state != "queued" else None, outcome.of_account, n),
            )
            for one in outcome.recipients:
                database.execute(
                    "UPDATE recipient SET state = ?, said = ? WHERE mail = ? AND address = ?",
                    (one.state, one.detail, n, one.address),
                )
        if state in ("sent", "cancelled"):
            (self._files / row["file"]).unlink(missing_ok=True)

    def hold(self, detail: str, next_ms: int, longest_ms: int) -> None:
        """Postpone all queued mails to `next_ms`, because the server accepts nothing now."""
        with transaction(self._database) as database:
            database.execute(
                "UPDATE mail SET next_ms = ?, said = ? WHERE state = 'queued' AND (next_ms < ? OR next_ms > ?)",
                (next_ms, detail, next_ms, next_ms + longest_ms),
            )

    def refuse_all(self, detail: str, now_ms: int) -> None:
        """Mark all queued mails as failed, because the server refuses this account; new settings try them again."""
        with transaction(self._database) as database:
            database.execute(
                "UPDATE mail SET state = 'failed', next_ms = NULL, done_ms = ?, of_account = 1, said = ? "
                "WHERE state = 'queued'",
                (now_ms, detail),
            )

    def try_all_again(self, sender: str, now_ms: int) -> None:
        """Apply changed settings: waiting mails are due, account failures are requeued, and mails composed for another
        sender are composed again."""
        with transaction(self._database) as database:
            database.execute(
                "UPDATE mail SET state = 'queued', next_ms = ?, done_ms = NULL, of_account = 0 "
                "WHERE state = 'failed' AND of_account",
                (now_ms,),
            )
            database.execute("UPDATE mail SET next_ms = ? WHERE state = 'queued'", (now_ms,))
            database.execute(
                "UPDATE letter SET stage = 'preparing' WHERE stage = 'ready' AND sender != ? AND EXISTS "
                "(SELECT 1 FROM mail WHERE letter = letter.n AND state = 'queued') AND NOT EXISTS "
                "(SELECT 1 FROM mail WHERE letter = letter.n AND state = 'sending')",
                (sender,),
            )
