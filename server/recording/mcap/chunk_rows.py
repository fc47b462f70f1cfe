"""Reads the messages of one chunk of an MCAP file; the libraries' own ways make an object of each record, which takes
four times as long."""

from __future__ import annotations

import heapq
import os
import struct
from collections.abc import Callable, Container, Iterable, Iterator
from io import BytesIO
from operator import attrgetter, itemgetter
from typing import IO, Protocol, TypeVar

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Chunk

from server.recording.mcap.chunks import HEAD_BYTES
from server.recording.read.unpack import verified

_MESSAGE = int(Opcode.MESSAGE)
_MESSAGE_HEAD = struct.Struct("<BQHIQQ")  # opcode, length, channel, sequence, log time, publish time

EVERYWHERE = range(2**62)
ChunkRow = tuple[int, int, bytes]  # ns, channel, message


class Part(Protocol):
    """A chunk's entry in the index."""

    @property
    def message_start_time(self) -> int: ...  # ns


P = TypeVar("P", bound=Part)


def in_order(parts: Iterable[P], read: Callable[[P], list[ChunkRow]]) -> Iterator[ChunkRow]:
    """What is in these parts, in order of time; each is read when its time has come. Nearly always no two overlap."""
    unread = sorted(parts, key=attrgetter("message_start_time"))[::-1]
    heap: list[tuple[int, int, int, bytes]] = []  # time, place, channel, message: of the parts that overlap
    place = 0
    while unread or heap:
        while unread and (not heap or unread[-1].message_start_time <= heap[0][0]):
            rows = read(unread.pop())
            if rows and not heap and (not unread or unread[-1].message_start_time > rows[-1][0]):
                yield from rows
                continue
            for time_ns, channel, raw in rows:
                place += 1
                heapq.heappush(heap, (time_ns, place, channel, raw))
        if heap:
            time_ns, _, channel, raw = heapq.heappop(heap)
            yield time_ns, channel, raw


def read_chunk(file: IO[bytes], at: int) -> Chunk:
    """The chunk whose record starts at an offset of the file. Its declared lengths are not trusted and reserve no
    memory. Damage can raise any exception."""
    left = file.seek(0, os.SEEK_END) - at - HEAD_BYTES
    file.seek(at)
    length = int.from_bytes(file.read(HEAD_BYTES)[1:], "little")
    if length > left:
        raise ValueError("it is longer than its file")
    chunk: Chunk = Chunk.read(ReadDataStream(BytesIO(file.read(length))))
    return chunk


def chunk_rows(
    file: IO[bytes],
    at: int,
    channels: Container[int],
    from_ns: int,
    to_ns: int = 2**64 - 1,
    places: range = EVERYWHERE,
) -> list[ChunkRow]:
    """What came on these channels within a time, in its order, of the chunk whose record begins at a place in the file.
    `places`: of its content, where the records of these messages begin.

    Raises PartTooLarge and MemoryError; damage makes the reader fail in every other way there is.
    """
    return _rows(verified(read_chunk(file, at)), channels, from_ns, to_ns, places)


def run_rows(
    file: IO[bytes], at: int, size: int, channels: Container[int], from_ns: int, places: range = EVERYWHERE
) -> list[ChunkRow]:
    """As `chunk_rows`, of `size` bytes of messages outside of a chunk."""
    file.seek(at)
    data = file.read(size)
    if len(data) < size:
        raise ValueError("it is longer than its file")
    return _rows(data, channels, from_ns, 2**64, places)


def _rows(data: bytes, channels: Container[int], from_ns: int, to_ns: int, places: range) -> list[ChunkRow]:
    size = len(data)
    rows: list[ChunkRow] = []
    is_all = places is EVERYWHERE
    place = 0
    while place < size:
        if data[place] == _MESSAGE:
            _, length, channel, _, time_ns, _ = _MESSAGE_HEAD.unpack_from(data, place)
            if channel in channels and from_ns <= time_ns < to_ns and (is_all or place in places):
                rows.append((time_ns, channel, data[place + _MESSAGE_HEAD.size : place + HEAD_BYTES + length]))
        elif data[place]:
            length = int.from_bytes(data[place + 1 : place + HEAD_BYTES], "little")
        else:
            raise ValueError("it holds what is no record")
        place += HEAD_BYTES + length
    if place != size:
        raise ValueError("its records do not fill it")
    rows.sort(key=itemgetter(0))
    return rows
