"""Verifies recordings of the list on request, in a process of its own, one at a time; keeps the results in memory.

A result holds for the file as it was: once it was changed there is none.
"""

from __future__ import annotations

import logging
import os
import subprocess
import sys
import threading
from collections import OrderedDict
from pathlib import Path

import orjson

from server.protocol.answers import VerificationAnswer
from server.recording.catalog.catalog_db import Entry
from server.recording.catalog.entries import Refused

log = logging.getLogger("catgraph.catalog")

MOST_KEPT = 1000
LONGEST_S = 900.0  # of one file: 200 MB in a second leave room for any drive
_Stamp = tuple[int, int, int, int]
_ROOT = Path(__file__).resolve().parents[3]  # of the packages: the process must find the same code


class Verifications:
    """Of the recordings in one folder. For any thread."""

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._one = threading.Lock()  # held while a file is verified
        self._kept: OrderedDict[str, tuple[_Stamp, VerificationAnswer]] = OrderedDict()

    def of(self, entry: Entry) -> VerificationAnswer | None:
        """The result for the file as it is; None: it was not verified since the server started."""
        kept = self._kept.get(entry.path)
        return kept[1] if kept is not None and kept[0] == _stamp(self._folder / entry.path) else None

    def verify(self, entry: Entry, at_ms: int) -> VerificationAnswer:
        """Verifies a file and keeps the result. Waits for it. Raises Refused."""
        if not self._one.acquire(blocking=False):
            raise Refused("Another recording is being verified. Try again when it is done.")
        path = self._folder / entry.path
        try:
            before = _stamp(path)
            found: VerificationAnswer = {**_run(path), "at_ms": at_ms}
            self._kept.pop(entry.path, None)
            if before is not None and before == _stamp(path):
                self._kept[entry.path] = before, found
            while len(self._kept) > MOST_KEPT:
                self._kept.popitem(last=False)
        finally:
            self._one.release()
        return found


def _stamp(path: Path) -> _Stamp | None:
    """What changes with each change of a file; a program can set the time of the change, but not that of the inode."""
    try:
        stat = path.stat()
    except OSError:
        return None
    return stat.st_ino, stat.st_size, stat.st_mtime_ns, stat.st_ctime_ns


def _run(path: Path) -> VerificationAnswer:
    name = os.fsencode(path.absolute())  # the process has another working directory
    command = [sys.executable, "-m", "server.recording.verification", name.hex()]
    try:
        done = subprocess.run(command, cwd=_ROOT, stdin=subprocess.DEVNULL, capture_output=True, timeout=LONGEST_S)
        found: VerificationAnswer = orjson.loads(done.stdout)
    except subprocess.TimeoutExpired:
        raise Refused(f"It could not be verified within {LONGEST_S / 60:.0f} minutes.") from None
    except (OSError, orjson.JSONDecodeError) as why:
        log.warning("verification failed: recording=%s error=%r", path, why)
        raise Refused("It could not be verified: the reader failed.") from None
    return found
