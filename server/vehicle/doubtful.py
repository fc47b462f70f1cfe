"""Messages without a stamp of which only the bridge's next answers show whether they are new and are recorded.

A subscription is given what a publisher keeps, at once. A message like the newest one that comes after a renewal may be
that sample, or one that was published with the same content. It is therefore held, and the topic subscribed to once
more, without an end between: what a publisher keeps is given each time, what it published is not. A topic that goes on,
or that sends a few messages in a row, gives what looks like an answer too. The next probes therefore follow a silence,
each a longer one: a message in the silence, or none after it, and all that is held is recorded, with its delay. No
interval fits both silences. What passed is dropped only after a while in which nothing new comes.

Pure: time is an argument, on a monotonic clock in seconds.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from typing import Any

ANSWERED_WITHIN_S = 0.3  # and a round trip: of what comes later it is not known whether the subscription gave it
SILENCES = (0, 2, 4)  # before each probe, in times of that; so many answers show that a sample is kept
SETTLED_AFTER_S = 5.0  # without something new
QUIET_PERIODS = 5  # a topic that is silent for so long does not continue
GOES_ON_S = 0.5  # another content that comes so soon after the answers is of a topic that continues
MOST_HELD, MOST_HELD_BYTES = 500, 8_000_000


def may_be_kept(period_s: float | None, silent_s: float, within_s: float = ANSWERED_WITHIN_S) -> bool:
    """Whether a repeat may be what a publisher keeps, and not the next message of a topic that is too fast for that.

    `period_s`: its usual interval, None: not known; `silent_s`: since its newest message; `within_s`: in which an
    answer comes.
    """
    if not period_s or silent_s >= max(QUIET_PERIODS * period_s, SETTLED_AFTER_S):
        return True
    return period_s > within_s


@dataclass(frozen=True, slots=True)
class Held:
    """A message, parsed or as RawFrame, of `size` bytes."""

    message: Any
    size: int
    at_s: float
    first_s: float  # when the same message came first


@dataclass(slots=True)
class _Doubt:
    held: list[Held]
    last_s: float
    probed_s: float  # the newest subscription that is to be answered
    within_s: float  # in which an answer comes
    probe_at_s: float | None = None  # when the silence before the next probe is over
    answers: int = 0
    is_kept: bool = False  # it had its answers: what is held is dropped, if nothing new comes

    def is_awaited(self, at_s: float) -> bool:
        return at_s - self.probed_s <= self.within_s

    def hold(self, one: Held, within_s: float) -> None:
        """An answer to the newest probe, or, in a silence, to a subscription that had another reason: that one proves
        nothing, and the silence begins anew."""
        self.within_s, self.last_s = within_s, one.at_s
        self.held.append(one)
        if self.probe_at_s is None:
            self.answers += 1
        self.is_kept = self.is_kept or self.answers >= len(SILENCES)
        self.probe_at_s = None if self.is_kept else one.at_s + SILENCES[self.answers] * within_s


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
        if doubt is None:
            return
        if doubt.probe_at_s is None:
            doubt.probed_s = at_s
        elif at_s >= doubt.probe_at_s:
            doubt.probed_s, doubt.probe_at_s = at_s, None

    def came(self, topic: str, one: Held, *, may_be_kept: bool, within_s: float = ANSWERED_WITHIN_S) -> Verdict:
        """A message of which it is not known whether it is new: no more of them come than there were subscriptions."""
        doubt = self._doubts.get(topic)
        if doubt is None:
            if not may_be_kept or len(self._doubts) >= MOST_HELD or self._is_full(one.size):
                return Verdict(record=(one,))
            self._doubts[topic] = _Doubt([one], one.at_s, one.at_s, within_s)
            self._bytes += one.size
            return Verdict(probes=True)
        in_time = doubt.is_kept or doubt.probe_at_s is not None or doubt.is_awaited(one.at_s)
        if self._is_full(one.size) or not in_time:
            return Verdict(record=(*self.settled(topic), one))
        doubt.hold(one, within_s)
        self._bytes += one.size
        return Verdict()

    def to_probe(self, now_s: float) -> list[str]:
        """Topics that were silent for long enough and are to be subscribed to once more."""
        return [
            topic for topic, doubt in self._doubts.items() if doubt.probe_at_s is not None and now_s >= doubt.probe_at_s
        ]

    def came_new(self, topic: str, one: Held, is_same: Callable[[Any, Any], bool]) -> tuple[Held, ...]:
        """What is held of a topic and to be recorded, once: something new came of it. Another content, long after the
        answers, is no evidence about those."""
        doubt, held = self._doubts.get(topic), self.settled(topic)
        if doubt is None or not doubt.is_kept:
            return held
        goes_on = one.at_s - held[-1].at_s <= GOES_ON_S
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
                doubt.is_kept, doubt.probe_at_s = False, None
            if doubt.held and not doubt.is_kept:
                if doubt.probe_at_s is None and not doubt.is_awaited(now_s):
                    yield topic, self._given_up(doubt)
            elif now_s - doubt.last_s > SETTLED_AFTER_S and self.settled(topic):
                yield topic, ()

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
