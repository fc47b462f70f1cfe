"""Single topics of a file, for what is to be known before it is read: nothing is counted as lost by it.

Types of topics that were recorded without one, from a bridge that names none, are known in this way.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress

from server.judge import shapes
from server.judge.message import Json
from server.recording.read.decode import Decode
from server.recording.read.errors import Undecodable
from server.recording.read.source import Channel, Damage, FileSource


def beforehand(
    source: FileSource, ways: Mapping[int, tuple[str, str, Decode]]
) -> Iterator[tuple[float, str, str, Json]]:
    """Time [s since 1970], topic, type and content of the messages of some channels, by number: topic, type, decoder.
    What cannot be read is left out; the reading itself names it."""
    try:
        for time_ns, number, raw in source.messages(set(ways), 0, Damage()):
            topic, type, decode = ways[number]
            with suppress(Undecodable):
                yield time_ns / 1e9, topic, type, decode(raw)
    except MemoryError:
        raise
    except Exception:  # a damaged file makes the readers fail in every way there is
        return


def type_of_first(source: FileSource, channel: Channel, decode: Decode) -> str:
    """The type of a channel by the fields of its first message, as live; "": none is known."""
    for _, topic, _, message in beforehand(source, {channel.number: (channel.topic, "", decode)}):
        found = shapes.type_of(message, topic) or shapes.type_by_fields(message)
        return found if source.ros_version == 1 else found.replace("/", "/msg/")
    return ""
