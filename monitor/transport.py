"""An upper bound of a message's transport delay, from pings, queues and stamps.

Pings are marks in the stream. The bridge answers one when it reads it, behind all data already written to the
connection. So a message that arrives after the answer was written after the ping was sent, by our own clock: no clock
of the car is needed, and a delay that exists from the first message on is measured too.

A message may have waited before it was written. ROS 1's rosbridge, and ours, keep a queue for each subscription and
hold one message more beside the queue while the connection takes nothing. A message cannot have entered a queue of `q`
before the message that came `q + 1` before it was written; the mark known at *that* arrival bounds its age.

Stamps only make the bound a little tighter. Any clock will do: its offset is bounded by the message that waited least,
as the pings bound it, and each other message is then placed by its own stamp. They are not trusted further: stamps at
four times the pace, over a link that carries a quarter, look as even as those of a healthy one.

What waited before the bridge, in a node or in the bridge's own processor, no ping sees. There the clock of ROS helps,
where stamps are of that clock; signals without a stamp are as late as the least late of those that carry one.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass, field

from monitor.car_clock import CarClock, StampedDelay

WINDOW_S = 3.0  # round trips are compared over so long, or over two of the longest
SHUT_BYTES = 16_384  # a system takes at least so much for a connection (tcp_wmem) before it takes nothing
JITTER_S = 0.05  # round trips that differ by less do not come from a connection that takes nothing
EXACT_WITHIN_S = 0.12  # a bound by the queue that costs no more than this is taken as it is
TRIM_S = 0.15  # the bound is at most so much too high where the link is healthy; stamps take no more off it
OLDER_S = 0.5  # the first message of a topic that is so much older by its stamp was kept for us
OLDEST_S = 30 * 86_400.0  # a stamp that is further behind is of another clock
PLACE_PERIODS = 2.0  # a mean of a burst is too short
KEPT_S = 10.0  # the offset of a clock is the least of the last one to two of these: ±200 ppm are 4 ms
RECENT_S = 3.0  # a topic that was silent for longer shows nothing of the link now …
LONG_QUEUE = 10  # a longer one bounds the age of its own topic only: a second of messages may have waited in it
FAST_S = 0.5  # … nor does one that comes less often than this, where others come more often
USUAL_S = 30.0  # what a link needs when nothing waits is the least round trip of one to two of these …
USUAL_AT_MOST_S = 1.0
EXCESS_S = 0.1
MIDDLE_AT_MOST_S = 0.15  # a delay may be given 0.2 s too low: the rest is for clocks and ticks
TOGETHER_S = 0.3  # what came so long before the newest message shows nothing of the link now …
DUE_PERIODS = 1.5  # … but where its topic comes more rarely: so many of its periods
NEIGHBOURS, NEIGHBOUR_S, PERIOD_WEIGHT = 2, 1.0, 0.1
MOST_UNANSWERED = 600


class _Clock:
    """The clock of one topic's stamps: the least that it can be ahead of ours."""

    __slots__ = ("_before_s", "_now_s", "_since_s", "_stamp_s")

    def __init__(self) -> None:
        self._stamp_s = self._since_s = -float("inf")
        self._now_s = self._before_s = float("inf")

    def place(self, stamp_s: float, at_s: float, bound_s: float) -> float:
        """The delay by the stamp: at most `bound_s`, and little less, for stamps may run at any pace."""
        ahead_s = stamp_s - at_s
        if stamp_s < self._stamp_s:
            self._now_s = self._before_s = float("inf")
        if at_s - self._since_s > KEPT_S:
            self._before_s, self._now_s, self._since_s = self._now_s, float("inf"), at_s
        self._stamp_s = stamp_s
        self._now_s = min(self._now_s, ahead_s + bound_s)
        return max(min(self._now_s, self._before_s) - ahead_s, bound_s - TRIM_S, 0.0)


@dataclass(slots=True, eq=False)
class _Topic:
    """What is kept of one subscription."""

    queue_length: int
    former_length: int = 0
    came: int = 0  # messages since the queue has this length
    throttle_s: float = 0.0
    period_s: float | None = None  # between two messages while all are sent
    marks: deque[float] = field(default_factory=deque)  # the mark known when each of the last ones came
    clock: _Clock = field(default_factory=_Clock)
    by_clock: StampedDelay = field(default_factory=StampedDelay)
    at_s: float | None = None
    delay_s: float = 0.0
    is_own: bool = False  # that delay is of this topic only: its queue was long when the message came
    excess_s: float | None = None  # later by the clock of ROS than by the pings; None: it is not known
    first: tuple[float, float | None] | None = None  # when the only message came, and its stamp
    older_s: float = 0.0  # how old the newest message was when it came, where that is not due to its transport
    is_given: bool = False  # it had such a message, on any connection
    stamped: int = 0  # messages with a stamp on this connection

    def __post_init__(self) -> None:
        self.former_length = self.queue_length
        self.marks = deque(maxlen=self.queue_length + 1)

    def restart(self) -> None:
        """Begin anew on another connection: of the one before only the usual intervals are kept."""
        self.marks.clear()
        self.clock = _Clock()
        self.by_clock = StampedDelay()
        self.at_s = self.excess_s = self.first = None
        self.delay_s = self.older_s = 0.0
        self.stamped = 0
        self.former_length = self.queue_length

    def resize(self, queue_length: int) -> None:
        """The queue gets another length."""
        former = self.queue_length
        # What came under the longer queue still counts: its marks are the older ones.
        self.marks = deque(self.marks, maxlen=queue_length + 1)
        if len(self.marks) > former and self.came > self.former_length:
            # What came under the shorter one leaves the rest of the places empty: what fills them comes later.
            self.marks.extendleft([self.marks[0]] * (queue_length - former))
        self.queue_length, self.former_length, self.came = queue_length, former, 0

    def follow_period(self, at_s: float) -> None:
        if self.at_s is None or self.throttle_s or at_s < self.at_s:
            return
        gap_s = at_s - self.at_s
        self.period_s = gap_s if self.period_s is None else self.period_s + PERIOD_WEIGHT * (gap_s - self.period_s)

    @property
    def counts_s(self) -> float:
        """Until then its last message shows how late the link is: its next one is due."""
        return (self.at_s or 0.0) + max(TOGETHER_S, DUE_PERIODS * (self.period_s or 0.0))

    @property
    def held_s(self) -> float:
        """How long the bridge may hold a message back to send fewer: until the next one takes its place."""
        return self.throttle_s if self.period_s is None else min(self.throttle_s, self.period_s)


class TransportDelay:
    """Follows one link. All times are seconds of our own clock, but for stamps."""

    def __init__(self) -> None:
        self._topics: dict[str, _Topic] = {}
        self.clock = CarClock()
        self.open(0.0)

    def open(self, at_s: float) -> None:
        """The connection opens: nothing that comes was sent before."""
        self._opened_s = self._mark_s = at_s
        for topic in self._topics.values():
            topic.restart()
        self.clock = CarClock()
        self._took_bytes = 0
        self._unanswered: deque[tuple[float, int]] = deque(maxlen=MOST_UNANSWERED)  # (sent, bytes that had come)
        self._trips: deque[tuple[float, float, bool]] = deque()  # (answered, round trip, the connection may be shut)
        self._answers: deque[tuple[float, float]] = deque(maxlen=MOST_UNANSWERED)  # (sent, answered)
        self._trip_s = self._least_trip_s = self._longest_trip_s = 0.0
        self._longest_shut_s = self._mark_shut_s = 0.0  # of the trips in which the connection may have taken nothing
        self._is_measured = False
        self._usual_trip_s = self._usual_before_s = float("inf")
        self._usual_since_s = at_s

    def sent(self, at_s: float) -> None:
        """A ping was sent."""
        self._unanswered.append((at_s, self._took_bytes))

    def took(self, size: int) -> None:
        """So many bytes came."""
        self._took_bytes += size

    def answered(self, sent_s: float, at_s: float) -> None:
        """The answer to a ping came."""
        if sent_s < self._mark_s or at_s < sent_s:
            return
        self._mark_s, self._is_measured = sent_s, True
        before = 0
        while self._unanswered and self._unanswered[0][0] <= sent_s:
            _, before = self._unanswered.popleft()
        self._answers.append((sent_s, at_s))
        trip_s = self._trip_s = at_s - sent_s
        trips = self._trips
        # What waited before the answer came after the ping was sent. Who reports no bytes may have been shut.
        trips.append((at_s, trip_s, not self._took_bytes or self._took_bytes - before >= SHUT_BYTES))
        since_s = at_s - max(WINDOW_S, 2.0 * max(self._longest_trip_s, trip_s))
        while trips[0][0] < since_s:
            trips.popleft()
        self._least_trip_s = min(trip for _, trip, _ in trips)
        self._longest_trip_s = max(trip for _, trip, _ in trips)
        self._longest_shut_s = max((trip for _, trip, is_shut in trips if is_shut), default=0.0)
        self._mark_shut_s = max(
            (trip for answered_s, trip, is_shut in trips if is_shut and answered_s >= sent_s), default=0.0
        )
        if at_s - self._usual_since_s > USUAL_S:
            self._usual_since_s, self._usual_before_s, self._usual_trip_s = at_s, self._usual_trip_s, float("inf")
        self._usual_trip_s = min(self._usual_trip_s, trip_s)

    def subscribe(self, topic: str, queue_length: int, throttle_s: float = 0.0) -> None:
        """So many messages of a topic may wait in the bridge, which sends one every `throttle_s` at most."""
        known = self._topics.get(topic)
        if known is None:
            known = self._topics[topic] = _Topic(queue_length)
        known.throttle_s = throttle_s
        if known.queue_length != queue_length:
            known.resize(queue_length)

    def receive(self, topic: str, at_s: float, stamp_s: float | None = None) -> float:
        """A message came: how old it may have been [s]."""
        known = self._topics.get(topic)
        if known is None:
            known = self._topics[topic] = _Topic(1)
        known.follow_period(at_s)
        bound_s = self._bound_s(known, at_s)
        known.came += 1
        delay_s = bound_s
        if stamp_s is not None:
            delay_s = known.clock.place(stamp_s, at_s, bound_s)
            late_s = known.by_clock.late_s(stamp_s, at_s, self.clock)
            known.excess_s = None if late_s is None else late_s - delay_s
            if late_s is not None and late_s > delay_s + EXCESS_S:
                delay_s = late_s
        else:
            delay_s += self._excess_s(at_s)
        known.first = (at_s, stamp_s) if known.at_s is None else None
        known.stamped += stamp_s is not None
        known.at_s, known.delay_s, known.older_s = at_s, delay_s, 0.0
        known.is_own = known.queue_length > LONG_QUEUE
        if known.first is not None:
            self._find_older(topic, known)
        return max(delay_s, known.older_s)

    def given(self, topic: str, age_s: float) -> None:
        """The bridge sent a message again that came `age_s` ago."""
        known = self._topics.get(topic)
        if known is not None:
            known.older_s, known.first, known.is_given = age_s, None, True

    def is_new(self, topic: str) -> None:
        """A new message came, of a topic that may not be judged."""
        known = self._topics.get(topic)
        if known is not None:
            known.older_s = 0.0

    def older(self) -> dict[str, tuple[float, float]]:
        """Topics of which one message came on this connection: when it came, and how old it was then by all that is
        known by now [s]."""
        found: dict[str, tuple[float, float]] = {}
        for name, topic in self._topics.items():
            if topic.first is not None:
                self._find_older(name, topic)
                found[name] = topic.first[0], max(topic.delay_s, topic.older_s)
        return found

    def of_unknown_age(self) -> frozenset[str]:
        """Topics of which one message came on this connection, whose age is not known: it may have been kept for us."""
        return frozenset(
            name
            for name, topic in self._topics.items()
            if topic.first is not None and (topic.first[1] is None or self._age_s(name, topic) is None)
        )

    def _find_older(self, name: str, topic: _Topic) -> None:
        age_s = self._age_s(name, topic)
        topic.older_s = age_s if age_s is not None and age_s > topic.delay_s + OLDER_S else 0.0

    def _age_s(self, name: str, topic: _Topic) -> float | None:
        """How old the only message of a topic was when it came; None where its stamp is not known to be of the clock of
        ROS. One message cannot show that: the stamps of the car's other topics do, where there are any."""
        if topic.first is None or topic.first[1] is None or self.clock.ahead_s is None:
            return None
        others = [one for other, one in self._topics.items() if other != name and one.stamped > 1]
        if others and all(one.excess_s is None for one in others):
            return None
        age_s = topic.first[0] - topic.first[1] + self.clock.ahead_s
        return age_s if age_s <= OLDEST_S else None

    def _bound_s(self, topic: _Topic, at_s: float) -> float:
        since_mark_s = max(0.0, at_s - self._mark_s)
        marks, places = topic.marks, topic.queue_length + 1
        queued_s = at_s - (marks[0] if len(marks) == places else self._opened_s)
        marks.append(self._mark_s)
        if queued_s - since_mark_s <= EXACT_WITHIN_S:
            return queued_s
        # The connection takes nothing until it is empty; so long the answer of a ping waits too. Each time it takes
        # something again, at least one message of each topic is sent.
        shut_s = places * self._shut_s(self._longest_shut_s, at_s)
        if topic.queue_length == 1 and topic.period_s is not None:
            # A longer queue may hold what came before several shuts. One place holds the newest: it came a
            # period before the message beside the queue was taken; and a shut that ended before the
            # mark was over by then.
            shut_s = min(shut_s, self._shut_s(self._mark_shut_s, at_s) + PLACE_PERIODS * topic.period_s)
        return min(queued_s, since_mark_s + shut_s + topic.held_s)

    def _shut_s(self, trip_s: float, at_s: float) -> float:
        """How long the connection took nothing, by the longest round trip of that time."""
        is_settled = at_s - self._opened_s > WINDOW_S + 2.0 * self._longest_trip_s
        return max(0.0, trip_s - (self._least_trip_s if is_settled else 0.0) - JITTER_S)

    def _excess_s(self, at_s: float) -> float:
        """How much later the stamped neighbours are than the pings indicate: all of them, and more than one."""
        found = list(self._excesses(at_s))
        return least_s if len(found) >= NEIGHBOURS and (least_s := min(found)) > EXCESS_S else 0.0

    def _excesses(self, at_s: float) -> Iterator[float]:
        for topic in self._topics.values():
            if topic.excess_s is not None and topic.at_s is not None and at_s - topic.at_s <= NEIGHBOUR_S:
                yield topic.excess_s

    def late_s(self, now_s: float) -> float:
        """How late is what comes now, estimated: the bound takes both ways of a round trip for the delay, which is in
        the middle where these are alike."""
        return max(0.0, self.most_late_s(now_s) - min(self._least_trip_s / 2.0, MIDDLE_AT_MOST_S))

    def most_late_s(self, now_s: float) -> float:
        """How late is what comes now at most: the most of the topics that come often, by those that came last."""
        recent = [topic for topic in self._topics.values() if topic.at_s is not None and now_s - topic.at_s <= RECENT_S]
        fast = [topic for topic in recent if topic.period_s is not None and topic.period_s <= FAST_S]
        shared = [topic for topic in fast if not topic.is_own]
        counted = shared or fast or recent
        newest_s = max((topic.at_s or 0.0 for topic in counted), default=0.0)
        return max((topic.delay_s for topic in counted if topic.counts_s >= newest_s), default=self._trip_s)

    def delays(self) -> dict[str, float]:
        """How old the newest message of each topic was when it came."""
        return {
            name: max(topic.delay_s, topic.older_s)
            for name, topic in self._topics.items()
            if topic.at_s is not None or topic.is_given
        }

    def queued_s(self, now_s: float) -> float:
        """How much of that is queueing: more is requested than the link carries."""
        return max(0.0, self.most_late_s(now_s) - min(self._usual_trip_s, self._usual_before_s, USUAL_AT_MOST_S))

    @property
    def trip_s(self) -> float:
        """The least of the last round trips: what the link takes where nothing waits and nothing was lost."""
        return self._least_trip_s

    def waiting_s(self, now_s: float) -> float:
        """Since the oldest ping was sent that is not answered yet."""
        return now_s - self._unanswered[0][0] if self._unanswered else 0.0

    def answer_s(self, now_s: float) -> float:
        """The most that the answer to something sent takes now, by all that is known."""
        return max(self._longest_trip_s, self.waiting_s(now_s))

    def read_s(self, sent_s: float) -> float | None:
        """When the bridge was known to have read what was sent then: the first answer to a ping behind it, of those
        that are kept. None: not yet."""
        return next((answered_s for ping_s, answered_s in self._answers if ping_s >= sent_s), None)
