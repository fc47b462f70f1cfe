"""Messages without a stamp of which only the bridge's next answer shows whether they are new and are recorded.

A subscription is given what a publisher keeps, at once. A message like the newest one that comes after a renewal may be
that sample, or one that was published with the same content. It is therefore held, and the topic subscribed to once
more: what a publisher keeps is given each time, what it published is not. Without such an answer the message is
recorded late, with its delay: no message is lost, and a kept sample is recorded once.

Pure: time is an argument, on a monotonic clock in seconds.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

ANSWERED_WITHIN_S = 0.3  # of what comes later it is not known whether the subscription gave it
UNANSWERED_AFTER_S = 5.0
LEAST_ANSWERS, MOST_ANSWERS = 2, 6
CHANCE = 0.01  # that so many answers are new messages of a topic that goes on
QUIET_PERIODS = 5  # a topic that is silent for so long does not go on
MOST_HELD, MOST_HELD_BYTES = 500, 8_000_000


def answers_needed(period_s: float | None, silent_s: float) -> int | None:
    """How many answers prove that a publisher keeps its sample; None: the topic is too fast to tell.

    `period_s`: its usual interval, None: not known; `silent_s`: since its newest message.
    """
    if period_s is None or silent_s >= QUIET_PERIODS * period_s:
        return LEAST_ANSWERS
    by_chance = ANSWERED_WITHIN_S / max(period_s, ANSWERED_WITHIN_S / 2)
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


@dataclass(slots=True)
class _Doubt:
    needed: int
    held: list[Held]
    answers: int = 0
    probed_s: float = -math.inf


@dataclass(frozen=True, slots=True)
class Verdict:
    """What follows from one more message: which are to be recorded, and whether the topic is to be subscribed to."""

    record: tuple[Held, ...] = ()
    probes: bool = False
    is_kept: bool = False  # it is a sample that its publisher keeps


@dataclass(slots=True)
class Doubtful:
    """Of one car."""

    _doubts: dict[str, _Doubt] = field(default_factory=dict)
    _bytes: int = 0

    def came(self, topic: str, one: Held, needed: int | None) -> Verdict:
        """A message of which it is not known whether it is new. `needed`: as `answers_needed` gives it."""
        doubt = self._doubts.get(topic)
        if doubt is None and (needed is None or self._is_full(one.size)):
            return Verdict(record=(one,))
        if doubt is None:
            doubt = self._doubts[topic] = _Doubt(needed or LEAST_ANSWERS, [])
        elif one.at_s - doubt.probed_s > ANSWERED_WITHIN_S:
            return Verdict(record=(*self.settled(topic), one))
        else:
            doubt.answers += 1
        if doubt.answers >= doubt.needed:
            self.settled(topic)
            return Verdict(is_kept=True)
        doubt.held.append(one)
        doubt.probed_s = one.at_s
        self._bytes += one.size
        return Verdict(probes=True)

    def settled(self, topic: str) -> tuple[Held, ...]:
        """What is held of a topic, once: something new came of it, or it cannot be subscribed to again."""
        doubt = self._doubts.pop(topic, None)
        if doubt is None:
            return ()
        self._bytes -= sum(one.size for one in doubt.held)
        return tuple(doubt.held)

    def overdue(self, now_s: float) -> Iterator[tuple[str, Held]]:
        """What was not given again."""
        for topic in [one for one, doubt in self._doubts.items() if now_s - doubt.probed_s > UNANSWERED_AFTER_S]:
            yield from ((topic, one) for one in self.settled(topic))

    def all(self) -> Iterator[tuple[str, Held]]:
        """What is held, once: a part of the recording ends."""
        for topic in list(self._doubts):
            yield from ((topic, one) for one in self.settled(topic))

    def _is_full(self, size: int) -> bool:
        return len(self._doubts) >= MOST_HELD or self._bytes + size > MOST_HELD_BYTES
