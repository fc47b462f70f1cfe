"""Makes the index of an MCAP file from its records, for files whose own index is missing, incomplete or cut off.

The times of the file's parts are in the order in which the messages were written, and corrected.
"""

from __future__ import annotations

import os
import struct
from bisect import bisect_left, bisect_right
from collections import Counter
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field, replace
from io import BytesIO
from typing import IO, Any

import numpy as np
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import AttachmentIndex, Channel, Header, Metadata, Schema

from server.recording.mcap.chunk_rows import read_chunk
from server.recording.mcap.chunks import HEAD_BYTES, MAGIC
from server.recording.read.clock_steps import PLACES_A_PART, Arrivals, Stretch
from server.recording.read.unpack import verified

RUN_BYTES = 1 << 20  # messages outside of chunks are read in runs of about this size
MOST_TEXT = 16 << 20  # bytes of a record that declares something
LATEST_NS = np.uint64(2**62)
_HEAD = struct.Struct("<BQ")  # opcode, length
_MESSAGE = struct.Struct("<HIQ")  # channel, sequence, log time [ns]
_MESSAGE_BYTES = 22  # before the data of a message
_ATTACHMENT_HEAD = 4096  # bytes in which name and media type of an attachment are
_TIMES = struct.Struct("<QQ")  # of a chunk: first and last message [ns]

_INDEX_HEAD = struct.Struct("<BQHI")  # of a message index: opcode, length, channel, bytes of its entries


@dataclass(slots=True, kw_only=True)
class Part:
    """A chunk, or a run of messages outside of chunks: what is read at once."""

    message_start_time: int  # ns
    message_end_time: int
    at: int  # place of its first record
    run_bytes: int = 0  # length of a run; 0: it is a chunk
    channels: frozenset[int] = frozenset()  # with messages in it; empty: unknown
    index_at: int = 0  # where its message indexes are
    index_bytes: int = 0
    arrivals: Arrivals | None = None  # as the scan found them, with places from its beginning on
    shift_ns: int = 0  # added to the times of its messages
    from_place: int = 0  # of a chunk of which only some messages belong to this part
    to_place: int = PLACES_A_PART


@dataclass(slots=True, kw_only=True)
class Index:
    """What a file holds and where."""

    profile: str = ""
    schemas: dict[int, Schema] = field(default_factory=dict)
    channels: dict[int, Channel] = field(default_factory=dict)
    counts: Counter[int] = field(default_factory=Counter)  # of messages by channel
    parts: list[Part] = field(default_factory=list)
    metadata: list[Metadata] = field(default_factory=list)
    attachments: list[AttachmentIndex] = field(default_factory=list)
    is_ended: bool = False  # its writer ended the data
    pieces: int = 0  # records that cannot be read
    behind_bytes: int = 0  # that follow the file's end, as where two files were joined
    rest_bytes: int = 0  # from the first record that is none, where the file's end was not reached
    why: Exception | None = None  # why the first of the chunks that cannot be read cannot

    @property
    def span_ns(self) -> tuple[int, int]:
        """First and last message of the whole parts; where none is whole as they are declared, (0, 0) where there is
        none."""
        parts = [part for part in self.parts if part.channels] or self.parts  # those of damaged ones can be anything
        if not parts:
            return 0, 0
        return min(part.message_start_time for part in parts), max(part.message_end_time for part in parts)

    def take(self, opcode: int, body: bytes) -> None:
        """Notes what a record declares. Of the same id the first counts; damage raises any exception."""
        stream: Any = ReadDataStream(BytesIO(body))
        if opcode == Opcode.SCHEMA:
            schema = Schema.read(stream)
            self.schemas.setdefault(schema.id, schema)
        elif opcode == Opcode.CHANNEL:
            channel = Channel.read(stream)
            self.channels.setdefault(channel.id, channel)
        elif opcode == Opcode.METADATA:
            self.metadata.append(Metadata.read(stream))
        elif opcode == Opcode.HEADER:
            self.profile = Header.read(stream).profile


_DECLARING = (Opcode.HEADER, Opcode.SCHEMA, Opcode.CHANNEL, Opcode.METADATA)


def scan(file: IO[bytes], *, with_messages: bool = True) -> Index:
    """The index of a file by its records, to where it ends or no record can be read.

    Without messages, chunks are not unpacked: only what is declared outside of them is found. Raises OSError,
    PartTooLarge and MemoryError.
    """
    index = Index()
    size = file.seek(0, os.SEEK_END)
    at = len(MAGIC)
    run: _Run | None = None
    while True:
        file.seek(at)
        head = file.read(HEAD_BYTES)
        if len(head) < HEAD_BYTES:
            index.rest_bytes = len(head)
            break
        opcode, length = _HEAD.unpack(head)
        end = at + HEAD_BYTES + length
        if opcode == 0 and run is not None:
            run.drop_torn(file, at, index.counts)
        if opcode == 0 or end > size:  # no record, or torn
            index.rest_bytes = size - at
            break
        is_message = opcode == Opcode.MESSAGE and length >= _MESSAGE_BYTES
        if run is not None and not is_message:
            index.parts.append(run.part(at))
            run = None
        if is_message:
            if with_messages:
                if run is None or at - run.at >= RUN_BYTES:
                    index.parts += [run.part(at)] if run is not None else []
                    run = _Run(at)
                channel, _, time_ns = _MESSAGE.unpack(file.read(_MESSAGE.size))
                run.add(channel, time_ns, at)
                index.counts[channel] += 1
        elif opcode == Opcode.CHUNK:
            if with_messages:
                _chunk(index, file, at, length)
        elif opcode == Opcode.ATTACHMENT:
            _attachment(index, at, HEAD_BYTES + length, file.read(min(length, _ATTACHMENT_HEAD)))
        elif opcode == Opcode.DATA_END:
            index.is_ended = True
        elif opcode == Opcode.FOOTER:
            index.behind_bytes = max(0, size - end - len(MAGIC))
            break
        else:
            body = file.read(length) if length <= MOST_TEXT else b""
            if opcode in _DECLARING:
                _declared(index, opcode, body)
            index.pieces += opcode == Opcode.MESSAGE or MAGIC in body  # in a torn one another file begins
        at = end
    index.parts += [run.part(at)] if run is not None and run.count else []
    return index


class _Run:
    """Messages outside of chunks, one behind the other."""

    def __init__(self, at: int) -> None:
        self.at = at
        self.count = 0
        self._torn_at: int | None = None
        self._first_ns, self._last_ns = 2**64, 0
        self._channels: set[int] = set()
        self._newest = (0, 0)  # place and channel of the last message
        self._rows: list[tuple[int, int, int]] = []  # place, time [ns], channel

    def add(self, channel: int, time_ns: int, at: int) -> None:
        self.count += 1
        self._first_ns, self._last_ns = min(self._first_ns, time_ns), max(self._last_ns, time_ns)
        self._channels.add(channel)
        self._newest = at, channel
        self._rows.append((at - self.at, time_ns, channel))

    def drop_torn(self, file: IO[bytes], end: int, counts: Counter[int]) -> None:
        """Leave out the last message where it ends in zeros and zeros follow, as behind a power loss: its rest may
        never have reached the disk, and there is no checksum."""
        file.seek(end - 1)
        if self.count and file.read(1) == b"\0":
            self._torn_at, channel = self._newest
            self.count -= 1
            counts[channel] -= 1

    def part(self, end: int) -> Part:
        """The run, which ends at a place in the file."""
        return Part(
            message_start_time=self._first_ns,
            message_end_time=self._last_ns,
            at=self.at,
            run_bytes=(self._torn_at or end) - self.at,
            channels=frozenset(self._channels),
            arrivals=as_arrivals(self._rows[: self.count]),
        )


def _declared(index: Index, opcode: int, body: bytes) -> None:
    try:
        index.take(opcode, body)
    except MemoryError:
        raise
    except Exception:  # damage makes the library's readers fail in every way there is
        index.pieces += 1


def _attachment(index: Index, at: int, length: int, head: bytes) -> None:
    """Notes where an attachment is, by the fields before its data."""
    try:
        stream: Any = ReadDataStream(BytesIO(head))
        found = AttachmentIndex(
            offset=at,
            length=length,
            log_time=stream.read8(),
            create_time=stream.read8(),
            name=stream.read_prefixed_string(),
            media_type=stream.read_prefixed_string(),
            data_size=stream.read8(),
        )
    except MemoryError:
        raise
    except Exception:  # as above
        index.pieces += 1
        return
    index.attachments.append(found)


def _chunk(index: Index, file: IO[bytes], at: int, length: int) -> None:
    """Notes one chunk; what cannot be unpacked is found out again, and named, when it is read."""
    head = file.read(_TIMES.size)
    if len(head) < _TIMES.size or length < _TIMES.size:
        index.pieces += 1
        return
    first_ns, last_ns = _TIMES.unpack(head)
    try:
        data = verified(read_chunk(file, at))
        rows: list[tuple[int, int, int]] = []
        counts: Counter[int] = Counter()
        for opcode, place, size in _records(data):
            if opcode == Opcode.MESSAGE:
                channel, _, time_ns = _MESSAGE.unpack_from(data, place)
                counts[channel] += 1
                rows.append((place - HEAD_BYTES, time_ns, channel))
            elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
                _declared(index, opcode, data[place : place + size])
    except MemoryError:
        raise
    except Exception as why:  # as above; its times are those that it declares
        index.why = index.why or why
        index.parts.append(Part(message_start_time=first_ns, message_end_time=last_ns, at=at))
        return
    if rows:
        times_ns = [time_ns for _, time_ns, _ in rows]
        index.counts.update(counts)
        part = Part(
            message_start_time=min(times_ns),
            message_end_time=max(times_ns),
            at=at,
            channels=frozenset(counts),
            arrivals=as_arrivals(rows),
        )
        index.parts.append(part)


def as_arrivals(rows: list[tuple[int, int, int]]) -> Arrivals:
    """Messages by place, time [ns] and channel, in their order; times that no clock shows become the latest."""
    table = np.minimum(np.array(rows, np.uint64).reshape(-1, 3), LATEST_NS).astype(np.int64)
    return Arrivals(places=table[:, 0], times_ns=table[:, 1], channels=table[:, 2])


def _records(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Opcode, place and length of the content of each record. Raises ValueError where they do not fill the chunk."""
    place, size = 0, len(data)
    while place < size:
        opcode, length = data[place], int.from_bytes(data[place + 1 : place + HEAD_BYTES], "little")
        place += HEAD_BYTES
        if opcode == 0 or place + length > size or (opcode == Opcode.MESSAGE and length < _MESSAGE_BYTES):
            raise ValueError("its records do not fill it")
        yield opcode, place, length
        place += length


def by_name(metadata: list[Metadata], name: str) -> Mapping[str, str]:
    """The last metadata record of a name; empty: there is none."""
    return next((dict(record.metadata) for record in reversed(metadata) if record.name == name), {})


def arrivals_of(file: IO[bytes], parts: Sequence[Part]) -> Iterator[Arrivals]:
    """The messages of each part, in the order of the file. Raises OSError."""
    for number, part in enumerate(sorted(parts, key=lambda part: part.at)):
        found = part.arrivals or _indexed(file, part)
        if found is not None:
            yield Arrivals(found.places + number * PLACES_A_PART, found.times_ns, found.channels)


def _indexed(file: IO[bytes], part: Part) -> Arrivals | None:
    """The messages of a chunk by its message indexes; None where these are damaged."""
    file.seek(part.index_at)
    data = file.read(part.index_bytes)
    entries, channels, counts = [], [], []
    at = 0
    while at + _INDEX_HEAD.size <= len(data):
        opcode, length, channel, size = _INDEX_HEAD.unpack_from(data, at)
        if opcode != Opcode.MESSAGE_INDEX or size + 6 != length or size % 16:
            return None
        entries.append(data[at + _INDEX_HEAD.size : at + _INDEX_HEAD.size + size])
        channels.append(channel)
        counts.append(size // 16)
        at += 9 + length
    joined = b"".join(entries)
    if not joined or at != len(data) or len(joined) != 16 * sum(counts):
        return None
    table = np.minimum(np.frombuffer(joined, "<u8"), LATEST_NS).astype(np.int64).reshape(-1, 2)
    order = np.argsort(table[:, 1], kind="stable")
    numbers = np.repeat(np.array(channels, np.int64), counts)
    return Arrivals(places=table[order, 1], times_ns=table[order, 0], channels=numbers[order])


def corrected_parts(parts: Sequence[Part], stretches: Sequence[Stretch]) -> list[Part]:
    """The parts with the corrections of their times; one in which the clock was set becomes several."""
    starts = [one.place for one in stretches]
    found = []
    for number, part in enumerate(sorted(parts, key=lambda part: part.at)):
        origin = number * PLACES_A_PART
        first = max(bisect_right(starts, origin) - 1, 0)
        behind = max(bisect_left(starts, origin + PLACES_A_PART), first + 1)
        for place, one in enumerate(stretches[first:behind], first):
            is_inner = behind - first > 1
            first_ns, last_ns = part.message_start_time, part.message_end_time
            if is_inner:
                first_ns, last_ns = max(first_ns, one.first_ns), min(last_ns, one.last_ns)
            found.append(
                replace(
                    part,
                    message_start_time=first_ns + one.shift_ns,
                    message_end_time=last_ns + one.shift_ns,
                    shift_ns=one.shift_ns,
                    from_place=max(one.place - origin, 0) if place > first else 0,
                    to_place=stretches[place + 1].place - origin if place + 1 < behind else PLACES_A_PART,
                )
            )
    return found
