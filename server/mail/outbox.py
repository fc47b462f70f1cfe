"""Every letter that was ordered and where each of its mails stands: on the disk before anybody is told.

Used from one thread at a time. A mail's file lies beside it for as long as it may have to be sent.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import asdict, dataclass, replace
from pathlib import Path

import orjson

from server.mail import outbox_file
from server.mail.order import Letter, Mail, Order, Recipient, State, Way, said_of, state_of

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


@dataclass(frozen=True, slots=True, kw_only=True)
class Composed:
    """One mail on the disk, before it is in the outbox."""

    part: int
    parts: int
    message_id: str
    file: str
    size_bytes: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Prepared:
    """All mails of a letter."""

    mails: tuple[Composed, ...]
    sender: str
    way: Way
    size_bytes: int
    sha256: str


@dataclass(frozen=True, slots=True, kw_only=True)
class Outcome:
    """What an attempt to send one mail came to."""

    state: State
    said: str
    recipients: tuple[Recipient, ...]
    next_ms: int | None = None
    of_account: bool = False


class Outbox:
    """In `folder`: outbox.sqlite, and outbox/ with the mails. Raises sqlite3.Error for what the disk does."""

    def __init__(self, folder: Path) -> None:
        self.files = folder / "outbox"
        self.files.mkdir(mode=0o700, parents=True, exist_ok=True)
        self._database, self.complaint = outbox_file.open_at(folder)

    def close(self) -> None:
        self._database.close()

    def recover(self) -> None:
        """After a start: what was on its way waits again, what was cancelled stays so, files nobody needs go."""
        self.requeue()
        self.sweep()

    def requeue(self) -> None:
        """Nothing is on its way any more: whoever sent was ended in the midst of it."""
        with self._change() as database:
            database.execute(
                "UPDATE mail SET state = 'cancelled' WHERE state IN ('sending', 'queued') "
                "AND letter IN (SELECT n FROM letter WHERE stage = 'cancelled')"
            )
            database.execute(
                "UPDATE mail SET state = 'queued', next_ms = 0, said = ? WHERE state = 'sending'", (KILLED,)
            )

    def sweep(self) -> None:
        """Takes files away that no mail needs any more."""
        needed = {
            row["file"]
            for row in self._database.execute("SELECT file FROM mail WHERE state IN ('queued', 'sending', 'failed')")
        }
        for path in self.files.iterdir():
            if path.is_file() and path.name not in needed:
                path.unlink(missing_ok=True)

    def add(self, key: str, order: Order, now_ms: int) -> Letter:
        """A new letter; the one that has the key, where it was ordered before. Raises OutboxFull."""
        with self._change() as database:
            found = database.execute("SELECT n FROM letter WHERE key = ?", (key,)).fetchone()
            if found is None:
                if self._open_letters() >= MAX_OPEN:
                    raise OutboxFull
                database.execute(
                    "INSERT INTO letter (key, ordered_ms, body) VALUES (?, ?, ?)",
                    (key, now_ms, orjson.dumps(asdict(order)).decode()),
                )
                self._forget_old(database)
        row = self._database.execute("SELECT * FROM letter WHERE key = ?", (key,)).fetchone()
        return self._letter(row)

    def letter(self, n: int) -> Letter | None:
        row = self._database.execute("SELECT * FROM letter WHERE n = ?", (n,)).fetchone()
        return None if row is None else self._letter(row)

    def letters(self, before: int | None = None, limit: int = 100) -> list[Letter]:
        """Newest first, numbered below `before`."""
        rows = self._database.execute(
            "SELECT * FROM letter WHERE n < ? ORDER BY n DESC LIMIT ?", (before or 2**62, limit)
        ).fetchall()
        return [self._letter(row) for row in rows]

    def to_prepare(self) -> Letter | None:
        """The oldest letter whose mails are not composed."""
        row = self._database.execute("SELECT * FROM letter WHERE stage = 'preparing' ORDER BY n LIMIT 1").fetchone()
        return None if row is None else self._letter(row)

    def prepared(self, n: int, made: Prepared) -> bool:
        """The mails of a letter are composed and wait to be sent; False: it was cancelled meanwhile.

        A mail that was sent already, with the same content and so the same Message-ID, is not sent again; where the
        content is another, all are, for parts of two contents cannot be joined.
        """
        with self._change() as database:
            row = database.execute("SELECT * FROM letter WHERE n = ?", (n,)).fetchone()
            if row is None or row["stage"] != "preparing":
                return False
            old = {mail.message_id: mail for mail in self._mails(n)}
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

    def prepare_failed(self, n: int, said: str) -> None:
        with self._change() as database:
            database.execute(
                "UPDATE letter SET stage = 'failed', said = ? WHERE n = ? AND stage = 'preparing'", (said, n)
            )

    def next_due(self, now_ms: int, longest_ms: int) -> Mail | None:
        """The mail to be sent now. One that would have to wait longer than any pause is due: a clock was set back."""
        row = self._database.execute(
            "SELECT mail.* FROM mail JOIN letter ON letter.n = mail.letter WHERE mail.state = 'queued' "
            "AND letter.stage = 'ready' AND (next_ms <= ? OR next_ms > ?) ORDER BY next_ms, mail.n LIMIT 1",
            (now_ms, now_ms + longest_ms),
        ).fetchone()
        return None if row is None else self._mail(row)

    def earliest_ms(self) -> int | None:
        """When the next mail is due; None: none waits."""
        (found,) = self._database.execute(
            "SELECT MIN(next_ms) FROM mail JOIN letter ON letter.n = mail.letter "
            "WHERE mail.state = 'queued' AND letter.stage = 'ready'"
        ).fetchone()
        return None if found is None else int(found)

    def begin(self, n: int) -> Mail | None:
        """An attempt begins; None: the mail does not wait any more."""
        with self._change() as database:
            done = database.execute(
                "UPDATE mail SET state = 'sending', attempts = attempts + 1 WHERE n = ? AND state = 'queued'", (n,)
            )
        return self._mail_of(n) if done.rowcount == 1 else None

    def settle(self, n: int, outcome: Outcome, now_ms: int) -> None:
        """An attempt is over. A mail of a letter cancelled meanwhile waits no more."""
        with self._change() as database:
            row = database.execute("SELECT * FROM mail WHERE n = ?", (n,)).fetchone()
            if row is None:
                return
            (stage,) = database.execute("SELECT stage FROM letter WHERE n = ?", (row["letter"],)).fetchone()
            state = "cancelled" if stage == "cancelled" and outcome.state != "sent" else outcome.state
            database.execute(
                "UPDATE mail SET state = ?, said = ?, next_ms = ?, done_ms = ?, of_account = ? WHERE n = ?",
                (state, outcome.said, outcome.next_ms, now_ms if state != "queued" else None, outcome.of_account, n),
            )
            for one in outcome.recipients:
                database.execute(
                    "UPDATE recipient SET state = ?, said = ? WHERE mail = ? AND address = ?",
                    (one.state, one.said, n, one.address),
                )
        if state in ("sent", "cancelled"):
            (self.files / row["file"]).unlink(missing_ok=True)

    def hold(self, said: str, next_ms: int, longest_ms: int) -> None:
        """The server takes nothing now: no mail that waits is tried before that time."""
        with self._change() as database:
            database.execute(
                "UPDATE mail SET next_ms = ?, said = ? WHERE state = 'queued' AND (next_ms < ? OR next_ms > ?)",
                (next_ms, said, next_ms, next_ms + longest_ms),
            )

    def refuse_all(self, said: str, now_ms: int) -> None:
        """The server will take nothing from this account: what waits has failed, until the settings are changed."""
        with self._change() as database:
            database.execute(
                "UPDATE mail SET state = 'failed', next_ms = NULL, done_ms = ?, of_account = 1, said = ? "
                "WHERE state = 'queued'",
                (now_ms, said),
            )

    def try_all_again(self, sender: str, now_ms: int) -> None:
        """The settings are others now: what waits is due, what failed for the account waits again, and what was
        composed for another sender is composed anew."""
        with self._change() as database:
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

    def discard(self, key: str) -> None:
        """Files that were composed for a letter and are not wanted any more."""
        needed = {
            row["file"]
            for row in self._database.execute(
                "SELECT file FROM mail JOIN letter ON letter.n = mail.letter "
                "WHERE key = ? AND state IN ('queued', 'sending', 'failed')",
                (key,),
            )
        }
        for path in self.files.glob(f"{key}-*.eml*"):
            if path.name not in needed:
                path.unlink(missing_ok=True)

    def cancel(self, n: int) -> Letter:
        """Nothing more of it is sent; what is on its way is for the caller to break off. Raises WrongState."""
        with self._change() as database:
            letter = self._known(n)
            if letter.state in ("sent", "cancelled"):
                raise WrongState("It was sent already." if letter.state == "sent" else "It is cancelled already.")
            database.execute("UPDATE letter SET stage = 'cancelled', said = '' WHERE n = ?", (n,))
            database.execute(
                "UPDATE mail SET state = 'cancelled', next_ms = NULL "
                "WHERE letter = ? AND state IN ('queued', 'failed')",
                (n,),
            )
        for mail in letter.mails:
            if mail.state in ("queued", "failed"):
                (self.files / mail.file).unlink(missing_ok=True)
        return self._known(n)

    def resend(self, n: int, sender: str, now_ms: int) -> Letter:
        """Tries now what has not arrived; what was sent as a whole is sent as a whole again. Raises WrongState.

        Whatever is sent again keeps its Message-ID and Date.
        """
        with self._change() as database:
            letter = self._known(n)
            if letter.state == "sending" or (letter.state == "queued" and not letter.is_ready):
                raise WrongState("It is on its way.")
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
        return self._known(n)

    def _mail_of(self, n: int) -> Mail | None:
        row = self._database.execute("SELECT * FROM mail WHERE n = ?", (n,)).fetchone()
        return None if row is None else self._mail(row)

    @contextmanager
    def _change(self) -> Iterator[sqlite3.Connection]:
        """A transaction: on the disk as a whole, or not at all."""
        self._database.execute("BEGIN IMMEDIATE")
        try:
            yield self._database
            self._database.execute("COMMIT")
        except BaseException:
            if self._database.in_transaction:
                self._database.execute("ROLLBACK")
            raise

    def _insert(self, database: sqlite3.Connection, letter: int, mail: Composed, to: Sequence[str]) -> None:
        row = database.execute(
            "INSERT INTO mail (letter, part, parts, message_id, file, size, next_ms) VALUES (?, ?, ?, ?, ?, ?, 0)",
            (letter, mail.part, mail.parts, mail.message_id, mail.file, mail.size_bytes),
        )
        database.executemany(
            "INSERT INTO recipient (mail, place, address) VALUES (?, ?, ?)",
            [(row.lastrowid, place, address) for place, address in enumerate(to)],
        )

    def _open_letters(self) -> int:
        (found,) = self._database.execute(
            "SELECT COUNT(*) FROM letter WHERE stage IN ('preparing', 'failed') OR (stage = 'ready' AND EXISTS "
            "(SELECT 1 FROM mail WHERE letter = letter.n AND state IN ('queued', 'sending', 'failed')))"
        ).fetchone()
        return int(found)

    def _forget_old(self, database: sqlite3.Connection) -> None:
        """Letters that are over and stand far down; what failed stays until somebody has decided."""
        database.execute(
            "DELETE FROM letter WHERE n IN (SELECT n FROM letter WHERE stage = 'cancelled' OR (stage = 'ready' AND NOT "
            "EXISTS (SELECT 1 FROM mail WHERE mail.letter = letter.n AND state IN ('queued', 'sending', 'failed'))) "
            "ORDER BY n DESC LIMIT -1 OFFSET ?)",
            (KEEP,),
        )

    def _known(self, n: int) -> Letter:
        letter = self.letter(n)
        if letter is None:
            raise KeyError(n)
        return letter

    def _letter(self, row: sqlite3.Row) -> Letter:
        body = orjson.loads(row["body"])
        order = Order(**{**body, "recordings": tuple(body["recordings"]), "to": tuple(body["to"])})
        bare = Letter(
            n=row["n"],
            key=row["key"],
            ordered_ms=row["ordered_ms"],
            order=order,
            is_ready=row["stage"] == "ready",
            state="queued",
            said=row["said"],
            sender=row["sender"],
            way=row["way"],
            size_bytes=row["size"],
            sha256=row["sha256"],
            mails=tuple(self._mails(row["n"])),
        )
        match row["stage"]:
            case "ready":
                return replace(bare, state=state_of(bare.mails), said=said_of(bare.mails))
            case "cancelled":
                is_under_way = any(mail.state == "sending" for mail in bare.mails)
                sent = sum(mail.state == "sent" for mail in bare.mails)
                if sent and sent == len(bare.mails):
                    return replace(bare, state="sent", said="It was sent before it could be cancelled.")
                said = f"{sent} of {len(bare.mails)} mails were sent before." if sent else ""
                return replace(bare, state="sending" if is_under_way else "cancelled", said=said)
            case "failed":
                return replace(bare, state="failed")
        return bare

    def _mails(self, letter: int) -> list[Mail]:
        rows = self._database.execute("SELECT * FROM mail WHERE letter = ? ORDER BY part", (letter,)).fetchall()
        return [self._mail(row) for row in rows]

    def _mail(self, row: sqlite3.Row) -> Mail:
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
            said=row["said"],
            recipients=tuple(
                Recipient(address=one["address"], state=one["state"], said=one["said"]) for one in recipients
            ),
        )
