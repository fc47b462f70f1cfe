"""Opens one file of a recording, of whatever kind it is."""

from __future__ import annotations

from dataclasses import replace

from server.recording.mcap.mcap_file import McapFile
from server.recording.read import rosbag1_truncated
from server.recording.read.bag2_database import Bag2Database
from server.recording.read.errors import RecordingUnreadable
from server.recording.read.qos import is_latched
from server.recording.read.recognise import Found
from server.recording.read.rosbag1 import Bag1
from server.recording.read.source import FileSource
from server.recording.read.temporary_copy import TemporaryCopy


def open_file(found: Found) -> FileSource:
    """The open file. Raises RecordingUnreadable, MemoryError, and whatever damage makes the readers raise."""
    path = found.path
    if found.kind == "bag":
        return rosbag1_truncated.CutBag1(path) if rosbag1_truncated.is_cut(path) else Bag1(path)
    copy = TemporaryCopy() if found.is_packed else None
    try:
        content, is_whole = copy.unpack(path) if copy is not None else (path, True)
        source: McapFile | Bag2Database
        if found.kind == "mcap":
            source = McapFile(path, content=content, copy=copy)
        elif is_whole:
            source = Bag2Database(path, content=content, copy=copy)
        else:
            raise RecordingUnreadable(f"{path} is not complete: it ends too early")
    except BaseException:
        if copy is not None:
            copy.close()
        raise
    if found.bag is not None:
        latched = {topic for topic, offered in found.bag.qos.items() if is_latched(offered)}
        source.is_listed = True
        source.distro = source.distro or found.bag.distro
        source.channels = [
            replace(channel, is_latched=True) if channel.topic in latched else channel for channel in source.channels
        ]
    return source
