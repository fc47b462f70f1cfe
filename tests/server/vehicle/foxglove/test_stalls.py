"""A modelled server behind a radio with gaps: nothing is ever taken for newer than it is.

As that of foxglove-sdk, the server keeps the messages of all topics in one queue, and answers a ping at once: the
answer goes before what is in the queue, and behind what the system has taken. A gap stops both directions.
"""

from __future__ import annotations

import random
from collections import deque
from dataclasses import dataclass, field

import pytest

from server.vehicle.foxglove.delay import Delay

STEP_S = 0.005
PING_EVERY_S = 0.1
PONG_BYTES = 10
AHEAD_S = 1000.0  # the server's clock before ours
HEALTHY_BPS = 2_000_000.0


@dataclass(slots=True)
class Topic:
    period_s: float
    size: int
    due_s: float = 0.0


@dataclass(slots=True)
class Marks:
    """The newest ping that is known to lie behind."""

    newest_s: float = 0.0

    def open(self, at_s: float) -> None: ...
    def took(self, size: int) -> None: ...
    def sent(self, at_s: float) -> None: ...
    def subscribe(self, topic: str, queue_length: int, throttle_s: float = 0.0) -> None: ...

    def answered(self, sent_s: float, at_s: float) -> None:
        self.newest_s = max(self.newest_s, sent_s)


@dataclass(slots=True)
class Sent:
    """Held by the system: the answer to a ping, or the message of a topic that entered the queue then."""

    bytes_left: float
    at_s: float
    topic: int | None = None


@dataclass
class Model:
    """`gaps`: from when to when nothing passes; `slow`: from when on so few bytes a second pass."""

    topics: list[Topic]
    gaps: list[tuple[float, float]]
    slow: tuple[float, float]
    holds_bytes: int  # what the system takes at a time
    most_queued: int
    now_s: float = 0.0
    ages: list[tuple[float, float, float]] = field(default_factory=list)  # when it came, shown, true

    def __post_init__(self) -> None:
        self._marks = Marks()
        self._delay = Delay(self._marks, lambda: self.now_s)
        self._delay.opened()
        self._queue: deque[tuple[int, float]] = deque(maxlen=self.most_queued)
        self._system: deque[Sent] = deque()
        self._pings: list[float] = []
        for number in range(len(self.topics)):
            self._delay.subscribed(f"/{number}", number)

    def run(self, until_s: float) -> list[tuple[float, float, float]]:
        for step in range(1, round(until_s / STEP_S)):
            self.now_s = step * STEP_S
            if step % round(PING_EVERY_S / STEP_S) == 0:
                self._delay.ping_sent(self.now_s)
                self._pings.append(self.now_s)
            for number, topic in enumerate(self.topics):
                if self.now_s >= topic.due_s:
                    topic.due_s = self.now_s + topic.period_s
                    self._queue.append((number, self.now_s))
            if not any(begin_s <= self.now_s < end_s for begin_s, end_s in self.gaps):
                self._pass()
        return self.ages

    def _pass(self) -> None:
        since_s, rate_Bps = self.slow
        room = (rate_Bps if self.now_s >= since_s else HEALTHY_BPS) * STEP_S
        self._system.extend(Sent(PONG_BYTES, sent_s) for sent_s in self._pings)
        self._pings.clear()
        self._write()
        while self._system and room > 0.0:
            first = self._system[0]
            taken = min(room, first.bytes_left)
            room, first.bytes_left = room - taken, first.bytes_left - taken
            if first.bytes_left <= 0.0:
                self._came(self._system.popleft())
        self._write()

    def _write(self) -> None:
        while self._queue and sum(one.bytes_left for one in self._system) < self.holds_bytes:
            number, entered_s = self._queue.popleft()
            self._system.append(Sent(self.topics[number].size, entered_s, number))

    def _came(self, one: Sent) -> None:
        self.now_s += 1e-6  # one after the other
        if one.topic is None:
            self._delay.pong(one.at_s, is_in_message=False)
            return
        self._delay.message(one.topic, round((one.at_s + AHEAD_S) * 1e9))
        self.ages.append((self.now_s, self.now_s - self._marks.newest_s, self.now_s - one.at_s))


def too_young(ages: list[tuple[float, float, float]]) -> float:
    """The most that an age was shown below what it was [s]."""
    return max(true_s - shown_s for _, shown_s, true_s in ages)


@pytest.mark.parametrize("seed", range(20))
def test_no_message_is_taken_for_newer_than_it_is_in_a_radio_with_gaps(seed: int) -> None:
    dice = random.Random(seed)
    topics = [Topic(0.05, 400), Topic(dice.choice([0.1, 1.0]), dice.choice([3_000, 60_000]))]
    gaps = [(at_s, at_s + dice.uniform(0.2, 1.4)) for at_s in (dice.uniform(2.0, 30.0) for _ in range(8))]
    slow = (dice.uniform(2.0, 10.0), dice.choice([4_000.0, 40_000.0, HEALTHY_BPS]))
    model = Model(topics, gaps, slow, holds_bytes=dice.choice([500, 20_000]), most_queued=dice.choice([20, 1024]))
    ages = model.run(35.0)
    assert len(ages) > 50
    assert too_young(ages) <= 0.0


def test_a_large_message_that_needs_seconds_is_no_silence() -> None:
    topics = [Topic(0.05, 400), Topic(8.0, 60_000), Topic(8.0, 60_000)]
    model = Model(topics, [], (2.0, 30_000.0), holds_bytes=500, most_queued=1024)
    ages = model.run(35.0)
    assert max(true_s for _, _, true_s in ages) > 3.0  # it waited indeed
    assert too_young(ages) <= 0.0


@pytest.mark.parametrize("period_s", [0.05, 0.4, 0.5, 1.0, 3.0])
def test_on_a_healthy_link_ages_are_little_too_old(period_s: float) -> None:
    """Also where the first message comes long after its subscription, which alone bounds the clock by then."""
    topic = Topic(period_s, 400, due_s=0.9 * period_s)
    ages = Model([topic], [], (0.0, HEALTHY_BPS), holds_bytes=20_000, most_queued=1024).run(20.0)
    settled = [shown_s - true_s for at_s, shown_s, true_s in ages if at_s > 2.0 * period_s + 1.0]
    assert len(settled) > 3
    assert max(settled) < 0.8
    assert min(settled) >= 0.0
