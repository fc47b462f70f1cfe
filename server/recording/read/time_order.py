"""The rows of several files in the order of time, whatever the order of the files."""

from __future__ import annotations

import heapq
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, TypeVar

R = TypeVar("R")


@dataclass(frozen=True, slots=True, kw_only=True)
class Stream(Generic[R]):
    """The rows of one file, in order."""

    start_ns: int
    end_ns: int
    rows: Iterable[R]


def in_time_order(streams: Sequence[Stream[R]], time_of: Callable[[R], Any]) -> Iterator[R]:
    """All rows in order. Parts of a split recording follow each other, so that one is read behind the other; only
    files that overlap are merged, which takes longer for each row."""
    for group in _overlapping(streams):
        rows = [stream.rows for stream in group]
        yield from rows[0] if len(rows) == 1 else heapq.merge(*rows, key=time_of)


def _overlapping(streams: Sequence[Stream[R]]) -> list[list[Stream[R]]]:
    groups: list[list[Stream[R]]] = []
    end_ns = 0
    for stream in sorted(streams, key=lambda one: one.start_ns):
        if groups and stream.start_ns <= end_ns:
            groups[-1].append(stream)
            end_ns = max(end_ns, stream.end_ns)
        else:
            groups.append([stream])
            end_ns = stream.end_ns
    return groups
