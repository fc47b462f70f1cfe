"""Writes the finished file of a recording whose writer was killed: what is whole of it, and an index of that."""

from __future__ import annotations

import contextlib
import os
import zlib
from collections import Counter
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import IO, Any

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    AttachmentIndex,
    Channel,
    DataEnd,
    Footer,
    Header,
    MessageIndex,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)

from server.recording.mcap.chain import RECORD_BYTES, ChainWriter, Kind
from server.recording.mcap.chunks import MAGIC, BadChunk, Walk, WholeChunk
from server.recording.mcap.write import read_indexes
from server.recording.own import METADATA

_BLOCK = 1 << 20


@dataclass(slots=True)
class Contents:
    """What the whole chunks of a file hold."""

    messages: int = 0
    bad: int = 0  # chunks left out
    start_ns: int = 0
    end_ns: int = 0
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)
    unlinked: list[int] = field(default_factory=list)  # places of the chunks behind the last record of the chain
    _linked_to: int = 0

    def take(self, chunk: WholeChunk | BadChunk, linked_to: int) -> bool:
        """Counts a chunk; False: it is none that can be copied. `linked_to`: where the chain ends before it."""
        if isinstance(chunk, BadChunk):
            self.bad += 1
            return False
        self.schemas.update((schema.id, schema) for schema in chunk.schemas)
        self.channels.update((channel.id, channel) for channel in chunk.channels)
        if not self.channels.keys() >= chunk.index.keys():  # the definitions of its messages were in a damaged chunk
            self.bad += 1
            return False
        if not chunk.index:
            return False
        start_ns, end_ns = chunk.record.message_start_time, chunk.record.message_end_time
        self.start_ns = min(self.start_ns, start_ns) if self.messages else start_ns
        self.end_ns = max(self.end_ns, end_ns)
        self.messages += chunk.messages
        for channel, rows in chunk.index.items():
            self.counts[channel] += len(rows)
        if linked_to > self._linked_to:
            self._linked_to = linked_to
            self.unlinked.clear()
        if linked_to:  # they are needed only with a chain
            self.unlinked.append(chunk.at)
        return True


def write_recovered(path: Path, left: IO[bytes], walk: Walk, found: Contents, **ended: str) -> None:
    """Writes the new file to `path`, and waits until the disk has it. `walk`: of the file that was left, at its end.

    Raises OSError; then there is no new file.
    """
    try:
        with path.open("w+b") as file:
            new = _NewFile(file)
            if walk.last_link is not None and not found.bad:
                new.chain = ChainWriter(walk.last_link)
                _continue(new, left, walk, found)
            else:
                found = _salvage(new, left, walk)
            recorded = next((note.metadata for note in reversed(walk.metadata) if note.name == METADATA), {})
            new.note(Metadata(name=METADATA, metadata=dict(recorded) | ended))
            new.finish(found)
            file.flush()
            os.fsync(file.fileno())
    except BaseException:
        with contextlib.suppress(FileNotFoundError):
            path.unlink()
        raise


def _continue(new: _NewFile, left: IO[bytes], walk: Walk, found: Contents) -> None:
    """Copies the bytes up to the last record of the chain, and the chunks behind it, whose index may be torn."""
    left.seek(0)
    while new.at < walk.linked_to:
        block = left.read(min(_BLOCK, walk.linked_to - new.at))
        if not block:
            raise OSError("the file became shorter while it was recovered")
        new.write(block, is_linked=True)
    places = zip(walk.metadata, walk.metadata_at, strict=True)
    later = []
    for note, (at, length) in places:
        if at < walk.linked_to:
            new.notes.append(MetadataIndex(offset=at, length=length, name=note.name))
        else:
            later.append(note)
    for at in found.unlinked:
        if at >= walk.linked_to:
            new.chunk(walk.chunk_at(at))
    for note in later:
        new.note(note)
    for attachment in walk.attachments:
        if attachment.offset < walk.linked_to:
            new.attachments.append(attachment)
        else:
            new.attach(attachment, walk)


def _salvage(new: _NewFile, left: IO[bytes], walk: Walk) -> Contents:
    """Copies the chunks that are whole; the bytes between them are left out."""
    builder: Any = RecordBuilder()
    (walk.header or Header(profile="", library=METADATA)).write(builder)
    new.write(MAGIC + builder.end())
    for note in walk.metadata:
        new.note(note)
    for attachment in walk.attachments:
        new.attach(attachment, walk)
    found = Contents()
    for chunk in Walk(left, walk.size).chunks():
        if found.take(chunk, 0) and isinstance(chunk, WholeChunk):
            new.chunk(chunk)
    return found


class _NewFile:
    """The file that is written."""

    def __init__(self, file: IO[bytes]) -> None:
        self.at = 0
        self.chain: ChainWriter | None = None
        self.notes: list[MetadataIndex] = []
        self.attachments: list[AttachmentIndex] = []
        self._file = file
        self._crc = 0

    def write(self, raw: bytes, *, is_linked: bool = False) -> None:
        """`is_linked`: the chain covers these bytes already."""
        self._file.write(raw)
        self.at += len(raw)
        self._crc = zlib.crc32(raw, self._crc)
        if self.chain is not None and not is_linked:
            self.chain.feed(raw)

    def note(self, note: Metadata) -> None:
        builder: Any = RecordBuilder()
        note.write(builder)
        raw = builder.end()
        self.notes.append(MetadataIndex(offset=self.at, length=len(raw), name=note.name))
        self.write(raw)

    def attach(self, attachment: AttachmentIndex, walk: Walk) -> None:
        """An attachment, unchanged."""
        raw = walk.raw_at(attachment.offset, attachment.length)
        self.attachments.append(replace(attachment, offset=self.at))
        self.write(raw)

    def chunk(self, chunk: WholeChunk) -> None:
        """A chunk, unchanged, and the index of its messages."""
        self.write(chunk.raw)
        builder: Any = RecordBuilder()
        for channel, rows in chunk.index.items():
            MessageIndex(channel_id=channel, records=rows).write(builder)
        self.write(builder.end())

    def finish(self, found: Contents) -> None:
        """Writes what belongs behind the chunks."""
        seal_bytes = 0
        if self.chain is not None:
            self.write(self.chain.link(found.end_ns, Kind.RECOVERED), is_linked=True)
            seal_bytes = RECORD_BYTES
        self._file.flush()
        data_end = len(_data_end(0))
        tail = self._summary(found, self.at + seal_bytes + data_end) + MAGIC
        if self.chain is not None:
            self.write(self.chain.seal(found.end_ns, tail), is_linked=True)
        self.write(_data_end(self._crc), is_linked=True)
        self.write(tail, is_linked=True)

    def _summary(self, found: Contents, start: int) -> bytes:
        builder: Any = RecordBuilder()
        offsets: list[SummaryOffset] = []
        self._file.seek(0)
        chunks = list(read_indexes(self._file))
        self._file.seek(0, os.SEEK_END)
        statistics = Statistics(
            attachment_count=len(self.attachments),
            channel_count=len(found.channels),
            channel_message_counts=dict(found.counts),
            chunk_count=len(chunks),
            message_count=found.messages,
            message_end_time=found.end_ns,
            message_start_time=found.start_ns,
            metadata_count=len(self.notes),
            schema_count=len(found.schemas),
        )
        groups: tuple[tuple[Opcode, list[Any]], ...] = (
            (Opcode.SCHEMA, list(found.schemas.values())),
            (Opcode.CHANNEL, list(found.channels.values())),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, chunks),
            (Opcode.ATTACHMENT_INDEX, self.attachments),
            (Opcode.METADATA_INDEX, self.notes),
        )
        for opcode, records in groups:
            group = builder.count
            for record in records:
                record.write(builder)
            if records:
                length = builder.count - group
                offsets.append(SummaryOffset(group_opcode=opcode, group_start=start + group, group_length=length))
        offsets_at = start + builder.count
        for offset in offsets:
            offset.write(builder)
        summary = builder.end()
        head = bytes((Opcode.FOOTER,)) + (20).to_bytes(8, "little")
        places = start.to_bytes(8, "little") + offsets_at.to_bytes(8, "little")
        crc = zlib.crc32(head + places, zlib.crc32(summary))  # over the summary and the footer up to here
        Footer(summary_start=start, summary_offset_start=offsets_at, summary_crc=crc).write(builder)
        return bytes(summary + builder.end())


def _data_end(crc: int) -> bytes:
    builder: Any = RecordBuilder()
    DataEnd(crc).write(builder)
    return bytes(builder.end())
