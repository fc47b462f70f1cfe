"""Reads recorded drives of every kind as one stream of messages in rosbridge's shape."""

from __future__ import annotations

import operator
import re
from collections import Counter
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from types import TracebackType
from typing import Any, Self

import orjson

from server.judge.message import Json, Message, RosVersion
from server.recording.mcap.mcap_file import McapFile
from server.recording.own import PREFIX
from server.recording.read.decode import Decode, Layout, RawMessage, beforehand, compile_decoder, sifted, type_of_first
from server.recording.read.definitions import definition_of, definitions_of
from server.recording.read.errors import RecordingUnreadable, Undecodable
from server.recording.read.recognise import of_car, open_parts, open_with, recognise, what_is_wrong
from server.recording.read.source import (
    Channel,
    Damage,
    FileSource,
    Stream,
    in_time_order,
    spelled,
    types_of_topics,
    why_not_decoded,
)
from server.recording.read.steady_time import ClockStep, make_steady, notes_on
from server.rosbridge import codec

__all__ = ["Recording", "RecordingUnreadable", "TopicInfo", "open_recording"]


@dataclass(frozen=True, slots=True, kw_only=True)
class TopicInfo:
    """What a recording holds of one topic."""

    type: str  # "geometry_msgs/Twist" in ROS 1, "geometry_msgs/msg/Twist" in ROS 2
    count: int
    definition: str | None  # the message definition that the recording carries
    is_latched: bool = False  # newcomers were given the last message


@dataclass(frozen=True, slots=True, kw_only=True)
class _ChannelReader:
    """How messages of one channel become ours."""

    topic: str
    type: str
    decode: Decode
    layout: Layout | None  # of its bytes; None: JSON


_ROS_TYPE = re.compile(r"[A-Za-z]\w*(/msg)?/[A-Za-z]\w*")
Row = tuple[float, str, str, Json]  # seconds since 1970, topic, type, content
_Decoders = Mapping[int, tuple[str, str, Callable[[bytes], Json]]]  # number of a channel → topic, type, decoder


def open_recording(paths: Sequence[Path], *, required: Path | None = None) -> Recording:
    """Open one drive of one or several files, of ROS 1 or ROS 2.

    A path is a ROS 1 bag, a ROS 2 bag directory, a single .mcap or .db3 file, or a directory with such files in it.
    With `required`, one of the paths, the others are read where they can be read with it, and else named in `lacking`.
    Raises RecordingUnreadable with one sentence that names the file.
    """
    if not paths:
        raise RecordingUnreadable("no recording was given")
    sources: list[FileSource] = []
    lacking: list[str] = []
    try:
        if required is None:
            for path in paths:
                open_parts(recognise(Path(path)), sources, lacking)
        else:
            open_with(required, paths, sources, lacking)
        if len({source.ros_version for source in sources if of_car(source)}) > 1:
            raise RecordingUnreadable("recordings of ROS 1 and ROS 2 cannot be read as one")
        return Recording(sources, lacking, list(map(Path, paths)))
    except BaseException:
        for source in sources:
            source.close()
        raise


class Recording:
    """A drive on disk. Use it as a context manager, or close it."""

    def __init__(self, sources: Sequence[FileSource], lacking: Sequence[str], paths: Sequence[Path]) -> None:
        """`lacking`: parts that are missing or cannot be read at all, a sentence each; `paths`: files and folders."""
        self._sources = sources
        self.lacking = lacking
        self.paths = paths
        self.clock_steps = _made_steady(sources)  # the times of the files are corrected for them
        self.clock_notes = notes_on(self.clock_steps)  # for a person
        self.ros_version: RosVersion = next(
            (s for which in (of_car, lambda one: one.channels) for s in sources if which(s)), sources[0]
        ).ros_version
        self.topics: dict[str, TopicInfo] = {}
        ours = (source.metadata for source in sources if isinstance(source, McapFile) and source.metadata)
        self.metadata: dict[str, str] = next(ours, {})
        self.rejected: dict[str, int] = {}  # messages by topic that could not be decoded while reading
        self.why_rejected: dict[str, str] = {}
        self._readers: list[dict[int, _ChannelReader]] = []
        self._decoders: dict[tuple[str, str, str], tuple[Decode, Layout | None]] = {}
        self._types = types_of_topics(sources, self.ros_version, self._decoder)
        left_out: Counter[tuple[str, str]] = Counter()  # messages by topic and reason
        for source in sources:
            self._readers.append(self._readers_of(source, left_out))
        # Topics left out, each with the reason, for a person.
        self.notes = [f"{topic} ({count} messages) is left out: {why}" for (topic, why), count in left_out.items()]
        filled = [source for source in sources if any(channel.count for channel in source.channels)]
        self._start_ns = min((source.start_ns for source in filled), default=0)
        end_ns = max((source.end_ns for source in filled), default=self._start_ns)
        self.start_s = self._start_ns / 1e9  # since 1970, of the first message
        self.duration_s = (end_ns - self._start_ns) / 1e9  # from the first message to the last

    @property
    def damage(self) -> list[str]:
        """What the newest reading had to leave out because it is damaged or was never written, in sentences."""
        return [*self.lacking] + [
            sentence
            for source in self._sources
            for sentence in source.damage.sentences(source.path.name, self._start_ns, source.end_ns)
        ]

    @property
    def files(self) -> Sequence[FileSource]:
        """The source files, for copying messages unchanged."""
        return self._sources

    def assert_some(self, source: FileSource) -> None:
        """Check, when a file was read, that it or another one is not damaged everywhere. Raises RecordingUnreadable."""
        filled = [one for one in self._sources if any(channel.count for channel in one.channels)]
        if all(one.damage.is_total for one in filled):
            raise RecordingUnreadable(source.damage.why_nothing(source.path))

    @property
    def count(self) -> int:
        """Messages of all topics that can be read."""
        return sum(topic.count for topic in self.topics.values())

    def messages(self, start_s: float = 0.0, topics: Collection[str] | None = None) -> Iterator[Message]:
        """All messages in time order, from `start_s` after the start, read lazily; see `rows`."""
        return (
            Message(at_s=at_s, topic=topic, type=type, message=message)
            for at_s, topic, type, message in self.rows(start_s, topics)
        )

    def raw_messages(self, start_s: float = 0.0) -> Iterator[Message]:
        """Like `messages`, with a RawMessage wherever the recording has the bytes that ROS sends between nodes.

        `rejected` then counts a message that cannot be decoded when its fields are first read.
        """
        decoders = [{n: (r.topic, r.type, self._deferred(r)) for n, r in readers.items()} for readers in self._readers]
        return (
            Message(at_s=at_s, topic=topic, type=type, message=message)
            for at_s, topic, type, message in self._in_order(start_s, decoders)
        )

    def rows(self, start_s: float = 0.0, topics: Collection[str] | None = None) -> Iterator[Row]:
        """Like `messages`, as tuples: time, topic, type, content.

        With `topics`, messages of other topics are empty, because decoding is most of the work (`sifted`). What cannot
        be decoded is left out and counted in `rejected`, what is damaged is left out where the rest can be read without
        it, and named in `damage`. Raises RecordingUnreadable where it cannot, or nothing is whole.
        """
        decoders = [
            {n: (r.topic, r.type, sifted(r.decode, r.topic, topics)) for n, r in readers.items()}
            for readers in self._readers
        ]
        return self._in_order(start_s, decoders)

    def only(self, topics: Collection[str]) -> Iterator[Row]:
        """Messages of these topics alone, in time order, for what is to be known before a reading; see `beforehand`."""
        streams = [
            Stream(start_ns=source.start_ns, end_ns=source.end_ns, rows=beforehand(source, ways))
            for source, readers in zip(self._sources, self._readers, strict=True)
            if (ways := {n: (r.topic, r.type, r.decode) for n, r in readers.items() if r.topic in topics})
        ]
        return in_time_order(streams, operator.itemgetter(0))

    def own(self, topic: str) -> Iterator[tuple[float, dict[str, Any]]]:
        """What catgraph itself wrote on one of its channels ("/catgraph/alarms"), in time order: seconds since 1970,
        and its fields. None of it is among `topics` and `messages()`, and `damage` stays that of the newest reading
        of those."""
        streams = [
            Stream(start_ns=source.start_ns, end_ns=source.end_ns, rows=self._own(source, topic))
            for source in self._sources
            if topic.startswith(PREFIX)
        ]
        return in_time_order(streams, operator.itemgetter(0))

    def _own(self, source: FileSource, topic: str) -> Iterator[tuple[float, dict[str, Any]]]:
        numbers = {channel.number for channel in source.channels if channel.topic == topic}
        for time_ns, _, raw in source.messages(numbers, 0, Damage()) if numbers else ():
            try:
                yield time_ns / 1e9, _decode_json(raw)
            except Undecodable:
                self.rejected[topic] = self.rejected.get(topic, 0) + 1

    def close(self) -> None:
        for source in self._sources:
            source.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, value: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    def _decoder(self, channel: Channel, source: FileSource) -> tuple[Decode, Layout | None]:
        """As the function: channels of one type share one."""
        key = (channel.type, channel.definition, channel.encoding)
        if key not in self._decoders:
            self._decoders[key] = _decoder(channel, source)
        return self._decoders[key]

    def _readers_of(self, source: FileSource, left_out: Counter[tuple[str, str]]) -> dict[int, _ChannelReader]:
        readers: dict[int, _ChannelReader] = {}
        for channel in sorted(source.channels, key=lambda one: not one.type):
            if channel.topic.startswith(PREFIX) and channel.encoding == "json":
                continue
            if source.ros_version != self.ros_version:
                continue  # it has no messages of the car
            type = spelled(channel.type, self.ros_version)
            try:
                known = self.topics.get(channel.topic)
                decode, layout = self._decoder(channel, source)
                read = self._types.get(channel.topic, "")
                if type and type != read:
                    raise Undecodable(f"it has the type {type} and also {read}")
            except Undecodable as why:
                if channel.count:
                    left_out[channel.topic, str(why)] += channel.count
                continue
            if not type and known is None:
                type = type_of_first(source, channel, decode)
            type = type or (known.type if known else "")
            readers[channel.number] = _ChannelReader(topic=channel.topic, type=type, decode=decode, layout=layout)
            self.topics[channel.topic] = TopicInfo(
                type=type,
                count=channel.count + (known.count if known else 0),
                definition=definition_of(channel) or (known.definition if known else None),
                is_latched=channel.is_latched or (known is not None and known.is_latched),
            )
        return readers

    def _deferred(self, reader: _ChannelReader) -> Callable[[bytes], Json]:
        """Wraps the bytes of a channel's messages, which are decoded when their fields are read."""
        layout = reader.layout
        if layout is None:
            return reader.decode

        def decode(raw: bytes) -> Json:
            try:
                return reader.decode(raw)
            except Undecodable as why:
                self._reject(reader.topic, why)
                raise

        return lambda raw: RawMessage(raw, decode, layout)

    def _reject(self, topic: str, why: Undecodable) -> None:
        self.rejected[topic] = self.rejected.get(topic, 0) + 1
        self.why_rejected.setdefault(topic, str(why))

    def _in_order(self, start_s: float, decoders: Sequence[_Decoders]) -> Iterator[Row]:
        first_ns = min(self._start_ns, 0)  # parts with damaged times matter too
        start_ns = self._start_ns + round(start_s * 1e9) if start_s else first_ns
        streams = [
            Stream(start_ns=source.start_ns, end_ns=source.end_ns, rows=self._read(source, own, start_ns))
            for source, own in zip(self._sources, decoders, strict=True)
            if own
        ]
        return in_time_order(streams, operator.itemgetter(0))

    def _read(self, source: FileSource, decoders: _Decoders, start_ns: int) -> Iterator[Row]:
        try:
            for time_ns, number, raw in source.messages(set(decoders), start_ns):
                topic, type, decode = decoders[number]
                try:
                    message = decode(raw)
                except Undecodable as why:
                    self._reject(topic, why)
                    continue
                yield time_ns / 1e9, topic, type, message
            if source.damage.is_total:
                self.assert_some(source)
        except (RecordingUnreadable, MemoryError):
            raise
        except Exception as error:  # a damaged file makes the readers fail in every way there is
            raise RecordingUnreadable(what_is_wrong(source.path, error)) from None


def _made_steady(sources: Sequence[FileSource]) -> list[ClockStep]:
    try:
        return make_steady(sources)
    except (RecordingUnreadable, MemoryError):
        raise
    except Exception as error:
        raise RecordingUnreadable(what_is_wrong(sources[0].path, error)) from None


def _decoder(channel: Channel, source: FileSource) -> tuple[Decode, Layout | None]:
    """The decoder of a channel's messages, and the layout of their bytes where they are not JSON."""
    version = source.ros_version
    match channel.encoding:
        case "json":
            if not _is_own(source) and not _ROS_TYPE.fullmatch(channel.type):
                raise Undecodable("its messages are JSON, and of no ROS type")
            return _decode_json, None
        case "ros1" if version == 1:
            pass
        case "cdr" if version == 2:
            pass
        case other:
            raise Undecodable(why_not_decoded(other))
    layout = Layout(version, definitions_of(channel, version, source.distro))
    return compile_decoder(channel.type, layout.definitions, version), layout


def _is_own(source: FileSource) -> bool:
    """Whether it is a recording of catgraph, or a copy of one: there messages of unknown types are JSON."""
    return isinstance(source, McapFile) and (
        bool(source.metadata) or any(channel.topic.startswith(PREFIX) for channel in source.channels)
    )


def _decode_json(raw: bytes) -> dict[str, Any]:
    try:
        message = orjson.loads(raw)
    except orjson.JSONDecodeError:  # NaN is no JSON, and written as such by foxglove-sdk; it is read as on a live link
        try:
            message, _ = codec.decode(raw, False)
        except codec.Unreadable:
            raise Undecodable("it is not JSON") from None
    if not isinstance(message, dict):
        raise Undecodable("it is not a JSON object")
    return message
