"""Finds where the clock of a recorder was set while it recorded, by the log times of messages in the order of receipt.

A clock was set where the log times go back, where they begin before 2000 and jump to now, where they jump by more than
a day, where the stamps of a sensor with a clock of its own show that less time has passed, or where another step takes
the gap back. Every other gap is silence.

A gap of some minutes may be silence, or a clock that was set ahead. Where the clock goes back by just as much, the gap
is a step of the clock: a silence of the same length to a second is very unlikely.
"""

from __future__ import annotations

from collections.abc import Callable, Collection, Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

S = 10**9  # ns
NEAR_NS = S  # a clock that is set by hand and back by a time server is not set by the same to the millisecond
NEAR_PART = 50  # but of a short gap only by so many-th of it
INTERVALS = 4  # a gap is longer than its step by an interval of messages, and a step back is shorter
CERTAIN = 3  # jumps that are not so many times as large as what they may differ by are silences
LONGEST_RUN = 4  # steps that cancel out
MOST_JUMPS = 1000

Ints = NDArray[np.int64]
Flags = NDArray[np.bool_]

BACK_NS = S // 2  # less is the order in which threads of a recorder write
SURE_BACK_NS = S  # and what is less than this may be it: the messages around show which
GAP_NS = 2 * S  # the stamps of longer gaps are compared
LEAP_NS = 86_400 * S  # a longer gap in one file is a clock that was set
FIRST_NS, LAST_NS = 946_684_800 * S, 4_102_444_800 * S  # years 2000 and 2100: of other times a clock was never set
MOST_STEPS = 100
LEAST_A_STEP = 10  # messages on average: of fewer between two steps, the order is no order of receipt
MOST_COMPARED = 50  # gaps whose stamps are compared
MOST_INTERVALS = 10_000
WINDOW = 512  # messages before and behind a step whose interval is evaluated
AROUND = 128  # … whose order is
SURE_RUN = 16  # so many messages in a row are not late by chance
LATE_PART = 2  # messages that are late by so many-th of a step count
UNKNOWN_NS = S // 100  # the interval where too few messages show one
LEAST = 3  # messages from which the clock of a stretch is trusted
PLACES_A_PART = 2**32


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


@dataclass(frozen=True, slots=True)
class Arrivals:
    """Messages in the order of receipt: where each is in its file (`PLACES_A_PART` apart in different parts), its log
    time [ns] and its channel."""

    places: Ints
    times_ns: Ints
    channels: Ints


@dataclass(frozen=True, slots=True, kw_only=True)
class Stretch:
    """Messages between two steps of the clock; the corrected times of two stretches never overlap."""

    place: int  # of the first message
    count: int
    first_ns: int  # by log time
    last_ns: int
    shift_ns: int = 0  # corrected minus log time

    def moved(self, by_ns: int) -> Stretch:
        """The stretch, later by this time."""
        return replace(self, shift_ns=self.shift_ns + by_ns)


# (all, start of the stretch, its first message after a gap) → how far the clock was set ahead there [ns]; None: unknown
Witness = Callable[[Arrivals, int, int], int | None]


class _NotInOrder(Exception):
    """The messages of a file are not in the order of receipt, as behind a tool that wrote topic by topic or in the
    order in which its workers ended."""


@dataclass(frozen=True, slots=True)
class _Cut:
    at: int  # the first message behind the step
    elapsed_ns: int | None = None  # since the latest one before it; None: unknown
    is_leap: bool = False


@dataclass(frozen=True, slots=True)
class Found:
    """What the log times of one file show."""

    stretches: Sequence[Stretch] = ()  # the first with a shift of 0; empty: the clock was not set
    jumps: Sequence[Jump] = ()  # steps, and gaps that may be some
    interval_ns: int = 0  # usual one of two messages


def find_steps(arrivals: Callable[[], Iterator[Arrivals]], witness: Witness, returns: Collection[int] = ()) -> Found:
    """Where the clock was set in one file. `returns`: places behind gaps that another step takes back."""
    if not _has_gaps(arrivals()):
        return Found()
    found = _joined(list(arrivals()))
    search = _Search(found, witness, frozenset(returns))
    try:
        cuts = search.cuts()
    except _NotInOrder:
        return Found()
    stretches = _stretches(found, cuts) if cuts else []
    intervals_ns = np.diff(found.times_ns[:MOST_INTERVALS])
    usual_ns = int(np.median(intervals_ns[intervals_ns >= 0])) if (intervals_ns >= 0).any() else 0
    return Found(stretches, search.jumps, usual_ns)


def corrected_ns(stretches: Sequence[Stretch], places: Any, times_ns: Any) -> Ints:
    """The corrected times of messages at places."""
    starts = np.array([one.place for one in stretches], np.int64)
    shifts = np.array([one.shift_ns for one in stretches], np.int64)
    moved: Ints = times_ns + shifts[np.maximum(np.searchsorted(starts, places, side="right") - 1, 0)]
    return moved


def _has_gaps(parts: Iterator[Arrivals]) -> bool:
    """Whether times go back or leave a gap, in any part or between two."""
    high_ns: int | None = None
    for part in parts:
        times_ns = part.times_ns
        if not len(times_ns):
            continue
        if high_ns is not None:
            times_ns = np.concatenate((np.array([high_ns], np.int64), times_ns))
        highs_ns = np.maximum.accumulate(times_ns)
        steps_ns = times_ns[1:] - highs_ns[:-1]
        if len(steps_ns) and (int(steps_ns.min()) <= -BACK_NS or int(steps_ns.max()) > GAP_NS):
            return True
        high_ns = int(highs_ns[-1])
    return False


def _joined(parts: list[Arrivals]) -> Arrivals:
    return Arrivals(
        places=np.concatenate([part.places for part in parts]),
        times_ns=np.concatenate([part.times_ns for part in parts]),
        channels=np.concatenate([part.channels for part in parts]),
    )


@dataclass(slots=True)
class _Search:
    """For the steps of one file."""

    found: Arrivals
    witness: Witness
    returns: frozenset[int]
    jumps: list[Jump] = field(default_factory=list)
    compared: int = 0

    def cuts(self) -> list[_Cut]:
        """Raises _NotInOrder."""
        cuts: list[_Cut] = []
        begin, is_leap = 0, False
        while len(cuts) < MOST_STEPS and (cut := self._next_cut(begin, is_leap)) is not None:
            cuts.append(cut)
            begin, is_leap = cut.at, cut.is_leap
        steps = [cut for cut in cuts if not cut.is_leap]  # a clock that was never set leaps in no file without order
        if len(steps) >= LEAST and len(steps) * LEAST_A_STEP > len(self.found.times_ns[: steps[-1].at]):
            raise _NotInOrder
        return cuts

    def _next_cut(self, begin: int, is_behind_leap: bool) -> _Cut | None:
        """The first step behind `begin`. `is_behind_leap`: what came before it was earlier by more than a day."""
        found = self.found
        times_ns = found.times_ns[begin:]
        highs_ns = np.maximum.accumulate(times_ns)[:-1]
        steps_ns = times_ns[1:] - highs_ns
        back = _first_back(times_ns, highs_ns, steps_ns, found.channels[begin:], is_behind_leap)
        for index in np.flatnonzero(steps_ns[:back] > GAP_NS):
            gap_ns, high_ns, next_ns = int(steps_ns[index]), int(highs_ns[index]), int(times_ns[index + 1])
            is_leap = gap_ns > LEAP_NS or high_ns < FIRST_NS <= next_ns
            at = begin + int(index) + 1
            elapsed_ns = _elapsed(gap_ns, self._shown(begin, at))
            place = int(found.places[at])
            is_cut = is_leap or elapsed_ns is not None
            self.jumps.append(Jump(place, gap_ns, is_sure=is_cut))
            if is_cut or place in self.returns:
                return _Cut(at, elapsed_ns, is_leap)
        if back is None:
            return None
        at = begin + back + 1
        self.jumps.append(Jump(int(found.places[at]), int(steps_ns[back]), is_sure=True))
        return _Cut(at, _elapsed(int(steps_ns[back]), self._shown(begin, at)))

    def _shown(self, begin: int, at: int) -> int | None:
        self.compared += 1
        return self.witness(self.found, begin, at) if self.compared <= MOST_COMPARED else None


def _elapsed(gap_ns: int, ahead_ns: int | None) -> int | None:
    """What of a gap has passed, where the clock was set ahead by so much; None: that cannot be."""
    if ahead_ns is None or not -BACK_NS <= gap_ns - ahead_ns <= LEAP_NS:
        return None
    return max(gap_ns - ahead_ns, 1)


def _first_back(times_ns: Ints, highs_ns: Ints, steps_ns: Ints, channels: Ints, is_behind_leap: bool) -> int | None:
    """Where the times first go back, as an index of `steps_ns`. Raises _NotInOrder.

    The messages of one channel must do so, too: in a file that was written topic by topic they do not.
    """
    is_back = steps_ns <= -BACK_NS
    if not is_back.any():
        return None
    sure = is_back & (times_ns[1:] < FIRST_NS) & (highs_ns >= FIRST_NS)
    if is_behind_leap:
        sure |= steps_ns < -LEAP_NS
    sure |= is_back & _goes_back(times_ns, channels)[1:]
    edges = np.flatnonzero(np.diff(np.concatenate(([False], is_back, [False]))))
    for start, end in zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True):
        if sure[start:end].any():
            is_sure = steps_ns[start:end].min() <= -SURE_BACK_NS or end - start >= SURE_RUN
            if is_sure or _goes_on_from(start + 1, times_ns, channels, int(highs_ns[start])):
                return int(start)
            continue
        if len(np.unique(channels[start + 1 : end + 1])) < end - start:
            raise _NotInOrder
    return None


def _goes_on_from(at: int, times_ns: Ints, channels: Ints, high_ns: int) -> bool:
    """Whether the clock goes on from the time of this message, which is before the latest one until then: not where the
    next message has the earlier clock again, nor where the messages of a channel are in no order around it."""
    around = slice(max(at - AROUND, 0), at), slice(at, at + AROUND)
    late_ns = (high_ns - int(times_ns[at])) // LATE_PART
    if sum(_late_ones(times_ns[side], channels[side], late_ns) for side in around) >= LEAST:
        return False
    usual_ns = int(np.median(np.diff(np.sort(times_ns[around[0]])))) if at > 1 else 0
    next_ns = int(times_ns[min(at + 1, len(times_ns) - 1)])
    return next_ns < high_ns or next_ns - int(times_ns[at]) <= 2 * usual_ns


def _late_ones(times_ns: Ints, channels: Ints, late_ns: int) -> int:
    """How many messages are earlier than the one of their channel before them, by this or more."""
    order = np.argsort(channels, kind="stable")
    is_same = np.diff(channels[order]) == 0
    return int(np.count_nonzero(is_same & (np.diff(times_ns[order]) <= -late_ns)))


def _goes_back(times_ns: Ints, channels: Ints) -> Flags:
    """Which messages are earlier than one of their own channel before them."""
    order = np.argsort(channels, kind="stable")
    bounds = np.flatnonzero(np.diff(channels[order])) + 1
    flags = np.zeros(len(times_ns), np.bool_)
    for group in np.split(order, bounds):
        own_ns = times_ns[group]
        flags[group[1:]] = np.maximum.accumulate(own_ns)[:-1] - own_ns[1:] >= BACK_NS
    return flags


def _stretches(found: Arrivals, cuts: Sequence[_Cut]) -> list[Stretch]:
    starts = [0, *(cut.at for cut in cuts)]
    ends = [*starts[1:], len(found.times_ns)]
    stretches: list[Stretch] = []
    for number, (start, end) in enumerate(zip(starts, ends, strict=True)):
        times_ns = found.times_ns[start:end]
        one = Stretch(
            place=int(found.places[start]),
            count=end - start,
            first_ns=int(times_ns.min()),
            last_ns=int(times_ns.max()),
        )
        if stretches:
            before, elapsed_ns = stretches[-1], cuts[number - 1].elapsed_ns
            if elapsed_ns is None:
                change_ns = _usual_change(found, starts[number - 1], start, end)
            else:
                change_ns = before.last_ns + elapsed_ns - int(times_ns[0])
            one = follows(before, one, change_ns)
        stretches.append(one)
    return stretches


def follows(before: Stretch, one: Stretch, change_ns: int) -> Stretch:
    """A stretch whose shift differs by `change_ns` from that of the one before it, or by more where it overlapped."""
    least_ns = before.last_ns + 1 - one.first_ns
    return one.moved(before.shift_ns + max(change_ns, least_ns))


def _usual_change(found: Arrivals, start: int, at: int, end: int) -> int:
    """The change of the shift with which the most frequent channel continues at its usual interval."""
    start, end = max(start, at - WINDOW), min(end, at + WINDOW)
    before, after = slice(start, at), slice(at, end)
    best: tuple[int, int] | None = None
    for channel in np.intersect1d(found.channels[before], found.channels[after]):
        ends = found.times_ns[before][found.channels[before] == channel]
        begins = found.times_ns[after][found.channels[after] == channel]
        intervals_ns = np.concatenate((np.diff(ends), np.diff(begins)))
        if len(intervals_ns) >= LEAST - 1 and (interval_ns := int(np.median(intervals_ns))) > 0:
            best = min(best or (interval_ns + 1, 0), (interval_ns, int(ends[-1]) + interval_ns - int(begins[0])))
    return best[1] if best is not None else int(found.times_ns[before].max()) + UNKNOWN_NS - int(found.times_ns[at])
