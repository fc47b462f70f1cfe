"""Limits of the process: memory for commands that read foreign files, and files and connections that it may open."""

from __future__ import annotations

import contextlib
import errno
import os
import re
import resource
from collections.abc import Iterator
from pathlib import Path

PART = 0.8  # of what the machine has free
TOO_LARGE = "a part of it, unpacked, is larger than this machine's memory."

KEPT_FREE = 32  # for the log, a recording, an export: below this it is reported


@contextlib.contextmanager
def bounded_memory(part: float = 1.0) -> Iterator[None]:
    """Within it, what would take nearly all free memory of the machine, or this part of it, raises MemoryError."""
    before = resource.getrlimit(resource.RLIMIT_DATA)
    free, used = free_bytes(), _bytes("/proc/self/status", "VmData")
    if free is None or used is None or before[0] != resource.RLIM_INFINITY:  # somebody has bounded it already
        yield
        return
    resource.setrlimit(resource.RLIMIT_DATA, (used + int(free * PART * part), before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_DATA, before)


def free_bytes() -> int | None:
    """The available memory of the machine [B]; None: unknown."""
    return _bytes("/proc/meminfo", "MemAvailable")


def _bytes(file: str, name: str) -> int | None:
    with contextlib.suppress(OSError):
        found = re.search(rf"^{name}:\s+(\d+) kB", Path(file).read_text(encoding="utf-8"), re.MULTILINE)
        return int(found[1]) * 1024 if found else None
    return None


class FilesExhausted(OSError):
    """Too few file descriptors are left; `str()` has the number."""


def demand_free() -> None:
    """Raises FilesExhausted where fewer than KEPT_FREE files can be opened. Takes some microseconds.

    The system gives the lowest number that is free: all below it are taken.
    """
    most, _ = resource.getrlimit(resource.RLIMIT_NOFILE)
    try:
        number = os.open(os.devnull, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        if error.errno not in (errno.EMFILE, errno.ENFILE):
            raise
        raise FilesExhausted(f"no file or connection can be opened: {most} are open, and no more are allowed") from None
    os.close(number)
    if most != resource.RLIM_INFINITY and number > most - KEPT_FREE:
        raise FilesExhausted(f"{most - number} more files and connections can be opened, of {most} (ulimit -n)")
