"""The numbered event log of each vehicle, in SQLite: one row per event, append-only.

Numbers start at 1 for each vehicle and continue over restarts, so that a page can request what it missed; they are of a
run (`log_runs.py`). A transaction is on the disk once it is committed: what waits is committed together. If the disk
fails, events stay in memory until they can be stored, and `trouble` reports it.
"""

from __future__ import annotations

import logging
import secrets
import sqlite3
import threading
import time
from collections import deque
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import islice
from pathlib import Path
from typing import Any, TypeVar

import orjson

from server.bus import journal_db
from server.storage.storage_thread import StorageThread

log = logging.getLogger("catgraph.journal")

_PORTION = 100  # events a transaction: one that is refused has cost little
RECENT = 200  # recent events of a vehicle, served from memory, because every page requests each one
MAX_UNSAVED = 10_000  # events of a vehicle that wait in memory for the disk; some 5 MB
SLOW_DISK_S = 1.0  # a disk that takes longer for one portion is reported, and its events are shown without it
T = TypeVar("T")


class Journal:
    """Appends and reads events. Never raises for what the disk does.

    `append` is for one thread and waits for no disk where there is a storage thread; the others are for any thread.
    """

    def __init__(
        self,
        path: Path | None,
        *,
        run: str | None = None,
        thread: StorageThread | None = None,
        lost: journal_db.Lost = journal_db.nothing_lost,
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        """At `path`, or in memory where it is None; written by `thread`, else by the caller. `run`: of this process,
        None: any that is new. `lost`: the events that a log has lost, from elsewhere. `now`: in seconds."""
        opened = journal_db.open_at(path, run or secrets.token_hex(8), lost)
        self._thread = thread
        self._now = now
        self.on_saved: Callable[[], None] = lambda: None  # called by the writing thread, whatever became of it
        self._memory = threading.Lock()  # guards what waits for the disk; never held during a write
        self._writing = threading.Lock()  # one portion at a time
        self._connection = threading.RLock()  # guards the database
        self._is_scheduled = False
        self._waits_since_s: float | None = None  # for how long nothing of what waits was written
        self._database = opened.database
        self.complaint = opened.complaint  # what was found wrong at the start and put right, for the log
        self.runs = opened.runs
        self._last = dict(opened.last)
        self._unsaved: dict[str, deque[dict[str, Any]]] = {}
        self._recent: dict[str, deque[dict[str, Any]]] = {}  # of this run, without a gap up to the newest
        self._lost = 0
        self.why_refused = opened.why  # why the disk does not take what is written; None: it does
        if self.why_refused:
            log.error("%s", self.trouble)

    @property
    def trouble(self) -> str | None:
        """Why what happens now is not kept on the disk, as a sentence; None: it is."""
        why, since_s = self.why_refused, self._waits_since_s
        if why is None and since_s is not None and (slow_s := self._now() - since_s) >= SLOW_DISK_S:
            why = f"the disk has not answered for {slow_s:.0f} s"
        if why is None:
            return None
        with self._memory:
            waiting = sum(len(events) for events in self._unsaved.values())
        in_memory = f" {_events(waiting)} in memory only." if waiting else ""
        lost = f" {_events(self._lost)} lost." if self._lost else ""
        return f"The alarm log is not stored: {why}.{in_memory}{lost}"

    def last(self, vehicle: str) -> int:
        """The number of the newest event, 0 where there is none."""
        return self._last.get(vehicle, 0)

    def append(self, vehicle: str, events: Sequence[Mapping[str, Any]]) -> list[dict[str, Any]]:
        """Numbers the events (`at_ms`, `alarm`, `change`, …) and keeps them; answers them with their numbers `n`."""
        numbered = [{"n": n, **event} for n, event in enumerate(events, self.last(vehicle) + 1)]
        if numbered:
            self._last[vehicle] = numbered[-1]["n"]
            self._recent.setdefault(vehicle, deque(maxlen=RECENT)).extend(numbered)
            with self._memory:
                waiting = self._unsaved.setdefault(vehicle, deque())
                waiting.extend(numbered)
                if self._waits_since_s is None:
                    self._waits_since_s = self._now()
            self.save_soon()
            with self._memory:
                while len(waiting) > MAX_UNSAVED:
                    waiting.popleft()
                    self._lost += 1
        return numbered

    def saved(self, vehicle: str) -> int:
        """The number up to which no event of the vehicle waits for the disk."""
        with self._memory:
            waiting = self._unsaved.get(vehicle)
            return waiting[0]["n"] - 1 if waiting else self.last(vehicle)

    def save_soon(self) -> None:
        """Tries to keep what waits in memory; to be called now and then while there is trouble."""
        if self._thread is None:
            self.save()
        elif not self._is_scheduled:
            self._is_scheduled = True
            self._thread.submit(self._save_scheduled)

    def _save_scheduled(self) -> None:
        self._is_scheduled = False  # before reading: events appended from now on schedule the next run
        self.save()
        self.on_saved()

    def save(self) -> None:
        """As `save_soon`, at once and in the calling thread."""
        with self._writing:
            while waiting := self._next():
                if not self._try(partial(self._write, waiting), False):
                    return
                with self._memory:
                    for vehicle, event in waiting:
                        unsaved = self._unsaved[vehicle]
                        while unsaved and unsaved[0]["n"] <= event["n"]:
                            unsaved.popleft()
                    self._waits_since_s = self._now() if any(self._unsaved.values()) else None
                if self.why_refused is not None:
                    log.warning("alarm log stored again")
                    self.why_refused = None

    def _next(self) -> list[tuple[str, dict[str, Any]]]:
        with self._memory:
            every = ((vehicle, event) for vehicle, events in self._unsaved.items() for event in events)
            return list(islice(every, _PORTION))

    def _waiting(self, vehicle: str) -> list[dict[str, Any]]:
        """What is not on the disk; to be copied before the disk is read, so that no event is in neither."""
        with self._memory:
            return list(self._unsaved.get(vehicle, ()))

    def _write(self, events: Sequence[tuple[str, Mapping[str, Any]]]) -> bool:
        if self._database is None:
            return False
        self._database.execute("BEGIN IMMEDIATE")
        journal_db.note_run(self._database, self.runs.present)
        self._database.executemany(
            "INSERT INTO event VALUES (?, ?, ?, ?, ?, ?)",
            ((v, e["n"], e["at_ms"], e.get("alarm"), e["change"], orjson.dumps(e)) for v, e in events),
        )
        self._database.execute("COMMIT")
        return True

    def after(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]]:
        """The events that follow number `n`, in order, at most `limit`."""
        recent = self.recent_after(vehicle, n, limit)
        return self.stored_after(vehicle, n, limit) if recent is None else recent

    def stored_after(self, vehicle: str, n: int, limit: int = 100, *, is_whole: bool = False) -> list[dict[str, Any]]:
        """As `after`, from the disk and what waits for it; `is_whole`: raises OSError where the disk cannot be read."""
        waiting = self._waiting(vehicle)
        found = self._read("vehicle = ? AND n > ? ORDER BY n LIMIT ?", (vehicle, n, limit))
        if found is None and is_whole:
            raise OSError(self.why_refused)
        newest = found[-1]["n"] if found else n
        return [*(found or []), *(event for event in waiting if event["n"] > newest)][:limit]

    def recent_after(self, vehicle: str, n: int, limit: int = 100) -> list[dict[str, Any]] | None:
        """As `after`, from memory alone; None where the disk must be read. For the thread that appends."""
        if n >= self.last(vehicle):
            return []
        recent = self._recent.get(vehicle, ())
        if recent and recent[0]["n"] <= n + 1:
            return [event for event in recent if event["n"] > n][:limit]
        return None

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
        """Events newest first, numbered below `before`, of one alarm, one kind of change, one span of time.

        `alarm` "" selects those without an alarm.
        """
        conditions: list[str] = ["vehicle = ?"]  # `unlikely` makes SQLite use the index of the alarms
        values: list[str | int] = [vehicle]
        for condition, value in (
            ("n < ?", before),
            ("unlikely(alarm = ?)", alarm or None),
            ("change = ?", change),
            ("at_ms >= ?", since_ms),
            ("at_ms < ?", until_ms),
        ):
            if value is not None:
                conditions.append(condition)
                values.append(value)
        if alarm == "":
            conditions.append("unlikely(alarm IS NULL)")
        waiting = [
            event
            for event in reversed(self._waiting(vehicle))
            if (before is None or event["n"] < before)
            and (alarm is None or (event.get("alarm") or "") == alarm)
            and (change is None or event["change"] == change)
            and (since_ms is None or event["at_ms"] >= since_ms)
            and (until_ms is None or event["at_ms"] < until_ms)
        ]
        found = self._read(f"{' AND '.join(conditions)} ORDER BY n DESC LIMIT ?", (*values, limit)) or []
        written = {event["n"] for event in found}
        return [*(event for event in waiting if event["n"] not in written), *found][:limit]

    def alarms(self, vehicle: str) -> list[str]:
        """The ids of all alarms in the log."""
        database = self._database
        waiting = {event["alarm"] for event in self._waiting(vehicle) if event.get("alarm")}
        if database is None:
            return sorted(waiting)

        def walk() -> set[str]:
            found: set[str] = set()
            name = ""
            while True:  # from one to the next by the index: there are some dozens, in any number of events
                row = database.execute(
                    "SELECT MIN(alarm) FROM event WHERE vehicle = ? AND alarm > ?", (vehicle, name)
                ).fetchone()
                if row is None or row[0] is None:
                    return found
                name = row[0]
                found.add(name)

        none: set[str] = set()
        return sorted(self._try(walk, none) | waiting)

    def close(self) -> None:
        """Saves what waits, and closes the file."""
        self.save()
        if self._database is not None:
            with self._connection:
                self._database.close()

    def _read(self, which: str, values: Iterable[str | int]) -> list[dict[str, Any]] | None:
        database = self._database
        if database is None:
            return []
        query = f"SELECT body FROM event WHERE {which}"  # its conditions are ours; None: it cannot be read
        return self._try(lambda: [orjson.loads(body) for (body,) in database.execute(query, tuple(values))], None)

    def _try(self, work: Callable[[], T], else_: T) -> T:
        """What the database answers; where it does not, why is kept, and `else_` is the answer."""
        with self._connection:
            return self._try_alone(work, else_)

    def _try_alone(self, work: Callable[[], T], else_: T) -> T:
        try:
            return work()
        except (sqlite3.Error, orjson.JSONDecodeError) as error:
            if self._database is not None and self._database.in_transaction:
                try:
                    self._database.execute("ROLLBACK")
                except sqlite3.Error:
                    log.debug("nothing to roll back", exc_info=True)
            why = journal_db.why(error)
            if why != self.why_refused:
                log.error("alarm log not stored: %s (%s)", why, error)
            self.why_refused = why
            return else_


def _events(number: int) -> str:
    return f"{number} event is" if number == 1 else f"{number} events are"
