"""Reads a ROS 1 bag whose index is missing, as a recorder leaves it that was killed, or a copy that ends too early.

All whole chunks are read, and of the one that was open the whole messages, where it is not compressed.
"""

from __future__ import annotations

import os
import struct
from dataclasses import replace
from pathlib import Path
from typing import BinaryIO, NamedTuple

from rosbags.rosbag1.reader import RecordType
from rosbags.typesys.msg import normalize_msgtype

from server.recording.read.errors import RecordingUnreadable
from server.recording.read.rosbag1 import Bag1, BagIndex, Entry, Packed, fields_of, unpacked
from server.recording.read.source import Channel
from server.recording.read.unpack import MOST_BYTES, PartTooLarge, allowed_bytes

MOST_HEADER = 1 << 20  # bytes of the header of one record
LEAST_HEADER = 16  # no record has a shorter one
_U32 = struct.Struct("<I").unpack
_U64 = struct.Struct("<Q").unpack
_TIME = struct.Struct("<II").unpack
_MALFORMED = (KeyError, ValueError, struct.error)  # of fields that are missing, too short, or no text


def is_cut(path: Path) -> bool:
    """Whether a bag was never closed, or lost its end. Of what is no bag: False."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        try:
            head = _record(file, _begin(file), size)
            if head is None or head.op != RecordType.BAGHEADER or head.fields.get(b"encryptor"):
                return False
            at: int = _U64(head.fields[b"index_pos"])[0]
            records = _U32(head.fields[b"conn_count"])[0] + _U32(head.fields[b"chunk_count"])[0]
        except _MALFORMED:
            return False
        if at == 0 or at > size:
            return True
        for _ in range(records):  # of the index, which ends the file
            record = _record(file, at, size)
            if record is None or record.end > size:
                return True
            at = record.end
        return at > size


class CutBag1(Bag1):
    """A ROS 1 bag without its index, which is made from its chunks. Raises RecordingUnreadable as Bag1."""

    is_cut = True

    def __init__(self, path: Path) -> None:
        self._scan = _Scan(path)
        super().__init__(path)
        self.damage.pieces = self._scan.left_out

    def _reader_of(self, path: Path) -> BagIndex:
        return self._scan


class _Record(NamedTuple):
    """The header of one record, and the place of its data."""

    op: int
    fields: dict[bytes, bytes]
    data_at: int
    end: int


class _Scan:
    """The index of a bag as its chunks have it."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.bio: BinaryIO | None = None
        self.indexes: dict[int, list[Entry]] = {}
        self.chunks: dict[int, Packed] = {}
        self.records: dict[int, list[tuple[int, bytes]]] = {}
        self.channels: list[Channel] = []
        self.start_time = 2**63 - 1
        self.end_time = 0
        self.left_out = 0  # pieces: chunks, the rest of one, records, topics that nothing declares
        self._connections: dict[int, Channel] = {}

    def open(self) -> None:
        """Raises RecordingUnreadable where not one message is whole."""
        self.bio = file = self.path.open("rb")
        try:
            self._walk(file)
            if not any(self.indexes.get(number) for number in self._connections):
                raise RecordingUnreadable(f"{self.path} is not complete: it ends too early")
        except BaseException:
            self.close()
            raise
        self.left_out += sum(number not in self._connections for number in self.indexes)
        self.indexes = {number: sorted(self.indexes.get(number, ())) for number in self._connections}
        self.channels = [replace(one, count=len(self.indexes[one.number])) for one in self._connections.values()]
        times_ns = [entry[0] for entries in self.indexes.values() for entry in (*entries[:1], *entries[-1:])]
        self.start_time, self.end_time = min(times_ns), max(times_ns) + 1

    def close(self) -> None:
        if self.bio is not None:
            self.bio.close()
        self.bio = None
        self.indexes.clear()
        self.chunks.clear()

    def _walk(self, file: BinaryIO) -> None:
        size = file.seek(0, os.SEEK_END)
        at = _begin(file)
        while (record := _record(file, at, size)) is not None:
            if record.op == RecordType.CHUNK and not self._chunk(file, at, record, size):
                return
            at = record.end

    def _chunk(self, file: BinaryIO, at: int, record: _Record, size: int) -> bool:
        """Whether it is whole, and may be followed by another."""
        compression = record.fields.get(b"compression", b"").decode("ascii", "replace")
        length = record.end - record.data_at
        is_open = length == 0 or record.end > size  # a recorder writes its length last
        if is_open:
            if compression != "none":
                return False
            length = min(size - record.data_at, allowed_bytes(MOST_BYTES))
        declared = record.fields.get(b"size", b"")
        packed = Packed(length, record.data_at, compression, _U32(declared)[0] if len(declared) == 4 else length)
        file.seek(record.data_at)
        try:
            data = unpacked(packed, file.read(length))
        except PartTooLarge as why:
            raise RecordingUnreadable(f"{self.path.name} cannot be read: of a part of it, {why}") from None
        except MemoryError:
            raise
        except (OSError, EOFError, ValueError, RuntimeError):
            self.left_out += 1
            return not is_open
        self.chunks[at] = packed
        is_whole = self._take(at, data)
        self.left_out += not is_whole and not is_open
        return not is_open

    def _take(self, place: int, data: bytes) -> bool:
        """Note the connections and the whole messages of the chunk at `place`. False: its rest is no records."""
        at = 0
        while at + 8 <= len(data):
            data_at = at + 8 + _U32(data[at : at + 4])[0]
            if data_at > len(data) or data_at < at + 8 + LEAST_HEADER:
                return False
            end = data_at + _U32(data[data_at - 4 : data_at])[0]
            if end > len(data):
                return False
            try:
                fields = fields_of(data[at + 4 : data_at - 4])
                number = _U32(fields[b"conn"])[0]
                if fields[b"op"][0] == RecordType.CONNECTION:
                    self._connections.setdefault(number, _channel(number, fields, fields_of(data[data_at:end])))
                elif fields[b"op"][0] == RecordType.MSGDATA:
                    seconds, nanoseconds = _TIME(fields[b"time"])
                    self.indexes.setdefault(number, []).append((seconds * 10**9 + nanoseconds, place, at, number))
                else:
                    self.left_out += 1
            except (*_MALFORMED, IndexError):
                self.left_out += 1
            at = end
        return at == len(data)


def _begin(file: BinaryIO) -> int:
    """The place of the first record."""
    file.seek(0)
    return len(file.readline(64))


def _record(file: BinaryIO, at: int, size: int) -> _Record | None:
    """The record at a place of a file of `size` bytes; None where there is none whose header is whole."""
    file.seek(at)
    head = file.read(4)
    length = _U32(head)[0] if len(head) == 4 else 0
    if not LEAST_HEADER <= length <= MOST_HEADER or at + 8 + length > size:
        return None
    header = file.read(length + 4)
    try:
        fields = fields_of(header[:length])
        op = fields[b"op"][0]
    except (*_MALFORMED, IndexError):
        return None
    data_at = at + 8 + length
    return _Record(op=op, fields=fields, data_at=data_at, end=data_at + _U32(header[length:])[0])


def _channel(number: int, fields: dict[bytes, bytes], inner: dict[bytes, bytes]) -> Channel:
    """A connection of a bag. Raises KeyError or ValueError where it is none."""
    topic = fields[b"topic"].decode()
    return Channel(
        number=number,
        topic=("/" if topic.startswith("/") else "") + "/".join(filter(None, topic.split("/"))),
        type=normalize_msgtype(inner[b"type"].decode()),
        definition=inner[b"message_definition"].decode(),
        format="msg",
        encoding="ros1",
        count=0,
        is_latched=inner.get(b"latching") == b"1",
    )
