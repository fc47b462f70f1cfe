"""A disk made slow on purpose, for one process: whatever it does with files of a folder or a database takes longer.

It sleeps where the system would, in the calling thread and without the interpreter's lock. Audit events report what
is opened, listed, moved and removed; `stat`, `fsync` and statements of SQLite have none, so these are wrapped.
"""

from __future__ import annotations

import functools
import os
import sqlite3
import sys
import time
from collections.abc import Callable
from pathlib import Path
from typing import Any

WRAPPED = ("stat", "lstat", "statvfs", "fsync", "fdatasync")


def begin(folder: Path, delay_s: float) -> None:
    """From now on each access to the folder, each flush and each statement takes `delay_s` longer."""
    inside = str(folder)

    def audit(event: str, arguments: tuple[Any, ...]) -> None:
        if (event == "open" or event.startswith("os.")) and arguments and _is_inside(arguments[0]):
            time.sleep(delay_s)

    def _is_inside(what: object) -> bool:
        return isinstance(what, (str, bytes, os.PathLike)) and os.fsdecode(what).startswith(inside)

    def slow(inner: Callable[..., Any], *, always: bool) -> Callable[..., Any]:
        @functools.wraps(inner)
        def outer(*args: Any, **kwargs: Any) -> Any:
            if always or _is_inside(args[0]):
                time.sleep(delay_s)
            return inner(*args, **kwargs)

        return outer

    class Connection(sqlite3.Connection):
        def execute(self, *args: Any) -> sqlite3.Cursor:
            time.sleep(delay_s)
            return super().execute(*args)

        def executemany(self, *args: Any) -> sqlite3.Cursor:
            time.sleep(delay_s)
            return super().executemany(*args)

    for name in WRAPPED:
        setattr(os, name, slow(getattr(os, name), always=name in ("fsync", "fdatasync")))
    sqlite3.connect = functools.partial(sqlite3.connect, factory=Connection)  # type: ignore[assignment]
    sys.addaudithook(audit)
