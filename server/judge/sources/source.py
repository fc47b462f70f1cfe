"""The topic that carries a signal, as the car spells it, and how its messages are decoded."""

from __future__ import annotations

from dataclasses import dataclass, replace

from server.judge.signals import TOPICS
from server.judge.topic import Decode, Topic

COMMAND = "command"
BY_SIGNAL = {topic.signal: topic for topic in TOPICS}


@dataclass(frozen=True, slots=True, kw_only=True)
class Source:
    """The topic that fills a signal in this car."""

    signal: str
    topic: str  # as the car spells it
    type: str | None  # as the bridge spells it; None: not known
    decode: Decode | None  # None: known by name, but of a type that cannot be read
    note: str | None = None  # what the operator should know of the choice
    why: str | None = None  # what decided for this topic
    carries: bool = True  # False: a further candidate, watched to compare it with the source of the signal


def plain_type(ros_type: str) -> str:
    """`pkg/msg/Type` and `pkg/Type` alike as `pkg/Type`."""
    return ros_type.replace("/msg/", "/", 1)


def source_of(row: Topic, name: str, kind: str, *, why: str, is_by_type: bool = False) -> Source:
    """A topic as the source of a signal; without a decoder where its type cannot be read. `is_by_type`: another type
    than the usual one is no surprise."""
    plain = plain_type(kind)
    read = row.types.get(plain)
    note = None
    if read is None:
        note = f"{plain or 'an unknown type'} cannot be read as this signal"
    elif plain != row.expected_type and not is_by_type:
        short, expected = plain.rpartition("/")[2], row.expected_type.rpartition("/")[2]
        note = f"{short}, expected {expected}: reading it as {short}"
    return Source(signal=row.signal, topic=name, type=kind or None, decode=read, note=note, why=why)


def unread(source: Source) -> Source:
    """A source that stands for its signal and is not read, because no node publishes it."""
    return replace(source, decode=None, note="no node publishes it")
