"""Looks into a recording before it is judged: what its messages show of topics that compete for a signal."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from typing import Any, Protocol

from server.judge.message import Json
from server.judge.sources.evidence import Evidence

# Where it looks, as parts of the length: a car may stand still at the beginning, for minutes.
PLACES = (0.0, 0.03, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)
WINDOW_S = 15.0
MOST_ROWS = 6000  # of all topics, in one place
MOST_TAKEN = 1000  # of the topics that compete, in one place


class Rows(Protocol):
    """Messages with their times, as `server.judge.drive.MessageSource`."""

    start_s: float
    duration_s: float

    def rows(
        self, start_s: float = 0.0, topics: Collection[str] | None = None
    ) -> Iterator[tuple[float, str, str, Json]]: ...


def survey(source: Rows, names: Mapping[str, str], topics: Mapping[str, str], silent: Collection[str]) -> Evidence:
    """What the messages of `topics` (topic → type, as a bridge would offer them) show; it ends as soon as that decides.

    `names`: topic as the recording spells it → as a bridge would. `silent`: topics without any message.
    """
    evidence = Evidence()
    evidence.silent = frozenset(silent)
    evidence.follow(topics)
    wanted = frozenset(name for name, offered in names.items() if offered in topics)
    rejected: dict[str, int] = getattr(source, "rejected", {})
    before = dict(rejected)
    try:
        for place in PLACES:
            if place and source.duration_s * place < WINDOW_S:
                continue
            if _look(source, source.duration_s * place, names, wanted, evidence):
                break
    except MemoryError:
        raise
    except Exception:  # whoever judges the recording comes to the same place, and says what is wrong with it
        pass
    rejected.clear()
    rejected.update(before)
    return evidence


def _look(source: Rows, at_s: float, names: Mapping[str, str], wanted: frozenset[str], evidence: Evidence) -> bool:
    """Reads on from one place for a while; whether all is known."""
    end_s = source.start_s + at_s + WINDOW_S
    taken = 0
    rows: Any = source.rows(at_s, wanted)
    try:
        for number, (row_s, topic, _, message) in enumerate(rows):
            if row_s > end_s or number > MOST_ROWS or taken > MOST_TAKEN:
                return False
            if topic in wanted:
                taken += 1
                if evidence.receive(names[topic], message, row_s) and evidence.is_enough:
                    return True
    finally:
        close = getattr(rows, "close", None)
        if close is not None:
            close()
    return evidence.is_enough
