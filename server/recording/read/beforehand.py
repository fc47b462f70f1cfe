"""Single topics of a file, for what is to be known before it is read: nothing is counted as lost by it."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import suppress

from server.judge.message import Json
from server.recording.read.decode import Decode
from server.recording.read.errors import Undecodable
from server.recording.read.source import Damage, FileSource


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
