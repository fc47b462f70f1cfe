"""The queue of mails to send, and the outcome of each attempt."""

from __future__ import annotations

import sqlite3
from pathlib import Path

from server.mail.order import Mail, Outcome
from server.mail.outbox_file import transaction
from server.mail.outbox_reader import OutboxReader

KILLED = (
    "The sender was ended while this mail was on its way; it is sent again and may arrive twice, "
    "known by its Message-ID."
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
