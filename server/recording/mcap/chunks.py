"""Walks through an MCAP file from its beginning, as far as it is whole: chunk by chunk, without its index."""

from __future__ import annotations

import struct
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import IO, Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, Header, Metadata, Schema

from server.recording.read.unpack import verified

MAGIC = b"\x89MCAP0\r\n"
HEAD_BYTES = 1 + 8  # of a record: what it is, and how long
_MESSAGE_HEAD = struct.Struct("<BQHIQ")  # opcode, length, channel, sequence, log time
_LARGEST = 1 << 31  # bytes; a record that claims more is none
LARGEST_CHUNK = 256 << 20  # bytes, unpacked; ours have 32 kB, or one message


@dataclass(slots=True)
class WholeChunk:
    """A chunk that its checksum vouches for, and what is in it."""

    at: int  # its place in the file
    raw: bytes  # the record, unchanged
    record: Chunk
    schemas: list[Schema] = field(default_factory=list)
    channels: list[Channel] = field(default_factory=list)
    index: dict[int, list[tuple[int, int]]] = field(default_factory=dict)  # channel → (ns, place in the chunk)

    @property
    def messages(self) -> int:
        return sum(len(rows) for rows in self.index.values())


@dataclass(frozen=True, slots=True, kw_only=True)
class BadChunk:
    """A chunk with a wrong checksum."""

    at: int
    size: int


class Walk:
    """One file's records in order. After the walk `at` is where what is whole ends, and `is_whole` tells whether its
    writer ended it there."""

    def __init__(self, file: IO[bytes], size: int) -> None:
        self._file = file
        self.size = size
        self.at = 0
        self.is_whole = False
        self.header: Header | None = None
        self.metadata: list[Metadata] = []

    def chunks(self) -> Iterator[WholeChunk | BadChunk]:
        """The file's chunks. Raises OSError only."""
        self._file.seek(0)
        if self._file.read(len(MAGIC)) != MAGIC:
            return
        self.at = len(MAGIC)
        while self.at + HEAD_BYTES <= self.size:
            self._file.seek(self.at)
            head = self._file.read(HEAD_BYTES)
            length = int.from_bytes(head[1:], "little")
            if not Opcode.HEADER <= head[0] <= Opcode.DATA_END or length > _LARGEST:
                return
            if self.at + HEAD_BYTES + length > self.size:
                return
            body = self._file.read(length)
            if len(body) < length:
                return
            found: WholeChunk | BadChunk | None = None
            try:
                if head[0] == Opcode.CHUNK:
                    found = _chunk(self.at, head + body)
                elif head[0] == Opcode.METADATA:
                    self.metadata.append(Metadata.read(_stream(body)))
                elif head[0] == Opcode.HEADER:
                    self.header = Header.read(_stream(body))
                elif head[0] == Opcode.FOOTER:
                    self._file.seek(self.size - len(MAGIC))
                    self.is_whole = (
                        self.at + HEAD_BYTES + length + len(MAGIC) == self.size and self._file.read(len(MAGIC)) == MAGIC
                    )
                    return
            except OSError:
                raise
            except Exception:  # damage makes the readers fail in every way there is
                if head[0] != Opcode.CHUNK:
                    return
                found = BadChunk(at=self.at, size=HEAD_BYTES + length)
            self.at += HEAD_BYTES + length
            if found is not None:
                yield found


def _chunk(at: int, raw: bytes) -> WholeChunk:
    record = Chunk.read(_stream(raw[HEAD_BYTES:]))
    data = verified(record, LARGEST_CHUNK)
    size = len(data)
    chunk = WholeChunk(at=at, raw=raw, record=record)
    place = 0
    while place < size:
        if data[place] == Opcode.MESSAGE:
            _, length, channel, _, at_ns = _MESSAGE_HEAD.unpack_from(data, place)
            chunk.index.setdefault(channel, []).append((at_ns, place))
        else:
            length = int.from_bytes(data[place + 1 : place + HEAD_BYTES], "little")
            body: Any = _stream(data[place + HEAD_BYTES : place + HEAD_BYTES + length])
            if data[place] == Opcode.SCHEMA:
                chunk.schemas.append(Schema.read(body))
            elif data[place] == Opcode.CHANNEL:
                chunk.channels.append(Channel.read(body))
        place += HEAD_BYTES + length
    if place != size:
        raise ValueError("its records do not fill it")
    return chunk


def _stream(raw: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(raw))
