"""Walks through an MCAP file from its beginning, as far as it is whole: chunk by chunk, without its index.

Where no record can be read, the walk continues behind the next record of the hash chain, and what is between counts as
damaged. Without a record of the chain behind that place the file ends there.
"""

from __future__ import annotations

import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import IO, Any

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, AttachmentIndex, Channel, Chunk, Header, Metadata, Schema

from server.recording.mcap.chain import CHAIN_OPCODE, RECORD_BYTES, TAG, ChainRecord, Kind, parsed
from server.recording.read.unpack import verified

MAGIC = b"\x89MCAP0\r\n"
HEAD_BYTES = 1 + 8  # of a record: what it is, and how long
_MESSAGE_HEAD = struct.Struct("<BQHIQ")  # opcode, length, channel, sequence, log time
_CHUNK_FIELDS = 8 + 8 + 8 + 4 + 4 + 8  # bytes of a chunk's: times, size, CRC, lengths of the compression and the data
_BLOCK = 1 << 20  # bytes that are searched at a time
_LARGEST = 1 << 31  # bytes; a record that claims more is none
_IN_DATA = (  # all that a recorder writes before DataEnd
    *(Opcode.HEADER, Opcode.METADATA, Opcode.CHUNK, Opcode.MESSAGE_INDEX, Opcode.ATTACHMENT, Opcode.DATA_END),
    CHAIN_OPCODE,
)
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
    """A chunk with a wrong checksum, or what is between a place where no record can be read and the end of the next
    record of the chain."""

    at: int
    size: int


class Walk:
    """One file's records in order. After the walk `at` is where what is whole ends, and `is_whole` states whether its
    writer ended it there."""

    def __init__(self, file: IO[bytes], size: int) -> None:
        self._file = file
        self.size = size
        self.at = 0
        self.is_whole = False
        self.header: Header | None = None
        self.metadata: list[Metadata] = []
        self.metadata_at: list[tuple[int, int]] = []  # place and length of each
        self.attachments: list[AttachmentIndex] = []  # those with a correct checksum
        self.last_link: ChainRecord | None = None  # of the chain; the seal is none
        self.linked_to = 0  # where it ends
        self._sure_to = 0  # end of the last whole chunk or record of the chain: lengths behind it may be wrong
        self._is_in_data = True
        self._is_behind_last_link = False  # known to be

    def chunks(self) -> Iterator[WholeChunk | BadChunk]:
        """The file's chunks. Raises OSError only."""
        self._file.seek(0)
        if self._file.read(len(MAGIC)) != MAGIC:
            return
        self.at = self._sure_to = len(MAGIC)
        while True:
            self._file.seek(self.at)
            head = self._file.read(HEAD_BYTES)
            end = self.at + HEAD_BYTES + int.from_bytes(head[1:], "little")
            found: WholeChunk | BadChunk | None = None
            is_record = _is_record(head) and end <= self.size
            if is_record:
                body = self._file.read(end - self.at - HEAD_BYTES)
                if self.at + HEAD_BYTES + len(body) < end:
                    return
                try:
                    found = self._read(head, body)
                except OSError:
                    raise
                except Exception:  # damage makes the readers fail in every way there is
                    found = BadChunk(at=self.at, size=end - self.at)
                    is_record = head[0] in (Opcode.CHUNK, Opcode.ATTACHMENT)
                if self.is_whole:
                    return
                if found is None and self._is_out_of_place(head[0], body):
                    found = BadChunk(at=self.at, size=end - self.at)
                if head[0] == Opcode.FOOTER:
                    is_record = False
            if not is_record:
                if (gap := self._gap()) is None:
                    return
                yield gap
                self.at = self._sure_to = gap.at + gap.size
                continue
            if isinstance(found, WholeChunk) or head[0] == CHAIN_OPCODE:
                self._sure_to = end
            self._is_in_data = self._is_in_data and head[0] != Opcode.DATA_END
            self.at = end
            if found is not None:
                yield found

    def _read(self, head: bytes, body: bytes) -> WholeChunk | None:
        """Note what a record contains; return the chunk, where it is one."""
        if head[0] == Opcode.CHUNK:
            return _chunk(self.at, head + body)
        if head[0] == Opcode.METADATA:
            self.metadata.append(Metadata.read(_stream(body)))
            self.metadata_at.append((self.at, HEAD_BYTES + len(body)))
        elif head[0] == Opcode.ATTACHMENT:
            self.attachments.append(_attachment(self.at, body))
        elif head[0] == CHAIN_OPCODE:
            self._note_link(head + body)
        elif head[0] == Opcode.HEADER:
            self.header = Header.read(_stream(body))
        elif head[0] == Opcode.FOOTER:
            self._file.seek(self.size - len(MAGIC))
            is_at_end = self.at + HEAD_BYTES + len(body) + len(MAGIC) == self.size
            self.is_whole = is_at_end and self._file.read(len(MAGIC)) == MAGIC
        return None

    def _is_out_of_place(self, opcode: int, body: bytes) -> bool:
        """Whether a record cannot be of its opcode, as one that was a chunk, and the chain continues behind it."""
        if opcode == Opcode.MESSAGE_INDEX:
            is_odd = len(body) != 6 + int.from_bytes(body[2:6], "little")
        else:
            is_odd = self._is_in_data and opcode not in _IN_DATA
        return is_odd and self._behind_next_link() is not None

    def _gap(self) -> BadChunk | None:
        """What is damaged where no record can be read. None: all that is left, as behind a torn end."""
        if (behind := self._behind_next_link()) is None:
            return None
        self._file.seek(self.at + HEAD_BYTES)
        if self._file.read(len(TAG)) == TAG:  # only the frame of a record of the chain
            return BadChunk(at=self.at, size=RECORD_BYTES)
        return BadChunk(at=self._sure_to, size=behind - self._sure_to)

    def _behind_next_link(self) -> int | None:
        """Where the next record of the chain ends. None: there is none, as behind a torn end."""
        if self._is_behind_last_link:
            return None
        start = self._sure_to  # place of the first byte of `kept`
        self._file.seek(start)
        kept = b""
        while (left := self.size - start - len(kept)) > 0 and (block := self._file.read(min(_BLOCK, left))):
            kept += block
            tag = HEAD_BYTES - 1
            while (tag := kept.find(TAG, tag + 1)) >= 0:
                place = tag - HEAD_BYTES
                if parsed(kept[place : place + RECORD_BYTES]) is not None:
                    return start + place + RECORD_BYTES
            start += max(0, len(kept) - RECORD_BYTES)
            kept = kept[-RECORD_BYTES:]
        self._is_behind_last_link = True
        return None

    def _note_link(self, raw: bytes) -> None:
        record = parsed(raw)
        if record is not None and record.kind is not Kind.SEAL:
            self.last_link, self.linked_to = record, self.at + len(raw)

    def raw_at(self, at: int, length: int) -> bytes:
        """A record, unchanged. Raises OSError."""
        self._file.seek(at)
        raw = self._file.read(length)
        if len(raw) < length:
            raise OSError("the file became shorter while it was recovered")
        return raw

    def chunk_at(self, at: int) -> WholeChunk:
        """A chunk that `chunks` gave, once more. Raises OSError, and anything where the file was changed meanwhile."""
        self._file.seek(at)
        head = self._file.read(HEAD_BYTES)
        return _chunk(at, head + self._file.read(int.from_bytes(head[1:], "little")))


def has_magic(file: IO[bytes], at: int, end: int, block_bytes: int = _BLOCK) -> bool:
    """Whether a file begins or ends between two places, which may be far apart: it is read in blocks to the first."""
    file.seek(at)
    kept = b""
    while block := file.read(min(block_bytes, end - at)):
        at += len(block)
        kept = kept[1 - len(MAGIC) :] + block
        if MAGIC in kept:
            return True
    return False


def _is_record(head: bytes) -> bool:
    if len(head) < HEAD_BYTES:
        return False
    length = int.from_bytes(head[1:], "little")
    if head[0] == CHAIN_OPCODE:
        return HEAD_BYTES + length == RECORD_BYTES
    return Opcode.HEADER <= head[0] <= Opcode.DATA_END and length <= _LARGEST


def _chunk(at: int, raw: bytes) -> WholeChunk:
    record = Chunk.read(_stream(raw[HEAD_BYTES:]))
    if len(raw) != HEAD_BYTES + _CHUNK_FIELDS + len(record.compression.encode()) + len(record.data):
        raise ValueError("its length is not that of what is in it")
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


def _attachment(at: int, body: bytes) -> AttachmentIndex:
    """Where an attachment is, and what it is. Raises ValueError, and anything, where it is damaged."""
    if zlib.crc32(body[:-4]) != int.from_bytes(body[-4:], "little"):
        raise ValueError("its checksum is wrong")
    found = Attachment.read(_stream(body))
    return AttachmentIndex(
        offset=at,
        length=HEAD_BYTES + len(body),
        log_time=found.log_time,
        create_time=found.create_time,
        data_size=len(found.data),
        name=found.name,
        media_type=found.media_type,
    )


def _stream(raw: bytes) -> ReadDataStream:
    return ReadDataStream(BytesIO(raw))
