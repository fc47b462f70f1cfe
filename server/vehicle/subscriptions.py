"""What a car offers, which of its topics carry signals, and the subscriptions that follow from both."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Mapping
from dataclasses import replace

from server.judge import pipeline
from server.judge.active_settings import ActiveSettings
from server.judge.sources.evidence import Place
from server.judge.topics import Source, could_carry
from server.recording.recorded_topics import Also, Missing
from server.rosbridge.connection_errors import Problem
from server.rosbridge.live_source import LinkDown, LiveSource
from server.rosbridge.rosapi_client import ServiceCaller
from server.vehicle import car_marks, discovery
from server.vehicle.delivery import Delivery
from server.vehicle.rosapi_watch import MissingWatch, RosWatch
from server.vehicle.signal_map import SignalMap
from server.vehicle.subscription_table import SubscriptionTable
from server.vehicle.type_definitions import TypeDefinitions
from server.vehicle.undelivered import CLIENT_COUNT

LOOK_AGAIN_S = 5.0  # the car's software may start after its bridge


class TypesInUse:
    """Types of topics of which messages come, where rosapi names another one.

    rosapi names one type of a topic, also where a second node publishes or subscribes to it with a wrong one. A
    subscription with that type would end the one that delivers.
    """

    def __init__(self, delivery: Delivery, noted: Callable[[str], None], now: Callable[[], float]) -> None:
        self._delivery = delivery
        self._noted = noted
        self._now = now
        self._others: dict[str, str] = {}  # topic → the type that rosapi names

    def is_due(self) -> bool:
        """Whether the messages of such a topic ended: it has the other type then."""
        return any(not self._delivery.flows(topic, self._now()) for topic in self._others)

    def kept(self, offer: discovery.Offer, *, before: Mapping[str, str], link: LiveSource) -> discovery.Offer:
        """The offer with these types; `before`: topic → type of the offer before it."""
        if not link.keeps_types:
            return offer
        now_s = self._now()
        kept = {
            topic: before[topic]
            for topic in {row.topic for row in link.subscriptions if row.type and row.type == before.get(row.topic)}
            if offer.topics.get(topic) not in (None, before[topic]) and self._delivery.flows(topic, now_s)
        }
        others = {topic: offer.topics[topic] for topic in kept}
        for topic, kind in others.items():
            if self._others.get(topic) != kind:
                self._noted(f"{topic} is still received as {kept[topic]}: another node has it as {kind or 'no type'}.")
        self._others = others
        return replace(offer, topics={**offer.topics, **kept})


class Subscriptions:
    """One car's topics and subscriptions from dialling to the end of monitoring, over any number of openings.

    `now` is a monotonic clock in seconds; `proved()` is called with each answer that only a rosbridge gives,
    `recognised(title)` when the car turns out to be of another kind than it was taken for.
    """

    def __init__(
        self,
        link: LiveSource | None,
        tuning: ActiveSettings,
        *,
        now: Callable[[], float],
        proved: Callable[[], None],
        recognised: Callable[[str], None],
        learned: Callable[[Mapping[str, str]], None] = lambda _: None,
        noted: Callable[[str], None] = lambda _: None,
        timed: Callable[[float, float], None] = lambda *_: None,
        place: Place | None = None,
    ) -> None:
        """`link` None: no car is dialled. `timed`: the time of the call and of ROS; `place`: as of `Evidence`."""
        self._link = link
        self._tuning = tuning
        self._now = now
        self._proved = proved
        self._recognised = recognised
        self.noted = noted
        self._offer: discovery.Offer | None = None
        self._look_soon = False
        self._unfit: str | None = None  # why the car's button does not mark
        self._definitions = TypeDefinitions(learned, self._subscribe)
        self._missing = MissingWatch(
            now=now,
            renew=self._subscribe_anew,
            remap=self.map_again,
            resubscribe=self._subscribe,
            noted=noted,
            type_of=self.type_of,
        )
        self._types = TypesInUse(self._missing.delivery, noted, now)
        self.table = SubscriptionTable(link, self._definitions, self._missing.delivery, now=now)
        self.signals = SignalMap(place)
        self.by_topic: Mapping[str, tuple[Source, ...]] = {}
        self.ros = RosWatch(link, now=now, timed=timed)
        self.ros_version: int | None = None

    async def run(self) -> None:
        """While this connection is open: fetch the car's topics, and check whether ROS is alive."""
        link, ros, rosapi = self._link, self.ros, self.ros.rosapi
        looked_s = -LOOK_AGAIN_S
        self._missing.opened()
        ros.diagnosis.opened()
        self.table.opened()
        while link is not None and rosapi is not None and link is self._link and link.is_open:
            try:
                self._look_soon |= self.signals.is_due(self._now()) or self._types.is_due()
                if self._look_soon or self._now() - looked_s >= (LOOK_AGAIN_S if self.signals.sources else 1.0):
                    looked_s, self._look_soon = self._now(), False
                    await self._look(link, rosapi)
                alive = await ros.ask(rosapi)
                if self.table.tries_another():
                    self._subscribe()
                if self._offer is not None:
                    found = could_carry(self._offer.topics, self._tuning.settings.topics)
                    commanded = {ros.commanded_on, self.signals.command_topic}
                    await self._missing.look(rosapi, found, commanded=commanded, is_current=lambda: link is self._link)
                await self._missing.look_behind(rosapi)
            except LinkDown:
                return
            if link is not self._link:
                return
            if ros.diagnosis.is_rosbridge:
                self._proved()
            if ros.diagnosis.master_restarted():
                self.table.renew_all()
            ros.answered(alive)
            await asyncio.sleep(ros.pause_s)

    def end(self) -> None:
        """Whatever is still answered is of no interest any more."""
        self._link = None
        self.ros.end()
        self._definitions.end()
        self.table.end()

    # -- what is known -----------------------------------------------------------------------------------------------

    @property
    def offered(self) -> Mapping[str, str] | None:
        """Topic → type of all topics, as the bridge spells them; None while unknown."""
        return self._offer.topics if self._offer is not None else None

    @property
    def others(self) -> Mapping[str, str]:
        """Topic → type of what is subscribed to only to be recorded."""
        return self.table.recorded.topics

    @property
    def missing(self) -> Missing:
        """What is offered and does not come to be recorded."""
        left_out, too_large = self.table.recorded.left_out, self.table.large.left
        return Missing(left_out=left_out, not_received=self._missing.not_received, too_large=too_large)

    def published(self) -> frozenset[str]:
        """The signals that the car has in a form that can be read; not yet one whose publisher has only just come."""
        has_its_time, now_s = self._missing.delivery.has_its_time, self._now()
        return pipeline.published(one for one in self.signals.sources.values() if not has_its_time(one.topic, now_s))

    def type_of(self, topic: str) -> str | None:
        """The type of a topic that is subscribed to, as the bridge spells it; None: it does not say."""
        sources, offered = self.by_topic.get(topic) if self._offer else None, (self.offered or {}).get(topic)
        return self.others.get(topic) or (sources[0].type if sources else offered or None)

    def problem(self, now_s: float, *, flows: bool) -> Problem | None:
        """The part that failed behind the open bridge; None: none is known to have. `flows`: messages come."""
        return self.ros.diagnosis.problem(now_s, flows=flows) or self._missing.problem(now_s)

    # -- what others want --------------------------------------------------------------------------------------------

    def watch_commands(self, topic: str | None, *, guard: str | None) -> None:
        """Set the command topic whose publishers are fetched; None: there is none. `guard`: a further topic."""
        self.ros.watch_commands(topic)
        if guard != self.table.guard:
            self.table.guard = guard
            if self._offer is not None:
                self._subscribe()

    def watch_load(self, late_s: float, trip_s: float) -> bool:
        """Subscribes to less where the link is late, and to more once it is in time; True where that changed."""
        changed, left = self.table.look_at_load(late_s, trip_s)
        self._note_left(left)
        if changed:
            self.map_again()
        return changed

    def record(self, also: Also) -> None:
        """The topics that are recorded only."""
        if also != self.table.also:
            self.table.also, self._look_soon = also, True
            if self._offer is not None:
                self._subscribe()

    def map_again(self) -> None:
        """After a change of settings, of what is published or shown, or of the capacity of the link."""
        if self._offer is not None or self.signals.by_name is not None:
            self._map()

    # -- what came ---------------------------------------------------------------------------------------------------

    def received(self, topic: str) -> None:
        """A message came on a topic."""
        self.table.probation.received(topic)
        if self._missing.delivery.received(topic, self._now()):
            self._look_soon = True  # it has a publisher now: it may carry a signal

    def took(self, topic: str, message: object) -> bool:
        """A message about the bridge itself; whether it was one."""
        if topic == CLIENT_COUNT:
            self._missing.client_count(message)
        return topic == CLIENT_COUNT and topic not in self.others and topic not in self.by_topic

    def skipped(self, topic: str | None, size: int) -> None:
        """A message that was too large to be read. A topic that the message does not name is found where only one can
        be it."""
        topic = self._missing.delivery.only_silent() if topic is None else topic
        if topic is not None and self._link is not None and self.table.large.skipped(topic, size):
            if self._offer is not None:
                self._subscribe()
            else:
                self._link.unsubscribe(topic)
            self.noted(self.table.large.sentence(topic))

    def unreadable(self, topic: str, why: str) -> None:
        """A message of a recorded topic could not be read: as JSON its text is recorded, whatever it holds."""
        if self._offer is not None and self.table.is_cbor(topic):
            self._subscribe_anew(topic)
            self.noted(f"{topic} is now received as JSON: {why} could not be read, and is not recorded.")

    def fell_silent(self) -> None:
        """The link was given up because the bridge did not answer."""
        is_suspected, left = self.table.fell_silent()
        self._note_left(left)
        if is_suspected and self._offer is not None:
            self._subscribe()  # before the link sends its rows again

    def _note_left(self, topics: list[str]) -> None:
        for topic in topics:
            self.noted(f"{topic} is no longer received: while it is subscribed, the bridge does not answer in time.")

    def bridge_complains(self, text: str) -> None:
        """An error the bridge states."""
        if self.table.cbor.bridge_complains(text):
            self._subscribe()

    def binary_noise(self) -> None:
        """A binary frame that could not be read, where no scan ever could."""
        if self.table.cbor.binary_noise():
            self._subscribe()

    # -- subscribing -------------------------------------------------------------------------------------------------

    async def _look(self, link: LiveSource, rosapi: ServiceCaller) -> None:
        offer = await discovery.fetch_topics(rosapi)
        if link is not self._link:
            return
        if offer is None:
            if self._offer is None:
                self._map()  # no rosapi: try the names we know
                self.table.renew_by_name()
            else:
                self._learn(rosapi, self._offer)  # rosapi may have ended since it named them
            return
        self.signals.by_name = None
        self._proved()
        self.ros_version = offer.ros or self.ros_version
        self._offer = offer = self._types.kept(offer, before=self.offered or {}, link=link)
        if self._tuning.recognise(offer.topics, offer.ros):
            self._recognised(self._tuning.profile.title)
        self._map()
        self._learn(rosapi, offer)

    def _learn(self, rosapi: ServiceCaller, offer: discovery.Offer) -> None:
        if self.table.also != "none":
            self._definitions.learn(rosapi, offer.topics, self.ros_version)

    def _map(self) -> None:
        """Chooses the topic of each signal and subscribes to them; without rosapi of those of which messages come."""
        offer, known = self._offer, (self._tuning.settings.topics, self._missing.delivery, self._now())
        if offer is None:
            if self._tuning.recognise(self.signals.update_by_name(*known), None):
                self._recognised(self._tuning.profile.title)
            self._subscribe()
            return self.table.renew_single(self.signals.new_by_name)
        self.signals.update(offer.topics, *known)
        self._subscribe()
        before, self._unfit = self._unfit, car_marks.unfit(offer.topics.get(car_marks.TOPIC))
        if self._unfit not in (None, before):
            self.noted(self._unfit)

    def _subscribe(self) -> None:
        self.by_topic = pipeline.by_topic(self.signals.decoded)
        if self.signals.by_name is not None:
            self.table.subscribe_by_name(self._tuning.settings.topics, self.by_topic)
        elif self._link is not None:
            needs, watched = self._missing.needs_client_count, self.signals.watched
            self.table.subscribe(self.by_topic, self.offered, needs_client_count=needs, watched=watched)

    def _subscribe_anew(self, topic: str) -> None:
        if self.table.renew(topic):
            self._subscribe()
