"""Which messages of a recording are decoded: decoding is most of the work of reading it."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from typing import Any

from server.recording.read.decode import Decode


def sifted(decode: Decode, topic: str, topics: Collection[str] | None) -> Decode:
    """The decoder of a topic's messages where only `topics` are wanted (None: all); what is not is empty.

    With `topics` as a mapping, those are wanted whose bytes hold one of the words of their topic (None: all); the words
    may change while they are read.
    """
    if topics is None:
        return decode
    if topic not in topics:
        return _nothing
    words: Collection[bytes] | None = topics[topic] if isinstance(topics, Mapping) else None
    return decode if words is None else _sifting(decode, words)


def _sifting(decode: Decode, words: Collection[bytes]) -> Decode:
    def decode_some(raw: bytes) -> dict[str, Any]:
        for word in words:
            if word in raw:
                return decode(raw)
        return {}

    return decode_some


def _nothing(raw: bytes) -> dict[str, Any]:
    return {}
