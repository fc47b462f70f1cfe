"""What of each recording is in the store already: kept in a database, so that a kill loses no part that was sent."""

from __future__ import annotations

import contextlib
import logging
import sqlite3
import threading
from collections.abc import Callable
from pathlib import Path

from pydantic import BaseModel, ConfigDict, Field, ValidationError

from server.storage.durable_file import set_aside

log = logging.getLogger("catgraph.store")

VERSION = 1
_SCHEMA = f"""
CREATE TABLE IF NOT EXISTS upload (id TEXT PRIMARY KEY, body TEXT NOT NULL) WITHOUT ROWID;
PRAGMA user_version = {VERSION};
"""


class _Kept(BaseModel):
    model_config = ConfigDict(extra="ignore")


class SentPart(_Kept):
    """One object in the store, and what was sent into it."""

    key: str
    size: int
    sha256: str


class SentClip(SentPart):
    at_ms: int  # the moment it is about


class Verified(_Kept):
    """The copy was read back and is the file as it was then."""

    sha256: str
    size: int
    changed_ns: int
    at_ms: int


class Failure(_Kept):
    """Why it does not go on, and when it is tried again."""

    sentence: str
    tries: int
    next_ms: int


class Upload(_Kept):
    """Of one recording."""

    id: str
    size: int = 0  # of the file that the parts are of
    changed_ns: int = 0
    parts: dict[int, SentPart] = Field(default_factory=dict)
    clips: list[SentClip] = Field(default_factory=list)
    clips_are_made: bool = False
    row: str = ""  # the digest of what the row in the store was made of
    is_asked: bool = False  # a person wants the whole file
    is_deletion_asked: bool = False
    is_deleted: bool = False  # here, after `verified`: the copy in the store may be the only one, and is kept
    verified: Verified | None = None
    failure: Failure | None = None


class Uploads:
    """Its methods may be called from any thread. Each change is on the disk when `change` returns."""

    def __init__(self, path: Path) -> None:
        """Raises OSError, sqlite3.Error where nothing can be kept there."""
        path.parent.mkdir(parents=True, exist_ok=True)
        self._lock = threading.Lock()
        try:
            self._database = _open(path)
        except sqlite3.OperationalError:
            raise
        except sqlite3.DatabaseError as why:
            log.error("uploads_unreadable error=%s aside=%s", why, set_aside(path))
            for suffix in ("-wal", "-shm"):
                with contextlib.suppress(OSError):
                    path.with_name(path.name + suffix).unlink()
            self._database = _open(path)
        self._known = {id: upload for id, body in self._rows() if (upload := _read(id, body)) is not None}

    def _rows(self) -> list[tuple[str, str]]:
        return list(self._database.execute("SELECT id, body FROM upload"))

    def get(self, id: str) -> Upload:
        """A copy of what is known; an empty one where nothing is."""
        with self._lock:
            known = self._known.get(id)
            return Upload(id=id) if known is None else known.model_copy(deep=True)

    def change(self, id: str, change: Callable[[Upload], object]) -> Upload:
        """Has `change` called with what is known, and keeps it so; a copy of it. Raises sqlite3.Error where it cannot
        be kept: then nothing changed."""
        with self._lock:
            known = self._known.get(id)
            new = Upload(id=id) if known is None else known.model_copy(deep=True)
            change(new)
            self._database.execute("INSERT OR REPLACE INTO upload VALUES (?, ?)", (id, new.model_dump_json()))
            self._known[id] = new
            return new.model_copy(deep=True)

    def close(self) -> None:
        with self._lock:
            self._database.close()


def _open(path: Path) -> sqlite3.Connection:
    database = sqlite3.connect(path, isolation_level=None, check_same_thread=False, timeout=5.0)
    try:
        database.execute("PRAGMA journal_mode=WAL")
        database.execute("PRAGMA synchronous=FULL")
        database.executescript(_SCHEMA)
        return database
    except BaseException:
        database.close()
        raise


def _read(id: str, body: str) -> Upload | None:
    try:
        return Upload.model_validate_json(body)
    except ValidationError as why:
        log.error("upload_unreadable recording=%s error=%s", id, why.errors(include_input=False)[0]["msg"])
        return None
