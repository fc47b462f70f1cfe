"""Writes a ROS 1 bag (format 2.0, wiki.ros.org/Bags/Format/2.0), a chunk at a time.

rosbags has such a writer; it keeps the place of every message in lists until the end, 130 MB for an hour of a car. Here
what is kept for the end is a few bytes a chunk.
"""

from __future__ import annotations

import bz2
import struct
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO, Literal

import lz4.frame

CHUNK_BYTES = 768 * 1024  # as rosbag itself has it
Compression = Literal["none", "bz2", "lz4"]
COMPRESSIONS: tuple[Compression, ...] = ("none", "bz2", "lz4")

_MAGIC = b"#ROSBAG V2.0\n"
_HEADER_BYTES = 4096  # of the first record, which is written again in the end
_MESSAGE, _BAG, _INDEX, _CHUNK, _CHUNK_INFO, _CONNECTION = 2, 3, 4, 5, 6, 7
_LAST_NS = 2**32 * 10**9 - 1  # seconds are 32 bits

_u32 = struct.Struct("<I").pack
_u64 = struct.Struct("<Q").pack
_entry = struct.Struct("<III").pack  # seconds, nanoseconds, offset
_message_head = struct.Struct("<II3scI5sII5sIII").pack


class BagTimeOutOfRange(ValueError):
    """A message's time cannot be written in a bag."""


@dataclass(slots=True)
class _Chunk:
    """What is not yet in the file."""

    data: bytearray
    index: dict[int, bytearray]
    first_ns: int = 0
    last_ns: int = 0


class BagFile:
    """A bag that is being written. `close` makes it whole; without it the file is worthless."""

    def __init__(self, path: Path, compression: Compression = "none") -> None:
        """Overwrite existing data. Raises OSError."""
        self._file: BinaryIO = path.open("wb")
        self._compression = compression
        self._pack = _COMPRESSORS[compression]
        self._connections: list[bytes] = []  # their records, for the end
        self._chunk_infos = bytearray()
        self._chunks = 0
        self._chunk = _Chunk(bytearray(), {})
        self._file.write(_MAGIC)
        self._write_header(0)

    def add_connection(self, topic: str, type: str, md5sum: str, definition: str, *, is_latched: bool = False) -> int:
        """Declares messages of a type ("pkg/Type") on a topic; answers the number to write them with."""
        number = len(self._connections)
        data = _fields(
            topic=topic.encode(),
            type=type.encode(),
            md5sum=md5sum.encode(),
            message_definition=definition.encode(),
            latching=b"1" if is_latched else b"0",
        )
        record = _record(_fields(op=bytes((_CONNECTION,)), conn=_u32(number), topic=topic.encode()), data)
        self._connections.append(record)
        self._chunk.data += record
        return number

    def write(self, connection: int, time_ns: int, raw: bytes | memoryview) -> None:
        """Adds a message. Raises BagTimeOutOfRange, OSError."""
        if not 0 <= time_ns <= _LAST_NS:
            raise BagTimeOutOfRange(f"{time_ns} ns since 1970 is outside a bag's range of times")
        chunk = self._chunk
        seconds, nanoseconds = divmod(max(time_ns, 1), 1_000_000_000)  # 0 is "no time" in ROS
        if not chunk.index:
            chunk.first_ns = chunk.last_ns = time_ns
        elif time_ns < chunk.first_ns:
            chunk.first_ns = time_ns
        elif time_ns > chunk.last_ns:
            chunk.last_ns = time_ns
        entries = chunk.index.get(connection)
        if entries is None:
            entries = chunk.index[connection] = bytearray()
        data = chunk.data
        entries += _entry(seconds, nanoseconds, len(data))
        data += _message_head(
            *(38, 4, b"op=", bytes((_MESSAGE,)), 9, b"conn=", connection, 13, b"time=", seconds, nanoseconds, len(raw))
        )
        data += raw
        if len(data) > CHUNK_BYTES:
            self._end_chunk()

    def close(self) -> None:
        """Writes the index and ends the file."""
        try:
            if self._chunk.data:
                self._end_chunk()
            index_at = self._file.tell()
            for record in self._connections:
                self._file.write(record)
            self._file.write(self._chunk_infos)
            self._file.seek(len(_MAGIC))
            self._write_header(index_at)
        finally:
            self._file.close()

    def abandon(self) -> None:
        """Abort writing; the file is not used."""
        self._file.close()

    def _end_chunk(self) -> None:
        chunk, at = self._chunk, self._file.tell()
        header = _fields(op=bytes((_CHUNK,)), compression=self._compression.encode(), size=_u32(len(chunk.data)))
        self._file.write(_record(header, self._pack(bytes(chunk.data))))
        for number, entries in chunk.index.items():
            count = _u32(len(entries) // 12)
            header = _fields(op=bytes((_INDEX,)), ver=_u32(1), conn=_u32(number), count=count)
            self._file.write(_record(header, bytes(entries)))
        self._chunk_infos += _record(
            _fields(
                op=bytes((_CHUNK_INFO,)),
                ver=_u32(1),
                chunk_pos=_u64(at),
                start_time=_time(chunk.first_ns),
                end_time=_time(chunk.last_ns),
                count=_u32(len(chunk.index)),
            ),
            b"".join(_u32(number) + _u32(len(entries) // 12) for number, entries in chunk.index.items()),
        )
        self._chunks += 1
        self._chunk = _Chunk(bytearray(), {})

    def _write_header(self, index_at: int) -> None:
        header = _fields(
            op=bytes((_BAG,)),
            index_pos=_u64(index_at),
            conn_count=_u32(len(self._connections)),
            chunk_count=_u32(self._chunks),
        )
        self._file.write(_record(header, b" " * (_HEADER_BYTES - 8 - len(header))))


def _fields(**fields: bytes) -> bytes:
    return b"".join(_u32(len(name) + 1 + len(value)) + name.encode() + b"=" + value for name, value in fields.items())


def _record(header: bytes, data: bytes) -> bytes:
    return _u32(len(header)) + header + _u32(len(data)) + data


def _time(time_ns: int) -> bytes:
    seconds, nanoseconds = divmod(max(time_ns, 1), 1_000_000_000)
    return _u32(seconds) + _u32(nanoseconds)


def _as_is(data: bytes) -> bytes:
    return data


def _lz4(data: bytes) -> bytes:
    """As roslz4 reads it: blocks that do not need each other, and a checksum over all."""
    return bytes(lz4.frame.compress(data, block_linked=False, content_checksum=True, store_size=False))


_COMPRESSORS: dict[Compression, Callable[[bytes], bytes]] = {"none": _as_is, "bz2": bz2.compress, "lz4": _lz4}
