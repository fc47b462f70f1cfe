"""Queries rosapi regularly: whether ROS is alive, who else publishes commands, and why topics have no messages."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Collection, Mapping
from functools import partial

from server.judge.topics import plain_type
from server.recording import recorded_topics
from server.rosbridge.connection_errors import Problem
from server.rosbridge.diagnosis import Diagnosis
from server.rosbridge.live_source import LiveSource
from server.rosbridge.rosapi_client import Questions, ServiceCaller
from server.vehicle import discovery
from server.vehicle.delivery import Delivery
from server.vehicle.undelivered import CLIENT_COUNT, Passing

ALIVE_EVERY_S = 1.0
DOUBT_S = 0.5  # after a first failure: is it one?

MOST_NAMED = 20


class RosWatch:
    """Checks whether ROS behind the bridge is alive, and which other nodes publish commands.

    Of one car, over any number of openings. `now` is a monotonic clock in seconds.

    `timed(asked_s, ros_s)`: the time of the call and the time of ROS.
    """

    def __init__(
        self, link: LiveSource | None, *, now: Callable[[], float], timed: Callable[[float, float], None]
    ) -> None:
        """`link` None: no car is dialled."""
        self._now = now
        self._timed = timed
        self.diagnosis = Diagnosis()
        self.rosapi = None if link is None else Questions(link, self.diagnosis, now=now)
        self.alive: bool | None = None  # None: not known
        self.answered_s: float | None = None
        self.commanded_on: str | None = None  # the topic on which the car is commanded
        self.publishers: tuple[str, ...] | None = None  # who publishes there; None: not known

    def watch_commands(self, topic: str | None) -> None:
        """Set the command topic whose publishers are fetched; None: there is none."""
        if topic != self.commanded_on:
            self.commanded_on, self.publishers = topic, None

    async def ask(self, rosapi: Questions) -> bool | None:
        """Call rosapi; return whether ROS answered. Raises LinkDown."""
        alive = await discovery.fetch_alive(rosapi, timed=partial(self._timed, self._now()))
        if self.commanded_on is not None:
            self.publishers = await discovery.fetch_publishers(rosapi, self.commanded_on)
        return alive

    def answered(self, alive: bool | None) -> None:
        """What became of the newest question."""
        if alive:
            self.answered_s = self._now()
        self.alive = alive if self.answered_s is not None else None

    @property
    def pause_s(self) -> float:
        """Until the next question."""
        return DOUBT_S if self.diagnosis.doubts else ALIVE_EVERY_S

    def end(self) -> None:
        """Whatever is still answered is of no interest any more."""
        if self.rosapi is not None:
            self.rosapi.stop()


class MissingWatch:
    """Queries rosapi about topics without messages: publishers, and whether the bridge subscribes to them.

    Of one car's connection. `now` is a monotonic clock in seconds.

    `renew(topic)` renews a subscription, `remap()` follows a change of publishers, `resubscribe()` one of the watch's
    own topics, `noted(text)` logs.
    """

    def __init__(
        self,
        *,
        now: Callable[[], float],
        renew: Callable[[str], None],
        remap: Callable[[], None],
        resubscribe: Callable[[], None],
        noted: Callable[[str], None],
        type_of: Callable[[str], str | None],
    ) -> None:
        self._now = now
        self._renew = renew
        self._remap = remap
        self._resubscribe = resubscribe
        self._noted = noted
        self._type_of = type_of
        self._named: set[str] = set()
        self._undelivered = Passing()
        self.delivery = Delivery()
        self.not_received: Mapping[str, tuple[str, ...]] = {}  # topic → its publishers, of what does not come

    def opened(self) -> None:
        """The connection opens, for the first time or again."""
        self.delivery.opened(self._now())
        self._undelivered.opened()

    @property
    def needs_client_count(self) -> bool:
        """Whether CLIENT_COUNT has to be subscribed to."""
        return self._undelivered.needs_clients

    def client_count(self, message: object) -> None:
        """A message of CLIENT_COUNT."""
        self._undelivered.counted(message)

    def problem(self, now_s: float) -> Problem | None:
        """What keeps topics from us; None: nothing is known to."""
        return self._undelivered.problem(now_s)

    async def look(
        self,
        rosapi: ServiceCaller,
        candidates: Collection[str],
        *,
        commanded: Collection[str | None],
        is_current: Callable[[], bool],
    ) -> None:
        """Fetch the publishers of missing topics and renew those that have one. `candidates`: topics that could carry a
        signal. `commanded`: the command topic, where the armed bridge is a publisher itself and no message is expected.
        Stops once `is_current()` is false. Raises LinkDown."""
        topics = self.delivery.to_ask(self._now(), candidates)
        answers = await asyncio.gather(
            *(discovery.fetch_publishers(rosapi, topic, and_bridge=topic not in commanded) for topic in topics),
            return_exceptions=True,
        )
        if not is_current():
            return
        before = set(self.delivery.unpublished)
        for topic, nodes in zip(topics, answers, strict=True):
            if isinstance(nodes, BaseException):
                raise nodes
            if self.delivery.answered(topic, nodes, self._now()):
                self._renew(topic)
        if self.delivery.unpublished != before:
            self._remap()
        missing = {
            topic: nodes
            for topic, nodes in self.delivery.not_received(self._now()).items()
            if plain_type(self._type_of(topic) or "") not in recorded_topics.EVENTS
        }
        news = [f"{topic} ({', '.join(missing[topic][:3])})" for topic in missing if topic not in self._named]
        self.not_received = missing
        if news:
            self._named |= set(missing)
            self._noted(f"Topics with a publisher but no messages: {', '.join(news[:MOST_NAMED])}.")

    async def look_behind(self, rosapi: ServiceCaller) -> None:
        """Fetch whether the bridge subscribed to published signal topics that do not arrive; renew those that another
        client no longer blocks. Raises LinkDown."""
        needed = self._undelivered.needs_clients
        now_s, delivery = self._now(), self.delivery
        self._undelivered.follow(delivery.never_came(now_s), now_s, once=delivery.came_once(now_s))
        if self._undelivered.needs_clients != needed:
            self._resubscribe()
        if self._undelivered.needs_clients and not self._undelivered.bridges:
            nodes = await discovery.fetch_publishers(rosapi, CLIENT_COUNT, and_bridge=True)
            self._undelivered.bridges = frozenset(nodes or ())
        for topic in self._undelivered.to_ask(self._now()):
            self._undelivered.answered(topic, await discovery.fetch_subscribers(rosapi, topic), self._now())
        for topic in self._undelivered.to_renew(self._now(), delivery.renewed_s):
            self._renew(topic)
