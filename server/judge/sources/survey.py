"""Reads parts of a recording before it is judged, as evidence for topics that compete for a signal."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import islice
from typing import Protocol

from server.judge.message import Json
from server.judge.sources.evidence import Evidence

# Where it reads, as parts of the length: a car may stand still at the beginning, for minutes.
PLACES = (0.0, 0.03, 0.1, 0.2, 0.35, 0.5, 0.65, 0.8, 0.95)
WINDOW_S = 15.0
MOST_ROWS = 6000  # of all topics, in one place
MOST_TAKEN = 1000  # of the topics that compete, in one place


Row = tuple[float, str, str, Json]


class Rows(Protocol):
    """Messages with their times, as `server.judge.drive.MessageSource`."""

    start_s: float
    duration_s: float

    def rows(self, start_s: float = 0.0, topics: Collection[str] | None = None) -> Iterator[Row]: ...


def survey(source: Rows, names: Mapping[str, str], evidence: Evidence) -> Evidence:
    """Lets the messages of the topics that the evidence follows count, until they are enough.

    `names`: topic as the recording spells it → as a bridge would.
    """
    followed = evidence.followed
    wanted = frozenset(name for name, offered in names.items() if offered in followed)
    rejected: dict[str, int] = getattr(source, "rejected", {})
    before = dict(rejected)
    for part in PLACES:
        if part and source.duration_s * part < WINDOW_S:
            continue
        if _look(source, source.duration_s * part, names, wanted, evidence):
            break
    rejected.clear()
    rejected.update(before)
    return evidence


def _look(source: Rows, at_s: float, names: Mapping[str, str], wanted: frozenset[str], evidence: Evidence) -> bool:
    """Reads on from one place for a while; whether all is known."""
    end_s = source.start_s + at_s + WINDOW_S
    taken = 0
    for row_s, topic, _, message in islice(_rows(source, at_s, wanted), MOST_ROWS):
        if row_s > end_s or taken >= MOST_TAKEN:
            break
        if topic in wanted:
            taken += 1
            if evidence.receive(names[topic], message, row_s) and evidence.is_enough:
                return True
    return evidence.is_enough


def _rows(source: Rows, at_s: float, wanted: frozenset[str]) -> Iterator[Row]:
    """Messages up to the first unreadable one; the run that judges the recording reports the error."""
    rows = source.rows(at_s, wanted)
    while True:
        try:
            row = next(rows, None)
        except MemoryError:
            raise
        except Exception:  # readers of damaged files fail in every way there is
            return
        if row is None:
            return
        yield row
