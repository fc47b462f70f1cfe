"""Reads an MCAP file whose end is missing, as a recorder leaves it that was killed: all of its whole chunks."""

from __future__ import annotations

import os
from collections import Counter
from dataclasses import replace
from pathlib import Path

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Channel, Chunk, ChunkIndex, Header, Message, Metadata, Schema
from mcap.stream_reader import breakup_chunk

from server.recording.mcap.mcap_file import Index, McapFile, latest
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.unpack import verified

MAGIC = b"\x89MCAP0\r\n"  # begins a file, and ends one that was closed
_HEAD_BYTES = 1 + 8  # of a record: what it is, and how long


def is_cut(path: Path) -> bool:
    """Whether an MCAP file was never closed, or lost its end."""
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - len(MAGIC)))
        return size < 2 * len(MAGIC) or file.read() != MAGIC


class CutMcapFile(McapFile):
    """An MCAP file without its index, which is rebuilt from the whole chunks."""

    is_cut = True

    def _read_index(self) -> Index:
        schemas: dict[int, Schema] = {}
        channels: dict[int, Channel] = {}
        counts: Counter[int] = Counter()
        parts: list[ChunkIndex] = []
        notes: list[Metadata] = []
        profile = ""
        size = self._file.seek(0, os.SEEK_END)
        at = len(MAGIC)
        while at + _HEAD_BYTES <= size:
            self._file.seek(at)
            head = self._file.read(_HEAD_BYTES)
            length = int.from_bytes(head[1:], "little")
            if at + _HEAD_BYTES + length > size:
                break
            if head[0] == Opcode.CHUNK:
                part = self._part(at, length, schemas, channels, counts)
                if part is not None:
                    parts.append(part)
            elif head[0] == Opcode.METADATA:
                notes.append(Metadata.read(ReadDataStream(self._file)))
            elif head[0] == Opcode.HEADER:
                profile = Header.read(ReadDataStream(self._file)).profile
            at += _HEAD_BYTES + length
        if not parts:
            raise RecordingUnreadable(f"{self.path} is not complete: it ends too early")
        if not channels:  # no part has the definitions of its messages
            raise RecordingUnreadable(f"{self.path} is not complete, and none of its {len(parts)} parts can be read")
        return Index(
            schemas=schemas, channels=channels, counts=counts, parts=parts, metadata=latest(notes), profile=profile
        )

    def _part(
        self, at: int, length: int, schemas: dict[int, Schema], channels: dict[int, Channel], counts: Counter[int]
    ) -> ChunkIndex | None:
        """The index of one chunk; what it declares and holds is noted. None where it holds no message."""
        try:
            chunk = Chunk.read(ReadDataStream(self._file))
        except Exception:  # also damaged, with unknown content
            return None
        part = ChunkIndex(
            chunk_length=_HEAD_BYTES + length,
            chunk_start_offset=at,
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            message_end_time=chunk.message_end_time,
            message_index_length=0,
            message_index_offsets={},
            message_start_time=chunk.message_start_time,
            uncompressed_size=chunk.uncompressed_size,
        )
        try:
            records = breakup_chunk(replace(chunk, compression="", data=verified(chunk)))
        except MemoryError:
            raise
        except Exception:  # damaged besides, or too large: reading will find it out again, and name it
            return part
        for record in records:
            match record:
                case Schema():
                    schemas[record.id] = record
                case Channel():
                    channels[record.id] = record
                case Message():
                    counts[record.channel_id] += 1
        return part if any(isinstance(record, Message) for record in records) else None
