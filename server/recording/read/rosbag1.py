"""Reads ROS 1 bags (format 2.0): the index by rosbags, the messages straight out of their chunks."""

from __future__ import annotations

import os
import struct
from bisect import bisect_left
from collections import OrderedDict
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from operator import itemgetter
from pathlib import Path
from typing import Any, BinaryIO, NamedTuple, Protocol, cast

import numpy as np
from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag1 import Reader, ReaderError
from rosbags.rosbag1.reader import Header, RecordType

from server.judge.message import RosVersion
from server.recording.read.clock_steps import PLACES_A_PART, Arrivals, Stretch, corrected_ns
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.source import Channel, Damage
from server.recording.read.unpack import PartTooLarge, unpack

CACHE_BYTES = 64_000_000  # unpacked chunks kept: chunks may overlap in time
MOST_CONNECTIONS = 1000  # records of them that may stand before one message
_CONNECTION = 7  # the op of a record that may stand before a message in its chunk
_OP = b"\x04\x00\x00\x00op="
_OP_BYTES = len(_OP)

_INDEX, _INDEX_1 = b"\x04", b"\x01\x00\x00\x00"  # the op of an index record, and the only version there is
_ENTRY = struct.Struct("<III")  # seconds, nanoseconds, place in the chunk
_length = struct.Struct("<I").unpack_from


Entry = tuple[int, int, int, int]  # of an index: ns, chunk, place in it, connection
Table = np.ndarray[Any, np.dtype[np.int64]]  # of entries, (n, 4), or a column of one


class Packed(NamedTuple):
    """One chunk and its header."""

    datasize: int
    datapos: int
    compression: str
    size: int  # unpacked


class BagIndex(Protocol):
    """What a bag holds and where, once it is open."""

    bio: BinaryIO | None
    indexes: dict[int, list[Entry]]  # by connection, in order
    chunks: dict[int, Packed]  # by place in the file
    records: dict[int, list[tuple[int, bytes]]]  # of each chunk's index: connection, entries; empty: not kept

    @property
    def channels(self) -> Sequence[Channel]: ...

    @property
    def start_time(self) -> int:
        """Of the earliest message [ns]."""
        ...

    @property
    def end_time(self) -> int:
        """After the latest message [ns]."""
        ...

    def open(self) -> None: ...

    def close(self) -> None: ...


class _Reader(Reader):
    """The library's, but for the entries of the index: made one by one they take longer than all else of opening."""

    indexes: dict[int, list[Entry]]  # type: ignore[assignment]  # by connection, in order
    chunks: dict[int, Packed]  # type: ignore[assignment]  # by place in the file

    def __init__(self, path: Path, on_first_chunk: Callable[[int], None]) -> None:
        super().__init__(path)
        self._on_first_chunk: Callable[[int], None] | None = on_first_chunk
        self._indexed: set[tuple[int, int]] = set()  # chunk and connection
        self.records: dict[int, list[tuple[int, bytes]]] = {}

    @property
    def channels(self) -> Sequence[Channel]:
        return [_channel(connection) for connection in self.connections]

    def read_chunk(self) -> Packed:  # type: ignore[override]
        """The header of the chunk at the current place, with its size: the library's own keeps none."""
        file = cast("BinaryIO", self.bio)
        header = Header.read(file, RecordType.CHUNK)
        compression, size = header.get_string("compression"), header.get_uint32("size")
        packed = _length(file.read(4))[0]
        place = file.tell()
        file.seek(packed, os.SEEK_CUR)
        if compression not in ("none", "bz2", "lz4"):
            raise ReaderError(f"Compression {compression[:20]!r} is not supported.")
        return Packed(packed, place, compression, size)

    def read_index_data(self, pos: int, indexes: dict[int, list[Any]]) -> None:
        """One record of a connection's messages in the chunk at `pos`. Raises ReaderError where it is none."""
        file = cast("BinaryIO", self.bio)
        if self._on_first_chunk is not None:
            notify, self._on_first_chunk, place = self._on_first_chunk, None, file.tell()
            notify(pos)
            file.seek(place)
        header = fields_of(file.read(_length(file.read(4))[0]))
        entries = file.read(_length(file.read(4))[0])
        count = _length(header[b"count"])[0]
        if header[b"op"] != _INDEX or header[b"ver"] != _INDEX_1 or len(entries) != count * _ENTRY.size:
            raise ReaderError("An index record is damaged.")
        number = _length(header[b"conn"])[0]
        if (pos, number) in self._indexed:  # a small bag could hold any number of messages
            raise ReaderError("The index names a part twice.")
        self._indexed.add((pos, number))
        self.records.setdefault(pos, []).append((number, entries))
        indexes[number] += [
            (seconds * 10**9 + nanoseconds, pos, place, number)
            for seconds, nanoseconds, place in _ENTRY.iter_unpack(entries)
        ]


def fields_of(header: bytes) -> dict[bytes, bytes]:
    """Of a record's header: each "name=value" after its length. Raises ValueError or struct.error where it is none."""
    found: dict[bytes, bytes] = {}
    at = 0
    while at < len(header):
        end = at + 4 + _length(header, at)[0]
        if end > len(header):
            raise ValueError("A field is longer than its header.")
        name, _, value = header[at + 4 : end].partition(b"=")
        found.setdefault(name, value)
        at = end
    return found


class Bag1:
    """A ROS 1 bag with its index in memory. Raises RecordingUnreadable on opening and while reading."""

    ros_version: RosVersion = 1
    distro: str | None = None
    is_cut = False
    is_listed = False

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damage = Damage(is_cut=self.is_cut)  # else none that is left out: the format has no checksums
        self.stretches: Sequence[Stretch] = ()
        self._chunks: OrderedDict[int, bytes] = OrderedDict()
        self._chunk_bytes = 0
        self._ahead = ThreadPoolExecutor(1, "bag")
        self._coming: dict[int, Future[bytes]] = {}  # at most one
        self._reader = self._reader_of(path)
        try:
            self._reader.open()
        except BaseException:
            self._ahead.shutdown(cancel_futures=True)
            raise
        self.channels: Sequence[Channel] = self._reader.channels
        self.start_ns = self._reader.start_time
        self.end_ns = self._reader.end_time - 1

    def messages(
        self, numbers: set[int], start_ns: int, damage: Damage | None = None
    ) -> Iterator[tuple[int, int, bytes]]:
        self._reader.records.clear()  # needed on opening only
        entries: list[Entry] = []
        for number in numbers:
            entries += _since(start_ns, self._reader.indexes.get(number, ()))
        entries.sort()  # by time, then by place in the file
        wanted = dict.fromkeys(map(itemgetter(1), entries))
        self._coming = {at: future for at, future in self._coming.items() if at in wanted}
        order = iter(wanted)
        position, chunk = -1, b""
        for time_ns, at, offset, number in entries:
            if at != position:
                position, chunk = at, self._chunk(at)
                following = None if self._coming else next((one for one in order if one not in self._chunks), None)
                if following is not None:
                    self._begin_unpacking(following)
            try:
                raw = _message(chunk, offset)
            except (struct.error, IndexError):
                raise RecordingUnreadable(f"{self.path.name} is damaged: a message is outside its chunk") from None
            yield time_ns, number, raw

    def arrivals(self) -> Iterator[Arrivals]:
        if records := self._reader.records:
            for number, at in enumerate(sorted(self._reader.chunks)):
                if at in records:
                    yield _arrivals(number, records[at])
            return
        entries = [_table(index) for index in self._reader.indexes.values() if index]
        if entries:
            table = np.concatenate(entries)
            places = self._places(table)
            order = np.argsort(places, kind="stable")
            yield Arrivals(places=places[order], times_ns=table[order, 0], channels=table[order, 3])

    def raw_at(self, place: int, channel: int) -> bytes | None:
        part, offset = divmod(place, PLACES_A_PART)
        try:
            return _message(self._chunk(sorted(self._reader.chunks)[part]), offset)
        except (struct.error, IndexError, RecordingUnreadable):  # reading it reports the reason
            return None

    def correct(self, stretches: Sequence[Stretch]) -> None:
        self.stretches = stretches
        for number, index in self._reader.indexes.items():
            if index:
                table = _table(index)
                times_ns = corrected_ns(stretches, self._places(table), table[:, 0]).tolist()
                self._reader.indexes[number] = sorted(
                    (time_ns, *entry[1:]) for time_ns, entry in zip(times_ns, index, strict=True)
                )
        filled = [index for index in self._reader.indexes.values() if index]
        self.start_ns = min(index[0][0] for index in filled)
        self.end_ns = max(index[-1][0] for index in filled)

    def _places(self, table: Table) -> Table:
        """Of the entries of an index: the chunk's number in the file, and the place in it."""
        chunks = np.array(sorted(self._reader.chunks), np.int64)
        return np.searchsorted(chunks, table[:, 1]) * PLACES_A_PART + table[:, 2]

    def close(self) -> None:
        self._ahead.shutdown(cancel_futures=True)
        self._coming.clear()
        self._chunks.clear()
        self._reader.close()

    def _reader_of(self, path: Path) -> BagIndex:
        return _Reader(path, self._begin_unpacking)  # a bag is usually read from its start after opening

    def _begin_unpacking(self, position: int) -> None:
        """A chunk is unpacked beside the reader: that takes as long as judging what is in it."""
        header, file = self._reader.chunks[position], cast("BinaryIO", self._reader.bio)
        try:
            file.seek(header.datapos)
            packed = file.read(
                min(header.datasize, os.fstat(file.fileno()).st_size)
            )  # not the declared size, which would reserve memory
        except (OSError, MemoryError) as error:
            failed: Future[bytes] = Future()
            failed.set_exception(error)
            self._coming[position] = failed
        else:
            self._coming[position] = self._ahead.submit(unpacked, header, packed)

    def _chunk(self, position: int) -> bytes:
        cached = self._chunks.get(position)
        if cached is not None:
            self._chunks.move_to_end(position)
            return cached
        if position not in self._coming:
            self._begin_unpacking(position)
        future = self._coming.pop(position)
        try:
            chunk = future.result()
        except PartTooLarge as why:
            raise RecordingUnreadable(f"{self.path.name} cannot be read: of a part of it, {why}") from None
        except (OSError, EOFError, ValueError, RuntimeError, MemoryError):  # exceptions of bz2, lz4 and the disk
            raise RecordingUnreadable(f"{self.path.name} is damaged: a part of it cannot be unpacked") from None
        self._chunks[position] = chunk
        self._chunk_bytes += len(chunk)
        while self._chunk_bytes > CACHE_BYTES and len(self._chunks) > 1:
            _, old = self._chunks.popitem(last=False)
            self._chunk_bytes -= len(old)
        return chunk


def _arrivals(number: int, records: Sequence[tuple[int, bytes]]) -> Arrivals:
    """The messages of a chunk by the records of its index."""
    table = np.frombuffer(b"".join(entries for _, entries in records), "<u4").reshape(-1, 3).astype(np.int64)
    counts = [len(entries) // _ENTRY.size for _, entries in records]
    connections = np.repeat(np.array([one for one, _ in records], np.int64), counts)
    order = np.argsort(table[:, 2], kind="stable")
    times_ns = table[order, 0] * 10**9 + table[order, 1]
    return Arrivals(table[order, 2] + number * PLACES_A_PART, times_ns, connections[order])


def _table(index: Sequence[Entry]) -> Table:
    return np.array(index, np.int64).reshape(-1, 4)


def _since(start_ns: int, index: Sequence[Entry]) -> Sequence[Entry]:
    """The entries of one connection from a moment on."""
    first = bisect_left(index, start_ns, key=itemgetter(0))
    return index[first:] if first else index


def unpacked(header: Packed, packed: bytes) -> bytes:
    if len(packed) < header.datasize:
        raise EOFError
    return unpack(header.compression, packed, header.size if header.compression != "none" else len(packed))


def _message(chunk: bytes, offset: int) -> bytes:
    """The data of the message record at `offset`. Raises struct.error or IndexError where there is none."""
    for _ in range(MOST_CONNECTIONS):
        head = offset + 4
        data = head + _length(chunk, offset)[0]
        begin = data + 4
        end = begin + _length(chunk, data)[0]
        if end > len(chunk):
            raise IndexError
        op = chunk.find(_OP, head, data)
        if op >= 0 and chunk[op + _OP_BYTES] == _CONNECTION:
            offset = end
            continue
        return chunk[begin:end]
    raise IndexError


def _channel(connection: Any) -> Channel:
    is_text = connection.msgdef.format == MessageDefinitionFormat.MSG
    return Channel(
        number=connection.id,
        topic=connection.topic,
        type=connection.msgtype,
        definition=connection.msgdef.data,
        format="msg" if is_text else "none",
        encoding="ros1",
        count=connection.msgcount,
        is_latched=bool(connection.ext.latching),
    )
