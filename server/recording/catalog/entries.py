"""What is known of each file, shared by the threads that list, read, move and show recordings; and their refusals."""

from __future__ import annotations

import contextlib
import logging
import sqlite3
import threading
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any, Literal

from server.protocol.answers import RecordingNames, Total
from server.recording.catalog import catalog_db
from server.recording.catalog.catalog_db import COLUMNS, Entry, Table, Which

log = logging.getLogger("catgraph.catalog")


class NotThere(Exception):
    """No such recording. The text is one sentence."""


class Refused(Exception):
    """It cannot be done now. The text is one sentence."""


class Entries:
    """Of one folder. Its methods may be called from any thread; after `close` it has no entries and takes none.

    Hold `lock` over steps that must see the same entries.
    """

    def __init__(self, database: Path | None) -> None:
        """`database` None: in memory."""
        self.lock = threading.RLock()
        self._database = catalog_db.open_at(database)
        self._is_closed = False

    def close(self) -> None:
        with self.lock:
            self._is_closed = True
            self._database.close()

    def select(self, how: str, values: Sequence[Any]) -> list[Entry]:
        """The entries that a SQL clause chooses."""
        with self.lock:
            if self._is_closed:
                return []
            return [
                catalog_db.entry(row)
                for row in self._database.execute(f"SELECT {COLUMNS} FROM recording {how}", values)
            ]

    def by_id(self, id: str, *, is_trashed: bool = False) -> Entry | None:
        """The recording; of those in the trash the one that was deleted last."""
        kept = "IS NOT NULL ORDER BY trashed_ms DESC" if is_trashed else "IS NULL"
        return next(iter(self.select(f"WHERE id = ? AND trashed_ms {kept}", [id])), None)

    def put(self, entries: Sequence[Entry]) -> None:
        """Keeps them in place of what there was of the same files."""
        with self.lock:
            if entries and not self._is_closed:
                self._write(lambda database: catalog_db.put(database, entries))

    def forget(self, paths: Sequence[str]) -> None:
        with self.lock:
            if paths and not self._is_closed:
                self._write(lambda database: catalog_db.forget(database, paths))

    def put_body(self, table: Table, sha256: str, body: dict[str, Any]) -> None:
        """Keeps trends, course or figures of a drive."""
        kept = catalog_db.encoded(table, body)  # others need not wait for it
        with self.lock:
            if not self._is_closed:
                self._write(lambda database: catalog_db.put_body(database, table, sha256, kept))

    def body(self, table: Literal["trends", "course"], sha256: str) -> bytes | None:
        """What `put_body` kept, as JSON; None: nothing."""
        with self.lock:
            return None if self._is_closed else catalog_db.body(self._database, table, sha256)

    def figures(self, which: Which, most: int) -> list[tuple[Any, ...]]:
        """The newest drives of some kind, oldest first: see catalog_db.figures."""
        with self.lock:
            return [] if self._is_closed else catalog_db.figures(self._database, which, most)

    def totals(self, which: Which | None = None) -> Total:
        """How many recordings there are of some kind, and how large together."""
        where, values = catalog_db.condition(which or Which())
        with self.lock:
            count, size = self._database.execute(
                f"SELECT COUNT(*), COALESCE(SUM(size), 0) FROM recording WHERE {where}", values
            ).fetchone()
        return {"count": count, "bytes": size}

    @property
    def waiting(self) -> int:
        """Files that are yet to be read."""
        with self.lock:
            return int(self._database.execute("SELECT COUNT(*) FROM recording WHERE found IS NULL").fetchone()[0])

    @property
    def unreadable(self) -> int:
        with self.lock:
            query = "SELECT COUNT(*) FROM recording WHERE trashed_ms IS NULL AND found ->> 'problem' IS NOT NULL"
            return int(self._database.execute(query).fetchone()[0])

    def names(self) -> RecordingNames:
        """The vehicles and tags that recordings have, to choose among."""
        with self.lock:
            vehicles = [row[0] for row in self._database.execute("SELECT DISTINCT vehicle FROM recording ORDER BY 1")]
            query = (
                "SELECT DISTINCT value FROM recording, json_each(tags) WHERE trashed_ms IS NULL ORDER BY 1 LIMIT 200"
            )
            tags = [row[0] for row in self._database.execute(query)]
        return {"vehicles": [vehicle for vehicle in vehicles if vehicle], "tags": tags}

    def _write(self, how: Callable[[sqlite3.Connection], None]) -> None:
        """A disk that takes nothing more leaves a catalog in memory: the files are the truth."""
        try:
            how(self._database)
        except sqlite3.Error as why:
            log.warning("catalog continues in memory: error=%s", why)
            old, self._database = self._database, catalog_db.open_at(None)
            with contextlib.suppress(sqlite3.Error):
                old.backup(self._database)
            old.close()
            how(self._database)
