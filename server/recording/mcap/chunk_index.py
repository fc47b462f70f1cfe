"""The index of a file's chunks, read from the file when needed instead of kept in memory.

A recording has five chunks a second and an index entry of some kilobyte each: kept as objects until the end they would
take some 20 MB for each hour.
"""

from __future__ import annotations

import struct
import time
from collections.abc import Iterator
from pathlib import Path
from typing import IO

from mcap.opcode import Opcode
from mcap.records import ChunkIndex

from server.recording.mcap.chunks import MAGIC

_HEAD = struct.Struct("<BQ")  # of each record: opcode, length
_CHUNK = struct.Struct("<QQQII")  # start, end [ns], size uncompressed, its CRC, length of the compression's name
_SIZE = struct.Struct("<Q")
_CHANNEL = struct.Struct("<H")
PORTION = 100  # chunks between two chances for other threads to run
REST_S = 0.001


class ChunkIndexes:
    """Takes the place of the list in which the library's writer keeps the index; `path` is the file being written."""

    def __init__(self, path: Path) -> None:
        self._path = path
        self._count = 0

    def append(self, index: ChunkIndex) -> None:
        """Count the entry; its content can be read from the file."""
        self._count += 1

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[ChunkIndex]:
        """All that was appended, which must be in the file. Raises OSError, also where the file has fewer."""
        found = 0
        with self._path.open("rb") as file:
            for index in read_indexes(file):
                found += 1
                yield index
                if found == self._count:
                    return
                if found % PORTION == 0:
                    time.sleep(REST_S)
        if found != self._count:
            raise OSError(f"{self._path.name} has {found} chunks instead of {self._count}")


def read_indexes(file: IO[bytes]) -> Iterator[ChunkIndex]:
    """The index of each chunk, in the order of the file."""
    at = len(MAGIC)
    file.seek(at)
    index: ChunkIndex | None = None
    while len(head := file.read(_HEAD.size)) == _HEAD.size:
        opcode, length = _HEAD.unpack(head)
        end = at + _HEAD.size + length
        if opcode == Opcode.MESSAGE_INDEX and index is not None:
            (channel,) = _CHANNEL.unpack(file.read(_CHANNEL.size))
            index.message_index_offsets[channel] = at
            index.message_index_length = end - index.chunk_start_offset - index.chunk_length
        elif index is not None:
            yield index
            index = None
        if opcode == Opcode.CHUNK:
            start_ns, end_ns, size, _, name = _CHUNK.unpack(file.read(_CHUNK.size))
            compression = file.read(name).decode()
            (compressed,) = _SIZE.unpack(file.read(_SIZE.size))
            index = ChunkIndex(
                message_start_time=start_ns,
                message_end_time=end_ns,
                chunk_start_offset=at,
                chunk_length=_HEAD.size + length,
                message_index_offsets={},
                message_index_length=0,
                compression=compression,
                compressed_size=compressed,
                uncompressed_size=size,
            )
        at = end
        file.seek(at)
    if index is not None:
        yield index
