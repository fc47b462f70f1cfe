"""One server's data folder: locked against a second server, and refused where a newer version wrote it."""

from __future__ import annotations

import contextlib
import errno
import fcntl
import logging
import os
import sqlite3
import weakref
from pathlib import Path

import orjson

from server.storage import durable_file
from server.storage.durable_file import set_aside
from server.version import catgraph_version

log = logging.getLogger("catgraph.storage")

FORMAT = 1  # of the folder as a whole; one more when an older version could do harm to what a newer one keeps
FORMAT_FILE = "format.json"
LOCK_FILE = "lock"
DATABASES = {  # newest user_version that we read
    "events.sqlite": 1,
    "recordings.sqlite": 2,
    "mail/outbox.sqlite": 1,
    "store/uploads.sqlite": 1,
}
_UNLOCKABLE = (errno.ENOLCK, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS)


class DataFolderRefused(Exception):
    """This server must not use the folder; `str()` is one sentence or two for a person."""


class DataFolder:
    """Held from its making until `close`, or until the process ends."""

    def __init__(self, path: Path) -> None:
        """Makes the folder where there is none. Raises DataFolderRefused; OSError where it cannot be used at all."""
        path.mkdir(parents=True, exist_ok=True)
        self._path = path
        descriptor = os.open(path / LOCK_FILE, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        self._close = weakref.finalize(self, os.close, descriptor)
        try:
            self._lock(descriptor)
            self._demand_format()
        except BaseException:
            self.close()
            raise

    def close(self) -> None:
        """Release the folder."""
        self._close()

    def _lock(self, descriptor: int) -> None:
        try:
            fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            holder = os.pread(descriptor, 20, 0).decode("ascii", "replace").strip()
            process = f" (process {holder})" if holder.isdigit() else ""
            raise DataFolderRefused(
                f"Another catgraph{process} uses the data folder {self._path}. "
                "Stop it, or start this one with --data and another folder."
            ) from None
        except OSError as why:
            if why.errno not in _UNLOCKABLE:
                raise
            log.warning("data folder not locked, start no second server on it: path=%s error=%s", self._path, why)
        with contextlib.suppress(OSError):  # a full disk; the number is only for the sentence above
            os.ftruncate(descriptor, 0)
            os.pwrite(descriptor, f"{os.getpid()}\n".encode(), 0)

    def _demand_format(self) -> None:
        """Raises DataFolderRefused where a newer catgraph wrote here; else notes that this one does."""
        file = self._path / FORMAT_FILE
        kept: object = None
        try:
            kept = orjson.loads(file.read_bytes())
        except FileNotFoundError:
            pass
        except (OSError, orjson.JSONDecodeError) as why:
            log.warning("format file unreadable, rewritten: path=%s error=%s", file, why)
            set_aside(file)
        number = kept.get("format") if isinstance(kept, dict) else None
        if isinstance(number, int) and number > FORMAT:
            by = kept.get("catgraph") if isinstance(kept, dict) else None
            raise self._newer(f"format {number}" + (f", catgraph {by}" if isinstance(by, str) else ""), FORMAT)
        for name, known in DATABASES.items():
            found = _user_version(self._path / name)
            if found > known:
                raise self._newer(f"{name} has format {found}", known)
        if number != FORMAT:
            with contextlib.suppress(OSError):  # a full disk must not prevent monitoring
                content = orjson.dumps({"format": FORMAT, "catgraph": catgraph_version()})
                durable_file.write(file, content)

    def _newer(self, what: str, known: int) -> DataFolderRefused:
        return DataFolderRefused(
            f"A newer catgraph wrote the data folder {self._path} ({what}; this version reads format {known}). "
            "Install that version, or start with --data and another folder."
        )


def _user_version(path: Path) -> int:
    """The format number of a database; 0 where there is none, or it cannot be read (its owner deals with that)."""
    if not path.is_file():
        return 0
    with contextlib.suppress(sqlite3.Error):
        database = sqlite3.connect(f"{path.absolute().as_uri()}?mode=ro", uri=True, timeout=0)
        try:
            (version,) = database.execute("PRAGMA user_version").fetchone()
            return int(version)
        finally:
            database.close()
    return 0
