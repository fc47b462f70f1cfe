"""Finds gaps in log times that a later or earlier step of the clock explains: it was set, and set back again.

A gap of some minutes may be silence, or a clock that was set ahead. Where the clock goes back by just as much, the gap
was the clock: a silence that is as long as the step to a second is next to impossible.
"""

from __future__ import annotations

from collections.abc import Collection, Sequence
from dataclasses import dataclass

S = 10**9  # ns
NEAR_NS = S  # a clock that is set by hand and back by a time server is not set by the same to the millisecond
NEAR_PART = 50  # but of a short gap only by so many-th of it
INTERVALS = 4  # a gap is longer than its step by an interval of messages, and a step back is shorter
CERTAIN = 3  # jumps that are not so many times as large as what they may differ by are silences
LONGEST_RUN = 4  # steps that cancel out
MOST_JUMPS = 1000


@dataclass(frozen=True, slots=True)
class Jump:
    """Log times go ahead or back from one message to the next."""

    place: int  # of the message behind it
    by_ns: int  # ahead positive
    is_sure: bool  # the clock was set


def returned(jumps: Sequence[Jump], interval_ns: int) -> set[int]:
    """Which jumps are of the clock though nothing but another one shows it, as indexes. `interval_ns`: usual one of two
    messages."""
    jumps = jumps[:MOST_JUMPS]
    taken: set[int] = set()
    _take_pairs(jumps, interval_ns, taken, is_sure=True)
    explained = _take_pairs(jumps, interval_ns, taken, is_sure=False)
    for length in range(3, LONGEST_RUN + 1):
        rest = [index for index in range(len(jumps)) if index not in taken]
        for start in range(len(rest) - length + 1):
            run = rest[start : start + length]
            if taken.isdisjoint(run) and _cancels(jumps, run, interval_ns):
                taken.update(run)
                explained.update(run)
    return {index for index in explained if not jumps[index].is_sure}


def _take_pairs(jumps: Sequence[Jump], interval_ns: int, taken: set[int], *, is_sure: bool) -> set[int]:
    """Takes each step back with the jump ahead that is nearest to it in size."""
    backs = [index for index, one in enumerate(jumps) if one.is_sure and one.by_ns < 0 and index not in taken]
    aheads = [index for index, one in enumerate(jumps) if one.is_sure == is_sure and one.by_ns > 0]
    pairs = [(abs(jumps[back].by_ns + jumps[ahead].by_ns), back, ahead) for back in backs for ahead in aheads]
    found: set[int] = set()
    for _, back, ahead in sorted(pairs):
        if taken.isdisjoint((back, ahead)) and _cancels(jumps, (back, ahead), interval_ns):
            taken.update((back, ahead))
            found.update((back, ahead))
    return found


def _cancels(jumps: Sequence[Jump], run: Collection[int], interval_ns: int) -> bool:
    sizes = [jumps[index].by_ns for index in run]
    has_back = any(jumps[index].is_sure and jumps[index].by_ns < 0 for index in run)
    largest_ns = max(map(abs, sizes))
    near_ns = min(NEAR_NS, largest_ns // NEAR_PART) + min(INTERVALS * interval_ns, NEAR_NS)
    return has_back and max(sizes) > 0 and abs(sum(sizes)) <= near_ns and largest_ns >= CERTAIN * near_ns
