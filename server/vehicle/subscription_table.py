"""The subscriptions of one car's link: derived from mapped and offered topics, and kept up at the bridge."""

from __future__ import annotations

from collections.abc import Callable, Collection, Mapping

from server.judge.frames import is_static, is_transforms
from server.judge.topics import Source
from server.recording.recorded_topics import Also
from server.rosbridge.live_source import LiveSource
from server.rosbridge.subscription import Subscription
from server.vehicle import car_marks, wanted_topics
from server.vehicle.delivery import Delivery
from server.vehicle.link_load import LinkLoad
from server.vehicle.type_definitions import TypeDefinitions
from server.vehicle.undelivered import CLIENT_COUNT
from server.vehicle.wanted_topics import CborUse, LargeTopics, Probation

TRANSFORMS_MS = (
    200  # of transforms that move, where none of them places a sensor: they are sent a hundred times a second
)
MOST_TRANSFORMS = 8  # topics: one or two of each namespace
BY_NAME_AGAIN_S, BY_NAME_LAST_S = 5.0, 60.0  # each attempt without rosapi costs the bridge a line in its log a name


class SubscriptionTable:
    """`link` None: no car is dialled. `now` is a monotonic clock in seconds."""

    def __init__(
        self,
        link: LiveSource | None,
        definitions: TypeDefinitions,
        delivery: Delivery,
        *,
        now: Callable[[], float],
    ) -> None:
        self._link = link
        self._definitions = definitions
        self._delivery = delivery
        self._now = now
        self._by_name_s: float | None = None  # when the names were last subscribed to without rosapi
        self._by_name_pause_s = BY_NAME_AGAIN_S
        self.cbor = CborUse()
        self.large = LargeTopics()
        self.load = LinkLoad()
        self.probation = Probation()
        self.guard: str | None = None  # a topic that is subscribed to besides
        self.also: Also = "none"  # what is to be recorded beyond the signals
        self.recorded = wanted_topics.Recorded(topics={}, left_out=())
        self.transforms: frozenset[str] = frozenset()  # topics that say where the sensors are
        self.needs_moving = self._has_moving = False  # whether those that move may place a sensor: each one counts
        self.judged = 0  # topics that are subscribed to for their signals
        self.button: car_marks.ButtonSubscription | None = None  # how the car's button was subscribed to

    @property
    def rows(self) -> tuple[Subscription, ...]:
        return () if self._link is None else tuple(self._link.subscriptions)

    def end(self) -> None:
        """Nothing is subscribed to any more."""
        self._link = None

    def opened(self) -> None:
        """The connection opens, and the link sends its rows."""
        self._by_name_s, self._by_name_pause_s = self._now(), BY_NAME_AGAIN_S
        self.button = car_marks.ButtonSubscription(self._now())
        self.probation.opened(self._now())

    def subscribe(
        self,
        by_topic: Mapping[str, tuple[Source, ...]],
        offered: Mapping[str, str] | None,
        *,
        needs_client_count: bool,
        watched: Mapping[str, Source] | None = None,
    ) -> None:
        """Update the link's subscriptions to the wanted ones. `offered` None: the topics are unknown.

        `watched`: further topics that are compared and not judged.
        """
        watched = watched or {}
        known, too_large, compression = self._definitions, self.large.left, self.cbor.compression
        carrying = {topic: sources for topic, sources in by_topic.items() if any(one.carries for one in sources)}
        beside = {**{topic: (one,) for topic, one in watched.items()}, **by_topic}
        wanted = wanted_topics.judged(
            carrying, self.load, without=too_large, requested=known.requested, fit=known.fit, compression=compression
        )
        wanted |= wanted_topics.compared(
            beside, self.load, undecided=watched, without={*carrying, *too_large}, is_recorded=self.also != "none",
            requested=known.requested, fit=known.fit, compression=compression,
        )  # fmt: skip
        self.judged = len(wanted)
        if offered is not None:
            has_button = car_marks.is_button(car_marks.TOPIC, offered.get(car_marks.TOPIC))
            without = {*wanted, *too_large, *([car_marks.TOPIC] if has_button else ())}
            self.recorded = wanted_topics.recorded(
                offered, self.load, without=without, held=self.probation.held, also=self.also, requested=known.requested
            )
            wanted |= wanted_topics.rows_of(self.recorded, fit=known.fit, compression=compression)
            if has_button:
                button = Subscription(topic=car_marks.TOPIC, type=offered[car_marks.TOPIC], queue_length=10)
                wanted.setdefault(car_marks.TOPIC, button)
            wanted |= self._transform_rows(offered, wanted, too_large)
            if needs_client_count and CLIENT_COUNT in offered:
                kind = offered[CLIENT_COUNT] or None
                wanted.setdefault(CLIENT_COUNT, Subscription(topic=CLIENT_COUNT, type=kind, queue_length=1))
        if self.guard is not None:
            wanted.setdefault(self.guard, Subscription(topic=self.guard, type="std_msgs/String", queue_length=1))
        self._apply(
            wanted, [topic for topic in wanted if topic in by_topic or topic in watched], [*self.recorded.topics]
        )

    def _transform_rows(
        self, offered: Mapping[str, str], wanted: Mapping[str, Subscription], without: Collection[str]
    ) -> dict[str, Subscription]:
        """Subscriptions of the transforms, as far as they are not `wanted` to be recorded whole."""
        found = sorted(topic for topic, kind in offered.items() if is_transforms(topic, kind) and topic not in without)
        self.transforms = frozenset(found[:MOST_TRANSFORMS])
        self._has_moving = self.needs_moving
        has_all = self.needs_moving and self.load.step == 0
        return {
            topic: Subscription(
                topic=topic,
                type=offered[topic],
                throttle_ms=0 if has_all or is_static(topic) else TRANSFORMS_MS,
                queue_length=50 if has_all or is_static(topic) else 1,  # many publishers send one each, at once
            )
            for topic in self.transforms
            if topic not in wanted
        }

    def subscribe_by_name(self, picked: Mapping[str, str], used: Collection[str] = ()) -> None:
        """Without rosapi, by the names that are known, or that the operator picked. `used`: what is decoded."""
        wanted = wanted_topics.by_name(picked, self.load, used=used)
        self.judged = len(wanted)
        button = Subscription(topic=car_marks.TOPIC, type=None, queue_length=10)
        self._apply({**wanted, button.topic: button}, [*wanted], [button.topic])

    def renew_by_name(self) -> None:
        """A bridge drops a subscription without a type if the topic has no publisher yet."""
        now_s = self._now()
        if self._by_name_s is None or now_s - self._by_name_s < self._by_name_pause_s:
            return
        self._by_name_s, self._by_name_pause_s = now_s, min(self._by_name_pause_s * 2, BY_NAME_LAST_S)
        for row in self.rows:
            if row.type is None and self._delivery.never_received(row.topic):
                self._renew(row.topic, is_quiet=True)

    def renew_single(self, topics: Collection[str]) -> None:
        """One message came of each of these before it was known to be wanted: a bridge may have kept it."""
        for topic in topics:
            if self._delivery.was_single(topic):
                self._renew(topic, is_quiet=True)

    def is_cbor(self, topic: str) -> bool:
        """Whether a topic is subscribed to as CBOR."""
        return any(row.topic == topic and row.compression == "cbor" for row in self.rows)

    def renew(self, topic: str) -> bool:
        """A subscription that another client spoilt comes alive; one as CBOR is to be made as JSON: then `subscribe` is
        still to be called, and the answer is true."""
        if self.is_cbor(topic):
            self.cbor.did_not_arrive(topic)
            return True
        self._renew(topic)
        return False

    def probe(self, topic: str) -> bool:
        """Subscribe to a topic once more, to see whether its publisher keeps a sample; False: it cannot be."""
        return any(row.topic == topic for row in self.rows) and self._again(topic, is_quiet=True)

    def tries_another(self) -> bool:
        """Whether a topic on probation, or more or less of the transforms, is to be subscribed to now; then `subscribe`
        is still to be called."""
        if self.needs_moving != self._has_moving:
            return True
        return self.load.level.records_others and self.probation.look(self._now())

    def look_at_load(self, late_s: float, trip_s: float) -> tuple[bool, list[str]]:
        """Whether less or more is to be subscribed to now, and the topics that are left because of it."""
        before = self.load.step
        if not self.load.look(late_s, self._now(), trip_s):
            return False, []
        if self.load.step == 0:
            self.probation.opened(self._now())
        if before:
            return True, []
        if self.probation.is_trying:
            self.load.relapse_is_explained()
        return True, self.probation.silent(self._suspects())

    def fell_silent(self) -> tuple[bool, list[str]]:
        """The link was given up because the bridge did not answer; it may be busy with what is only recorded. Whether
        topics are suspected of it, and those that are left now."""
        suspects = self._suspects()
        return bool(suspects), self.probation.silent(suspects)

    def _suspects(self) -> list[str]:
        """Recorded topics whose type may be large, and of which no message ever came."""
        return [
            topic
            for topic, kind in self.recorded.topics.items()
            if kind in self._definitions.may_be_large and topic not in self._delivery.delivered
        ]

    def given(self, topic: str) -> None:
        """A sample from before came again on a topic."""
        self.probation.received(topic)
        self._delivery.given(topic)

    def renew_quiet(self) -> None:
        """A recording begins, which needs what the bridge keeps of topics that came before."""
        for topic in self._delivery.quiet(self._now()):
            self._again(topic)

    def renew_all(self) -> None:
        """A new roscore does not know the old subscriptions."""
        for row in self.rows:
            self._renew(row.topic)

    def _apply(self, wanted: Mapping[str, Subscription], judged: Collection[str], recorded: Collection[str]) -> None:
        link = self._link
        if link is None:
            return
        for row in self.rows:
            if row.topic not in wanted:
                link.unsubscribe(row.topic)
        if wanted.get(car_marks.TOPIC) not in (None, *self.rows):
            self.button = car_marks.ButtonSubscription(self._now())
        for subscription in wanted.values():
            link.subscribe(subscription)
        self._delivery.follow(judged, recorded, now_s=self._now())

    def _again(self, topic: str, *, is_quiet: bool = False) -> bool:
        if self._link is None or not self._link.again(topic):
            return False
        self._note_button(topic, is_quiet=is_quiet)
        return True

    def _note_button(self, topic: str, *, is_quiet: bool) -> None:
        if topic == car_marks.TOPIC:
            self.button = car_marks.ButtonSubscription(self._now(), is_renewal=is_quiet)

    def _renew(self, topic: str, *, is_quiet: bool = False) -> None:
        self._note_button(topic, is_quiet=is_quiet)
        if self._link is not None:
            self._link.renew(topic)
