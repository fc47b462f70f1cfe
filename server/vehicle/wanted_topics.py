"""Which topics are to be subscribed to, and how: from what is offered, what is judged and what the link bears. Pure."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping
from dataclasses import dataclass, replace

from server.judge.signals import TOPICS
from server.judge.topics import BY_SIGNAL, Source
from server.recording import recorded_topics
from server.recording.recorded_topics import Also
from server.rosbridge.subscription import Subscription
from server.vehicle.link_load import LinkLoad

COMPARED_MS = 200  # at most one message in this of a topic that is only compared
LASER_THROTTLE_MS = 500  # of a laser that is only compared
Compression = Callable[[str, bool], str]  # topic and whether its type is fit for CBOR → "cbor" or "none"


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
    asked: Collection[str],
    fit: Collection[str],
    compression: Compression,
) -> dict[str, Subscription]:
    """The subscriptions of the signals. `asked`: types whose definitions are known; `fit`: those fit for CBOR."""
    wanted: dict[str, Subscription] = {}
    for topic, sources in by_topic.items():
        rows = [BY_SIGNAL[source.signal] for source in sources if source.decode is not None]
        if rows and topic not in without:
            kind = sources[0].type
            is_fit = rows[0].compression == "cbor" and (kind not in asked or kind in fit)
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
    asked: Collection[str],
    fit: Collection[str],
    compression: Compression,
) -> dict[str, Subscription]:
    """The subscriptions of topics that carry no signal and are compared.

    `undecided`: those that may carry one, of which each message counts, but for lasers; `is_recorded`: all topics are
    recorded, so that none is thinned out for it.
    """
    found = judged(by_topic, load, without=without, asked=asked, fit=fit, compression=compression)
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
    asked: Collection[str],
) -> Recorded:
    """What is to be recorded beside; none over a link that is too slow for it. `held`: they silence the bridge."""
    found, left_out = recorded_topics.choose(offered, without=without, also=also, asked=asked)
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
