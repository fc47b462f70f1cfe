"""Which topic of a car fills which signal."""

from __future__ import annotations

from collections.abc import Mapping

from server.judge.signals import TOPICS
from server.judge.sources.source import BY_SIGNAL, COMMAND, Source, plain_type
from server.protocol.questions import TopicOffer

__all__ = ["BY_SIGNAL", "COMMAND", "Source", "candidates", "could_carry", "fitness", "plain_type", "ros_version"]


def ros_version(types: Mapping[str, str]) -> int | None:
    """1 or 2, by the spelling of the types (topic → type); None: undecided."""
    spellings = [kind for kind in types.values() if "/" in kind]
    if not spellings:
        return None
    return 2 if any("/msg/" in kind for kind in spellings) else 1


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


def fitness(topic: str, kind: str) -> int:
    """2: a signal is read of a topic's messages, if they are of this type; 1: only where the topic is chosen for it."""
    plain = plain_type(kind)
    rows = [row for row in TOPICS if plain in row.types]
    if any(plain in row.by_type or topic.lower() in map(str.lower, row.names) for row in rows):
        return 2
    return 1 if rows else 0


def could_carry(found: Mapping[str, str], chosen: Mapping[str, str] | None = None) -> set[str]:
    """The topics of a car that a signal may be mapped to, now or when their publisher comes."""
    names = {name for row in TOPICS for name in map(str.lower, row.names)}
    kinds = {kind for row in TOPICS for kind in row.by_type}
    picked = set((chosen or {}).values())
    return {
        name for name, kind in found.items() if name in picked or name.lower() in names or plain_type(kind) in kinds
    }
