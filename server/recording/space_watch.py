"""Reads the free space of the disk often, and sums up the recordings' files rarely."""

from __future__ import annotations

import time
from pathlib import Path

from server.recording import space
from server.recording.space import Space

LOOK_S = 1.0  # interval of reading the free space
COUNT_S = 15.0  # how often the folder's files are counted up


class SpaceWatch:
    """Of the folder below `root`. `size`: bytes of the file that is being written, 0 where there is none."""

    def __init__(self, root: Path) -> None:
        self._root = root
        self._looked_s = self._counted_s = 0.0
        self._used_elsewhere = self._free = 0

    def is_due(self, now_s: float) -> bool:
        return now_s - self._looked_s >= LOOK_S

    def count_up(self) -> None:
        """Sum up all files before a new one starts."""
        self._counted_s = time.monotonic()
        self._used_elsewhere = space.used_by(self._root)

    def look(self, now_s: float, size: int) -> Space:
        """Read the current sizes. Raises OSError."""
        self._looked_s = now_s
        if now_s - self._counted_s >= COUNT_S:
            self.count_up()
            self._used_elsewhere -= size
        self._free = space.free_at(self._root)
        return self.now(size)

    def now(self, size: int) -> Space:
        """What the disk said last, with what was written since."""
        return Space(free=self._free, used=self._used_elsewhere + size)
