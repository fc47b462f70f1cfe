"""Messages without a stamp of which only the bridge's next answer shows whether they are new and are recorded.

A subscription is given what a publisher keeps, at once. A message like the newest one that comes after a renewal may be
that sample, or one that was published with the same content. It is therefore held, and the topic subscribed to once
more, without an end between: what a publisher keeps is given each time, what it published is not. Without such an
answer in time the message is recorded, with its delay. With enough of them it is dropped only after a while without a
new message: a topic that goes on gives what looks like answers. No message is lost, and a kept sample is recorded once
where nothing new comes.

Pure: time is an argument, on a monotonic clock in seconds.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

ANSWERED_WITHIN_S = 0.3  # and a round trip: of what comes later it is not known whether the subscription gave it
SETTLED_AFTER_S = 5.0  # without an answer, or without something new
LEAST_ANSWERS, MOST_ANSWERS = 2, 6
CHANCE = 0.01  # that so many answers are new messages of a topic that goes on
QUIET_PERIODS = 5  # a topic that is silent for so long does not go on
GOES_ON, GOES_ON_S = 5, 0.5  # intervals: what comes later is not of a topic whose messages look like answers
MOST_HELD, MOST_HELD_BYTES = 500, 8_000_000


def answers_needed(period_s: float | None, silent_s: float, within_s: float = ANSWERED_WITHIN_S) -> int | None:
    """How many answers prove that a publisher keeps its sample; None: the topic is too fast to tell.

    `period_s`: its usual interval, None: not known; `silent_s`: since its newest message; `within_s`: in which an
    answer comes.
    """
    if not period_s or silent_s >= max(QUIET_PERIODS * period_s, SETTLED_AFTER_S):
        return LEAST_ANSWERS
    by_chance = within_s / max(period_s, within_s / 2)
    if by_chance >= 1.0:
        return None
    needed = math.ceil(math.log(CHANCE) / math.log(by_chance))
    return max(LEAST_ANSWERS, needed) if needed <= MOST_ANSWERS else None


@dataclass(frozen=True, slots=True)
class Held:
    """A message, parsed or as RawFrame, of `size` bytes."""

    message: Any
    size: int
    at_s: float
    first_s: float  # when the same message came first


@dataclass(slots=True)
class _Doubt:
    needed: int
    held: list[Held]
    last_s: float
    within_s: float  # in which an answer comes
    answers: int = 0
    probed_s: float = -math.inf
    is_kept: bool = False  # it had its answers: what is held is dropped, if nothing new comes


@dataclass(frozen=True, slots=True)
class Verdict:
    """What follows from one more message: which are to be recorded, and whether the topic is to be subscribed to."""

    record: tuple[Held, ...] = ()
    probes: bool = False


@dataclass(slots=True)
class Doubtful:
    """Of one car."""

    _doubts: dict[str, _Doubt] = field(default_factory=dict)
    _bytes: int = 0

    def subscribed(self, topic: str, at_s: float) -> None:
        """A subscription to a topic was sent."""
        doubt = self._doubts.get(topic)
        if doubt is not None:
            doubt.probed_s = at_s

    def came(self, topic: str, one: Held, needed: int | None, within_s: float = ANSWERED_WITHIN_S) -> Verdict:
        """A message of which it is not known whether it is new. `needed`: as `answers_needed` gives it."""
        doubt = self._doubts.get(topic)
        if doubt is None:
            if needed is None or len(self._doubts) >= MOST_HELD or self._is_full(one.size):
                return Verdict(record=(one,))
            doubt = self._doubts[topic] = _Doubt(needed, [], one.at_s, within_s)
        elif self._is_full(one.size) or not (doubt.is_kept or one.at_s - doubt.probed_s <= within_s):
            return Verdict(record=(*self.settled(topic), one))
        else:
            doubt.answers += 1
        doubt.held.append(one)
        doubt.probed_s = doubt.last_s = one.at_s
        doubt.within_s = within_s
        doubt.is_kept = doubt.is_kept or doubt.answers >= doubt.needed
        self._bytes += one.size
        return Verdict(probes=not doubt.is_kept)

    def came_new(self, topic: str, one: Held, is_same: Callable[[Any, Any], bool]) -> tuple[Held, ...]:
        """What is held of a topic and to be recorded, once: something new came of it. Another content, long after the
        answers, says nothing of those."""
        doubt, held = self._doubts.get(topic), self.settled(topic)
        if doubt is None or not doubt.is_kept:
            return held
        interval_s = max((later.at_s - sooner.at_s for sooner, later in pairwise(held)), default=0.0)
        goes_on = one.at_s - held[-1].at_s <= max(GOES_ON * interval_s, GOES_ON_S)
        return held if goes_on or is_same(held[0].message, one.message) else ()

    def settled(self, topic: str) -> tuple[Held, ...]:
        """What is held of a topic, once."""
        doubt = self._doubts.pop(topic, None)
        if doubt is None:
            return ()
        self._bytes -= sum(one.size for one in doubt.held)
        return tuple(doubt.held)

    def overdue(self, now_s: float, *, is_heard: bool) -> Iterator[tuple[str, tuple[Held, ...]]]:
        """Topics that were not given again, or of which nothing new came, and what of each is to be recorded; none of
        it: its publisher keeps its sample. `is_heard`: something new could have come."""
        for topic, doubt in list(self._doubts.items()):
            if not is_heard:
                doubt.is_kept = False
            if now_s - doubt.last_s > SETTLED_AFTER_S:
                held = self.settled(topic)
                if held:
                    yield topic, () if doubt.is_kept else held
            elif doubt.held and not doubt.is_kept and now_s - doubt.probed_s > doubt.within_s:
                yield topic, self._given_up(doubt)

    def _given_up(self, doubt: _Doubt) -> tuple[Held, ...]:
        """What is held without an answer in time. The doubt stays: a late answer must not begin another one."""
        held, doubt.held, doubt.answers = tuple(doubt.held), [], 0
        self._bytes -= sum(one.size for one in held)
        return held

    def all(self) -> Iterator[tuple[str, Held]]:
        """What is held and to be recorded, once: a part of the recording ends."""
        for topic, doubt in list(self._doubts.items()):
            held = self.settled(topic)
            yield from ((topic, one) for one in held if not doubt.is_kept)

    def _is_full(self, size: int) -> bool:
        return self._bytes + size > MOST_HELD_BYTES
