"""The talk with one car's bridge: what the car offers, which topics carry its signals, whether ROS behind it lives."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping

from server import discovery, judging, others
from server.link import LinkDown, RosLink, Subscription
from server.others import Also
from server.topics import BY_SIGNAL, TOPICS, Source, map_signals
from server.tuning import Tuning

log = logging.getLogger("catgraph.conversation")

ALIVE_EVERY_S = 1.0
LOOK_AGAIN_S = 5.0  # the car's software may start after its bridge
CBOR_TRIES = 5  # unreadable binary frames before scans are asked for as JSON


class Conversation:
    """One car's topics and subscriptions from dialling to the end of monitoring, over any number of openings.

    `now` is a monotonic clock in seconds; `proved()` is called with each answer that only a rosbridge gives,
    `recognised(title)` when the car turns out to be of another kind than it was taken for.
    """

    def __init__(
        self,
        link: RosLink | None,
        tuning: Tuning,
        *,
        now: Callable[[], float],
        proved: Callable[[], None],
        recognised: Callable[[str], None],
        learned: Callable[[Mapping[str, str]], None] = lambda _: None,
    ) -> None:
        """`link` None: no car is dialled, and nothing is known of any."""
        self._link = link
        self._tuning = tuning
        self._now = now
        self._proved = proved
        self._recognised = recognised
        self._learned = learned
        self._offer: discovery.Offer | None = None
        self._looked = False
        self._cbor_failed = False  # then scans come as JSON
        self._cbor_noise = 0
        self.sources: Mapping[str, Source] = {}  # by signal
        self.by_topic: Mapping[str, tuple[Source, ...]] = {}
        self.unmapped: Mapping[str, str] = {}  # topic → type of what carries no signal
        self.offers_nothing = False
        self.judged = 0  # topics that are subscribed to for their signals
        self._also: Also = "none"
        self._asked: set[str] = set()  # types whose definitions the bridge was asked for
        self._learning: asyncio.Task[None] | None = None  # beside the talk: it may take long, and proves nothing
        self._look_soon = False
        self.others: Mapping[str, str] = {}  # topic → type of what is subscribed to only to be recorded
        self.left_out: tuple[str, ...] = ()  # topics that are not recorded, for they are bulky or there are too many
        self.ros_version: int | None = None
        self.ros_alive: bool | None = None
        self.ros_answered_s: float | None = None
        self.commanded_on: str | None = (
            None  # the topic on which the car is commanded: who else publishes there is asked
        )
        self.publishers: tuple[str, ...] | None = None  # who does; None: not known
        self._guard: str | None = None  # a topic that is heard besides

    async def go_on(self) -> None:
        """While this opening lasts: looks at what the car offers, and asks whether ROS behind the bridge lives."""
        link = self._link
        looked_s = -LOOK_AGAIN_S
        while link is not None and link is self._link and link.is_open:
            try:
                if self._look_soon or self._now() - looked_s >= (LOOK_AGAIN_S if self.sources else 1.0):
                    looked_s, self._look_soon = self._now(), False
                    await self._look(link)
                alive = await discovery.ask_alive(link)
                if self.commanded_on is not None:
                    self.publishers = await discovery.ask_publishers(link, self.commanded_on)
            except LinkDown:
                return
            if link is not self._link:
                return
            if alive:
                self.ros_answered_s = self._now()
                self._proved()
            self.ros_alive = alive if self.ros_answered_s is not None else None
            await asyncio.sleep(ALIVE_EVERY_S)

    @property
    def offered(self) -> Mapping[str, str] | None:
        """Topic → type of all the car has, as its bridge spells them; None while the bridge does not say."""
        return self._offer.topics if self._offer is not None else None

    def watch_commands(self, topic: str | None, *, guard: str | None) -> None:
        """Asks from now on who publishes there; None: nobody commands the car. `guard`: a topic heard as well."""
        if topic != self.commanded_on:
            self.commanded_on, self.publishers = topic, None
        if guard != self._guard:
            self._guard = guard
            if self._offer is not None:
                self._subscribe()

    def end(self) -> None:
        """Whatever is still answered is of no interest any more."""
        self._link = None
        if self._learning is not None:
            self._learning.cancel()

    def record(self, also: Also) -> None:
        """Which topics are to be heard beyond those that carry signals; they are judged by nobody."""
        if also != self._also:
            self._also, self._look_soon = also, True
            if self._offer is not None:
                self._subscribe()

    def type_of(self, topic: str) -> str | None:
        """The type of a topic that is subscribed to, as the bridge spells it; None: not known."""
        sources = self.by_topic.get(topic)
        return self.others.get(topic) or (sources[0].type if sources else None)

    def map_again(self) -> None:
        """After a change of settings."""
        if self._offer is not None:
            self._map(self._offer)
        elif self._link is not None and self.by_topic:
            self._subscribe_by_name(self._link)

    def bridge_complains(self, text: str) -> None:
        """An error the bridge states: an old one has no CBOR, and scans come as JSON from now on."""
        if "cbor" in text.lower() and "compression" in text.lower() and not self._cbor_failed:
            self._cbor_failed = True
            self._subscribe()

    def binary_noise(self) -> None:
        """A binary frame that could not be read, where no scan ever could."""
        if not self._cbor_failed:
            self._cbor_noise += 1
            if self._cbor_noise >= CBOR_TRIES:
                self._cbor_failed = True
                self._subscribe()

    async def _look(self, link: RosLink) -> None:
        offer = await discovery.ask_topics(link)
        if link is not self._link:
            return
        if offer is None:
            if not self._looked and not self.sources:
                self._subscribe_by_name(link)  # no rosapi: try the names we know
            return
        self._looked = True
        self._proved()
        self.ros_version = offer.ros or self.ros_version
        self._offer = offer
        if self._tuning.recognise(offer.topics, offer.ros):
            self._recognised(self._tuning.profile.title)
        self._map(offer)
        if self._also != "none" and self._learning is None:
            self._learning = asyncio.create_task(self._learn(link, offer), name="definitions")
            self._learning.add_done_callback(self._learned_all)

    async def _learn(self, link: RosLink, offer: discovery.Offer) -> None:
        """Definitions come first: what is recorded before they are known is JSON."""
        types = {kind for kind in offer.topics.values() if kind} - self._asked
        if not types:
            return
        try:
            found = await discovery.ask_definitions(link, types)
        except LinkDown:
            return
        if link is self._link:
            self._asked |= types
            if found:
                self._learned(found)
            self._subscribe()

    def _learned_all(self, task: asyncio.Task[None]) -> None:
        self._learning = None
        if not task.cancelled() and task.exception() is not None:
            log.error("the definitions of types could not be learned", exc_info=task.exception())

    def _map(self, offer: discovery.Offer) -> None:
        """Chooses the topic of each signal and subscribes to them."""
        sources = map_signals(offer.topics, self._tuning.settings.topics)
        gone = {
            s: source for s, source in self.sources.items() if s not in sources and source.topic not in offer.topics
        }
        self.sources = gone | sources  # a topic that vanished stays subscribed: it may come back
        mapped = {source.topic for source in self.sources.values()}
        self.unmapped = {name: kind for name, kind in offer.topics.items() if name not in mapped}
        self.offers_nothing = not self.sources
        self._subscribe()

    def _subscribe(self) -> None:
        link = self._link
        if link is None:
            return
        self.by_topic = judging.by_topic(self.sources.values())
        wanted = {}
        for topic, sources in self.by_topic.items():
            rows = [BY_SIGNAL[source.signal] for source in sources if source.decode is not None]
            if rows:
                wanted[topic] = Subscription(
                    topic=topic,
                    type=sources[0].type,
                    compression="cbor" if rows[0].compression == "cbor" and not self._cbor_failed else "none",
                    queue_length=min(row.queue_length for row in rows),
                )
        self.judged = len(wanted)
        if self._offer is not None:
            self.others, self.left_out = others.choose(
                self._offer.topics, without=wanted, also=self._also, asked=self._asked
            )
            for topic, kind in self.others.items():
                wanted[topic] = Subscription(
                    topic=topic,
                    type=kind or None,
                    compression="none" if self._cbor_failed else "cbor",  # it keeps NaN and the infinities apart
                    queue_length=others.QUEUE_LENGTH,
                )
        if self._guard is not None:
            wanted.setdefault(self._guard, Subscription(topic=self._guard, type="std_msgs/String", queue_length=1))
        for row in link.subscriptions:
            if row.topic not in wanted:
                link.unsubscribe(row.topic)
        for subscription in wanted.values():
            link.subscribe(subscription)

    def _subscribe_by_name(self, link: RosLink) -> None:
        """Without rosapi: what the operator picked, else every name of the table, its type left to the bridge."""
        by_topic: dict[str, tuple[Source, ...]] = {}
        picked = self._tuning.settings.topics
        for row in TOPICS:
            for name in (picked[row.signal],) if row.signal in picked else row.names:
                source = Source(
                    signal=row.signal,
                    topic=name,
                    type=None,
                    decode=row.types[row.expected_type],
                    note="subscribed by name: the bridge has no rosapi",
                )
                by_topic[name] = (*by_topic.get(name, ()), source)
                link.subscribe(Subscription(topic=name, type=None, queue_length=row.queue_length))
        for subscription in link.subscriptions:
            if subscription.topic not in by_topic:
                link.unsubscribe(subscription.topic)
        self.by_topic = by_topic
        self.judged = len(by_topic)
