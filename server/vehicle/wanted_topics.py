"""Which topics are to be subscribed to, and how: by what is offered and judged, and by what link and bridge can carry.
Pure.

A ROS 2 bridge does nothing else while it encodes a message. One of 40 MB delays all others by a second or more, or the
bridge answers no ping and the link is closed. Such a topic must cost neither the judged signals nor the recording of
the other topics: what may be one is tried alone, and left if it delays the bridge again.

"""

from __future__ import annotations

import math
from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, field, replace

from server.judge.signals import TOPICS
from server.judge.topics import BY_SIGNAL, Source
from server.recording import recorded_topics
from server.recording.recorded_topics import Also
from server.rosbridge.subscription import Subscription
from server.rosbridge.websocket import MAX_MESSAGE_BYTES
from server.vehicle.link_load import LinkLoad

CBOR_TRIES = 5  # unreadable binary frames before scans are requested as JSON

LARGE_TRIES = 2  # messages that are too large, before the topic is left

STEADY_S = 4.0  # the link holds for so long before the first of them is tried, and with each one before the next
LEFT_AFTER = 2  # times that the link fell silent while a topic was tried

COMPARED_MS = 200  # at most one message in this of a topic that is only compared
LASER_THROTTLE_MS = 500  # of a laser that is only compared
Compression = Callable[[str, bool], str]  # topic and whether its type is fit for CBOR → "cbor" or "none"


class CborUse:
    """Whether a topic is subscribed to as CBOR: not where the bridge has none, nor where it did not arrive.

    Of one car's bridge.
    """

    def __init__(self) -> None:
        self._failed = False  # then everything comes as JSON
        self._noise = 0
        self._json_only: set[str] = set()  # topics that did not arrive as CBOR

    def compression(self, topic: str, is_fit: bool) -> str:
        """CBOR where the type is fit for it: it is smaller, and keeps NaN and the infinities apart."""
        return "cbor" if is_fit and topic not in self._json_only and not self._failed else "none"

    def did_not_arrive(self, topic: str) -> None:
        """It comes as JSON from now on."""
        self._json_only.add(topic)

    def bridge_complains(self, text: str) -> bool:
        """Whether an error of the bridge means that it has no CBOR, as an old one."""
        if "cbor" in text.lower() and "compression" in text.lower() and not self._failed:
            self._failed = True
            return True
        return False

    def binary_noise(self) -> bool:
        """A binary frame that could not be read, where no scan ever could; whether CBOR is given up now."""
        if self._failed:
            return False
        self._noise += 1
        self._failed = self._noise >= CBOR_TRIES
        return self._failed


class LargeTopics:
    """Topics whose messages are too large to be read: left after the second one, and named.

    Of one car.
    """

    def __init__(self) -> None:
        self._sizes: dict[str, list[int]] = {}  # topic → sizes of its messages that were too large

    def skipped(self, topic: str, size: int) -> bool:
        """A message of `size` bytes was too large; whether its topic is to be left now: it would take the car's
        network for nothing."""
        if topic in self.left:
            return False
        sizes = self._sizes.setdefault(topic, [])
        sizes.append(size)
        return len(sizes) >= LARGE_TRIES

    @property
    def left(self) -> Mapping[str, int]:
        """Topic → bytes of its largest message, of those that are not subscribed to because of it."""
        return {topic: max(sizes) for topic, sizes in self._sizes.items() if len(sizes) >= LARGE_TRIES}

    def sentence(self, topic: str) -> str:
        """The log text for a topic that was unsubscribed."""
        return (
            f"{topic} is no longer received: its messages have {max(self._sizes[topic]) / 2**20:.0f} MB, and "
            f"{MAX_MESSAGE_BYTES // 2**20} MB is the limit."
        )


@dataclass(slots=True)
class Probation:
    """Recorded topics under suspicion of delaying the bridge: each is tried alone, and left if it delays it again.

    Of one car, over all openings of its link.
    """

    left: set[str] = field(default_factory=set)  # not tried any more
    _waiting: dict[str, int] = field(default_factory=dict)  # topic → how often the link fell silent with it alone
    _tried: str | None = None
    _since_s: float = math.inf  # since when the link holds, or the one is tried

    def opened(self, now_s: float) -> None:
        """The link was opened: first all the others are subscribed to."""
        self._tried, self._since_s = None, now_s

    def silent(self, suspects: Collection[str]) -> list[str]:
        """Returns the topics that are left from now on, after the bridge stopped answering or fell behind. `suspects`:
        subscribed topics of which no message ever came."""
        tried, self._tried, self._since_s = self._tried, None, math.inf
        if tried is not None:
            self._waiting[tried] += 1
            if self._waiting[tried] >= LEFT_AFTER:
                del self._waiting[tried]
                self.left.add(tried)
                return [tried]
            return []
        for topic in suspects:
            self._waiting.setdefault(topic, 0)
        return []

    @property
    def is_trying(self) -> bool:
        """Whether one of them is subscribed to now, to see what it does."""
        return self._tried is not None

    def received(self, topic: str) -> None:
        """A message of it arrived: it is not the cause."""
        if self._waiting.pop(topic, None) is not None and topic == self._tried:
            self._tried = None

    def look(self, now_s: float) -> bool:
        """Whether others are held back than before."""
        if now_s - self._since_s < STEADY_S:
            return False
        before = self.held
        if self._tried is not None:  # the link held with it
            del self._waiting[self._tried]
        self._tried = min(self._waiting, key=lambda topic: (self._waiting[topic], topic), default=None)
        self._since_s = now_s
        return self.held != before

    @property
    def held(self) -> set[str]:
        """Topics that are not to be subscribed to now."""
        return {*self.left, *self._waiting} - {self._tried}


@dataclass(frozen=True, slots=True, kw_only=True)
class Recorded:
    """Of the topics that carry no signal."""

    topics: Mapping[str, str]  # topic → type of what is subscribed to only to be recorded
    left_out: tuple[str, ...]  # not recorded, for they are bulky or there are too many


def judged(
    by_topic: Mapping[str, tuple[Source, ...]],
    load: LinkLoad,
    *,
    without: Collection[str],
    requested: Collection[str],
    fit: Collection[str],
    compression: Compression,
) -> dict[str, Subscription]:
    """The subscriptions of the signals. `requested`: types with a requested definition; `fit`: those fit for CBOR."""
    wanted: dict[str, Subscription] = {}
    for topic, sources in by_topic.items():
        rows = [BY_SIGNAL[source.signal] for source in sources if source.decode is not None]
        if rows and topic not in without:
            kind = sources[0].type
            is_fit = rows[0].compression == "cbor" and (kind not in requested or kind in fit)
            wanted[topic] = Subscription(
                topic=topic,
                type=kind,
                compression=compression(topic, is_fit),
                throttle_ms=min(load.throttle_ms(row.signal) for row in rows),
                queue_length=1 if load.step else min(row.queue_length for row in rows),
            )
    return wanted


def compared(
    by_topic: Mapping[str, tuple[Source, ...]],
    load: LinkLoad,
    *,
    undecided: Collection[str],
    without: Collection[str],
    is_recorded: bool,
    requested: Collection[str],
    fit: Collection[str],
    compression: Compression,
) -> dict[str, Subscription]:
    """The subscriptions of topics that carry no signal and are compared.

    `undecided`: those that may carry one, of which each message counts, but for lasers; `is_recorded`: all topics are
    recorded, so that none is thinned out for it.
    """
    found = judged(by_topic, load, without=without, requested=requested, fit=fit, compression=compression)
    for topic, row in found.items():
        if is_recorded and load.level.records_others:
            queue_length = 1 if load.step else recorded_topics.QUEUE_LENGTH
            found[topic] = replace(row, queue_length=queue_length)
        elif topic not in undecided:
            found[topic] = replace(row, throttle_ms=max(row.throttle_ms, COMPARED_MS), queue_length=1)
        elif any(source.signal == "scan" for source in by_topic[topic]):
            found[topic] = replace(row, throttle_ms=max(row.throttle_ms, LASER_THROTTLE_MS))
    return found


def recorded(
    offered: Mapping[str, str],
    load: LinkLoad,
    *,
    without: Collection[str],
    held: Collection[str],
    also: Also,
    requested: Collection[str],
) -> Recorded:
    """What is to be recorded beside; none over a link that is too slow for it. `held`: they silence the bridge."""
    found, left_out = recorded_topics.choose(offered, without=without, also=also, requested=requested)
    left_out = tuple(sorted({*left_out, *(topic for topic in found if topic in held)}))
    others = {topic: kind for topic, kind in found.items() if topic not in held}
    if not load.level.records_others:
        return Recorded(topics={}, left_out=tuple(sorted({*left_out, *others})))
    return Recorded(topics=others, left_out=left_out)


def rows_of(found: Recorded, *, fit: Collection[str], compression: Compression) -> dict[str, Subscription]:
    """The subscriptions of what is recorded beside."""
    return {
        topic: Subscription(
            topic=topic,
            type=kind or None,
            compression=compression(topic, kind in fit),
            queue_length=recorded_topics.QUEUE_LENGTH,
        )
        for topic, kind in found.topics.items()
    }


def by_name(picked: Mapping[str, str], load: LinkLoad, *, used: Collection[str]) -> dict[str, Subscription]:
    """Without rosapi: what the operator picked, else every name of the table, its type left to the bridge. `used`: what
    is compared with the pick stays."""
    wanted: dict[str, Subscription] = {}
    for row in TOPICS:
        is_picked = row.signal in picked
        names = [picked[row.signal], *(name for name in row.names if name in used)] if is_picked else row.names
        for name in names:
            before = wanted.get(name)
            wanted[name] = Subscription(
                topic=name,
                type=None,
                throttle_ms=min(load.throttle_ms(row.signal), before.throttle_ms if before else 10_000),
                queue_length=1 if load.step else row.queue_length,
            )
    return wanted
