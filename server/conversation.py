"""The talk with one car's bridge: what the car offers, which topics carry its signals, whether ROS behind it lives."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable, Mapping
from functools import partial

from server import discovery, judging, others
from server.delivery import Delivery
from server.diagnosis import Diagnosis
from server.encoding_choice import fit_for_cbor
from server.link import MAX_MESSAGE_BYTES, CallFailed, LinkDown, RosLink, Subscription
from server.link_load import LinkLoad
from server.others import Also, Missing
from server.passing import CLIENT_COUNT, Passing
from server.probation import Probation
from server.problems import Problem
from server.questions import Asks, Questions
from server.source import RosVersion
from server.topics import BY_SIGNAL, COMMAND, TOPICS, Source, could_carry, map_signals, plain_type
from server.tuning import Tuning

log = logging.getLogger("catgraph.conversation")

ALIVE_EVERY_S = 1.0
BY_NAME_AGAIN_S, BY_NAME_LAST_S = 5.0, 60.0  # each attempt without rosapi costs the bridge a line in its log a name
DOUBT_S = 0.5  # after a first failure: is it one?
LOOK_AGAIN_S = 5.0  # the car's software may start after its bridge
LEARN_TRIES = 3  # of rosapi's call for all definitions, which may take it long
LARGE_TRIES = 2  # messages of a topic that are too large to be read, before it is left
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
        noted: Callable[[str], None] = lambda _: None,
        timed: Callable[[float, float], None] = lambda *_: None,
    ) -> None:
        """`link` None: no car is dialled, and nothing is known of any."""
        self._link = link
        self._tuning = tuning
        self._now = now
        self._proved = proved
        self._recognised = recognised
        self._learned = learned
        self._noted = noted
        self._timed = timed  # when the time of ROS was asked for, and what it was
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
        self._unanswered: set[str] = set()  # and types of which rosapi then said nothing
        self._learn_tries = 0
        self._fit: set[str] = set()  # of those, the ones that arrive as CBOR
        self._json_only: set[str] = set()  # topics that did not arrive as CBOR
        self._delivery = Delivery()
        self._noted_missing: set[str] = set()
        self._not_received: Mapping[str, tuple[str, ...]] = {}
        self._large: dict[str, list[int]] = {}  # topic → sizes of its messages that were too large
        self._learning: asyncio.Task[None] | None = None  # beside the talk: it may take long, and proves nothing
        self._look_soon = False
        self.others: Mapping[str, str] = {}  # topic → type of what is subscribed to only to be recorded
        self.left_out: tuple[str, ...] = ()  # topics that are not recorded, for they are bulky or there are too many
        self.diagnosis = Diagnosis()
        self._probation = Probation()
        self._may_be_large: set[str] = set()  # types that have arrays without a bound
        self._passing = Passing()
        self._by_name_s: float | None = None  # when the names were last subscribed to without rosapi
        self._by_name_pause_s = BY_NAME_AGAIN_S
        self._questions = None if link is None else Questions(link, self.diagnosis, now=now)
        self.ros_version: int | None = None
        self.ros_alive: bool | None = None
        self.ros_answered_s: float | None = None
        self.commanded_on: str | None = (
            None  # the topic on which the car is commanded: who else publishes there is asked
        )
        self.publishers: tuple[str, ...] | None = None  # who does; None: not known
        self._guard: str | None = None  # a topic that is heard besides
        self.load = LinkLoad()

    async def go_on(self) -> None:
        """While this opening lasts: looks at what the car offers, and asks whether ROS behind the bridge lives."""
        link, asks = self._link, self._questions
        looked_s = -LOOK_AGAIN_S
        self._delivery.opened(self._now())
        self._probation.opened(self._now())
        self.diagnosis.opened()
        self._passing.opened()
        self._by_name_s, self._by_name_pause_s = self._now(), BY_NAME_AGAIN_S
        while link is not None and asks is not None and link is self._link and link.is_open:
            try:
                if self._look_soon or self._now() - looked_s >= (LOOK_AGAIN_S if self.sources else 1.0):
                    looked_s, self._look_soon = self._now(), False
                    await self._look(link, asks)
                asked_s = self._now()
                alive = await discovery.ask_alive(asks, timed=partial(self._timed, asked_s))
                if self.commanded_on is not None:
                    self.publishers = await discovery.ask_publishers(asks, self.commanded_on)
                if self.load.level.records_others and self._probation.look(self._now()):
                    self._subscribe()
                await self._watch_delivery(link, asks)
                await self._watch_passing(link, asks)
            except LinkDown:
                return
            if link is not self._link:
                return
            if alive:
                self.ros_answered_s = self._now()
            if self.diagnosis.is_rosbridge:
                self._proved()
            if self.diagnosis.master_came_back():
                for row in link.subscriptions:
                    link.renew(row.topic)  # the new roscore does not know the old subscriptions
            self.ros_alive = alive if self.ros_answered_s is not None else None
            await asyncio.sleep(DOUBT_S if self.diagnosis.doubts else ALIVE_EVERY_S)

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

    def watch_load(self, late_s: float) -> bool:
        """Asks for less where the link is late, and for more once it is in time; True where that changed."""
        before = self.load.step
        if not self.load.look(late_s, self._now()):
            return False
        if before == 0:
            self._tell_left(self._probation.silent(()))
        elif self.load.step == 0:
            self._probation.opened(self._now())
        if self._offer is not None:
            self._subscribe()
        elif self._link is not None and self.by_topic:
            self._subscribe_by_name(self._link)
        return True

    @property
    def _commanded(self) -> set[str | None]:
        """Where the car is commanded: there the bridge is a publisher once we have armed, and nothing need come."""
        source = self.sources.get(COMMAND)
        return {self.commanded_on, source.topic if source is not None else None}

    def end(self) -> None:
        """Whatever is still answered is of no interest any more."""
        self._link = None
        if self._questions is not None:
            self._questions.stop()
        if self._learning is not None:
            self._learning.cancel()

    def record(self, also: Also) -> None:
        """Which topics are to be heard beyond those that carry signals; they are judged by nobody."""
        if also != self._also:
            self._also, self._look_soon = also, True
            if self._offer is not None:
                self._subscribe()

    def published(self) -> frozenset[str]:
        """The signals that the car has in a form that can be read; not yet one whose publisher has only just come."""
        now_s = self._now()
        return judging.published(
            source for source in self.sources.values() if not self._delivery.has_its_time(source.topic, now_s)
        )

    def heard(self, topic: str) -> None:
        """A message came on a topic."""
        self._probation.heard(topic)
        if self._delivery.heard(topic, self._now()):
            self._look_soon = True  # it has a publisher now: it may carry a signal

    def fell_silent(self) -> None:
        """The link was given up because the bridge did not answer; it may be busy with what is only recorded."""
        suspects = [
            topic
            for topic, kind in self.others.items()
            if kind in self._may_be_large and topic not in self._delivery.delivered
        ]
        self._tell_left(self._probation.silent(suspects))
        if suspects and self._offer is not None:
            self._subscribe()  # before the link asks for them again

    def _tell_left(self, topics: list[str]) -> None:
        for topic in topics:
            self._noted(f"{topic} is not received any more: while it is asked for, the bridge does not answer in time.")

    def skipped(self, topic: str | None, size: int) -> None:
        """A message that was too large to be read. The second one of a topic ends its subscription: it would take the
        car's network for nothing. A topic that the message does not name is found where only one can be it."""
        topic = self._delivery.only_silent() if topic is None else topic
        if topic is None or self._link is None or topic in self.too_large:
            return
        sizes = self._large.setdefault(topic, [])
        sizes.append(size)
        if len(sizes) >= LARGE_TRIES:
            if self._offer is not None:
                self._subscribe()
            else:
                self._link.unsubscribe(topic)
            self._noted(
                f"{topic} is not received any more: its messages have {max(sizes) / 2**20:.0f} MB, and "
                f"{MAX_MESSAGE_BYTES // 2**20} MB are the most."
            )

    @property
    def too_large(self) -> Mapping[str, int]:
        """Topic → bytes of its largest message, of those that are not subscribed to because of it."""
        return {topic: max(sizes) for topic, sizes in self._large.items() if len(sizes) >= LARGE_TRIES}

    @property
    def missing(self) -> Missing:
        """What is offered and does not come to be recorded."""
        return Missing(left_out=self.left_out, not_received=self._not_received, too_large=self.too_large)

    def type_of(self, topic: str) -> str | None:
        """The type of a topic that is subscribed to, as the bridge spells it; None: not known."""
        sources = self.by_topic.get(topic)
        offered = self._offer.topics.get(topic) if self._offer is not None else None
        return self.others.get(topic) or (sources[0].type if sources else offered or None)

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

    def problem(self, now_s: float, *, flows: bool) -> Problem | None:
        """The part that failed behind the open bridge; None: none is known to have. `flows`: messages come."""
        return self.diagnosis.problem(now_s, flows=flows) or self._passing.problem(now_s)

    def took(self, topic: str, message: object) -> bool:
        """A message about the bridge itself; whether it was one."""
        if topic != CLIENT_COUNT:
            return False
        self._passing.counted(message)
        return topic not in self.others and topic not in self.by_topic

    async def _look(self, link: RosLink, asks: Asks) -> None:
        offer = await discovery.ask_topics(asks)
        if link is not self._link:
            return
        if offer is None:
            if not self._looked and not self.sources:
                self._subscribe_by_name(link)  # no rosapi: try the names we know
            elif self._offer is None:
                self._renew_by_name(link)
            else:
                self._begin_to_learn(link, asks, self._offer)  # rosapi may have ended since it named them
            return
        self._looked = True
        self._proved()
        self.ros_version = offer.ros or self.ros_version
        self._offer = offer
        if self._tuning.recognise(offer.topics, offer.ros):
            self._recognised(self._tuning.profile.title)
        self._map(offer)
        self._begin_to_learn(link, asks, offer)

    def _begin_to_learn(self, link: RosLink, asks: Asks, offer: discovery.Offer) -> None:
        if self._also != "none" and self._learning is None:
            self._learning = asyncio.create_task(self._learn(link, asks, offer), name="definitions")
            self._learning.add_done_callback(self._learned_all)

    async def _learn(self, link: RosLink, asks: Asks, offer: discovery.Offer) -> None:
        """Definitions come first: what is recorded before they are known is JSON."""
        types = {kind for kind in offer.topics.values() if kind} - self._asked
        if self._learn_tries < LEARN_TRIES:
            types |= self._unanswered
        if not types:
            return
        ros: RosVersion | None = 1 if self.ros_version == 1 else 2 if self.ros_version == 2 else None
        found: dict[str, str] = {}
        try:
            found = await discovery.ask_definitions(asks, types, ros)
        except LinkDown:
            return
        except CallFailed as why:
            self._learn_tries += 1
            self._unanswered |= types  # recorded as far as they are known without it, and asked for again
            log.warning("rosapi does not give the definitions of %d types: %s", len(types), why)
        else:
            self._learn_tries = 0
            self._unanswered.clear()
        fit = await asyncio.to_thread(fit_for_cbor, types, found, ros)
        if link is self._link:
            self._asked |= types
            self._fit |= fit
            self._may_be_large |= {kind for kind in types if kind not in found or "[]" in found[kind]}
            if found:
                self._learned(found)
            self._subscribe()

    def _learned_all(self, task: asyncio.Task[None]) -> None:
        self._learning = None
        if not task.cancelled() and task.exception() is not None:
            log.error("the definitions of types could not be learned", exc_info=task.exception())

    def _map(self, offer: discovery.Offer) -> None:
        """Chooses the topic of each signal and subscribes to them."""
        sources = map_signals(offer.topics, self._tuning.settings.topics, self._delivery.unpublished)
        gone = {
            s: source for s, source in self.sources.items() if s not in sources and source.topic not in offer.topics
        }
        self.sources = gone | sources  # a topic that vanished stays subscribed: it may come back
        mapped = {source.topic for source in self.sources.values()}
        self.unmapped = {name: kind for name, kind in offer.topics.items() if name not in mapped}
        self.offers_nothing = not any(source.decode for source in self.sources.values())
        self._subscribe()

    def _subscribe(self) -> None:
        link = self._link
        if link is None:
            return
        self.by_topic = judging.by_topic(self.sources.values())
        wanted: dict[str, Subscription] = {}
        too_large = self.too_large
        for topic, sources in self.by_topic.items():
            rows = [BY_SIGNAL[source.signal] for source in sources if source.decode is not None]
            if rows and topic not in too_large:
                kind = sources[0].type
                is_fit = rows[0].compression == "cbor" and (kind not in self._asked or kind in self._fit)
                wanted[topic] = Subscription(
                    topic=topic,
                    type=kind,
                    compression=self._compression(topic, is_fit=is_fit),
                    throttle_ms=min(self.load.throttle_ms(row.signal) for row in rows),
                    queue_length=1 if self.load.step else min(row.queue_length for row in rows),
                )
        self.judged = len(wanted)
        if self._offer is not None:
            self.others, self.left_out = others.choose(
                self._offer.topics, without={*wanted, *too_large}, also=self._also, asked=self._asked
            )
            held = self._probation.held & self.others.keys()
            self.left_out = tuple(sorted({*self.left_out, *held}))
            self.others = {topic: kind for topic, kind in self.others.items() if topic not in held}
            if not self.load.level.records_others:
                self.left_out = tuple(sorted({*self.left_out, *self.others}))
                self.others = {}
            for topic, kind in self.others.items():
                wanted[topic] = Subscription(
                    topic=topic,
                    type=kind or None,
                    compression=self._compression(topic, is_fit=kind in self._fit),
                    queue_length=others.QUEUE_LENGTH,
                )
        if self._offer is not None and self._passing.needs_clients and CLIENT_COUNT in self._offer.topics:
            kind = self._offer.topics[CLIENT_COUNT] or None
            wanted.setdefault(CLIENT_COUNT, Subscription(topic=CLIENT_COUNT, type=kind, queue_length=1))
        if self._guard is not None:
            wanted.setdefault(self._guard, Subscription(topic=self._guard, type="std_msgs/String", queue_length=1))
        for row in link.subscriptions:
            if row.topic not in wanted:
                link.unsubscribe(row.topic)
        for subscription in wanted.values():
            link.subscribe(subscription)
        self._delivery.follow([topic for topic in wanted if topic in self.by_topic], [*self.others], now_s=self._now())

    def _compression(self, topic: str, *, is_fit: bool) -> str:
        """CBOR where the type is fit for it: it is smaller, and keeps NaN and the infinities apart."""
        return "cbor" if is_fit and topic not in self._json_only and not self._cbor_failed else "none"

    async def _watch_delivery(self, link: RosLink, asks: Asks) -> None:
        """Asks who publishes what does not come; where somebody does, subscribes anew, as JSON. Raises LinkDown."""
        offer = self._offer
        if offer is None:
            return
        candidates = could_carry(offer.topics, self._tuning.settings.topics)
        topics = self._delivery.to_ask(self._now(), candidates)
        answers = await asyncio.gather(
            *(discovery.ask_publishers(asks, topic, and_bridge=topic not in self._commanded) for topic in topics),
            return_exceptions=True,
        )
        if link is not self._link:
            return
        before = set(self._delivery.unpublished)
        for topic, nodes in zip(topics, answers, strict=True):
            if isinstance(nodes, BaseException):
                raise nodes
            if self._delivery.answered(topic, nodes, self._now()):
                self._subscribe_anew(link, topic)
        if self._delivery.unpublished != before and self._offer is not None:
            self._map(self._offer)
        missing = {
            topic: nodes
            for topic, nodes in self._delivery.not_received(self._now()).items()
            if plain_type(self.type_of(topic) or "") not in others.EVENTS
        }
        news = [f"{topic} ({', '.join(missing[topic][:3])})" for topic in missing if topic not in self._noted_missing]
        self._not_received = missing
        if news:
            self._noted_missing |= set(missing)
            self._noted(f"No message comes from topics that have a publisher: {', '.join(news[:20])}.")

    async def _watch_passing(self, link: RosLink, asks: Asks) -> None:
        """Of a signal's topic that has a publisher and does not come: did the bridge subscribe? Raises LinkDown."""
        needed = self._passing.needs_clients
        self._passing.follow(self._delivery.never_came(self._now()), self._now())
        if self._passing.needs_clients != needed:
            self._subscribe()
        if self._passing.needs_clients and not self._passing.bridges:
            nodes = await discovery.ask_publishers(asks, CLIENT_COUNT, and_bridge=True)
            self._passing.bridges = frozenset(nodes or ())
        for topic in self._passing.to_ask(self._now()):
            self._passing.answered(topic, await discovery.ask_subscribers(asks, topic), self._now())

    def _renew_by_name(self, link: RosLink) -> None:
        """A bridge forgets a subscription without a type where nobody publishes the topic yet."""
        now_s = self._now()
        if self._by_name_s is None or now_s - self._by_name_s < self._by_name_pause_s:
            return
        self._by_name_s, self._by_name_pause_s = now_s, min(self._by_name_pause_s * 2, BY_NAME_LAST_S)
        for row in link.subscriptions:
            if row.type is None and self._delivery.never_heard(row.topic):
                link.renew(row.topic)

    def _subscribe_anew(self, link: RosLink, topic: str) -> None:
        """Where it came as CBOR it comes as JSON from now on; a subscription that another client spoilt comes alive."""
        if any(row.topic == topic and row.compression == "cbor" for row in link.subscriptions):
            self._json_only.add(topic)
            self._subscribe()
        else:
            link.renew(topic)

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
                link.subscribe(
                    Subscription(
                        topic=name,
                        type=None,
                        throttle_ms=self.load.throttle_ms(row.signal),
                        queue_length=1 if self.load.step else row.queue_length,
                    )
                )
        for subscription in link.subscriptions:
            if subscription.topic not in by_topic:
                link.unsubscribe(subscription.topic)
        self.by_topic = by_topic
        self.judged = len(by_topic)
        self._delivery.follow([*by_topic], [], now_s=self._now())
