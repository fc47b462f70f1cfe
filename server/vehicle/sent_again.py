"""Messages that a bridge sends again after another subscription: a sample that it kept, or one message twice.

A real bridge gives the latched sample of a topic to each new subscription, also where its throttle was changed. A
bridge of ROS 2 sends the first message after a second subscription of one connection twice; messages that were on
their way come before it. Neither is new: it must not make an old value look fresh. Only a message like one that came
before can be a repeat, and of each only as many as there were subscriptions. With a stamp, this is certain. Without
one, a publisher may have sent the same value anew: then only the first message after a subscription counts as a repeat,
which costs at most one period of its age. Its age alone is in doubt: whether it is recorded, `doubtful.py` decides.

Pure: time is an argument, on a monotonic clock in seconds.
"""

from __future__ import annotations

import math
from collections import OrderedDict, deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from server.judge.message_fields import stamp_s
from server.rosbridge.codec import Unreadable
from server.rosbridge.raw_frame import RawFrame

GIVEN_WITHIN_S = 5.0  # after it has read a subscription, a bridge of ROS 2 needs some time to get the kept sample
TWICE_WITHIN_S = 0.1  # a message that a bridge sends twice
LATER_TWICE_WITHIN_S = 0.5  # so does one behind those that were on their way
EXPECTED_S = 30.0  # a topic that continues for so long after a subscription has been given what was kept
IN_TIME = 0.25  # a message that comes when its period has passed, give or take so much of it, may be a new one
PERIOD_WEIGHT = 0.2
STEADY = 3  # gaps in a row that make a period
KEPT, KEPT_BYTES = 16, 64 * 1024  # of one topic: several publishers may each have a latched sample
HEADER_BYTES = 400  # of a large message, in which its stamp is sought
MOST_SUBSCRIBED = 3  # repeats of one sample that are expected at a time
MOST_TOPICS = 2_000


@dataclass(slots=True)
class Sample:
    """A message as it first came."""

    content: Any  # parsed, or its RawFrame, or the number and hash of its bytes where they are many
    size: int
    first_s: float
    part: object = None  # of the recording, that holds it
    expected: int = 0  # repeats of it that may come
    is_later: bool = False  # not the first one after a subscription: only its stamp shows a repeat


@dataclass(slots=True)
class _Topic:
    samples: deque[Sample] = field(default_factory=lambda: deque(maxlen=KEPT))  # the newest last
    subscribed_s: float | None = None  # the newest subscription
    is_first: bool = True  # nothing new came after it yet
    may_come_twice: bool = False  # the first message that the bridge sends after it may still come
    was_given: bool = False  # a repeat came after it
    newest_s: float = -math.inf
    period_s: float | None = None
    steady: int = 0  # gaps in a row of about this period
    is_kept: bool = False  # its publisher gave the newest sample to each subscription, and nothing new came since

    def twice_is_over(self) -> None:
        """The message that was to come twice after the subscription did, or none will."""
        self.may_come_twice = False
        for sample in self.samples:
            if sample.is_later:
                sample.expected = 0

    def came(self, at_s: float) -> None:
        gap_s = at_s - self.newest_s
        if math.isfinite(gap_s) and gap_s > 0.0:
            self.steady = self.steady + 1 if self._is_in_time(at_s) else 0
            self.period_s = gap_s if self.period_s is None else self.period_s + PERIOD_WEIGHT * (gap_s - self.period_s)
        self.newest_s = at_s

    def is_due(self, at_s: float) -> bool:
        """Whether a new message of a topic with a steady period would come now."""
        return self.steady >= STEADY and self._is_in_time(at_s)

    def _is_in_time(self, at_s: float) -> bool:
        return self.period_s is not None and abs(at_s - self.newest_s - self.period_s) <= IN_TIME * self.period_s


@dataclass(frozen=True, slots=True)
class Arrival:
    """What is known of a message that came."""

    sample: Sample
    is_repeat: bool = False
    may_be_new: bool = False  # a repeat without a stamp that came when a new message was due
    is_doubtful: bool = False  # a repeat without a stamp, of a topic whose publisher is not known to keep a sample
    period_s: float | None = None  # usual interval of the topic, for one that is; None: not known
    silent_s: float = 0.0  # since its newest message


class SentAgain:
    """Of one car, over all openings of its link. `read_s(sent_s)`: when the bridge was known to have read what was sent
    then; None: not yet."""

    def __init__(self, read_s: Callable[[float], float | None]) -> None:
        self._read_s = read_s
        self._topics: OrderedDict[str, _Topic] = OrderedDict()

    def subscribed(self, topic: str, at_s: float) -> None:
        """A subscription to a topic was sent, the first one or another."""
        known = self._topic(topic)
        if not known.was_given:
            known.is_kept = False
        known.subscribed_s, known.is_first, known.was_given = at_s, True, False
        known.twice_is_over()
        known.may_come_twice = bool(known.samples)
        for sample in known.samples:
            sample.expected, sample.is_later = min(sample.expected + 1, MOST_SUBSCRIBED), False

    def is_kept(self, topic: str) -> None:
        """The publisher of a topic gives the newest sample to each subscription: what comes first is not new."""
        self._topic(topic).is_kept = True

    def receive(self, topic: str, message: Any, size: int, at_s: float) -> Arrival:
        """A message came, parsed or as RawFrame. `size`: bytes of its frame."""
        known = self._topic(topic)
        found = self._repeated(known, message, size, at_s)
        if found is not None:
            known.was_given = True
            found.sample.expected -= 1
            known.twice_is_over()
            for other in known.samples:
                if other is not found.sample and other.expected and is_same(other.content, found.sample.content):
                    other.expected = 0  # one message that was sent many times is kept once by its publisher
            return found
        if known.subscribed_s is None or at_s - known.subscribed_s > EXPECTED_S:
            for one in known.samples:
                one.expected = 0
        sample = Sample(_content(message, size), size, at_s)
        if known.may_come_twice and self._is_over(known, at_s):
            known.twice_is_over()
        if known.may_come_twice:
            sample.expected, sample.is_later = 1, not known.is_first
        known.is_first = known.is_kept = False
        known.came(at_s)
        self._keep(known, sample)
        return Arrival(sample)

    def _repeated(self, known: _Topic, message: Any, size: int, at_s: float) -> Arrival | None:
        if not any(sample.expected for sample in known.samples):
            return None
        content = _content(message, size)
        for sample in reversed(known.samples):
            if sample.expected and is_same(sample.content, content):
                if sample.is_later and at_s - sample.first_s > LATER_TWICE_WITHIN_S:
                    return None
                if _is_stamped(message, size):
                    return Arrival(sample, is_repeat=True)
                if sample.is_later:
                    return None
                if sample is known.samples[-1] and self._may_be_given(known, sample, at_s):
                    return _unstamped(known, sample, at_s)
                return None
        return None

    def _is_over(self, known: _Topic, at_s: float) -> bool:
        """Whether a message that the bridge sends twice would have come: those before it read the subscription were
        on their way, and do not."""
        read_s = self._read_s(known.subscribed_s) if known.subscribed_s is not None else None
        return read_s is not None and at_s - read_s > GIVEN_WITHIN_S

    def _may_be_given(self, known: _Topic, newest: Sample, at_s: float) -> bool:
        if known.is_first and known.subscribed_s is not None:
            read_s = self._read_s(known.subscribed_s)
            return read_s is None or at_s - read_s <= GIVEN_WITHIN_S
        return at_s - newest.first_s <= TWICE_WITHIN_S and not known.is_due(at_s)

    def _keep(self, known: _Topic, sample: Sample) -> None:
        samples = known.samples
        samples.append(sample)
        kept = sum(one.size for one in samples)
        while len(samples) > 1 and kept > KEPT_BYTES:
            kept -= samples.popleft().size

    def _topic(self, name: str) -> _Topic:
        known = self._topics.get(name)
        if known is None:
            known = self._topics[name] = _Topic()
            if len(self._topics) > MOST_TOPICS:
                self._topics.popitem(last=False)
        return known


def _unstamped(known: _Topic, sample: Sample, at_s: float) -> Arrival:
    return Arrival(
        sample,
        is_repeat=True,
        may_be_new=known.is_due(at_s),
        is_doubtful=not known.is_kept,
        period_s=known.period_s,
        silent_s=at_s - known.newest_s,
    )


def _content(message: Any, size: int) -> Any:
    """What of a message is kept to compare the next ones with; None: it is too large for that."""
    if isinstance(message, RawFrame):
        return message if size <= KEPT_BYTES else (size, hash(message.payload))
    return message if size <= KEPT_BYTES else None


def _is_stamped(message: Any, size: int) -> bool:
    if isinstance(message, RawFrame):
        if size > KEPT_BYTES:
            return b"stamp" in message.payload[message.begins : message.begins + HEADER_BYTES]
        try:
            message = message.message()
        except Unreadable:
            return False
    if stamp_s(message) is not None:
        return True
    parts = message.values() if isinstance(message, Mapping) else ()  # such as the transforms of a TFMessage
    return any(
        isinstance(part, list) and bool(part) and all(stamp_s(one) is not None for one in part) for part in parts
    )


def is_same(one: Any, other: Any) -> bool:
    """Whether two messages have the same content, whatever they were encoded as."""
    if one is None or other is None:
        return False
    if isinstance(one, RawFrame) and isinstance(other, RawFrame) and one.is_binary == other.is_binary:
        return one.payload == other.payload
    try:
        return _equal(_parsed(one), _parsed(other))
    except (RecursionError, Unreadable):  # only a hostile message is so deep
        return False


def _parsed(content: Any) -> Any:
    """Raises Unreadable."""
    return content.message() if isinstance(content, RawFrame) else content


def _equal(one: Any, other: Any) -> bool:
    if isinstance(one, Mapping) and isinstance(other, Mapping):
        return one.keys() == other.keys() and all(_equal(value, other[name]) for name, value in one.items())
    if isinstance(one, (list, tuple, np.ndarray)) and isinstance(other, (list, tuple, np.ndarray)):
        return len(one) == len(other) and all(map(_equal, _listed(one), _listed(other)))
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return False
    if _is_unknown(one) or _is_unknown(other):
        return _is_unknown(one) and _is_unknown(other)
    return bool(one == other) and isinstance(one, bool) == isinstance(other, bool)


def _listed(values: Any) -> Any:
    return values.tolist() if isinstance(values, np.ndarray) else values


def _is_unknown(value: Any) -> bool:
    """NaN and the infinities are null in JSON."""
    return value is None or (isinstance(value, float) and not math.isfinite(value))
