"""Copies of recorded files in the temporary folder: unpacked, or with what belongs to a database that was not closed.

A recording is never changed, and its folder may not be writable.
"""

from __future__ import annotations

import contextlib
import errno
import os
import tempfile
from collections.abc import Iterable, Iterator
from pathlib import Path
from typing import IO

import zstandard

from server.recording import space
from server.recording.read.errors import NoRoom

LEAVE_FREE = 1 << 30  # bytes of the disk with the temporary files
LOOK_EVERY = 32 << 20  # bytes written between two checks of the disk
_BLOCK = 1 << 20
_PACKED_BLOCK = 4096  # bytes; they hold at most a thousand blocks of zstd, of 128 kB each, which are unpacked at once


class TemporaryCopy:
    """A folder with copies, which `close` removes. The disk keeps room for others that record meanwhile."""

    def __init__(self) -> None:
        with _room():
            self._folder = tempfile.TemporaryDirectory(prefix="catgraph-")
        self.path = Path(self._folder.name)
        self._leave_free = max(LEAVE_FREE, space.free_at(self.path.parent) // 2)
        self._look_in = 0

    def close(self) -> None:
        self._folder.cleanup()

    def release(self) -> None:
        """Removes the copies as soon as they are open, where the system keeps open files: a process that is killed
        leaves none."""
        if os.name == "posix":
            self.close()

    def unpack(self, packed: Path) -> tuple[Path, bool]:
        """A file packed with zstd, unpacked, and whether it ends where it should; what is whole of it is there.

        Raises NoRoom where it does not fit on the disk, OSError.
        """
        target = self.path / packed.stem
        with _room(), packed.open("rb") as source, target.open("wb") as copy:
            frames = _Frames(source)
            self._write(frames.blocks(), copy)
        return target, frames.is_whole

    def copy(self, file: Path) -> Path:
        """A file as it is. Raises as `unpack`."""
        target = self.path / file.name
        with _room(), file.open("rb") as source, target.open("wb") as copy:
            self._write(iter(lambda: source.read(_BLOCK), b""), copy)
        return target

    def _write(self, blocks: Iterable[bytes], copy: IO[bytes]) -> None:
        pieces = (block[at : at + LOOK_EVERY] for block in blocks for at in range(0, len(block), LOOK_EVERY))
        for data in pieces:
            copy.write(data)
            self._look_in -= len(data)
            if self._look_in < 0:
                self._look_in = LOOK_EVERY
                free = space.free_at(self.path.parent)
                if free < self._leave_free:
                    raise NoRoom(
                        f"a file of this recording, unpacked, does not fit on the disk: {space.amount(free)} are free"
                    )


@contextlib.contextmanager
def _room() -> Iterator[None]:
    """Raises NoRoom where the disk takes no more."""
    try:
        yield
    except OSError as why:
        if why.errno not in (errno.ENOSPC, errno.EDQUOT):
            raise
        raise NoRoom("a file of this recording, unpacked, does not fit on the disk: it is full") from None


class _Frames:
    """The content of a file packed with zstd, to where it can be unpacked."""

    def __init__(self, source: IO[bytes]) -> None:
        self.is_whole = False  # after the last block: whether its last frame has an end
        self._source = source

    def blocks(self) -> Iterator[bytes]:
        frame = zstandard.ZstdDecompressor().decompressobj()
        try:
            while packed := self._source.read(_PACKED_BLOCK):
                while packed:
                    frame = zstandard.ZstdDecompressor().decompressobj() if frame.eof else frame
                    yield frame.decompress(packed)
                    packed = frame.unused_data
        except zstandard.ZstdError:
            return
        self.is_whole = frame.eof
