"""The numbered log of what happened to each vehicle, in SQLite, one row an event, never rewritten.

Numbers count from 1 for each vehicle and go on over restarts, so that a page can ask for what it missed.
"""

from __future__ import annotations

import sqlite3
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import orjson

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


class Journal:
    """Appends and reads events; one connection, used from the event loop (an append is some 30 µs)."""

    def __init__(self, path: Path | None) -> None:
        """At `path`, or in memory where it is None. Raises OSError where the file cannot be opened."""
        try:
            self._database = sqlite3.connect(str(path) if path else ":memory:", isolation_level=None)
            self._database.execute("PRAGMA journal_mode=WAL")
            self._database.execute("PRAGMA synchronous=NORMAL")  # WAL: survives kill -9, not the loss of power
            self._database.execute(_SCHEMA)
        except sqlite3.Error as error:
            raise OSError(f"the alarm log {path} cannot be opened: {error}") from error
        self._last: dict[str, int] = dict(
            self._database.execute("SELECT vehicle, MAX(n) FROM event GROUP BY vehicle").fetchall()
        )

    def last(self, vehicle: str) -> int:
        """The number of the newest event, 0 where there is none."""
        return self._last.get(vehicle, 0)

    def append(self, vehicle: str, events: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Numbers the events (`at_ms`, `alarm`, `change`, …) and keeps them; answers them with their numbers `n`."""
        numbered = [{"n": n, **event} for n, event in enumerate(events, self.last(vehicle) + 1)]
        rows = [(vehicle, e["n"], e["at_ms"], e.get("alarm"), e["change"], orjson.dumps(e)) for e in numbered]
        self._database.execute("BEGIN")
        self._database.executemany("INSERT INTO event VALUES (?, ?, ?, ?, ?, ?)", rows)
        self._database.execute("COMMIT")
        if numbered:
            self._last[vehicle] = numbered[-1]["n"]
        return numbered

    def after(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]]:
        """The events that follow number `n`, in order, at most `limit`."""
        rows = self._database.execute(
            "SELECT body FROM event WHERE vehicle = ? AND n > ? ORDER BY n LIMIT ?", (vehicle, n, limit)
        )
        return [orjson.loads(body) for (body,) in rows]

    def find(
        self,
        vehicle: str,
        *,
        before: int | None = None,
        limit: int = 100,
        alarm: str | None = None,
        change: str | None = None,
        since_ms: int | None = None,
        until_ms: int | None = None,
    ) -> list[dict[str, Any]]:
        """Events newest first, numbered below `before`, of one alarm, one kind of change, one span of time."""
        conditions: list[str] = ["vehicle = ?"]
        values: list[str | int] = [vehicle]
        for condition, value in (
            ("n < ?", before),
            ("alarm = ?", alarm),
            ("change = ?", change),
            ("at_ms >= ?", since_ms),
            ("at_ms < ?", until_ms),
        ):
            if value is not None:
                conditions.append(condition)
                values.append(value)
        rows = self._database.execute(
            f"SELECT body FROM event WHERE {' AND '.join(conditions)} ORDER BY n DESC LIMIT ?",  # conditions are ours
            (*values, limit),
        )
        return [orjson.loads(body) for (body,) in rows]

    def close(self) -> None:
        self._database.close()
