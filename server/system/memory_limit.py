"""A memory limit for commands that read foreign files: a packed file can declare any size."""

from __future__ import annotations

import contextlib
import re
import resource
from collections.abc import Iterator
from pathlib import Path

PART = 0.8  # of what the machine has free
TOO_LARGE = "a part of it, unpacked, is larger than this machine's memory."


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
