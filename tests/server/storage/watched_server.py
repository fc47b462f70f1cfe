"""`catgraph ARGUMENTS…`, and every access to a disk from the thread of the event loop is written to a file.

The file is named by CATGRAPH_WATCHED, one line of JSON each: what was called, with what, and by whom. Python's audit
events tell what is opened, listed, moved and removed; they tell nothing of `stat`, `fsync` and statements to a
database, so these are wrapped. Files that the kernel makes up (/proc, /dev) are on no disk.
"""

from __future__ import annotations

import asyncio
import functools
import json
import os
import sqlite3
import sys
import threading
import traceback
from collections.abc import Callable
from pathlib import Path
from typing import Any

AUDITED = ("open", "os.", "shutil.", "sqlite3.connect", "tempfile.", "glob.")
ON_NO_DISK = ("os.putenv", "os.unsetenv", "os.system", "os.fork", "os.kill", "os.posix_spawn", "os.fwalk")
WRAPPED = ("stat", "lstat", "statvfs", "fsync", "fdatasync", "access", "readlink", "sendfile")
MADE_UP = ("/proc/", "/dev/", "/sys/")
HERE = Path(__file__).resolve()
PROJECT = HERE.parents[3]


class Watch:
    """Writes down what the event loop's thread does to a disk; each place in the code once."""

    def __init__(self, file: Path) -> None:
        self._loop_thread = threading.get_ident()
        self._descriptor = os.open(file, os.O_WRONLY | os.O_CREAT | os.O_APPEND | os.O_CLOEXEC, 0o600)
        self._seen: set[tuple[str, ...]] = set()
        self._is_writing = False
        self.is_on = False  # a server that starts serves nobody yet

    def note(self, call: str, what: object) -> None:
        """One access, where it is the event loop's."""
        if not self.is_on or self._is_writing or threading.get_ident() != self._loop_thread:
            return
        if not _runs() or _is_made_up(what):
            return
        self._is_writing = True  # what is done here is no access of the server
        try:
            frames = traceback.extract_stack()[:-2]
            by = [f"{_short(one.filename)}:{one.name}" for one in frames if not one.filename.startswith("<")]
            if (key := (call, *by)) not in self._seen:
                self._seen.add(key)
                os.write(self._descriptor, json.dumps({"call": call, "what": repr(what), "by": by}).encode() + b"\n")
        finally:
            self._is_writing = False

    def audit(self, event: str, arguments: tuple[Any, ...]) -> None:
        if event.startswith(AUDITED) and event not in ON_NO_DISK:
            self.note(event, arguments[0] if arguments else None)

    def wrap(self, owner: Any, name: str) -> None:
        """From now on calls of a function are noted."""
        inner: Callable[..., Any] = getattr(owner, name)

        @functools.wraps(inner)
        def outer(*args: Any, **kwargs: Any) -> Any:
            self.note(f"os.{name}", args[0] if args else None)
            return inner(*args, **kwargs)

        setattr(owner, name, outer)


def _watched(watch: Watch) -> type[sqlite3.Connection]:
    class Connection(sqlite3.Connection):
        def execute(self, *args: Any) -> sqlite3.Cursor:
            watch.note("sqlite3.execute", args[0])
            return super().execute(*args)

        def executemany(self, *args: Any) -> sqlite3.Cursor:
            watch.note("sqlite3.executemany", args[0])
            return super().executemany(*args)

        def close(self) -> None:
            watch.note("sqlite3.close", None)
            super().close()

    return Connection


def _runs() -> bool:
    try:
        asyncio.get_running_loop()
    except RuntimeError:
        return False
    return True


def _is_made_up(what: object) -> bool:
    try:
        return os.fsdecode(what).startswith(MADE_UP)  # type: ignore[arg-type]
    except TypeError:
        return False


def _short(file: str) -> str:
    path = Path(file)
    return path.relative_to(PROJECT).as_posix() if path.is_relative_to(PROJECT) else path.name


def begin(file: Path) -> None:
    """Watches the thread that calls this while an event loop runs in it, from the first line on stdin on."""
    watch = Watch(file)

    def wait() -> None:
        sys.stdin.readline()
        watch.is_on = True

    threading.Thread(target=wait, daemon=True).start()
    sys.addaudithook(watch.audit)
    for name in WRAPPED:
        watch.wrap(os, name)
    sqlite3.connect = functools.partial(sqlite3.connect, factory=_watched(watch))  # type: ignore[assignment]


if __name__ == "__main__":
    begin(Path(os.environ["CATGRAPH_WATCHED"]))
    from server.cli.main import main

    sys.exit(main(sys.argv[1:]))
