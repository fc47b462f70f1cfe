"""Reads ROS 2 bags through rosbags: a directory with its metadata, or one bare .mcap or .db3 file."""

from __future__ import annotations

from collections.abc import Collection, Generator, Iterator, Mapping, Sequence
from pathlib import Path, PosixPath
from typing import Any, BinaryIO, Literal, cast
from urllib.parse import quote

from rosbags.interfaces import Connection, MessageDefinitionFormat, QosDurability
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader
from rosbags.rosbag2.storage_sqlite3 import Sqlite3Reader

from server.judge.message import RosVersion
from server.recording.mcap.chunk_rows import ChunkRow, chunk_rows, in_order
from server.recording.read import rosbags_bounds
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.source import Channel, Damage, DefinitionFormat

_FORMATS: dict[Any, DefinitionFormat] = {
    MessageDefinitionFormat.NONE: "none",
    MessageDefinitionFormat.MSG: "msg",
    MessageDefinitionFormat.IDL: "idl",
}


rosbags_bounds.install()


class _UriPath(PosixPath):
    """A path that reads as part of a URI when it is written as text: so rosbags hands it to SQLite, unquoted, and a
    folder called "drive #3" could not be opened."""

    def __str__(self) -> str:
        return quote(super().__str__())

    def __fspath__(self) -> str:
        return super().__str__()


class _WholeParts(McapReader):
    """Reads the whole chunks of an MCAP file and leaves out the damaged ones; that of rosbags ends at the first."""

    def __init__(self, path: Any) -> None:
        super().__init__(path)
        self.damage = Damage()

    def messages(
        self, connections: Collection[Connection], start: int | None = None, stop: int | None = None
    ) -> Generator[tuple[Connection, int, bytes], None, None]:
        self.damage = Damage()
        if not self.chunks:  # nothing but messages, without an index
            yield from super().messages(connections, start, stop)
            return
        wanted = {connection.id: connection for connection in connections}
        from_ns, to_ns = start or 0, _LAST_NS if stop is None else stop
        parts = [
            part
            for part in self.chunks
            if part.message_end_time >= from_ns
            and part.message_start_time < to_ns
            and any(part.channel_count.get(number) for number in wanted)
        ]
        self.damage.parts = len(parts)
        for time_ns, number, raw in in_order(parts, lambda part: self._whole(part, wanted, from_ns, to_ns)):
            yield wanted[number], time_ns, raw

    def _whole(self, part: Any, wanted: dict[int, Connection], from_ns: int, to_ns: int) -> list[ChunkRow]:
        try:
            return chunk_rows(cast("BinaryIO", self.bio), part.chunk_start_offset, wanted, from_ns, to_ns)
        except MemoryError:
            raise
        except Exception as why:  # damage makes the readers fail in every way there is
            self.damage.leave_out(part.message_start_time, part.message_end_time, why)
            return []


class _Directory(DirectoryReader):
    STORAGE_PLUGINS: Mapping[str, Any] = {"mcap": _WholeParts, "sqlite3": Sqlite3Reader}


_READERS: dict[str, Any] = {"directory": _Directory, "mcap": _WholeParts, "db3": Sqlite3Reader}
_LAST_NS = 2**63 - 1


class Bag2:
    """A ROS 2 bag."""

    ros_version: RosVersion = 2

    def __init__(self, path: Path, kind: Literal["directory", "mcap", "db3"]) -> None:
        self.path = path
        if kind == "db3":
            _assert_whole(path)
        elif kind == "directory":
            rosbags_bounds.demand_plain(path / "metadata.yaml")
        self._reader = _READERS[kind](_UriPath(path))
        self._reader.open()
        self._connections = dict(enumerate(self._reader.connections))
        self.channels: Sequence[Channel] = [
            _channel(number, connection) for number, connection in self._connections.items()
        ]
        self.distro: str | None = self._reader.metadata.ros_distro
        self.start_ns = self._reader.metadata.start_time
        self.end_ns = self._reader.metadata.end_time - 1

    def messages(self, numbers: set[int], start_ns: int) -> Iterator[tuple[int, int, bytes]]:
        wanted = {number: self._connections[number] for number in numbers}
        number_of = {connection.id: number for number, connection in wanted.items()}
        for connection, time_ns, raw in self._reader.messages(list(wanted.values()), start_ns, None):
            yield time_ns, number_of[connection.id], raw

    @property
    def damage(self) -> Damage:
        files = getattr(self._reader, "storages", None) or [self._reader]
        found = [file.damage for file in files if isinstance(file, _WholeParts)]
        return Damage(
            parts=sum(one.parts for one in found),
            lost=[part for one in found for part in one.lost],
            too_large=sum(one.too_large for one in found),
        )

    def close(self) -> None:
        self._reader.close()


def _assert_whole(path: Path) -> None:
    """Check the length in the header, because SQLite reads a missing end of a database as zeros."""
    with path.open("rb") as file:
        header = file.read(100)
    page_bytes = int.from_bytes(header[16:18], "big")
    whole = (65_536 if page_bytes == 1 else page_bytes) * int.from_bytes(header[28:32], "big")
    if path.stat().st_size < whole:
        raise RecordingUnreadable(f"{path} is not complete: {path.stat().st_size} of {whole} bytes are there")


def _channel(number: int, connection: Any) -> Channel:
    return Channel(
        number=number,
        topic=connection.topic,
        type=connection.msgtype,
        definition=connection.msgdef.data,
        format=_FORMATS[connection.msgdef.format],
        encoding=connection.ext.serialization_format,
        count=connection.msgcount,
        is_latched=any(qos.durability == QosDurability.TRANSIENT_LOCAL for qos in connection.ext.offered_qos_profiles),
    )
