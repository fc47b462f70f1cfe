"""Types of topics that were recorded without one, from a bridge that names none."""

from __future__ import annotations

from server.judge import shapes
from server.recording.read.beforehand import beforehand
from server.recording.read.decode import Decode
from server.recording.read.source import Channel, FileSource


def type_of_first(source: FileSource, channel: Channel, decode: Decode) -> str:
    """The type of a channel by the fields of its first message, as live; "": none is known."""
    for _, topic, _, message in beforehand(source, {channel.number: (channel.topic, "", decode)}):
        found = shapes.type_of(message, topic) or shapes.type_by_fields(message)
        return found if source.ros_version == 1 else found.replace("/", "/msg/")
    return ""
