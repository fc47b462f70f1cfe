"""Reads MCAP files of every profile and writer, by their index where it is complete and else by their records."""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from collections.abc import Container, Iterator, Sequence
from dataclasses import replace
from pathlib import Path
from typing import IO, Any

import orjson
from mcap.reader import McapReader, make_reader
from mcap.records import AttachmentIndex, ChunkIndex, Statistics

from server.judge.message import RosVersion
from server.recording.mcap.chunk_rows import EVERYWHERE, ChunkRow, chunk_rows, in_order, run_rows
from server.recording.mcap.chunks import MAGIC, has_magic
from server.recording.mcap.scan import Index, Part, arrivals_of, by_name, corrected_parts, scan
from server.recording.own import METADATA, PREFIX
from server.recording.read.bag2_metadata import is_latched
from server.recording.read.clock_steps import PLACES_A_PART, Arrivals, Stretch
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.source import UNDECLARED, Channel, Damage, DefinitionFormat
from server.recording.read.temporary_copy import TemporaryCopy
from server.recording.read.unpack import PACKED, PartTooLarge, unpacked_rows

_FORMATS: dict[str, DefinitionFormat] = {"ros1msg": "msg", "ros2msg": "msg", "ros2idl": "idl", "omgidl": "idl"}
_INDEX_HEAD = 9 + 2 + 4  # bytes of a message index's record besides its entries
_INDEX_ENTRY = 16
_DATA_END = b"\x0f\4" + bytes(7)  # opcode and length
_FOOTER_BYTES = 8 + 8 + 4  # places of summary and offsets, checksum


class McapFile:
    """An MCAP file."""

    def __init__(
        self,
        path: Path,
        *,
        content: Path | None = None,
        copy: TemporaryCopy | None = None,
    ) -> None:
        """`path`: how it is named; `content`: where it is, which is in `copy` where that is given.

        Raises RecordingUnreadable where no message is whole, PartTooLarge, OSError and MemoryError.
        """
        self.path = path
        self.distro: str | None = None
        self.is_listed = False
        self._has_arrivals = True
        self.stretches: Sequence[Stretch] = ()
        self._copy = copy
        self._file = (content or path).open("rb")
        if copy is not None:
            copy.release()
        try:
            self.is_cut = is_cut(self._file)
            index = self._index()
        except BaseException:
            self._file.close()
            raise
        self._pieces, self._behind_bytes = index.pieces, index.behind_bytes
        self.damage = self._new_damage()
        self._parts = sorted(index.parts, key=lambda part: (part.message_start_time, part.message_end_time))
        self.start_ns, self.end_ns = index.span_ns
        self.channels: Sequence[Channel] = _channels(index)
        self._cdr = frozenset(channel.number for channel in self.channels if channel.encoding == "cdr")
        self.metadata = dict(by_name(index.metadata, METADATA))
        self.ros_version = _ros_version(index.profile, self.channels)

    def _index(self) -> Index:
        if not self.is_cut and (index := _summary(self._file)) is not None:
            return index
        index = scan(self._file)
        if not index.counts and (self.is_cut or index.parts):
            raise self._unreadable(index)
        if not self.is_cut:
            index.behind_bytes += index.rest_bytes  # it has the end of another file
            index.pieces += not index.is_ended
        return index

    def _unreadable(self, index: Index) -> Exception:
        """Why none of its messages can be read."""
        which = f"none of its {len(index.parts)} parts"
        if not index.parts:
            return RecordingUnreadable(f"{self.path} is not complete: it ends too early")
        if self.is_cut:
            return RecordingUnreadable(f"{self.path} is not complete, and {which} can be read")
        return (
            index.why
            if isinstance(index.why, PartTooLarge)
            else RecordingUnreadable(f"{self.path} is damaged: {which} is whole")
        )

    def messages(
        self, numbers: set[int], start_ns: int, damage: Damage | None = None
    ) -> Iterator[tuple[int, int, bytes]]:
        noted = damage
        if noted is None:
            noted = self.damage = self._new_damage()
        parts = [part for part in self._parts if _matters(part, numbers, start_ns)]
        noted.parts = len(parts)
        self._forget_arrivals()
        yield from in_order(parts, lambda part: self._whole(part, numbers, start_ns, noted))

    def _whole(self, part: Part, numbers: set[int], start_ns: int, damage: Damage) -> list[ChunkRow]:
        """The messages of a part that are wanted; none where it is damaged."""
        try:
            rows = self._rows(part, numbers, start_ns)
        except MemoryError:
            raise
        except Exception as why:  # damage makes the readers fail in every way there is
            damage.leave_out(part.message_start_time, part.message_end_time, why)
            return []
        if any(raw[:4] == PACKED for _, _, raw in rows):
            rows, lost = unpacked_rows(rows, self._cdr)
            damage.pieces += lost
        return rows

    def _rows(self, part: Part, numbers: Container[int], start_ns: int) -> list[ChunkRow]:
        """The messages of a part. Damage raises any exception."""
        is_whole = part.to_place - part.from_place == PLACES_A_PART
        places = EVERYWHERE if is_whole else range(part.from_place, part.to_place)
        from_ns = start_ns - part.shift_ns
        if part.run_bytes:
            rows = run_rows(self._file, part.at, part.run_bytes, numbers, from_ns, places)
        else:
            rows = chunk_rows(self._file, part.at, numbers, from_ns, places=places)
        return [(one[0] + part.shift_ns, one[1], one[2]) for one in rows] if part.shift_ns else rows

    def arrivals(self) -> Iterator[Arrivals]:
        if self.metadata or any(channel.topic.startswith(PREFIX) for channel in self.channels):
            return  # catgraph's recorder counts from the time of day at its beginning
        yield from arrivals_of(self._file, self._parts)

    def _forget_arrivals(self) -> None:
        for part in self._parts if self._has_arrivals else ():
            part.arrivals = None
        self._has_arrivals = False

    def raw_at(self, place: int, channel: int) -> bytes | None:
        number, offset = divmod(place, PLACES_A_PART)
        part = sorted(self._parts, key=lambda part: part.at)[number]
        try:
            rows = self._rows(replace(part, from_place=offset, to_place=offset + 1), {channel}, 0)
        except MemoryError:
            raise
        except Exception:  # damage makes the readers fail in every way there is
            return None
        rows, _ = unpacked_rows(rows, self._cdr)
        return rows[0][2] if rows else None

    def correct(self, stretches: Sequence[Stretch]) -> None:
        self.stretches = stretches
        parts = corrected_parts(self._parts, stretches)
        self._parts = sorted(parts, key=lambda part: (part.message_start_time, part.message_end_time))
        self.start_ns = stretches[0].first_ns + stretches[0].shift_ns
        self.end_ns = stretches[-1].last_ns + stretches[-1].shift_ns

    def _new_damage(self) -> Damage:
        is_cut = self.is_cut and not self._behind_bytes
        return Damage(is_cut=is_cut, pieces=self._pieces, behind_bytes=self._behind_bytes)

    def close(self) -> None:
        self._file.close()
        if self._copy is not None:
            self._copy.close()


def is_cut(file: IO[bytes]) -> bool:
    """Whether a file was never closed, or lost its end."""
    size = file.seek(0, os.SEEK_END)
    file.seek(max(0, size - len(MAGIC)))
    return size < 2 * len(MAGIC) or file.read() != MAGIC


def _summary(file: IO[bytes]) -> Index | None:
    """The file's own index; None where it has none, or not all that its messages need. Raises MemoryError."""
    try:
        file.seek(0)
        reader = make_reader(file)
        profile = reader.get_header().profile
        summary = reader.get_summary()
        if summary is None or summary.statistics is None:
            return None
        if not _is_alone(file):
            return None
        statistics = summary.statistics
        if not _is_complete(summary, statistics):
            return None
        index = Index(profile=profile, schemas=dict(summary.schemas), channels=dict(summary.channels), is_ended=True)
        index.counts = Counter(statistics.channel_message_counts)
        index.parts = _parts(summary.chunk_indexes)
        index.metadata = _metadata(file, reader, len(summary.metadata_indexes), statistics.metadata_count)
    except MemoryError:
        raise
    except Exception:  # damage makes the library fail in every way there is
        return None
    return index


def _is_alone(file: IO[bytes]) -> bool:
    """Whether the summary follows the end of the data, with no other file's beginning or end in it: where two files
    were joined, the footer of the second leads into the first."""
    end = file.seek(-len(MAGIC), os.SEEK_END)
    file.seek(end - _FOOTER_BYTES)
    start = int.from_bytes(file.read(8), "little") - len(_DATA_END) - 4  # before the checksum of the data
    file.seek(start)
    return file.read(len(_DATA_END)) == _DATA_END and not has_magic(file, start, end)


def _is_complete(summary: Any, statistics: Statistics) -> bool:
    """Whether the index declares all channels with messages, and leads to each message.

    The length of a chunk's message indexes is the only place from which a summary shows how many messages a chunk
    has; a file may have others outside of its chunks.
    """
    counts: dict[int, int] = statistics.channel_message_counts
    channels = [summary.channels.get(number) for number, count in counts.items() if count]
    if any(one is None or (one.schema_id and one.schema_id not in summary.schemas) for one in channels):
        return False
    indexed = sum(
        (part.message_index_length - _INDEX_HEAD * len(part.message_index_offsets)) // _INDEX_ENTRY
        for part in summary.chunk_indexes
        if part.message_index_offsets
    )
    return (
        statistics.chunk_count == len(summary.chunk_indexes)
        and statistics.message_count == sum(counts.values()) == indexed
    )


def _parts(indexes: Sequence[ChunkIndex]) -> list[Part]:
    """An hour has ten thousand chunks, of which most have the same channels: these are kept once."""
    known: dict[frozenset[int], frozenset[int]] = {}
    parts = []
    for index in indexes:
        if not index.message_index_offsets:  # without messages, as it is complete
            continue
        channels = frozenset(index.message_index_offsets)
        parts.append(
            Part(
                message_start_time=index.message_start_time,
                message_end_time=index.message_end_time,
                at=index.chunk_start_offset,
                channels=known.setdefault(channels, channels),
                index_at=index.chunk_start_offset + index.chunk_length,
                index_bytes=index.message_index_length,
            )
        )
    return parts


def _metadata(file: IO[bytes], reader: McapReader, indexed: int, count: int) -> list[Any]:
    """The metadata records; those that the index does not name are looked for."""
    return list(reader.iter_metadata()) if indexed == count else scan(file, with_messages=False).metadata


def _matters(part: Part, numbers: set[int], start_ns: int) -> bool:
    """Whether a part may contain a wanted message."""
    return part.message_end_time >= start_ns and (not part.channels or not numbers.isdisjoint(part.channels))


def _channels(index: Index) -> list[Channel]:
    """Those declared, and those that only have messages."""
    found = [
        _channel(channel, index.schemas.get(channel.schema_id), index.counts[channel.id])
        for channel in index.channels.values()
    ]
    found += [
        Channel(
            number=number,
            topic=f"channel {number}",
            type="",
            definition="",
            format="none",
            encoding=UNDECLARED,
            count=count,
            is_latched=False,
        )
        for number, count in index.counts.items()
        if number not in index.channels
    ]
    return found


def _channel(channel: Any, schema: Any, count: int) -> Channel:
    name = schema.name if schema else ""
    parts = name.split("/")
    is_ros = channel.message_encoding in ("ros1", "cdr")
    return Channel(
        number=channel.id,
        topic=channel.topic,
        type=f"{parts[0]}/msg/{parts[1]}" if is_ros and len(parts) == 2 else name,
        definition=schema.data.decode("utf-8", "replace") if schema else "",
        format=_FORMATS.get(schema.encoding, "none") if schema and schema.data.strip() else "none",
        encoding=channel.message_encoding,
        count=count,
        is_latched=is_latched(channel.metadata.get("offered_qos_profiles", "")),
    )


def _ros_version(profile: str, channels: Sequence[Channel]) -> RosVersion:
    """By what is encoded as ROS 1 or ROS 2; where that is both or nothing, by the profile, else by names of types."""
    encodings = {channel.encoding for channel in channels if channel.count}
    if ("cdr" in encodings) != ("ros1" in encodings):
        return 2 if "cdr" in encodings else 1
    if profile in ("ros1", "ros2"):
        return 2 if profile == "ros2" else 1
    encodings = {channel.encoding for channel in channels}
    is_ros2 = "cdr" in encodings or any("/msg/" in one.type for one in channels if one.encoding == "json")
    return 2 if is_ros2 and "ros1" not in encodings else 1


def own_entries(source: McapFile, topic: str) -> Iterator[dict[str, Any]]:
    """The JSON objects of a channel in the order of time. Raises OSError."""
    numbers = {channel.number for channel in source.channels if channel.topic == topic}
    for _, _, raw in source.messages(numbers, 0) if numbers else ():
        with contextlib.suppress(orjson.JSONDecodeError):
            entry = orjson.loads(raw)
            if isinstance(entry, dict):
                yield entry


def finished(path: Path) -> McapFile:
    """The file, open. Raises ValueError where it was never closed, OSError, and whatever damage makes of it."""
    with path.open("rb") as file:
        if is_cut(file):  # before its index is made, for which all of it is unpacked
            raise ValueError(f"{path.name} was never closed")
    return McapFile(path)


def attachments_of(file: IO[bytes]) -> list[AttachmentIndex]:
    """Where each attachment of a file is. Raises OSError, and whatever damage makes the library raise."""
    summary = make_reader(file).get_summary()
    if summary is not None and summary.statistics is not None:
        if len(summary.attachment_indexes) == summary.statistics.attachment_count:
            return list(summary.attachment_indexes)
    return scan(file, with_messages=False).attachments
