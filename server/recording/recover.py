"""Recovers recordings after a kill of the server or a full disk.

The chunks that are whole are copied as they are, their index is made anew, and the new file gets its name only when the
disk has it; only then what was left goes. Nothing that might still be of use is removed: what could not be read is kept
aside under another name, and said.
"""

from __future__ import annotations

import contextlib
import fcntl
import os
import zlib
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Channel,
    ChunkIndex,
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

from server.recording import space
from server.recording.folder import DAMAGED, FINISHED, RECOVERING, RecordingsFolder, id_of
from server.recording.mcap.chunks import MAGIC, BadChunk, Walk, WholeChunk
from server.recording.own import METADATA
from server.storage.durable_file import sync_folder

_TORN = 1024 * 1024  # bytes at the end that a kill may have left half-written; more of them are kept aside


@dataclass(frozen=True, slots=True, kw_only=True)
class Recovered:
    """What became of one file that was left."""

    id: str
    sentence: str
    path: Path | None = None  # the finished recording, where there is one now
    aside: Path | None = None  # where the rest is kept
    messages: int = 0
    is_settled: bool = True  # False: it is still as it was, and may be tried again


def recover_all(folder: RecordingsFolder) -> Iterator[Recovered]:
    """Recovers whatever a server left; nothing may be writing into the folder meanwhile."""
    for path in folder.unfinished():
        with contextlib.suppress(OSError):
            path.with_name(id_of(path) + RECOVERING).unlink()
        yield recover(path)


def recover(left: Path) -> Recovered:
    """Recovers one file that is not being written any more. Raises nothing."""
    try:
        return _recover(left)
    except FileNotFoundError:
        return Recovered(id=id_of(left), sentence=f"{left.name} is gone.")
    except OSError as error:
        with contextlib.suppress(OSError):
            left.with_name(id_of(left) + RECOVERING).unlink()
        return Recovered(
            id=id_of(left),
            sentence=f"{id_of(left)} cannot be recovered now: {space.why(error)}. It is kept as it is.",
            is_settled=False,
        )


def _recover(left: Path) -> Recovered:
    id = id_of(left)
    finished = left.with_name(id + FINISHED)
    if finished.exists():  # it was recovered before, and the server was killed before the original was removed
        if _is_whole(finished):
            left.unlink()
            sync_folder(left.parent)
            return Recovered(id=id, path=finished, sentence=f"{id} had already been recovered.")
        return _aside(left, f"{id} exists beside a finished recording of the same name; both are kept")
    with left.open("rb") as file:
        try:
            fcntl.flock(file.fileno(), fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            return Recovered(id=id, sentence=f"{id} is being written by another server.", is_settled=False)
        walk = Walk(file, os.fstat(file.fileno()).st_size)
        new = _Copy(left.with_name(id + RECOVERING))
        try:
            for chunk in walk.chunks():
                new.add(chunk, walk)
            unread = walk.size - walk.at
            if walk.is_whole and not new.bad:
                new.discard()
                os.rename(left, finished)
                sync_folder(left.parent)
                return Recovered(id=id, path=finished, messages=new.messages, sentence=f"{id} was whole.")
            if not new.messages:
                new.discard()
                if (walk.header is not None or not walk.size) and not unread and not new.bad:
                    left.unlink()
                    sync_folder(left.parent)
                    return Recovered(id=id, sentence=f"{id} had only started and is empty.")
                return _aside(left, f"Nothing of {id} can be read")
            sentence = _words(id, new, unread)
            new.finish(walk, ended="recovered", why=sentence)
        except BaseException:
            new.discard()
            raise
    os.rename(new.path, finished)
    sync_folder(left.parent)
    aside = None
    if new.bad or unread > _TORN:
        aside = left.with_name(id + DAMAGED)
        os.rename(left, aside)
        sentence = f"{sentence} The damaged file is kept as {aside.name}."
    else:
        left.unlink()
    sync_folder(left.parent)
    return Recovered(id=id, path=finished, aside=aside, messages=new.messages, sentence=sentence)


def _aside(left: Path, what: str) -> Recovered:
    aside = left.with_name(id_of(left) + DAMAGED)
    n = 2
    while aside.exists():
        aside = left.with_name(f"{id_of(left)}-{n}{DAMAGED}")
        n += 1
    os.rename(left, aside)
    sync_folder(left.parent)
    return Recovered(id=id_of(left), aside=aside, sentence=f"{what}; it is kept as {aside.name}.")


def _is_whole(path: Path) -> bool:
    with path.open("rb") as file:
        size = file.seek(0, os.SEEK_END)
        file.seek(max(0, size - len(MAGIC)))
        return size > 2 * len(MAGIC) and file.read() == MAGIC


def _words(id: str, new: _Copy, unread: int) -> str:
    span_s = (new.end_ns - new.start_ns) / 1e9
    bad = ""
    if new.bad:
        which = "1 part is" if new.bad == 1 else f"{new.bad} parts are"
        bad = f" {which} damaged and left out."
    return f"{id} is truncated: {span_s:.1f} s with {new.messages} messages are whole.{bad} " + (
        f"The last {space.amount(unread)} were only partly written." if unread else "Nothing was partly written."
    )


@dataclass(slots=True)
class _Copy:
    """The new file: chunks as they were, and an index of them."""

    path: Path
    messages: int = 0
    bad: int = 0  # chunks left out
    start_ns: int = 0
    end_ns: int = 0
    _file: IO[bytes] | None = None
    _at: int = 0
    _crc: int = 0
    _schemas: dict[int, Schema] = field(default_factory=dict)
    _channels: dict[int, Channel] = field(default_factory=dict)
    _counts: Counter[int] = field(default_factory=Counter)
    _chunks: list[ChunkIndex] = field(default_factory=list)
    _notes: list[MetadataIndex] = field(default_factory=list)

    def add(self, chunk: WholeChunk | BadChunk, walk: Walk) -> None:
        if isinstance(chunk, BadChunk):
            self.bad += 1
            return
        if self._file is None:
            self._begin(walk)
        self._schemas.update((schema.id, schema) for schema in chunk.schemas)
        self._channels.update((channel.id, channel) for channel in chunk.channels)
        if not self._channels.keys() >= chunk.index.keys():  # the definitions of its messages were in a damaged chunk
            self.bad += 1
            return
        if not chunk.index:
            return
        start_ns, end_ns = chunk.record.message_start_time, chunk.record.message_end_time
        self.start_ns = min(self.start_ns, start_ns) if self._chunks else start_ns
        self.end_ns = max(self.end_ns, end_ns)
        self.messages += chunk.messages
        at = self._at
        self._write(chunk.raw)
        index_at = self._at
        builder: Any = RecordBuilder()
        offsets: dict[int, int] = {}
        for channel, rows in chunk.index.items():
            offsets[channel] = index_at + builder.count
            MessageIndex(channel_id=channel, records=rows).write(builder)
            self._counts[channel] += len(rows)
        self._write(builder.end())
        self._chunks.append(
            ChunkIndex(
                message_start_time=start_ns,
                message_end_time=end_ns,
                chunk_start_offset=at,
                chunk_length=len(chunk.raw),
                message_index_offsets=offsets,
                message_index_length=self._at - index_at,
                compression=chunk.record.compression,
                compressed_size=len(chunk.record.data),
                uncompressed_size=chunk.record.uncompressed_size,
            )
        )

    def finish(self, walk: Walk, **ended: str) -> None:
        """Writes what belongs behind the chunks, and waits until the disk has it."""
        assert self._file is not None
        said = next((note.metadata for note in reversed(walk.metadata) if note.name == METADATA), {})
        self._note(Metadata(name=METADATA, metadata=dict(said) | ended))
        builder: Any = RecordBuilder()
        DataEnd(self._crc).write(builder)
        self._write(builder.end())
        self._write(self._summary(self._at))
        self._write(MAGIC)
        self._file.flush()
        os.fsync(self._file.fileno())
        self._file.close()

    def discard(self) -> None:
        if self._file is not None:
            self._file.close()
            with contextlib.suppress(FileNotFoundError):
                self.path.unlink()

    def _begin(self, walk: Walk) -> None:
        self._file = self.path.open("wb")
        builder: Any = RecordBuilder()
        (walk.header or Header(profile="", library=METADATA)).write(builder)
        self._write(MAGIC + builder.end())
        for note in walk.metadata:
            self._note(note)

    def _note(self, note: Metadata) -> None:
        builder: Any = RecordBuilder()
        note.write(builder)
        raw = builder.end()
        self._notes.append(MetadataIndex(offset=self._at, length=len(raw), name=note.name))
        self._write(raw)

    def _write(self, raw: bytes) -> None:
        assert self._file is not None
        self._file.write(raw)
        self._at += len(raw)
        self._crc = zlib.crc32(raw, self._crc)

    def _summary(self, start: int) -> bytes:
        builder: Any = RecordBuilder()
        offsets: list[SummaryOffset] = []
        statistics = Statistics(
            attachment_count=0,
            channel_count=len(self._channels),
            channel_message_counts=dict(self._counts),
            chunk_count=len(self._chunks),
            message_count=self.messages,
            message_end_time=self.end_ns,
            message_start_time=self.start_ns,
            metadata_count=len(self._notes),
            schema_count=len(self._schemas),
        )
        groups: tuple[tuple[Opcode, list[Any]], ...] = (
            (Opcode.SCHEMA, list(self._schemas.values())),
            (Opcode.CHANNEL, list(self._channels.values())),
            (Opcode.STATISTICS, [statistics]),
            (Opcode.CHUNK_INDEX, list(self._chunks)),
            (Opcode.METADATA_INDEX, list(self._notes)),
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
