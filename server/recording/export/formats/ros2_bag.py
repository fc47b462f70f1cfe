"""A recording as ROS 2 bag: a folder with metadata.yaml and one MCAP file, zipped, as `ros2 bag` and rosbags open it.

Our own files are MCAP too, but the tools of ROS 2 refuse a file in which one channel is JSON. Here the car's messages
stand as they are, and catgraph's own as std_msgs/msg/String with their JSON.
"""

from __future__ import annotations

import re
import struct
import tempfile
import zipfile
from collections import Counter
from collections.abc import Iterable
from pathlib import Path
from typing import Any, Literal

from rosbags.interfaces import Qos, QosDurability, QosHistory, QosLiveliness, QosReliability, QosTime
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer
from rosbags.typesys import Stores, get_typestore

from server.recording.export.export_format import ExportFormat, ExportRefused, Outcome, Progress, nothing
from server.recording.export.raw import OWN, Raw, explain, in_time, later_messages, raw_messages
from server.recording.read.definitions import definitions_of, distribution, times
from server.recording.read.errors import Undecodable
from server.recording.read.read import Recording
from server.recording.read.source import Channel, FileSource, why_not_decoded

FORMAT = ExportFormat(
    name="ros2",
    label="ROS 2 bag",
    use="for ros2 bag and rosbags, zipped",
    extension="ros2.zip",
    media_type="application/zip",
    writer=f"{__name__}:write_ros2_bag",
    options=("name", "with_own"),
    ros_version=2,
    order=20,
)

VERSION: Literal[8] = (
    8  # of the bag's metadata; 9 spells the quality of service in a way that ROS 2 Humble does not read
)
_STRING = "std_msgs/msg/String"
_READING = 0.9  # of the work; the rest is packing
_BLOCK = 1 << 20
_UNTIL_KNOWN = QosTime(0, 0)  # the default of each duration
_LATCHED = Qos(
    QosHistory.KEEP_LAST,
    1,
    QosReliability.RELIABLE,
    QosDurability.TRANSIENT_LOCAL,
    _UNTIL_KNOWN,
    _UNTIL_KNOWN,
    QosLiveliness.AUTOMATIC,
    _UNTIL_KNOWN,
    avoid_ros_namespace_conventions=False,
)


def write_ros2_bag(
    recording: Recording, path: Path, *, name: str = "drive", with_own: bool = True, progress: Progress = nothing
) -> Outcome:
    """Writes the zip; the folder in it gets the `name`.

    Raises ExportRefused where nothing can stand in a ROS 2 bag, RecordingUnreadable, OSError.
    """
    if recording.ros_version != 2:
        raise ExportRefused("This drive was recorded from ROS 1: export a ROS 1 bag.")
    outcome = Outcome()
    later = later_messages(recording) if with_own else []
    with tempfile.TemporaryDirectory(prefix=".bag-", dir=path.parent) as folder:
        bag = Path(folder) / (re.sub(r"[^A-Za-z0-9._-]+", "_", name).strip("._")[:100] or "drive")
        writer = Writer(bag, version=VERSION, storage_plugin=StoragePlugin.MCAP)
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            read = raw_messages(recording, progress=lambda part: progress(part * _READING))
            _copy(recording, in_time(read, later), writer, outcome, with_own=with_own)
        if not outcome.entries:
            raise ExportRefused("Nothing in this recording fits a ROS 2 bag.")
        _pack(path, bag, progress)
    explain(recording, later, outcome)
    outcome.notes += [f"{sentence}." for sentence in recording.damage]
    return outcome


def _copy(recording: Recording, messages: Iterable[Raw], writer: Writer, outcome: Outcome, *, with_own: bool) -> None:
    connections: dict[tuple[int, int], Any] = {}  # file and channel → its connection; None: left out
    by_topic: dict[str, tuple[str, Any]] = {}  # a topic has one type in a bag of ROS 2
    left_out: Counter[tuple[str, str]] = Counter()

    def connection_of(channel: Channel, file: FileSource) -> Any:
        type = _STRING if _is_own(channel) else channel.type
        known = by_topic.get(channel.topic)
        if known is not None:
            if known[0] != type:
                raise Undecodable(f"the topic has the type {known[0]} here")
            return known[1]
        added = writer.add_connection(
            channel.topic,
            type,
            typestore=_types(channel, file),
            offered_qos_profiles=[_LATCHED] if channel.is_latched else [],
        )
        by_topic[channel.topic] = (type, added)
        return added

    for raw in messages:
        channel, place = raw.channel, (raw.file, raw.channel.number)
        is_own = _is_own(channel)
        if is_own and not with_own:
            continue
        if place not in connections:
            try:
                if not is_own and channel.encoding not in ("cdr", "json"):
                    raise Undecodable(why_not_decoded(channel.encoding))
                if not is_own and channel.encoding == "json":
                    raise Undecodable(
                        "it was recorded as JSON: its type's definition was unknown, or it did not match it"
                    )
                connections[place] = connection_of(channel, recording.files[raw.file])
            except Undecodable as why:
                connections[place] = None
                left_out[channel.topic, str(why)] += channel.count
        connection = connections[place]
        if connection is not None:
            writer.write(connection, raw.time_ns, _text(raw.data) if is_own else raw.data)
            outcome.entries += 1
    outcome.notes += [
        f"{topic} ({count} messages) is left out: {why}." for (topic, why), count in sorted(left_out.items())
    ]


def _is_own(channel: Channel) -> bool:
    return channel.topic.startswith(OWN) and channel.encoding == "json"


def _types(channel: Channel, file: FileSource) -> Any:
    """A type store with the channel's type. Raises Undecodable."""
    type = _STRING if _is_own(channel) else channel.type
    definitions = distribution(2, file.distro) if _is_own(channel) else definitions_of(channel, 2, file.distro)
    store = get_typestore(Stores.EMPTY)
    try:
        store.register({**times(), **definitions})
        store.generate_msgdef(type, ros_version=2)
        store.hash_rihs01(type)
    except Exception:  # the generators fail in every way there is on what they do not know
        raise Undecodable(f"the definition of {type} is missing or cannot be understood") from None
    return store


def _text(data: bytes) -> bytes:
    """std_msgs/msg/String in little-endian CDR: the encapsulation header, then length with the NUL, letters, NUL."""
    return b"\x00\x01\x00\x00" + struct.pack("<I", len(data) + 1) + data + b"\x00"


def _pack(path: Path, bag: Path, progress: Progress) -> None:
    files = sorted(bag.iterdir())
    whole, done = max(sum(file.stat().st_size for file in files), 1), 0
    with zipfile.ZipFile(path, "w", zipfile.ZIP_STORED, allowZip64=True) as packed:  # its chunks are compressed
        for file in files:
            entry = zipfile.ZipInfo.from_file(file, f"{bag.name}/{file.name}")
            with file.open("rb") as source, packed.open(entry, "w", force_zip64=True) as target:
                while block := source.read(_BLOCK):
                    target.write(block)
                    done += len(block)
                    progress(_READING + (1 - _READING) * done / whole)
            file.unlink()
