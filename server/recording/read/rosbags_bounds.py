"""Bounds the rosbags library for files from elsewhere.

The library bounds neither what it unpacks nor what it reads as YAML. It has no options for that, so its own functions
are replaced here. What a bag of ROS 2 says of quality of service and cannot be read within bounds is not known.
"""

from __future__ import annotations

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from functools import lru_cache
from pathlib import Path
from typing import Any, BinaryIO

import zstandard
from rosbags.rosbag2 import reader, storage_mcap, storage_sqlite3
from rosbags.rosbag2.metadata import parse_qos
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError
from ruamel.yaml.events import AliasEvent, CollectionEndEvent, CollectionStartEvent

from server.recording import space
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.unpack import unpack, unpack_message

MOST_METADATA = 2 << 20  # bytes of metadata.yaml: a thousand topics
MOST_QOS = 64 << 10  # letters of the quality of service of one topic
DEEPEST = 30
MOST_ENTRIES = 100_000
LEAVE_FREE = 1 << 30  # bytes of the disk with the temporary files
LOOK_EVERY = 32 << 20  # bytes unpacked between two checks of the disk


def install() -> None:
    """Puts the bounds into the library. May be called again."""
    module: Any
    for module in (reader, storage_mcap, storage_sqlite3):
        module.parse_qos = _bounded_qos
    storage_mcap.DECOMPRESSORS.update(
        lz4=lambda packed, size: unpack("lz4", packed, size), zstd=lambda packed, size: unpack("zstd", packed, size)
    )
    module = reader
    module.zstd = _Zstd


def demand_plain(metadata: Path) -> None:
    """Raises RecordingUnreadable where metadata.yaml is not what a recorder of ROS 2 writes: short, flat, without
    references."""
    if metadata.stat().st_size > MOST_METADATA:
        raise RecordingUnreadable(f"{metadata} cannot be read: it is larger than {MOST_METADATA >> 20} MB")
    why = _why_not_plain(metadata.read_text(encoding="utf-8", errors="replace"))
    if why:
        raise RecordingUnreadable(f"{metadata} cannot be read: {why}")


@lru_cache(maxsize=64)  # topics have a few kinds of quality of service
def _why_not_plain(text: str) -> str | None:
    depth = 0
    try:
        for count, event in enumerate(YAML(typ="safe", pure=True).parse(text)):
            if isinstance(event, AliasEvent):
                return "it refers to parts of itself"
            depth += isinstance(event, CollectionStartEvent) - isinstance(event, CollectionEndEvent)
            if depth > DEEPEST:
                return "it is nested too deeply"
            if count > MOST_ENTRIES:
                return f"it has more than {MOST_ENTRIES} entries"
    except RecursionError:
        return "it is nested too deeply"
    except (YAMLError, ValueError):
        return None  # it is not YAML: the library raises
    return None


def _bounded_qos(said: Any) -> list[Any]:
    if isinstance(said, str) and (len(said) > MOST_QOS or _why_not_plain(said) is not None):
        return []
    return parse_qos(said)


class _Zstd:
    """What the library's reader of folders takes of its module for zstd."""

    decompress = staticmethod(unpack_message)

    @staticmethod
    @contextmanager
    def open(packed: BinaryIO, _mode: str) -> Iterator[_OntoDisk]:
        with zstandard.ZstdDecompressor().stream_reader(packed, read_across_frames=True) as stream:
            yield _OntoDisk(stream)


class _OntoDisk:
    """A file that is unpacked beside the temporary files, as long as they have room."""

    def __init__(self, stream: Any) -> None:
        self._stream = stream
        self._look_in = 0
        self._leave_free = max(LEAVE_FREE, space.free_at(Path(tempfile.gettempdir())) // 2)  # others record meanwhile

    def read(self, size: int) -> bytes:
        data = bytes(self._stream.read(size))
        self._look_in -= len(data)
        if self._look_in < 0:
            self._look_in = LOOK_EVERY
            free = space.free_at(Path(tempfile.gettempdir()))
            if free < self._leave_free:
                raise RecordingUnreadable(
                    f"a file of this recording, unpacked, does not fit on the disk: {space.amount(free)} are free"
                )
        return data
