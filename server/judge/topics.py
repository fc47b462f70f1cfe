"""Which topic of a car fills which signal."""

from __future__ import annotations

from collections.abc import Collection, Mapping
from dataclasses import dataclass, replace

from server.judge.signals import TOPICS
from server.judge.topic import Decode, Topic
from server.protocol.answers import TopicOffer

COMMAND = "command"
BY_SIGNAL = {topic.signal: topic for topic in TOPICS}


def plain_type(ros_type: str) -> str:
    """`pkg/msg/Type` and `pkg/Type` alike as `pkg/Type`."""
    return ros_type.replace("/msg/", "/", 1)


def ros_version(types: Mapping[str, str]) -> int | None:
    """1 or 2, by the spelling of the types (topic → type); None: undecided."""
    spellings = [kind for kind in types.values() if "/" in kind]
    if not spellings:
        return None
    return 2 if any("/msg/" in kind for kind in spellings) else 1


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


def candidates(found: Mapping[str, str]) -> dict[str, list[TopicOffer]]:
    """Signal → the topics of a car (topic → type) whose type can be read as that signal, those of the expected type
    first."""
    fitting: dict[str, list[TopicOffer]] = {}
    for row in TOPICS:
        order = list(row.types)
        rows = [
            (order.index(plain_type(kind)), name, kind) for name, kind in found.items() if plain_type(kind) in order
        ]
        fitting[row.signal] = [{"topic": name, "type": kind} for _, name, kind in sorted(rows)]
    return fitting


def map_signals(
    found: Mapping[str, str], chosen: Mapping[str, str] | None = None, unpublished: Collection[str] = ()
) -> dict[str, Source]:
    """Signal → Source for a car's topics (topic → type). `chosen` are the operator's choices, signal → topic.

    `unpublished` are topics that no node publishes. Such a one is not read; it stands for its signal, with a note, only
    where the operator picked it or nothing else could carry the signal. The command topic is kept by its name: the car
    listens there, and others may not have begun to publish.
    """
    lower = {name.lower(): name for name in sorted(found, reverse=True)}
    published = {name: kind for name, kind in found.items() if name not in unpublished}
    lower_published = {key: name for key, name in lower.items() if name in published}
    sources = {}
    for row in TOPICS:
        pick = (chosen or {}).get(row.signal)
        if pick:
            source = _picked(row, pick, found)
        elif row.signal == COMMAND:
            source = _by_name(row, lower, found)
        else:
            source = _by_name(row, lower_published, published) or _by_type(row, published)
            source = source or _by_name(row, lower, found) or _by_type(row, found)
        if source is not None:
            sources[row.signal] = _unread(source) if source.topic in unpublished else source
    return sources


def could_carry(found: Mapping[str, str], chosen: Mapping[str, str] | None = None) -> set[str]:
    """The topics of a car that a signal may be mapped to, now or when their publisher comes."""
    names = {name for row in TOPICS for name in map(str.lower, row.names)}
    kinds = {kind for row in TOPICS for kind in row.by_type}
    picked = set((chosen or {}).values())
    return {
        name for name, kind in found.items() if name in picked or name.lower() in names or plain_type(kind) in kinds
    }


def _unread(source: Source) -> Source:
    return replace(source, decode=None, note="no node publishes it")


def _picked(row: Topic, name: str, found: Mapping[str, str]) -> Source | None:
    if name not in found:
        return None
    return _source(row, name, found[name], note=None)


def _by_name(row: Topic, lower: Mapping[str, str], found: Mapping[str, str]) -> Source | None:
    unreadable: Source | None = None
    for name in row.names:
        here = lower.get(name.lower())
        if here is None:
            continue
        source = _source(row, here, found[here], note=None)
        if source.decode is not None:
            return source
        unreadable = unreadable or source
    return unreadable


def _by_type(row: Topic, found: Mapping[str, str]) -> Source | None:
    names = sorted(name for name, kind in found.items() if plain_type(kind) in row.by_type)
    if not names:
        return None
    note = f"chosen by its type, one of {len(names)}" if len(names) > 1 else "chosen by its type"
    return _source(row, names[0], found[names[0]], note=note)


def _source(row: Topic, name: str, kind: str, *, note: str | None) -> Source:
    plain = plain_type(kind)
    read = row.types.get(plain)
    short, expected = plain.rpartition("/")[2], row.expected_type.rpartition("/")[2]
    if read is None:
        note = f"{plain or 'an unknown type'} cannot be read as this signal"
    elif plain != row.expected_type and note is None:
        note = f"{short}, expected {expected}: reading it as {short}"
    return Source(signal=row.signal, topic=name, type=kind or None, decode=read, note=note)
