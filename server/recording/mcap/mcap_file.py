"""Reads MCAP files that are no ROS 2 bags: our own, ROS 1 messages in MCAP, and messages written as JSON."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import IO, Any, Literal, cast

from mcap.reader import McapReader, make_reader
from mcap.records import ChunkIndex, Metadata

from server.judge.message import RosVersion
from server.recording.mcap.chunk_rows import ChunkRow, chunk_rows, in_order
from server.recording.own import LIBRARY, METADATA
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.source import Channel, Damage, DefinitionFormat

_FORMATS: dict[str, DefinitionFormat] = {"ros1msg": "msg", "ros2msg": "msg", "ros2idl": "idl", "omgidl": "idl"}


def is_bag2(path: Path) -> bool:
    """Whether a ROS 2 recorder wrote the file, which rosbags reads with its metadata."""
    with path.open("rb") as file:
        header = make_reader(cast("IO[bytes]", file)).get_header()
        return header.profile == "ros2" and not header.library.startswith(LIBRARY)


@dataclass(frozen=True, slots=True, kw_only=True)
class Index:
    """What a file holds and where."""

    schemas: Mapping[int, Any]
    channels: Mapping[int, Any]
    counts: Mapping[int, int]  # of messages by channel
    parts: Sequence[ChunkIndex]
    span_ns: tuple[int, int] | None = None  # first and last message; None: that of the parts
    metadata: Mapping[str, str] = field(default_factory=dict)  # metadata of catgraph's own recording
    profile: str = ""


class McapFile:
    """An MCAP file of any profile."""

    distro: str | None = None

    is_cut = False

    def __init__(self, path: Path) -> None:
        self.path = path
        self.damage = Damage()
        self._file = path.open("rb")
        try:
            self._reader: McapReader = make_reader(self._file)
            index = self._read_index()
        except BaseException:
            self._file.close()
            raise
        _share_channels(index.parts)
        self._parts = sorted(index.parts, key=lambda part: (part.message_start_time, part.message_end_time))
        if index.span_ns is not None:
            self.start_ns, self.end_ns = index.span_ns
        else:
            self.start_ns = min(part.message_start_time for part in index.parts)
            self.end_ns = max(part.message_end_time for part in index.parts)
        self.channels: Sequence[Channel] = [
            _channel(channel, index.schemas.get(channel.schema_id), index.counts.get(channel.id, 0))
            for channel in index.channels.values()
        ]
        self.metadata = dict(index.metadata)
        is_ros2 = index.profile == "ros2" or any(
            c.encoding == "cdr" or "/msg/" in c.type for c in self.channels if c.encoding != "ros1"
        )
        self.ros_version: RosVersion = 2 if is_ros2 else 1

    def _read_index(self) -> Index:
        summary = self._reader.get_summary()
        if summary is None or summary.statistics is None:
            raise RecordingUnreadable(f"{self.path.name} ends too early: it has no index")
        statistics = summary.statistics
        return Index(
            schemas=summary.schemas,
            channels=summary.channels,
            counts=statistics.channel_message_counts,
            parts=summary.chunk_indexes,
            span_ns=(statistics.message_start_time, statistics.message_end_time),
            metadata=latest(self._reader.iter_metadata()),
            profile=self._reader.get_header().profile,
        )

    def messages(self, numbers: set[int], start_ns: int) -> Iterator[tuple[int, int, bytes]]:
        self.damage = Damage(is_cut=self.is_cut)
        if not self._parts:  # nothing but messages, without an index
            for _, channel, message in self._reader.iter_messages(starting_at=start_ns):
                if channel.id in numbers:
                    yield message.log_time, channel.id, message.data
            return
        parts = [part for part in self._parts if _matters(part, numbers, start_ns)]
        self.damage.parts = len(parts)
        yield from in_order(parts, lambda part: self._whole(part, numbers, start_ns))

    def _whole(self, part: ChunkIndex, numbers: set[int], start_ns: int) -> list[ChunkRow]:
        """The messages of a part that are wanted; none where it is damaged."""
        try:
            return chunk_rows(self._file, part.chunk_start_offset, numbers, start_ns)
        except MemoryError:
            raise
        except Exception as why:  # damage makes the readers fail in every way there is
            self.damage.leave_out(part.message_start_time, part.message_end_time, why)
            return []

    def close(self) -> None:
        self._file.close()


def _share_channels(parts: Sequence[ChunkIndex]) -> None:
    """An hour has ten thousand parts, each with a table of where its channels' indexes lie: 20 MB of which only the
    channels are asked for, and most parts have the same."""
    known: dict[frozenset[int], dict[int, int]] = {}
    for part in parts:
        part.message_index_offsets = known.setdefault(frozenset(part.message_index_offsets), part.message_index_offsets)


def _matters(part: ChunkIndex, numbers: set[int], start_ns: int) -> bool:
    """Whether a part may contain a wanted message; without its channels in the index it may."""
    return part.message_end_time >= start_ns and (
        not part.message_index_offsets or not numbers.isdisjoint(part.message_index_offsets)
    )


def latest(records: Iterable[Metadata]) -> dict[str, str]:
    """Our last metadata record: one is written at the start, one more when the file is closed."""
    found: dict[str, str] = {}
    for record in records:
        if record.name == METADATA:
            found = dict(record.metadata)
    return found


def _channel(channel: Any, schema: Any, count: int) -> Channel:
    name = schema.name if schema else ""
    parts = name.split("/")
    return Channel(
        number=channel.id,
        topic=channel.topic,
        type=f"{parts[0]}/msg/{parts[1]}" if channel.message_encoding == "ros1" and len(parts) == 2 else name,
        definition=schema.data.decode("utf-8", "replace") if schema else "",
        format=_FORMATS.get(schema.encoding, "none") if schema else "none",
        encoding=cast('Literal["ros1", "cdr", "json"]', channel.message_encoding),
        count=count,
        is_latched="durability: transient_local" in channel.metadata.get("offered_qos_profiles", "").lower(),
    )
