"""Writes one MCAP file that survives a crash of its writer.

Chunks are small and handed to the system at every `flush`, so a killed process loses what came since the last one, and
a loss of power what came since the last `sync`. While it is written the file has another name; its own it gets when it
is closed, whole and on the disk. A disk that refuses leaves it cut behind the last whole chunk, never in the middle.
"""

from __future__ import annotations

import contextlib
import errno
import fcntl
import os
import struct
import threading
import time
import zlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import IO, Any, cast

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import ChunkIndex, DataEnd, SummaryOffset
from mcap.writer import CompressionType, Writer

from server.recording.folder import writing_path
from server.recording.mcap.chain import DATA_END_BYTES, LIBRARY_MARK, RECORD_BYTES, ChainWriter, Head
from server.recording.mcap.chunks import MAGIC
from server.recording.own import LIBRARY, METADATA
from server.recording.read.schemas import Schema
from server.storage.durable_file import sync_folder
from server.version import catgraph_version

_HEAD = struct.Struct("<BQ")  # of each record: opcode, length
_CHUNK = struct.Struct("<QQQII")  # start, end [ns], size uncompressed, its CRC, length of the compression's name
_SIZE = struct.Struct("<Q")
_CHANNEL = struct.Struct("<H")
PORTION = 100  # chunks between two chances for other threads to run
REST_S = 0.001
CHUNK_BYTES = 32 * 1024
_CRC = "_Writer__data_section_crc"  # of the library's writer; there is no public name for it


class ChunkIndexes:
    """Takes the place of the list in which the library's writer keeps the index of chunks; reads it from the file,
    `path`, which is being written.

    A recording has five chunks a second and an index entry of some kilobyte each: kept as objects until the end they
    would take some 20 MB for each hour.
    """

    def __init__(self, path: Path) -> None:
        self._path = path
        self._count = 0

    def append(self, index: ChunkIndex) -> None:
        """Count the entry; its content can be read from the file."""
        self._count += 1

    def __len__(self) -> int:
        return self._count

    def __iter__(self) -> Iterator[ChunkIndex]:
        """All that was appended, which must be in the file. Raises OSError, also where the file has fewer."""
        found = 0
        with self._path.open("rb") as file:
            for index in read_indexes(file):
                found += 1
                yield index
                if found == self._count:
                    return
                if found % PORTION == 0:
                    time.sleep(REST_S)
        if found != self._count:
            raise OSError(f"{self._path.name} has {found} chunks instead of {self._count}")


def read_indexes(file: IO[bytes]) -> Iterator[ChunkIndex]:
    """The index of each chunk, in the order of the file."""
    at = len(MAGIC)
    file.seek(at)
    index: ChunkIndex | None = None
    while len(head := file.read(_HEAD.size)) == _HEAD.size:
        opcode, length = _HEAD.unpack(head)
        end = at + _HEAD.size + length
        if opcode == Opcode.MESSAGE_INDEX and index is not None:
            (channel,) = _CHANNEL.unpack(file.read(_CHANNEL.size))
            index.message_index_offsets[channel] = at
            index.message_index_length = end - index.chunk_start_offset - index.chunk_length
        elif index is not None:
            yield index
            index = None
        if opcode == Opcode.CHUNK:
            start_ns, end_ns, size, _, name = _CHUNK.unpack(file.read(_CHUNK.size))
            compression = file.read(name).decode()
            (compressed,) = _SIZE.unpack(file.read(_SIZE.size))
            index = ChunkIndex(
                message_start_time=start_ns,
                message_end_time=end_ns,
                chunk_start_offset=at,
                chunk_length=_HEAD.size + length,
                message_index_offsets={},
                message_index_length=0,
                compression=compression,
                compressed_size=compressed,
                uncompressed_size=size,
            )
        at = end
        file.seek(at)
    if index is not None:
        yield index


class PartFile:
    """One file from its beginning to its end; for one thread. Every method but `add` may raise OSError, and then only
    `close` and `abandon` are of use."""

    def __init__(self, path: Path, *, profile: str, metadata: Mapping[str, str]) -> None:
        """`path`: what it is called when it is closed. Raises FileExistsError where anything has that name."""
        self.path = path
        self._metadata = dict(metadata)
        self._channels: dict[tuple[str | bytes, ...], int] = {}  # topic, encoding, schema → number
        self._schemas: dict[tuple[str, str, bytes], int] = {}
        self._sequence: dict[int, int] = {}
        self._newest_ns = 0
        self.failed: OSError | None = None  # the error of the disk; the next flush raises it
        self._closing = threading.Lock()
        self._is_named = False  # the disk knows that the file is there
        make_folder(path.parent)
        self._writing = writing_path(path)
        if path.exists():
            raise FileExistsError(f"{path.name} is there already")
        self._fd = os.open(self._writing, os.O_WRONLY | os.O_CREAT | os.O_EXCL | os.O_CLOEXEC, 0o644)
        fcntl.flock(self._fd, fcntl.LOCK_EX | fcntl.LOCK_NB)  # no other server takes it for left behind
        self._stream = _Stream(self._fd)
        try:
            self._writer: Any = Writer(  # the library types only a part of itself
                cast("Any", self._stream),
                chunk_size=CHUNK_BYTES,
                compression=CompressionType.ZSTD,
                enable_crcs=True,
                enable_data_crcs=True,
            )
            # There are no public names for these two.
            vars(self._writer)["_Writer__chunk_indices"] = ChunkIndexes(self._writing)
            vars(self._writer)["_Writer__summary_offsets"] = _SummaryOffsets()
            self._writer.start(profile=profile, library=f"{LIBRARY} {catgraph_version()} {LIBRARY_MARK}")
            self._writer.add_metadata(METADATA, self._metadata)
            self._link()
            self._stream.drain()  # what came meanwhile waits: the disk is waited for by `sync`
        except BaseException:
            os.close(self._fd)
            with contextlib.suppress(OSError):
                self._writing.unlink()  # it holds no message
            raise

    @property
    def size(self) -> int:
        """Bytes of it that the system has taken."""
        return self._stream.drained

    def channel(self, topic: str, schema: Schema, metadata: Mapping[str, str] | None = None) -> int:
        """The number of a topic's channel; the same for the same schema."""
        declared = (schema.name, schema.encoding, schema.data)
        key = (topic, schema.message_encoding, *declared)
        number = self._channels.get(key)
        if number is None:
            if declared not in self._schemas:
                self._schemas[declared] = self._writer.register_schema(*declared)
            number = self._channels[key] = self._writer.register_channel(
                topic, schema.message_encoding, self._schemas[declared], dict(metadata or {})
            )
        return number

    def add(self, channel: int, at_ns: int, data: bytes) -> None:
        """One message; `at_ns` is the time of day when it came."""
        self._newest_ns = max(self._newest_ns, at_ns)
        sequence = self._sequence[channel] = self._sequence.get(channel, 0) + 1
        self._writer.add_message(channel, at_ns, data, publish_time=at_ns, sequence=sequence)

    def attach(self, name: str, media_type: str, at_ns: int, data: bytes) -> None:
        """A file that belongs to the moment `at_ns`."""
        self._writer.add_attachment(at_ns, at_ns, name, media_type, data)  # between two chunks, as `note`

    def note(self, **more: str) -> None:
        """Add metadata of the drive that is known only now: a kill does not lose it."""
        self._metadata |= more
        self._writer.add_metadata(METADATA, self._metadata)  # between two chunks: the current one is not written yet

    def flush(self) -> None:
        """Pass all that was added to the system: a kill does not lose it any more."""
        if self.failed is not None:
            raise self.failed
        self._writer.flush()
        self._link()
        self._stream.drain()

    def sync(self) -> None:
        """Waits until the disk has what was flushed: a loss of power does not lose it any more. For any thread."""
        with self._closing:
            if self._fd >= 0:
                os.fdatasync(self._fd)
                if not self._is_named:
                    sync_folder(self.path.parent)
                    self._is_named = True

    def demand_place(self) -> None:
        """Raises OSError where the file has been taken away, or replaced, while it is written."""
        here, there = os.fstat(self._fd), os.stat(self._writing)
        if (here.st_dev, here.st_ino) != (there.st_dev, there.st_ino):
            raise FileNotFoundError(errno.ENOENT, "replaced", str(self._writing))

    def close(self, **ended: str) -> Path:
        """Completes the file, and only when the disk has all of it, gives it its name. Raises OSError: then it is left
        as `abandon` leaves it."""
        try:
            self._writer.flush()
            self._writer.add_metadata(METADATA, self._metadata | ended)
            self._link()
            self._stream.drain()  # `finish` reads the chunks' index from the file
            self._finish()
            self._stream.drain()
            os.fsync(self._fd)
        except BaseException:
            self.abandon()
            raise
        self._shut()
        os.rename(self._writing, self.path)
        sync_folder(self.path.parent)
        return self.path

    def head(self, id: str) -> Head:
        """The newest record of its chain; of a closed file the seal. `id`: what the recording is called."""
        chain = self._stream.chain
        return Head(id=id, number=chain.number, digest=chain.head.hex())

    def _link(self) -> None:
        """Adds a chain record where there are bytes that none covers."""
        if self._stream.chain.has_unlinked:
            raw = self._stream.chain.link(self._newest_ns)
            vars(self._writer)[_CRC] = zlib.crc32(raw, vars(self._writer)[_CRC])
            self._stream.add(raw)

    def _finish(self) -> None:
        """Has the end of the file written, which follows a chain record, and the seal before it."""
        crc = vars(self._writer)[_CRC]
        self._stream.add(bytes(RECORD_BYTES))  # the place of the seal, which is made of what comes behind it
        self._writer.finish()
        end = self._stream.take_back()[RECORD_BYTES:]
        seal = self._stream.chain.seal(self._newest_ns, end[DATA_END_BYTES:])
        builder: Any = RecordBuilder()
        DataEnd(zlib.crc32(seal, crc)).write(builder)
        self._stream.add(seal + builder.end() + end[DATA_END_BYTES:])

    def abandon(self) -> None:
        """Leaves what the disk took, to be recovered when the server starts again."""
        with contextlib.suppress(OSError):
            self._shut()

    def _shut(self) -> None:
        with self._closing:
            fd, self._fd = self._fd, -1
            if fd >= 0:
                os.close(fd)


class _SummaryOffsets(list[SummaryOffset]):
    """Takes the place of the writer's own list: it leaves out empty groups, which readers report as faults."""

    def append(self, offset: SummaryOffset) -> None:
        if offset.group_length:
            super().append(offset)


class _Stream:
    """What the writer of the library writes into: memory, until it is drained into the file at the end of a record."""

    def __init__(self, fd: int) -> None:
        self._fd = fd
        self._waiting: list[bytes] = []
        self._size = 0
        self.drained = 0
        self.chain = ChainWriter()

    def write(self, data: bytes) -> int:
        if data:
            self.chain.feed(data)
            self.add(data)
        return len(data)

    def add(self, data: bytes) -> None:
        """Bytes that are part of the chain already."""
        self._waiting.append(data)
        self._size += len(data)

    def take_back(self) -> bytes:
        """All that waits, which is not written now."""
        data = b"".join(self._waiting)
        self._waiting.clear()
        self._size -= len(data)
        return data

    def tell(self) -> int:
        return self._size

    def flush(self) -> None:
        """Do nothing yet: the library calls it during other work."""

    def drain(self) -> None:
        """Writes all that waits, or none of it."""
        data = memoryview(b"".join(self._waiting))
        at = self.drained
        try:
            while at - self.drained < len(data):
                at += os.pwrite(self._fd, data[at - self.drained :], at)
        except OSError:
            with contextlib.suppress(OSError):
                os.ftruncate(self._fd, self.drained)
            raise
        self._waiting.clear()
        self.drained = at


def make_folder(folder: Path) -> None:
    """Create the folder with its parents, and sync each. Raises OSError."""
    missing = [each for each in (folder, *folder.parents) if not each.exists()]
    for each in reversed(missing):
        each.mkdir(exist_ok=True)
        sync_folder(each.parent)
