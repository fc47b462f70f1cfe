"""What every kind of recording file offers its reader, and the rows of several files in the order of time."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Generic, Literal, Protocol, TypeVar

from server.judge.message import RosVersion
from server.judge.topics import fitness
from server.recording.read.clock_steps import FIRST_NS, LAST_NS, Arrivals, Stretch
from server.recording.read.errors import Undecodable
from server.recording.read.unpack import PartTooLarge

DefinitionFormat = Literal["none", "msg", "idl"]
LEAST_SLACK_NS = 3600 * 10**9  # by which a damaged part can be before or behind what is whole
UNDECLARED = ""  # the encoding of messages whose channel the file does not declare

R = TypeVar("R")


def why_not_decoded(encoding: str) -> str:
    """Why messages of an encoding that is none of ours are left out."""
    if encoding == UNDECLARED:
        return "the file does not declare what they are"
    return f"messages encoded as {encoding[:40]!r} are not supported"


@dataclass(frozen=True, slots=True, kw_only=True)
class Channel:
    """Messages of one topic and type in one file."""

    number: int  # unique in its file
    topic: str
    type: str  # as rosbags spells it, "pkg/msg/Type" in both versions
    definition: str
    format: DefinitionFormat
    encoding: str  # "ros1", "cdr", "json"; others are named and not read
    count: int
    is_latched: bool


@dataclass(slots=True)
class Damage:
    """What of a file turned out to be damaged while it was read, in parts that each carry a checksum of their own."""

    parts: int = 0  # that were to be read
    lost: list[tuple[int, int]] = field(default_factory=list)  # first and last ns of each damaged one, by its index

    too_large: int = 0  # of the lost ones: larger, unpacked, than may be read
    is_cut: bool = False  # its end is missing too, of unknown length
    pieces: int = 0  # without checksums or times of their own, that could not be read either
    behind_bytes: int = 0  # that follow the end of the file

    def leave_out(self, start_ns: int, end_ns: int, why: Exception) -> None:
        """One part cannot be read."""
        self.lost.append((start_ns, end_ns))
        self.too_large += isinstance(why, PartTooLarge)

    @property
    def is_total(self) -> bool:
        return bool(self.parts) and len(self.lost) == self.parts

    def why_nothing(self, path: Path) -> str:
        """Why nothing of a file can be read, where this is total."""
        if self.too_large:
            which = "its only part is" if self.parts == 1 else f"{self.too_large} of its {self.parts} parts are"
            return f"{path} cannot be read: {which} larger, unpacked, than may be read"
        return f"{path} is damaged: none of its {self.parts} parts is whole"

    def sentences(self, name: str, origin_ns: int, end_ns: int) -> list[str]:
        """What is missing and when, for a person."""
        sentences = []
        if self.lost:
            which = "1 part" if len(self.lost) == 1 else f"{len(self.lost)} parts"
            what = "holds parts that are larger than may be read" if self.too_large else "is damaged"
            sentences.append(
                f"{name} {what}: {which} of {self.parts}{self._when(origin_ns, end_ns)} "
                f"{'is' if len(self.lost) == 1 else 'are'} left out"
            )
        if self.pieces:
            which = "1 piece of it is" if self.pieces == 1 else f"{self.pieces} pieces of it are"
            sentences.append(f"{name} is damaged: {which} left out")
        if self.behind_bytes:
            sentences.append(
                f"{name} goes on behind its end, as where two files were joined: {self.behind_bytes} bytes are left out"
            )
        if self.is_cut:
            sentences.append(
                f"{name} was never closed: it is read to its last whole part, {(end_ns - origin_ns) / 1e9:.1f} s"
            )
        return sentences

    def _when(self, origin_ns: int, end_ns: int) -> str:
        """When the lost parts were recorded; nothing where the times that they declare are damaged too."""
        span = min(first for first, _ in self.lost), max(last for _, last in self.lost)
        if not is_likely(span, origin_ns, end_ns):
            return ""
        return f", between {(span[0] - origin_ns) / 1e9:.1f} s and {(span[1] - origin_ns) / 1e9:.1f} s,"


def is_likely(span: tuple[int, int], origin_ns: int, end_ns: int) -> bool:
    """Whether a part of a file that covers this time may have been recorded then."""
    first_ns, last_ns = span
    slack_ns = max(end_ns - origin_ns, LEAST_SLACK_NS)
    is_near = origin_ns - slack_ns <= first_ns <= last_ns <= end_ns + slack_ns
    return is_near and (FIRST_NS <= first_ns <= last_ns < LAST_NS or not FIRST_NS <= origin_ns < LAST_NS)


class FileSource(Protocol):
    """One open file of a recording."""

    path: Path
    ros_version: RosVersion
    distro: str | None
    channels: Sequence[Channel]
    start_ns: int  # since 1970; of no meaning where there are no messages
    end_ns: int
    stretches: Sequence[Stretch]  # by which its times were corrected; empty: they are log times
    is_listed: bool  # a file of a bag that lists its files in metadata.yaml

    @property
    def damage(self) -> Damage:
        """Of the newest reading that has no other place for it."""
        ...

    def messages(
        self, numbers: set[int], start_ns: int, damage: Damage | None = None
    ) -> Iterator[tuple[int, int, bytes]]:
        """(time in ns, number of the channel, raw message) in time order, from `start_ns` on.

        Where the file has checksums of its parts, damaged ones are left out and noted: in `damage` where that is given,
        else in that of the file. All times are corrected ones once `correct` was called."""
        ...

    def arrivals(self) -> Iterator[Arrivals]:
        """The messages of each part in the order of receipt; none where the log times are known to go on."""
        ...

    def raw_at(self, place: int, channel: int) -> bytes | None:
        """The message of a channel at a place that `arrivals` named; None: it cannot be read."""
        ...

    def correct(self, stretches: Sequence[Stretch]) -> None:
        """Have all times corrected from now on, by stretches in the order of their places; called at most once."""
        ...

    def close(self) -> None: ...


def types_of_topics(
    sources: Sequence[FileSource], version: RosVersion, decoder: Callable[[Channel, FileSource], object]
) -> dict[str, str]:
    """The type of which each topic's messages are read: of those with messages that can be decoded one that a signal is
    read of, else the first. `decoder` raises Undecodable."""
    found: dict[str, tuple[tuple[bool, bool, int], str]] = {}
    for source in sources:
        for channel in source.channels if source.ros_version == version else ():
            type = spelled(channel.type, version)
            can_decode = _can_decode(channel, source, decoder)
            rank = can_decode and channel.count > 0, can_decode, fitness(channel.topic, type)
            if type and (channel.topic not in found or rank > found[channel.topic][0]):
                found[channel.topic] = rank, type
    return {topic: type for topic, (_, type) in found.items()}


def _can_decode(channel: Channel, source: FileSource, decoder: Callable[[Channel, FileSource], object]) -> bool:
    try:
        decoder(channel, source)
    except Undecodable:
        return False
    return True


def spelled(type: str, version: RosVersion) -> str:
    """A type as its version of ROS spells it, which the file may not do."""
    if version == 1:
        return type.replace("/msg/", "/")
    return type.replace("/", "/msg/") if type.count("/") == 1 else type


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream(Generic[R]):
    """The rows of one file, in order."""

    start_ns: int
    end_ns: int
    rows: Iterable[R]


def in_time_order(streams: Sequence[Stream[R]], time_of: Callable[[R], Any]) -> Iterator[R]:
    """All rows in order. Parts of a split recording follow each other, so that one is read behind the other; only
    files that overlap are merged, which takes longer for each row."""
    for group in _overlapping(streams):
        rows = [stream.rows for stream in group]
        yield from rows[0] if len(rows) == 1 else heapq.merge(*rows, key=time_of)


def _overlapping(streams: Sequence[Stream[R]]) -> list[list[Stream[R]]]:
    groups: list[list[Stream[R]]] = []
    end_ns = 0
    for stream in sorted(streams, key=lambda one: one.start_ns):
        if groups and stream.start_ns <= end_ns:
            groups[-1].append(stream)
            end_ns = max(end_ns, stream.end_ns)
        else:
            groups.append([stream])
            end_ns = stream.end_ns
    return groups
