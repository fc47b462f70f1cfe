"""Delivery of a car's topics: which have no publisher, which are published and not received, which to renew.

A bridge does not report that it cannot deliver a topic, and lists topics that have subscribers only. Arriving messages
are therefore compared with rosapi's publishers. rosapi is called only for topics without messages: each call makes the
bridge query all nodes, and on ROS 2 one of them may be shutting down.
"""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping
from dataclasses import dataclass, field

JUDGED_AFTER_S = 1.0  # time without a message until the publishers of a signal's topic are fetched
RECORDED_AFTER_S = 4.0  # the same for a topic that is only recorded
RENEW_AFTER_S = 4.0  # published, but nothing since subscribing: renewed as JSON
STOPPED_AFTER_S = 4.0  # a topic that came and stopped is looked at after so long, and
STOPPED_PERIODS = 10  # so many of its mean periods
ONCE_AFTER_S = 5.0  # a signal's topic of which one message came is looked at after so long
PROMPT_S = 2.0  # a message within so long after a subscription may be the one that a subscription gives
RENEWED_AGAIN_S = (0.0, 10.0, 30.0, 60.0, 120.0, 300.0)  # least interval of renewals in a row of a topic that came
ABSENT_AGAIN_S = 3.0  # interval of fetching the publishers of a signal's topic without one
SILENT_AGAIN_S = 10.0  # the same for a topic that is published and not received, and interval of renewal
RECORDED_AGAIN_S = (10.0, 30.0, 60.0, 120.0, 300.0)  # the same for a recorded topic, which may have few messages
FIRST_WITHIN_S = 5.0  # the first message of a publisher that came later
QUIET_S = 2.0  # a signal's topic without a message for so long, when a recording begins
FLOWS_AT_MOST_S = 30.0  # of a slow topic, or one that had pauses
FLOWS_S = 2.0  # anything within so long: the bridge delivers, so it is this topic and not all of them
AT_ONCE = 8  # topics per round
LEAST_GAPS = 3  # that show how fast a topic is
SLOW_PERIODS = 2  # a topic of which that is not known sends its next message within so many of its intervals


@dataclass(slots=True)
class _Row:
    """One topic that is subscribed to."""

    since_s: float  # when it was subscribed to, the last time
    is_judged: bool
    newest_s: float | None = None  # of its messages on this connection
    was_given: bool = False  # a sample from before came again on this connection
    gaps: int = 0  # between two messages without a renewal in between
    gaps_s: float = 0.0  # their sum
    got: int = 0  # messages since it was subscribed to
    was_prompt: bool = False  # the first of them came with the subscription
    single: int = 0  # renewals in a row before which the subscription gave one message at once, and no other
    interval_s: float = 0.0  # between the newest message and the one before, with a renewal in between
    publishers: tuple[str, ...] | None = None  # None: not known
    publishers_s: float = -math.inf  # since when there are these
    asked_s: float = -math.inf
    renewed: int = 0  # times in a row, without two messages since

    @property
    def came(self) -> bool:
        """Whether the bridge delivered anything of it on this connection."""
        return self.newest_s is not None or self.was_given

    def received(self, now_s: float) -> None:
        is_of_these = self.newest_s is not None and self.newest_s >= self.publishers_s
        if self.got:
            self.renewed = self.single = 0
            if is_of_these and self.newest_s is not None:
                self.gaps += 1
                self.gaps_s += now_s - self.newest_s
        else:
            self.was_prompt = now_s - self.since_s <= PROMPT_S
            self.interval_s = now_s - self.newest_s if is_of_these and self.newest_s is not None else 0.0
        self.got += 1
        self.newest_s = now_s

    def renew(self, now_s: float) -> None:
        self.single = self.single + 1 if self.got == 1 and self.was_prompt else 0
        self.since_s, self.got = now_s, 0
        self.renewed += 1

    def is_silent(self, now_s: float) -> bool:
        """Whether something ought to have come."""
        if not self.came:
            return now_s - self.since_s >= (JUDGED_AFTER_S if self.is_judged else RECORDED_AFTER_S)
        if not self.is_judged:
            return False
        due_s = max(STOPPED_AFTER_S, STOPPED_PERIODS * self.gaps_s / self.gaps) if self.gaps else ONCE_AFTER_S
        return now_s - self.last_s >= due_s

    def flows(self, now_s: float) -> bool:
        usual_s = self.gaps_s / self.gaps if self.gaps else 0.0
        due_s = min(FLOWS_AT_MOST_S, max(FLOWS_S, SLOW_PERIODS * usual_s))
        return self.newest_s is not None and now_s - self.newest_s <= due_s

    def came_once(self, now_s: float) -> bool:
        """Whether each subscription gives one message, and the topic is not merely slow: then its next message comes by
        itself before the third subscription, and after about the interval of those before."""
        if self.got > 1 or not self.single:
            return False
        is_given = self.got == 1 and self.was_prompt
        is_known = self.gaps >= LEAST_GAPS
        slow_s = STOPPED_PERIODS * self.gaps_s / self.gaps if is_known else SLOW_PERIODS * self.interval_s
        due_s = max(RENEW_AFTER_S, slow_s)
        return self.single > 2 or (is_given and (self.single > 1 or now_s - self.last_s >= due_s))

    @property
    def last_s(self) -> float:
        """Its newest message, or subscription."""
        return max(self.since_s, -math.inf if self.newest_s is None else self.newest_s)

    def again_s(self) -> float:
        """The time until its publishers are fetched again."""
        if self.is_judged:
            if self.publishers == ():
                return ABSENT_AGAIN_S
            return SILENT_AGAIN_S if self.renewed else JUDGED_AFTER_S
        return RECORDED_AGAIN_S[min(self.renewed, len(RECORDED_AGAIN_S) - 1)] if self.renewed else RECORDED_AFTER_S


@dataclass(slots=True)
class Delivery:
    """One car's, over all openings of its link. Times are on the session's monotonic clock, in seconds."""

    unpublished: set[str] = field(default_factory=set)  # topics without a publisher
    delivered: set[str] = field(default_factory=set)  # topics of which anything ever came
    _rows: dict[str, _Row] = field(default_factory=dict)
    _came_s: dict[str, float] = field(default_factory=dict)  # when a publisher came to a topic that had none
    _absent_asked_s: dict[str, float] = field(default_factory=dict)
    _newest_s: float = -math.inf  # of any topic

    def opened(self, now_s: float) -> None:
        """The link was opened: all topics are subscribed again."""
        self._rows = {topic: _Row(now_s, row.is_judged) for topic, row in self._rows.items()}

    def follow(self, judged: Collection[str], recorded: Collection[str], now_s: float) -> None:
        """What is subscribed to from now on, for signals and only to be recorded."""
        rows: dict[str, _Row] = {}
        for topics, is_judged in ((recorded, False), (judged, True)):
            for topic in topics:
                row = self._rows.get(topic) or _Row(now_s, is_judged)
                row.is_judged = is_judged
                rows[topic] = row
        self._rows = rows

    def received(self, topic: str, now_s: float) -> bool:
        """A message; whether it is the first one of a topic that was thought to have no publisher."""
        self._newest_s = now_s
        row = self._rows.get(topic)
        if row is not None:
            row.received(now_s)
        self.delivered.add(topic)
        if topic in self.unpublished:
            self.unpublished.discard(topic)
            self._came_s[topic] = now_s
            return True
        return False

    def given(self, topic: str) -> None:
        """A sample from before came again: the bridge delivers the topic, but nothing new was published."""
        row = self._rows.get(topic)
        if row is not None:
            row.was_given = True

    def renewed_s(self, topic: str) -> float:
        """When a topic's subscription was renewed last."""
        row = self._rows.get(topic)
        return row.since_s if row is not None and row.renewed else -math.inf

    def quiet(self, now_s: float) -> list[str]:
        """Topics of signals that came on this connection, and not lately: the bridge may keep a sample of them."""
        return [
            topic
            for topic, row in self._rows.items()
            if row.is_judged and row.came and (row.newest_s is None or now_s - row.newest_s >= QUIET_S)
        ]

    def flows(self, topic: str, now_s: float) -> bool:
        """Whether messages of a topic come, at its usual interval or about it."""
        row = self._rows.get(topic)
        return row is not None and row.flows(now_s)

    def has_its_time(self, topic: str, now_s: float) -> bool:
        """Whether a topic's publisher has only just come, so that no message yet is no silence."""
        return now_s - self._came_s.get(topic, -math.inf) < FIRST_WITHIN_S

    def only_silent(self) -> str | None:
        """The one topic of which nothing ever came, where there is exactly one."""
        silent = [topic for topic, row in self._rows.items() if not row.came]
        return silent[0] if len(silent) == 1 else None

    def to_ask(self, now_s: float, candidates: Collection[str] = ()) -> list[str]:
        """Topics whose publishers to fetch now, including those of `candidates` (topics that could carry a signal)
        without a known publisher."""
        due = [
            (row.asked_s, topic)
            for topic, row in self._rows.items()
            if row.is_silent(now_s) and now_s - row.asked_s >= row.again_s()
        ]
        chosen = {topic for _, topic in due}
        for topic in candidates:
            before_s = self._absent_asked_s.get(topic, -math.inf)
            if topic in self.unpublished and topic not in chosen and now_s - before_s >= ABSENT_AGAIN_S:
                due.append((before_s, topic))
        return [topic for _, topic in sorted(due)[:AT_ONCE]]

    def answered(self, topic: str, publishers: tuple[str, ...] | None, now_s: float) -> bool:
        """Store a topic's publishers, None: unknown. Return whether its subscription must be renewed as JSON."""
        row = self._rows.get(topic)
        self._absent_asked_s[topic] = now_s
        if publishers == () and topic not in self.delivered:
            self.unpublished.add(topic)
        elif publishers is not None:
            if topic in self.unpublished:
                self._came_s[topic] = now_s
            self.unpublished.discard(topic)
        if row is None:
            return False
        row.asked_s = now_s
        if publishers is None:
            return False
        if row.publishers == () and publishers:
            row.since_s = now_s  # it has its time from here on
        if publishers and publishers != row.publishers:
            row.renewed = row.single = 0  # another publisher has its own renewals
        if row.publishers not in (None, publishers) or not publishers:
            row.publishers_s = now_s
        row.publishers = publishers
        if not publishers or not row.is_silent(now_s):
            return False
        if (row.came or not row.is_judged) and now_s - self._newest_s > FLOWS_S:
            return (
                False  # nothing comes: the car is silent, not this topic; another client may block all of a few signals
            )
        if now_s - row.last_s < RENEW_AFTER_S:
            return False
        if row.came and now_s - row.since_s < RENEWED_AGAIN_S[min(row.renewed, len(RENEWED_AGAIN_S) - 1)]:
            return False
        row.renew(now_s)
        return True

    def never_came(self, now_s: float) -> list[str]:
        """Topics of signals that have a publisher and of which nothing came on this connection."""
        return [
            topic
            for topic, row in self._rows.items()
            if row.is_judged and row.publishers and not row.came and (row.renewed or row.is_silent(now_s))
        ]

    def came_once(self, now_s: float) -> list[str]:
        """Topics of signals that have a publisher and of which each subscription gives one message."""
        return [topic for topic, row in self._rows.items() if row.is_judged and row.publishers and row.came_once(now_s)]

    def never_received(self, topic: str) -> bool:
        """Whether nothing came of a topic on this connection."""
        row = self._rows.get(topic)
        return row is None or not row.came

    def was_single(self, topic: str) -> bool:
        """Whether one message came of a topic since it was subscribed to."""
        row = self._rows.get(topic)
        return row is not None and row.got == 1

    def not_received(self, now_s: float) -> Mapping[str, tuple[str, ...]]:
        """Topic → its publishers, for topics without messages after a renewal while other topics arrive."""
        return {
            topic: row.publishers
            for topic, row in sorted(self._rows.items())
            if row.publishers
            and not row.came
            and (row.renewed > 1 or (row.renewed and now_s - row.since_s >= RENEW_AFTER_S))
        }
