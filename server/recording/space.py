"""How much room there is for recordings, how much they take already, and a text for why a disk refuses.

The free space of the disk is read often, and the recordings' files are summed up rarely.
"""

from __future__ import annotations

import errno
import os
import time
from dataclasses import dataclass
from pathlib import Path

LOOK_S = 1.0  # interval of reading the free space
COUNT_S = 15.0  # how often the folder's files are counted up


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowance:
    """What the operator lets recordings have, in bytes."""

    quota: int  # of all recordings together, those in the trash too; 0: no limit
    min_free: int  # on their disk, for the log and for everything else


@dataclass(frozen=True, slots=True, kw_only=True)
class Space:
    """Sizes of the disk [B]."""

    free: int  # for this user
    used: int  # by all recordings together

    def exhausted(self, allowance: Allowance) -> str | None:
        """Why nothing more may be recorded, as a sentence; None: it may."""
        if self.free < allowance.min_free:
            return f"The disk has {amount(self.free)} left, and recording stops at {amount(allowance.min_free)}."
        if allowance.quota and self.used >= allowance.quota:
            return f"Recordings take {amount(self.used)}, all of the {amount(allowance.quota)} that are allowed."
        return None

    def left(self, allowance: Allowance) -> int:
        """Until it is exhausted."""
        room = self.free - allowance.min_free
        return max(0, min(room, allowance.quota - self.used) if allowance.quota else room)


def free_at(root: Path) -> int:
    """Bytes left for this user on the disk of a folder that need not be there yet. Raises OSError."""
    standing = next(folder for folder in (root, *root.parents) if folder.is_dir())
    disk = os.statvfs(standing)
    return disk.f_bavail * disk.f_frsize


def used_by(root: Path) -> int:
    """Bytes of all files below; what vanishes meanwhile counts nothing."""
    total = 0
    waiting = [root]
    while waiting:
        try:
            with os.scandir(waiting.pop()) as found:
                for entry in found:
                    if entry.is_dir(follow_symlinks=False):
                        waiting.append(Path(entry.path))
                    else:
                        total += entry.stat(follow_symlinks=False).st_size
        except OSError:
            continue
    return total


def amount(size: float) -> str:
    """“1.2 GB”, “340 MB”: as shops count them."""
    for unit, factor in (("GB", 1e9), ("MB", 1e6), ("kB", 1e3)):
        if size >= factor:
            number = size / factor
            return f"{number:.0f} {unit}" if number >= 99.5 else f"{number:.1f} {unit}"
    return f"{size:.0f} bytes"


_WHY = {
    errno.ENOSPC: "the disk is full",
    errno.EDQUOT: "the disk is full for this user",
    errno.EROFS: "the folder for recordings is read-only",
    errno.EACCES: "this user may not write into the folder for recordings",
    errno.EPERM: "this user may not write into the folder for recordings",
    errno.ENOENT: "the folder or the file was removed",
    errno.ENOTDIR: "the folder for recordings is not a folder",
    errno.EIO: "the disk reports an error",
    errno.EFBIG: "the file has grown too large for its disk",
    errno.ENODEV: "the disk was removed",
    errno.ESTALE: "the disk was removed",
}


def why(error: OSError) -> str:
    """What the disk did, as a short text."""
    return _WHY.get(error.errno or 0) or (error.strerror or str(error)).lower()


class SpaceWatch:
    """Reads the free space of the disk often, and sums up the recordings' files rarely.

    Of the folder below `root`. `size`: bytes of the file that is being written, 0 where there is none.
    """

    def __init__(self, root: Path) -> None:
        self._root = root
        self._looked_s = self._counted_s = 0.0
        self._used_elsewhere = self._free = 0

    def is_due(self, now_s: float) -> bool:
        return now_s - self._looked_s >= LOOK_S

    def count_up(self) -> None:
        """Sum up all files before a new one starts."""
        self._counted_s = time.monotonic()
        self._used_elsewhere = used_by(self._root)

    def look(self, now_s: float, size: int) -> Space:
        """Read the current sizes. Raises OSError."""
        self._looked_s = now_s
        if now_s - self._counted_s >= COUNT_S:
            self.count_up()
            self._used_elsewhere -= size
        self._free = free_at(self._root)
        return self.now(size)

    def now(self, size: int) -> Space:
        """What the disk reported last, with what was written since."""
        return Space(free=self._free, used=self._used_elsewhere + size)
